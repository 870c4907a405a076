//! Charts: parts of the surface that are laid out flat.
//!
//! A chart is grown from a triangle, the largest that is left, over edges that it shares with exactly
//! one other triangle of its object, as long as the angle at the edge stays below [`CREASE`] and that
//! to the first triangle below [`CONE`]. It is seen along its mean normal, which leaves a flat chart
//! as it is and stretches others by at most 1/cos [`CONE`]; all are scaled to have the area of their
//! surface. Where a curved one would lie over itself its flat parts become charts of their own.
//! Last, it is turned until the smallest box around it is upright: a wall's edges run along the rows
//! and columns of texels.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::overlap::overlapping;
use crate::geometry::Frame;
use crate::scene::Scene;

/// Two triangles that meet at a greater angle (radians) have a crease between them: 20 degrees, more
/// than between the facets of a cylinder of 20.
pub(super) const CREASE: f64 = 0.35;

/// Greatest angle between a triangle of a chart and the first one (radians): 30 degrees, so that
/// nothing is stretched by more than 1.16.
const CONE: f64 = std::f64::consts::FRAC_PI_6;

/// Normals that differ by at most this (radians) are of one plane, as far as charts go: distances are
/// right to half of its square.
const FLAT: f64 = 1e-3;

/// Parts of a chart wider than this share of it must not overlap.
const OVERLAP: f64 = 1e-6;

/// Whether unit vectors are within an angle (radians). Dot products could not tell small ones apart.
fn is_within(a: DVec3, b: DVec3, angle: f64) -> bool {
    a.distance(b) <= 2.0 * (0.5 * angle).sin()
}

/// Triangles laid out in a plane.
#[derive(Clone, Debug)]
pub(super) struct Flat {
    /// Index of the object.
    pub object: u32,
    /// The triangles, in ascending order.
    pub triangles: Vec<u32>,
    /// Their corners, metres, counter-clockwise; the least coordinates are zero.
    pub corners: Vec<[DVec2; 3]>,
    /// The greatest coordinates.
    pub size: DVec2,
}

/// What charts are cut from.
pub(super) struct Cutter<'a> {
    scene: &'a Scene,
    normals: Vec<DVec3>,
    /// Of each triangle the neighbour over each edge, where there is exactly one.
    neighbours: Vec<[Option<u32>; 3]>,
}

impl<'a> Cutter<'a> {
    /// Finds neighbours. Triangles of different `groups` are none.
    pub fn new(scene: &'a Scene, groups: &[u32]) -> Cutter<'a> {
        let count = scene.triangles.len();
        let normals: Vec<DVec3> = scene
            .triangles
            .iter()
            .map(|t| Frame::of_triangle(&t.vertices).map_or(DVec3::ZERO, |f| f.n))
            .collect();
        let key = |x: DVec3| (x + 0.0).to_array().map(f64::to_bits);
        let edge = |i: usize, k: usize| {
            let t = &scene.triangles[i];
            (t.object, groups[i], key(t.vertices[k]), key(t.vertices[(k + 1) % 3]))
        };
        let mut owners: HashMap<_, Vec<u32>> = HashMap::with_capacity(3 * count);
        for i in (0..count).filter(|&i| normals[i] != DVec3::ZERO) {
            for k in 0..3 {
                owners.entry(edge(i, k)).or_default().push(i as u32);
            }
        }
        let neighbours = (0..count)
            .map(|i| {
                [0, 1, 2].map(|k| {
                    let (object, group, from, to) = edge(i, k);
                    let own = owners.get(&(object, group, from, to))?;
                    let other = owners.get(&(object, group, to, from))?;
                    (own.len() == 1 && other.len() == 1).then(|| other[0])
                })
            })
            .collect();
        Cutter { scene, normals, neighbours }
    }

    /// The charts of the triangles that are `wanted`, in order of their objects and then of their
    /// first triangles. Triangles without a normal are in none.
    pub fn charts(&self, wanted: &[bool]) -> Vec<Flat> {
        let area = |i: u32| self.scene.triangles[i as usize].normal_and_area().1;
        let mut is_left: Vec<bool> =
            wanted.iter().zip(&self.normals).map(|(w, n)| *w && *n != DVec3::ZERO).collect();
        let mut order: Vec<u32> =
            (0..wanted.len() as u32).filter(|&i| is_left[i as usize]).collect();
        order.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
        let mut charts = vec![];
        for seed in order {
            if !is_left[seed as usize] {
                continue;
            }
            let members = self.grow(seed, CONE, &mut is_left);
            let chart = self.flatten(members);
            if self.is_flat(&chart)
                || overlapping(&chart.corners, OVERLAP * chart.size.max_element()) == 0
            {
                charts.push(chart);
                continue;
            }
            let members = chart.triangles;
            members.iter().for_each(|&i| is_left[i as usize] = true);
            for i in members {
                if is_left[i as usize] {
                    charts.push(self.flatten(self.grow(i, FLAT, &mut is_left)));
                }
            }
        }
        charts.iter_mut().for_each(Flat::make_upright);
        charts.sort_by_key(|c| (c.object, c.triangles[0]));
        charts
    }

    /// The triangles that are left around a first one, within a cone of normals.
    fn grow(&self, seed: u32, cone: f64, is_left: &mut [bool]) -> Vec<u32> {
        let axis = self.normals[seed as usize];
        let (mut members, mut next) = (vec![seed], 0);
        is_left[seed as usize] = false;
        while next < members.len() {
            let i = members[next] as usize;
            next += 1;
            for j in self.neighbours[i].into_iter().flatten() {
                let n = self.normals[j as usize];
                if is_left[j as usize]
                    && is_within(n, axis, cone)
                    && is_within(n, self.normals[i], CREASE)
                {
                    is_left[j as usize] = false;
                    members.push(j);
                }
            }
        }
        members.sort_unstable();
        members
    }

    /// Whether all triangles lie in planes of one direction.
    fn is_flat(&self, chart: &Flat) -> bool {
        let first = self.normals[chart.triangles[0] as usize];
        chart.triangles.iter().all(|&i| is_within(self.normals[i as usize], first, FLAT))
    }

    /// Triangles as seen along their mean normal, scaled to the area that they have.
    fn flatten(&self, triangles: Vec<u32>) -> Flat {
        let of = |i: u32| &self.scene.triangles[i as usize];
        let areas: Vec<f64> = triangles.iter().map(|&i| of(i).normal_and_area().1).collect();
        let whole: f64 = areas.iter().sum();
        // Of a flat chart every normal is the mean one; that of the largest triangle has the fewest
        // roundings.
        let largest = (0..areas.len()).max_by(|&a, &b| areas[a].total_cmp(&areas[b])).unwrap_or(0);
        let first = self.normals[triangles[largest] as usize];
        let flat = triangles.iter().all(|&i| is_within(self.normals[i as usize], first, FLAT));
        let mean: DVec3 =
            triangles.iter().zip(&areas).map(|(&i, a)| *a * self.normals[i as usize]).sum();
        let axis = if flat { first } else { mean.normalize_or(first) };
        let frame = Frame::new(of(triangles[largest]).vertices[0], axis);
        let mut corners: Vec<[DVec2; 3]> =
            triangles.iter().map(|&i| of(i).vertices.map(|x| frame.project(x))).collect();
        if !flat {
            let seen: f64 = triangles
                .iter()
                .zip(&areas)
                .map(|(&i, a)| a * self.normals[i as usize].dot(axis))
                .sum();
            // Areas of surfaces of 1e-160 m are zero.
            let scale = if seen > 0.0 { (whole / seen).sqrt() } else { 1.0 };
            corners.iter_mut().flatten().for_each(|x| *x *= scale);
        }
        let object = of(triangles[0]).object;
        let mut chart = Flat { object, triangles, corners, size: DVec2::ZERO };
        chart.move_to_origin();
        chart
    }
}

/// At most so many edges of the outline are tried as the direction of a row, the longest ones.
const MOST_DIRECTIONS: usize = 64;

/// Boxes whose areas differ by less than this share are equally good.
const AS_GOOD: f64 = 1e-9;

impl Flat {
    fn move_to_origin(&mut self) {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for x in self.corners.iter().flatten() {
            (low, high) = (low.min(*x), high.max(*x));
        }
        self.corners.iter_mut().flatten().for_each(|x| *x -= low);
        self.size = high - low;
    }

    /// Turns it until the smallest box around it is upright, and wider than high.
    fn make_upright(&mut self) {
        let outline = hull(self.corners.iter().flatten().copied().collect());
        let count = outline.len();
        let mut edges: Vec<DVec2> =
            (0..count).map(|k| outline[(k + 1) % count] - outline[k]).collect();
        // Stable: of edges of one length the first is tried first.
        edges.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        let mut best: Option<(f64, DVec2)> = None;
        for edge in edges.into_iter().take(MOST_DIRECTIONS) {
            let Some(along) = edge.try_normalize() else { continue };
            let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for x in &outline {
                let turned = DVec2::new(along.dot(*x), along.perp_dot(*x));
                (low, high) = (low.min(turned), high.max(turned));
            }
            let size = high - low;
            let area = size.x * size.y;
            if best.is_none_or(|(least, _)| area < (1.0 - AS_GOOD) * least) {
                let row = if size.x >= size.y { along } else { along.perp() };
                best = Some((area, row));
            }
        }
        if let Some((_, along)) = best {
            for x in self.corners.iter_mut().flatten() {
                *x = DVec2::new(along.dot(*x), along.perp_dot(*x));
            }
            self.move_to_origin();
        }
    }
}

/// The convex hull, counter-clockwise (A. M. Andrew's monotone chain, 1979).
fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = vec![];
        for x in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(x - b) <= 0.0
            {
                chain.pop();
            }
            chain.push(x);
        }
        chain.pop();
        chain
    };
    let mut outline = chain(&mut points.iter().copied());
    outline.extend(chain(&mut points.iter().rev().copied()));
    outline
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::polygon::twice_area;
    use crate::scene::{Material, Object, Triangle};

    fn scene(triangles: &[[DVec3; 3]]) -> Scene {
        let triangle = |vertices: &[DVec3; 3]| Triangle {
            vertices: *vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: 0,
        };
        Scene {
            objects: vec![Object { name: "all".into() }],
            materials: vec![Material::plain("grey", DVec3::splat(0.5))],
            triangles: triangles.iter().map(triangle).collect(),
            ..Scene::default()
        }
    }

    fn charts(scene: &Scene) -> Vec<Flat> {
        let count = scene.triangles.len();
        Cutter::new(scene, &vec![0; count]).charts(&vec![true; count])
    }

    /// A tube about the z axis through `turn` radians, rising by `rise` metres.
    fn tube(facets: u32, turn: f64, rise: f64) -> Scene {
        let at = |k: u32, z: f64| {
            let angle = turn * f64::from(k) / f64::from(facets);
            let up = rise * f64::from(k) / f64::from(facets);
            DVec3::new(angle.cos(), angle.sin(), z + up)
        };
        let quads = (0..facets).flat_map(|k| {
            let (a, b, c, d) = (at(k, 0.0), at(k + 1, 0.0), at(k + 1, 1.0), at(k, 1.0));
            [[a, b, c], [a, c, d]]
        });
        scene(&quads.collect::<Vec<_>>())
    }

    #[test]
    fn a_tilted_rectangle_lies_upright_and_unchanged() {
        let (u, v) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.64, 0.6, 0.48));
        let at = |x: f64, y: f64| DVec3::new(3.0, -2.0, 1.0) + x * u + y * v;
        let (a, b, c, d) = (at(0.0, 0.0), at(2.0, 0.0), at(2.0, 5.0), at(0.0, 5.0));
        let charts = charts(&scene(&[[a, b, c], [a, c, d]]));
        assert_eq!(charts.len(), 1);
        assert!(charts[0].size.distance(DVec2::new(5.0, 2.0)) < 1e-14, "{}", charts[0].size);
        for t in &charts[0].corners {
            assert!((twice_area(t) - 10.0).abs() < 1e-13);
            for x in t {
                let on_border = x.x.min(5.0 - x.x).max(x.y.min(2.0 - x.y)).abs();
                assert!(on_border < 1e-14, "{x}");
            }
        }
    }

    #[test]
    fn charts_end_at_creases() {
        // A box has six, an octagon's tube eight, and a finer tube is cut where the cone ends.
        let p = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let sides = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let cube = scene(&sides.map(|t| t.map(p)).collect::<Vec<_>>());
        assert_eq!(charts(&cube).len(), 6);
        let turn = std::f64::consts::TAU;
        assert_eq!(charts(&tube(8, turn, 0.0)).len(), 8);
        let fine = charts(&tube(36, turn, 0.0));
        assert!((6..=9).contains(&fine.len()), "{}", fine.len());
    }

    #[test]
    fn curved_charts_keep_their_area_and_stretch_little() {
        let tube = tube(40, 3.0, 0.7);
        for chart in charts(&tube) {
            let (mut laid, mut real) = (0.0, 0.0);
            for (&i, t) in chart.triangles.iter().zip(&chart.corners) {
                let vertices = tube.triangles[i as usize].vertices;
                laid += 0.5 * twice_area(t);
                real += tube.triangles[i as usize].normal_and_area().1;
                for k in 0..3 {
                    let m = (k + 1) % 3;
                    let stretch = t[k].distance(t[m]) / vertices[k].distance(vertices[m]);
                    assert!((0.8..1.16).contains(&stretch), "{stretch}");
                }
            }
            assert!((laid - real).abs() < 1e-12 * real, "{laid} {real}");
        }
    }

    #[test]
    fn what_would_lie_over_itself_is_cut() {
        // A flat spiral ramp: all normals within the cone, two turns above each other.
        let at = |k: u32, r: f64| {
            let angle = 0.2 * f64::from(k);
            DVec3::new(r * angle.cos(), r * angle.sin(), 0.1 * angle)
        };
        let quads = (0..63).flat_map(|k| {
            let (a, b, c, d) = (at(k, 1.0), at(k, 2.0), at(k + 1, 2.0), at(k + 1, 1.0));
            [[a, b, c], [a, c, d]]
        });
        let ramp = scene(&quads.collect::<Vec<_>>());
        let charts = charts(&ramp);
        assert!(charts.len() > 1);
        assert_eq!(charts.iter().map(|c| c.triangles.len()).sum::<usize>(), 126);
        for chart in charts {
            assert_eq!(overlapping(&chart.corners, 1e-6), 0);
        }
    }
}
