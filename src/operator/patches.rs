//! Sources of many small faces: patches of up to four cells, each cell with one radiosity.
//!
//! A face that is larger than the patches are to be is cut by a grid in its plane, the cells being the
//! quarters of a square; smaller ones are taken together with others of the same object and material
//! that lie in the same cube and face about the same way, a quarter of their area to a cell.
//! Receivers are anywhere and know nothing of patches: these are but what the surface radiates, as
//! coarsely as the sum over a hemisphere allows. Each cell has [`SPOTS`] points where light is gathered for
//! it; how cells of one patch differ tells whether it is to be split.

use std::collections::{HashMap, HashSet};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::hemisphere::mix;
use super::spread::on_triangle;
use crate::error::{Error, Result};
use crate::geometry::Pieces;
use crate::geometry::polygon::{Linear, twice_area};
use crate::mesh::{Face, Mesh};
use crate::scene::{self, Scene};

/// Cells of a patch, at most.
pub const CELLS: usize = 4;

/// Spots of a cell: of light that varies within it, their mean is far nearer to the cell's than
/// one of them.
pub const SPOTS: usize = 8;

/// Sizes of patches, before they are split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchSizes {
    /// Side of the squares of large faces, metres.
    pub square: f64,
    /// Side of the cubes whose small faces are taken together, metres.
    pub cube: f64,
}

/// A point of a cell where light is gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Its face.
    pub face: u32,
    /// The point in the plane of the face.
    pub x: DVec2,
}

/// Patches of all faces of a mesh.
#[derive(Clone, Default)]
pub struct Patches {
    /// Where the squares of each face are.
    grids: Vec<Grid>,
    /// What each square of each face holds: see [`Content`].
    squares: Vec<Content>,
    shapes: Vec<Shape>,
    /// Where the cells of each patch end: they are numbered one patch after the other.
    ends: Vec<usize>,
    /// The spots of each cell, [`SPOTS`] of them.
    spots: Vec<Spot>,
    /// Patches whose spots were put elsewhere.
    moved: HashSet<usize>,
    /// Area of each cell, square metres.
    pub area: Vec<f64>,
    /// Mean exitance E of each, W/m^2.
    pub exitance: Vec<DVec3>,
    /// Mean reflectance of each.
    pub reflectance: Vec<DVec3>,
    /// Least and largest radiosity that was found in each patch so far, W/m^2.
    pub found: Vec<[DVec3; 2]>,
    /// How often these were made from others: spots are elsewhere each time.
    round: u32,
}

/// Squares over a face, row by row.
#[derive(Clone, Copy)]
struct Grid {
    first: u32,
    across: (u32, u32),
    low: DVec2,
    /// Their side.
    side: f64,
}

/// What a square holds.
#[derive(Clone, Copy, PartialEq)]
enum Content {
    /// No part of the face.
    Nothing,
    Cell(u32),
    /// Four squares of half the side: the first of their numbers, which are row by row.
    Squares(u32),
}

/// What a patch is made of.
#[derive(Clone)]
enum Shape {
    /// The part of a face in a square of its plane.
    Square { face: u32, low: DVec2, side: f64, place: u32 },
    /// Small faces in a cube.
    Cube { faces: Vec<u32>, low: DVec3, side: f64 },
}

/// Of what nothing is known.
const UNKNOWN: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

/// Most squares of all faces.
const MOST_SQUARES: f64 = 2e7;

/// A part of a face.
struct Part {
    face: u32,
    /// The square that it fills, of a face that is cut; counted from its patch's first.
    quarter: u32,
    /// Its corners: it is convex.
    polygon: Vec<DVec2>,
    area: f64,
    centre: DVec2,
    exitance: DVec3,
    reflectance: DVec3,
}

impl Patches {
    /// Cuts and joins the faces of a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if there would be too many squares.
    pub fn build(scene: &Scene, mesh: &Mesh, sizes: &PatchSizes) -> Result<Patches> {
        let count: f64 = mesh.faces.iter().map(|f| across(f, sizes.square).element_product()).sum();
        if count > MOST_SQUARES {
            return Err(Error::Usage("there would be too many patches".into()));
        }
        let mut patches = Patches::default();
        let mut joined: HashMap<Key, usize> = HashMap::new();
        let mut cubes: Vec<([i64; 3], Vec<u32>)> = vec![];
        let mut cut: Vec<Shape> = vec![];
        for (number, face) in mesh.faces.iter().enumerate() {
            let count = across(face, sizes.square);
            let across = (count.x as u32, count.y as u32);
            let (low, high) = bounds(face);
            let (mut side, first) = (sizes.square, patches.squares.len() as u32);
            if across == (1, 1) {
                side = (high - low).max_element();
            }
            patches.grids.push(Grid { first, across, low, side });
            patches.squares.resize((first + across.0 * across.1) as usize, Content::Nothing);
            if side <= sizes.cube {
                let triangle = &scene.triangles[face.triangle as usize];
                let key = key_of(mesh, number, triangle.object, triangle.material, sizes.cube);
                let place = *joined.entry(key).or_insert_with(|| {
                    cubes.push((key.2, vec![]));
                    cubes.len() - 1
                });
                cubes[place].1.push(number as u32);
                continue;
            }
            for square in 0..across.0 * across.1 {
                let at = DVec2::new(f64::from(square % across.0), f64::from(square / across.0));
                let (low, place, face) = (low + side * at, first + square, number as u32);
                cut.push(Shape::Square { face, low, side, place });
            }
        }
        let cube = |(cell, faces): ([i64; 3], Vec<u32>)| {
            let low = mesh.bounds.min + sizes.cube * DVec3::from_array(cell.map(|x| x as f64));
            Shape::Cube { faces, low, side: sizes.cube }
        };
        cut.extend(cubes.into_iter().map(cube));
        patches.found = vec![UNKNOWN; cut.len()];
        let new = vec![true; cut.len()];
        patches.add(scene, mesh, cut, &new);
        Ok(patches)
    }

    /// The same with some patches split in four squares (or eight cubes), of which none may be left
    /// smaller than `least` metres.
    pub fn split(&self, scene: &Scene, mesh: &Mesh, which: &[bool], least: f64) -> Patches {
        let (grids, mut squares) = (self.grids.clone(), self.squares.clone());
        for content in squares.iter_mut().filter(|c| matches!(c, Content::Cell(_))) {
            *content = Content::Nothing;
        }
        let round = self.round + 1;
        let mut patches = Patches { grids, squares, round, ..Patches::default() };
        let (mut cut, mut new) = (vec![], vec![]);
        for (number, shape) in self.shapes.iter().enumerate() {
            match shape {
                Shape::Square { face, low, side, place }
                    if which[number] && *side > 2.0 * least =>
                {
                    patches.cut_square(*face, *low, *side, *place, &mut cut);
                }
                Shape::Cube { faces, .. } if which[number] && faces.len() == 1 => {
                    let Grid { low, side, first, .. } = self.grids[faces[0] as usize];
                    if side > 2.0 * least {
                        patches.cut_square(faces[0], low, side, first, &mut cut);
                    } else {
                        cut.push(shape.clone());
                    }
                }
                Shape::Cube { faces, low, side } if which[number] => {
                    cut.extend(halves(mesh, faces, *low, *side));
                }
                _ => cut.push(shape.clone()),
            }
            patches.found.resize(cut.len(), self.found[number]);
            new.resize(cut.len(), cut.len() > new.len() + 1);
        }
        patches.add(scene, mesh, cut, &new);
        patches
    }

    fn cut_square(&mut self, face: u32, low: DVec2, side: f64, place: u32, cut: &mut Vec<Shape>) {
        let first = self.quarters(place);
        for k in 0..4 {
            let low = low + 0.5 * side * DVec2::new(f64::from(k & 1), f64::from(k >> 1));
            cut.push(Shape::Square { face, low, side: 0.5 * side, place: first + k });
        }
    }

    /// The first of the four quarters of a square.
    fn quarters(&mut self, place: u32) -> u32 {
        if let Content::Squares(first) = self.squares[place as usize] {
            return first;
        }
        let first = self.squares.len() as u32;
        self.squares[place as usize] = Content::Squares(first);
        self.squares.extend([Content::Nothing; 4]);
        first
    }

    /// Adds patches of the given shapes, but for empty ones. Of those that are `new`, cells will tell how
    /// light varies; a single one cannot, and keeps what was found in the patch that it was a part of.
    fn add(&mut self, scene: &Scene, mesh: &Mesh, shapes: Vec<Shape>, new: &[bool]) {
        let parts: Vec<Vec<Part>> =
            shapes.par_iter().map(|shape| parts(scene, mesh, shape)).collect();
        let found = std::mem::take(&mut self.found);
        for (((shape, parts), found), &new) in shapes.into_iter().zip(parts).zip(found).zip(new) {
            if parts.is_empty() {
                continue;
            }
            let first = self.area.len();
            let first_square = match &shape {
                Shape::Square { place, .. } => Some(self.quarters(*place)),
                Shape::Cube { .. } => None,
            };
            for own in in_cells(&shape, &parts) {
                let square = |part: &Part| match first_square {
                    Some(square) => square + part.quarter,
                    None => self.grids[part.face as usize].first,
                };
                let squares: Vec<u32> = own.iter().map(square).collect();
                self.add_cell(own, &squares);
            }
            let single = self.area.len() == first + 1;
            self.found.push(if new && !single { UNKNOWN } else { found });
            self.ends.push(self.area.len());
            self.shapes.push(shape);
        }
    }

    /// Adds a cell of some parts, which fill `squares`. Its spots are in them.
    fn add_cell(&mut self, parts: &[Part], squares: &[u32]) {
        let area: f64 = parts.iter().map(|p| p.area).sum();
        let mean = |of: &dyn Fn(&Part) -> DVec3| -> DVec3 {
            parts.iter().map(|p| p.area * of(p)).sum::<DVec3>() / area
        };
        let cell = self.area.len() as u32;
        self.spots.extend(spots(parts, self.round, SPOTS));
        self.exitance.push(mean(&|p| p.exitance));
        self.reflectance.push(mean(&|p| p.reflectance));
        self.area.push(area);
        for &square in squares {
            self.squares[square as usize] = Content::Cell(cell);
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// How many cells all patches have.
    pub fn count_of_cells(&self) -> usize {
        self.area.len()
    }

    /// The spots of a cell.
    pub fn spots(&self, cell: usize) -> &[Spot] {
        &self.spots[SPOTS * cell..SPOTS * (cell + 1)]
    }

    /// The cells of a patch: 1 to [`CELLS`].
    pub fn cells(&self, patch: usize) -> std::ops::Range<usize> {
        let begin = if patch == 0 { 0 } else { self.ends[patch - 1] };
        begin..self.ends[patch]
    }

    /// More spots of a cell, so many times as many; its own where these were put elsewhere.
    pub fn more_spots(&self, scene: &Scene, mesh: &Mesh, cell: usize, times: usize) -> Vec<Spot> {
        let patch = self.ends.partition_point(|&end| end <= cell);
        if self.moved.contains(&patch) {
            return self.spots(cell).to_vec();
        }
        let parts = parts(scene, mesh, &self.shapes[patch]);
        let own = in_cells(&self.shapes[patch], &parts)[cell - self.cells(patch).start];
        spots(own, self.round, times * SPOTS)
    }

    /// What the cells of a patch are made of: convex polygons in the planes of faces, each with the
    /// numbers of its cell and its face.
    pub fn polygons(
        &self,
        scene: &Scene,
        mesh: &Mesh,
        patch: usize,
    ) -> Vec<(usize, u32, Vec<DVec2>)> {
        let parts = parts(scene, mesh, &self.shapes[patch]);
        let own = |(cell, own): (usize, &[Part])| -> Vec<(usize, u32, Vec<DVec2>)> {
            own.iter().map(|part| (cell, part.face, part.polygon.clone())).collect()
        };
        self.cells(patch).zip(in_cells(&self.shapes[patch], &parts)).flat_map(own).collect()
    }

    /// Puts the spots of a patch at other points of it, one or more.
    pub fn put_spots(&mut self, patch: usize, at: &[Spot]) {
        self.moved.insert(patch);
        let cells = self.cells(patch);
        for (k, spot) in self.spots[SPOTS * cells.start..SPOTS * cells.end].iter_mut().enumerate() {
            *spot = at[k % at.len()];
        }
    }

    /// Takes note of what was found at spots, but for those that are `hidden`; W/m^2.
    ///
    /// Reflectances are those of the patch, so that only light tells patches apart.
    pub fn learn(&mut self, irradiance: &[[f64; 3]], hidden: impl Fn(usize) -> bool) {
        for patch in 0..self.len() {
            let cells = self.cells(patch);
            let area: f64 = self.area[cells.clone()].iter().sum();
            let weighed = cells.clone().map(|cell| self.area[cell] * self.reflectance[cell]);
            let rho = weighed.sum::<DVec3>() / area;
            let [least, most] = &mut self.found[patch];
            for cell in cells.filter(|&cell| !hidden(cell)) {
                let own = rho * DVec3::from_array(irradiance[cell]);
                (*least, *most) = (least.min(own), most.max(own));
            }
        }
    }

    /// The cell at a point of a face, given in its plane.
    pub fn at(&self, face: u32, x: DVec2) -> usize {
        let grid = &self.grids[face as usize];
        let (across, up) = grid.across;
        let place = (x - grid.low) / grid.side;
        let index = |p: f64, most: u32| (p.max(0.0) as u32).min(most - 1);
        let (i, j) = (index(place.x, across), index(place.y, up));
        let mut low = DVec2::new(f64::from(i), f64::from(j));
        let (mut side, mut square) = (1.0, grid.first + j * across + i);
        loop {
            match self.squares[square as usize] {
                Content::Cell(cell) => return cell as usize,
                Content::Nothing => return self.nearest(grid, place),
                Content::Squares(first) => {
                    side *= 0.5;
                    let right = u32::from(place.x >= low.x + side);
                    let above = u32::from(place.y >= low.y + side);
                    low += side * DVec2::new(f64::from(right), f64::from(above));
                    square = first + right + 2 * above;
                }
            }
        }
    }

    /// The cell nearest to a place of a grid that a rounding took off the face.
    fn nearest(&self, grid: &Grid, place: DVec2) -> usize {
        let mut best = (f64::INFINITY, 0);
        let mut stack: Vec<(u32, DVec2, f64)> = (0..grid.across.0 * grid.across.1)
            .map(|k| (grid.first + k, k % grid.across.0, k / grid.across.0))
            .map(|(k, i, j)| (k, DVec2::new(f64::from(i), f64::from(j)), 1.0))
            .collect();
        while let Some((square, low, side)) = stack.pop() {
            let distance = place.distance_squared(place.clamp(low, low + side));
            match self.squares[square as usize] {
                Content::Cell(cell) if distance < best.0 => best = (distance, cell as usize),
                Content::Squares(first) if distance < best.0 => {
                    let half = 0.5 * side;
                    stack.extend((0..4).map(|k| {
                        let corner = DVec2::new(f64::from(k & 1), f64::from(k >> 1));
                        (first + k, low + half * corner, half)
                    }));
                }
                _ => {}
            }
        }
        best.1
    }
}

/// The faces of a cube in cubes of half its side, or smaller until they are told apart.
fn halves(mesh: &Mesh, faces: &[u32], mut low: DVec3, mut side: f64) -> Vec<Shape> {
    let centre = |f: u32| {
        let face = &mesh.faces[f as usize];
        face.frame.lift((face.corners[0] + face.corners[1] + face.corners[2]) / 3.0)
    };
    loop {
        let half = 0.5 * side;
        let mut parts: [Vec<u32>; 8] = Default::default();
        for &face in faces {
            let above = centre(face).cmpge(low + half);
            parts[above.bitmask() as usize].push(face);
        }
        let corner = |k: usize| {
            let bit = |axis: usize| f64::from(u8::from(k >> axis & 1 == 1));
            low + half * DVec3::new(bit(0), bit(1), bit(2))
        };
        let found: Vec<usize> = (0..8).filter(|&k| !parts[k].is_empty()).collect();
        // Faces with the same centre stay together.
        if found.len() > 1 || half < f64::EPSILON * mesh.magnitude {
            return found
                .into_iter()
                .map(|k| Shape::Cube {
                    faces: std::mem::take(&mut parts[k]),
                    low: corner(k),
                    side: half,
                })
                .collect();
        }
        (low, side) = (corner(found[0]), half);
    }
}

/// What small faces of one patch have in common.
type Key = (u32, u32, [i64; 3], u8);

fn key_of(mesh: &Mesh, number: usize, object: u32, material: u32, cube: f64) -> Key {
    let face = &mesh.faces[number];
    let centre = face.frame.lift((face.corners[0] + face.corners[1] + face.corners[2]) / 3.0);
    let cell = ((centre - mesh.bounds.min) / cube).to_array().map(|x| x.floor() as i64);
    // The 26 directions of a cube's sides, edges and corners.
    let n = face.frame.n;
    let third = |x: f64| u8::from(x > 0.4) + 2 * u8::from(x < -0.4);
    (object, material, cell, third(n.x) + 3 * third(n.y) + 9 * third(n.z))
}

/// Least and largest coordinates of a face in its plane.
fn bounds(face: &Face) -> (DVec2, DVec2) {
    let [a, b, c] = face.corners;
    (a.min(b).min(c), a.max(b).max(c))
}

/// Numbers of squares along both axes of a face's plane.
fn across(face: &Face, square: f64) -> DVec2 {
    let (low, high) = bounds(face);
    ((high - low) / square).ceil().max(DVec2::ONE)
}

/// A convex part of a face, with what varies over it averaged.
fn part(scene: &Scene, face: &Face, number: u32, polygon: &[DVec2]) -> Part {
    let triangle = face.triangle as usize;
    let mut own = Part {
        face: number,
        quarter: 0,
        polygon: polygon.to_vec(),
        area: 0.0,
        centre: DVec2::ZERO,
        exitance: DVec3::ZERO,
        reflectance: DVec3::ZERO,
    };
    for k in 1..polygon.len() - 1 {
        let piece = [polygon[0], polygon[k], polygon[k + 1]];
        let area = 0.5 * twice_area(&piece);
        let footprint = piece.map(|x| face.triangle_weights(x));
        own.area += area;
        own.centre += area * (piece[0] + piece[1] + piece[2]) / 3.0;
        own.exitance += area * scene::exitance(scene, triangle, &footprint);
        own.reflectance += area * scene::reflectance(scene, triangle, &footprint);
    }
    own.centre /= own.area;
    own.exitance /= own.area;
    own.reflectance /= own.area;
    own
}

/// Three numbers from 0 to 1 for what has its centre at x, evenly spread over numbers
/// (Roberts 2018: multiples of powers of the plastic number's kin, g^4 = g + 1).
fn scattered(x: DVec2, number: u32) -> [f64; 3] {
    let mut seed = mix(mix(x.x.to_bits()).wrapping_add(x.y.to_bits()));
    const G: f64 = 1.220_744_084_605_759_5;
    [G, G * G, G * G * G].map(|power| {
        seed = mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15));
        let own = (seed >> 11) as f64 / (1u64 << 53) as f64;
        (own + f64::from(number) / power).fract()
    })
}

/// So many spots of a cell of some parts, other ones in each round.
fn spots(parts: &[Part], round: u32, count: usize) -> Vec<Spot> {
    let area: f64 = parts.iter().map(|p| p.area).sum();
    let begin = round * count as u32;
    let spot = |number| {
        let [s, t, which] = scattered(parts[0].centre, number);
        let mut left = which * area;
        let chosen = parts.iter().position(|part| {
            let inside = left <= part.area;
            left -= if inside { 0.0 } else { part.area };
            inside
        });
        let part = &parts[chosen.unwrap_or(0)];
        let x = inside(&part.polygon, [s, t, left.clamp(0.0, part.area)]);
        Spot { face: part.face, x }
    };
    (begin..begin + count as u32).map(spot).collect()
}

/// The point of a convex polygon that two numbers from 0 to 1 and one from 0 to its area choose.
fn inside(polygon: &[DVec2], [s, t, mut left]: [f64; 3]) -> DVec2 {
    let mut k = 1;
    while k + 2 < polygon.len() {
        left -= 0.5 * twice_area(&[polygon[0], polygon[k], polygon[k + 1]]);
        if left < 0.0 {
            break;
        }
        k += 1;
    }
    let w = on_triangle(DVec2::new(s, t));
    w.x * polygon[0] + w.y * polygon[k] + w.z * polygon[k + 1]
}

/// The parts of a patch, cell by cell.
fn in_cells<'a>(shape: &Shape, parts: &'a [Part]) -> Vec<&'a [Part]> {
    match shape {
        Shape::Square { .. } => parts.chunks(1).collect(),
        Shape::Cube { .. } => in_quarters(parts),
    }
}

/// Parts in runs of about a quarter of their area each, [`CELLS`] of them at most.
fn in_quarters(parts: &[Part]) -> Vec<&[Part]> {
    let area: f64 = parts.iter().map(|p| p.area).sum();
    let mut sum = 0.0;
    let quarter: Vec<usize> = parts
        .iter()
        .map(|p| {
            sum += p.area;
            // By the middle of each.
            (((sum - 0.5 * p.area) / area * CELLS as f64) as usize).min(CELLS - 1)
        })
        .collect();
    let begins = |k: &usize| *k == 0 || quarter[*k] != quarter[*k - 1];
    let mut first: Vec<usize> = (0..parts.len()).filter(begins).collect();
    first.push(parts.len());
    first.windows(2).map(|run| &parts[run[0]..run[1]]).collect()
}

/// What a patch is made of.
fn parts(scene: &Scene, mesh: &Mesh, shape: &Shape) -> Vec<Part> {
    match shape {
        Shape::Square { face, low, side, .. } => {
            quarters(scene, &mesh.faces[*face as usize], *face, (*low, *side))
        }
        Shape::Cube { faces, .. } => {
            let whole = |&f: &u32| {
                let face = &mesh.faces[f as usize];
                part(scene, face, f, &face.corners)
            };
            faces.iter().map(whole).collect()
        }
    }
}

/// The parts of a face in the four quarters of a square.
fn quarters(scene: &Scene, face: &Face, number: u32, (low, side): (DVec2, f64)) -> Vec<Part> {
    let (mut pieces, half) = (Pieces::default(), 0.5 * side);
    let mut parts = vec![];
    for quarter in 0..4 {
        let from = low + half * DVec2::new(f64::from(quarter & 1), f64::from(quarter >> 1));
        let to = from + half;
        pieces.clear();
        pieces.push(&face.corners);
        let lines =
            [(DVec2::X, -from.x), (DVec2::NEG_X, to.x), (DVec2::Y, -from.y), (DVec2::NEG_Y, to.y)];
        let inside = lines.into_iter().all(|(g, c)| {
            let polygon = pieces.get(pieces.len() - 1).to_vec();
            pieces.push_clipped(&polygon, &Linear { g, c, uncertainty: 0.0 })
        });
        if inside {
            let mut own = part(scene, face, number, pieces.get(pieces.len() - 1));
            own.quarter = quarter;
            // Slivers of roundings have no centre.
            if own.area > 0.0 && own.centre.is_finite() {
                parts.push(own);
            }
        }
    }
    parts
}
