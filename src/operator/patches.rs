//! Sources of many small faces: patches, each with one radiosity.
//!
//! A face that is larger than the patches are to be is cut by a grid in its plane; smaller ones are
//! taken together with others of the same object and material that lie in the same cube and face
//! about the same way. Receivers are anywhere and know nothing of patches: these are but what the
//! surface radiates, as coarsely as the sum over a hemisphere allows.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::Pieces;
use crate::geometry::polygon::{Linear, twice_area};
use crate::mesh::{Face, Mesh};
use crate::scene::{self, Scene};

/// Points of a patch at which light is gathered, at most.
pub const SPOTS: usize = 4;

/// Sizes of patches, before they are split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchSizes {
    /// Side of the squares of large faces, metres.
    pub square: f64,
    /// Side of the cubes whose small faces are taken together, metres.
    pub cube: f64,
}

/// A point of a patch where light is gathered.
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
    /// Spots of one patch after the other, and where those of each end.
    spots: Vec<Spot>,
    ends: Vec<usize>,
    /// Area of each patch, square metres.
    pub area: Vec<f64>,
    /// Mean exitance E of each, W/m^2.
    pub exitance: Vec<DVec3>,
    /// Mean reflectance of each.
    pub reflectance: Vec<DVec3>,
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
    Patch(u32),
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

/// Most squares of all faces.
const MOST_SQUARES: f64 = 2e7;

/// A part of a face.
struct Part {
    face: u32,
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
            let (low, side, first) = (bounds(face).0, sizes.square, patches.squares.len() as u32);
            patches.grids.push(Grid { first, across, low, side });
            patches.squares.resize((first + across.0 * across.1) as usize, Content::Nothing);
            if across == (1, 1) {
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
        patches.add(scene, mesh, cut);
        Ok(patches)
    }

    /// The same with some patches split in four squares (or eight cubes), of which none may be left
    /// smaller than `least` metres.
    pub fn split(&self, scene: &Scene, mesh: &Mesh, which: &[bool], least: f64) -> Patches {
        let (grids, squares) = (self.grids.clone(), self.squares.clone());
        let mut patches = Patches { grids, squares, ..Patches::default() };
        let mut cut = vec![];
        for (number, shape) in self.shapes.iter().enumerate() {
            match shape {
                Shape::Square { face, low, side, place }
                    if which[number] && *side > 2.0 * least =>
                {
                    patches.cut_square(*face, *low, *side, *place, &mut cut);
                }
                Shape::Cube { faces, .. } if which[number] && faces.len() == 1 => {
                    let (low, high) = bounds(&mesh.faces[faces[0] as usize]);
                    let (side, place) =
                        ((high - low).max_element(), self.grids[faces[0] as usize].first);
                    if side > 2.0 * least {
                        patches.grids[faces[0] as usize].side = side;
                        patches.cut_square(faces[0], low, side, place, &mut cut);
                    } else {
                        cut.push(shape.clone());
                    }
                }
                Shape::Cube { faces, low, side } if which[number] => {
                    cut.extend(halves(mesh, faces, *low, *side));
                }
                _ => cut.push(shape.clone()),
            }
        }
        patches.add(scene, mesh, cut);
        patches
    }

    fn cut_square(&mut self, face: u32, low: DVec2, side: f64, place: u32, cut: &mut Vec<Shape>) {
        let first = self.squares.len() as u32;
        self.squares[place as usize] = Content::Squares(first);
        self.squares.extend([Content::Nothing; 4]);
        for k in 0..4 {
            let low = low + 0.5 * side * DVec2::new(f64::from(k & 1), f64::from(k >> 1));
            cut.push(Shape::Square { face, low, side: 0.5 * side, place: first + k });
        }
    }

    /// Adds patches of the given shapes, but for empty ones.
    fn add(&mut self, scene: &Scene, mesh: &Mesh, shapes: Vec<Shape>) {
        let parts: Vec<Vec<Part>> = shapes
            .par_iter()
            .map(|shape| match shape {
                Shape::Square { face, low, side, .. } => {
                    quarters(scene, &mesh.faces[*face as usize], *face, *low, *side)
                }
                Shape::Cube { faces, .. } => {
                    let whole = |&f: &u32| {
                        let face = &mesh.faces[f as usize];
                        part(scene, face, f, &face.corners)
                    };
                    faces.iter().map(whole).collect()
                }
            })
            .collect();
        for (shape, parts) in shapes.into_iter().zip(parts) {
            if parts.is_empty() {
                continue;
            }
            let number = self.area.len() as u32;
            match &shape {
                Shape::Square { place, .. } => {
                    self.squares[*place as usize] = Content::Patch(number);
                }
                Shape::Cube { faces, .. } => {
                    for &face in faces {
                        let place = self.grids[face as usize].first as usize;
                        self.squares[place] = Content::Patch(number);
                    }
                }
            }
            self.shapes.push(shape);
            self.push(&parts);
        }
    }

    fn push(&mut self, parts: &[Part]) {
        let area: f64 = parts.iter().map(|p| p.area).sum();
        let mean = |of: &dyn Fn(&Part) -> DVec3| -> DVec3 {
            parts.iter().map(|p| p.area * of(p)).sum::<DVec3>() / area
        };
        self.exitance.push(mean(&|p| p.exitance));
        self.reflectance.push(mean(&|p| p.reflectance));
        self.area.push(area);
        // Evenly by area; the first, where roundings leave none.
        let (mut sum, mut met) = (0.0, 0);
        for (k, part) in parts.iter().enumerate() {
            sum += part.area;
            let wanted = (sum / area * SPOTS as f64 + 0.5) as usize;
            if wanted > met || (k + 1 == parts.len() && met == 0) {
                self.spots.push(Spot { face: part.face, x: part.centre });
                met = wanted;
            }
        }
        self.ends.push(self.spots.len());
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.area.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.area.is_empty()
    }

    /// All spots, those of one patch after the other.
    pub fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// The range of a patch's own spots: 1 to [`SPOTS`].
    pub fn range(&self, patch: usize) -> std::ops::Range<usize> {
        let begin = if patch == 0 { 0 } else { self.ends[patch - 1] };
        begin..self.ends[patch]
    }

    /// Puts the spots of a patch at other points of it, one or more.
    pub fn put_spots(&mut self, patch: usize, at: &[Spot]) {
        for (k, spot) in self.range(patch).enumerate() {
            self.spots[spot] = at[k % at.len()];
        }
    }

    /// The patch at a point of a face, given in its plane.
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
                Content::Patch(patch) => return patch as usize,
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

    /// The patch nearest to a place of a grid that a rounding took off the face.
    fn nearest(&self, grid: &Grid, place: DVec2) -> usize {
        let mut best = (f64::INFINITY, 0);
        let mut stack: Vec<(u32, DVec2, f64)> = (0..grid.across.0 * grid.across.1)
            .map(|k| (grid.first + k, k % grid.across.0, k / grid.across.0))
            .map(|(k, i, j)| (k, DVec2::new(f64::from(i), f64::from(j)), 1.0))
            .collect();
        while let Some((square, low, side)) = stack.pop() {
            let distance = place.distance_squared(place.clamp(low, low + side));
            match self.squares[square as usize] {
                Content::Patch(patch) if distance < best.0 => best = (distance, patch as usize),
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

/// The parts of a face in the four quarters of a square: each has a spot of its own.
fn quarters(scene: &Scene, face: &Face, number: u32, low: DVec2, side: f64) -> Vec<Part> {
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
            let own = part(scene, face, number, pieces.get(pieces.len() - 1));
            // Slivers of roundings have no centre.
            if own.area > 0.0 && own.centre.is_finite() {
                parts.push(own);
            }
        }
    }
    parts
}
