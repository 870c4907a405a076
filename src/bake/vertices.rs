//! Irradiance at vertices, on triangles as fine as the light asks for.
//!
//! Each triangle of a conforming triangulation (`conforming`) has an irradiance at each corner, as
//! seen from within: gathered a little inside of the root that it belongs to, so that a vertex on a
//! crease, or on the line where a block stands on a floor, has one value for each side. Between them
//! light is linear, as graphics hardware draws it. How far that is off is looked at on a lattice of
//! points inside of each triangle. With e the difference (of the channels the largest), the mean of
//! e^2 over the surface, by area, tells the error; triangles with the largest shares of it are
//! refined until its root is at most the asked share of the mean irradiance, or until there are as
//! many triangles as are allowed. What reflects nothing counts nothing.
//!
//! Where sides agree within that error, and belong to one smooth surface, they take their mean: one
//! vertex.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec2, DVec3};

use super::conforming::{Conforming, Tri};
use crate::error::Result;
use crate::mesh::barycentric;
use crate::monitor::Monitor;
use crate::reconstruct::fill::RootPoints;
use crate::reconstruct::irradiance::{IrradianceCounts, irradiances};
use crate::scene::{self, Scene};
use crate::solve::Light;

/// Points at the rim of a root are moved inside by this share of its size: other faces touch it
/// there, and would be seen edge on.
const INSIDE: f64 = 1e-4;

/// Large triangles are looked at in points that are at most this share of the scene's size apart,
/// so that no shadow of that size is missed.
const SPACING: f64 = 1.0 / 32.0;

/// Parts of an edge of the lattice of points in a triangle: least and most.
const LATTICE: (u32, u32) = (2, 24);

/// Of the error that is left, triangles with this share of it are refined in one pass. More would
/// refine what neighbours are about to mend, less would take more passes.
const BULK: f64 = 0.7;

/// No edge shorter than this share of the scene's size is bisected: shadows that end in a point have
/// light that is not linear on triangles of any size.
const SHORTEST: f64 = 1.0 / 8192.0;

/// How fine the triangles are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexOptions {
    /// Root mean square error, of irradiance between vertices, relative to its mean.
    pub tolerance: f64,
    /// Most triangles, where the scene itself does not have more.
    pub most: usize,
}

/// A triangle with light at its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitTriangle {
    /// Index of the input triangle.
    pub triangle: u32,
    /// Whether this is its back.
    pub back: bool,
    /// Corners, metres, counter-clockwise seen from the side that radiates.
    pub corners: [DVec3; 3],
    /// Weights of the corners of the input triangle at each of these corners.
    pub weights: [DVec3; 3],
    /// Irradiance, W/m^2.
    pub irradiance: [DVec3; 3],
}

/// The surface with light at its vertices, and how good it is.
#[derive(Clone, Debug, Default)]
pub struct LitSurface {
    /// In order of the input triangles, a back after its front.
    pub triangles: Vec<LitTriangle>,
    /// Root mean square error of irradiance between vertices, relative to its mean.
    pub error: f64,
    /// Mean irradiance, W/m^2, of the brightest channel.
    pub mean: f64,
    /// Passes of refinement.
    pub passes: usize,
    /// Points gathered and filled in.
    pub counts: IrradianceCounts,
}

/// Finds the light at the vertices of a scene that was solved; of triangles that are not `wanted` it
/// is zero, and they are refined only as far as their neighbours are.
pub fn vertex_light(
    scene: &Scene,
    light: &Light,
    wanted: &[bool],
    options: &VertexOptions,
    monitor: &Monitor,
) -> Result<LitSurface> {
    let exact = |t: usize| scene.triangles[t].vertices;
    let mut work = Work {
        scene,
        light,
        wanted,
        monitor,
        mesh: Conforming::new(&light.mesh, exact),
        values: HashMap::new(),
        counts: IrradianceCounts::default(),
    };
    let mut errors: Vec<Option<Looked>> = vec![None; work.mesh.triangles.len()];
    let (shortest, extent) = (SHORTEST * light.mesh.bounds.extent(), light.mesh.bounds.extent());
    let mut passes = 0;
    let (error, mean) = loop {
        monitor.check()?;
        work.gather_corners()?;
        work.look(&mut errors, SPACING * extent)?;
        let looked: Vec<Looked> = errors.iter().flatten().copied().collect();
        let area: f64 = looked.iter().map(|l| l.area).sum();
        let squares: f64 = looked.iter().map(|l| l.area * l.square).sum();
        let sum: DVec3 = looked.iter().map(|l| l.area * l.mean).sum();
        let mean = if area > 0.0 { sum.max_element() / area } else { 0.0 };
        let error = if mean > 0.0 { (squares / area).sqrt() / mean } else { 0.0 };
        if error <= options.tolerance {
            break (error, mean);
        }
        // Largest shares first; of equal ones the first.
        let mut order: Vec<usize> = (0..looked.len())
            .filter(|&i| {
                looked[i].square > 0.0 && work.mesh.size(&work.mesh.triangles[i]) > shortest
            })
            .collect();
        let share = |i: usize| looked[i].area * looked[i].square;
        order.sort_by(|&a, &b| share(b).total_cmp(&share(a)).then(a.cmp(&b)));
        let mut taken = 0.0;
        let goal = BULK * squares;
        let enough = order.iter().position(|&i| {
            taken += share(i);
            taken >= goal
        });
        order.truncate(enough.map_or(order.len(), |k| k + 1));
        let mut before = None;
        while !order.is_empty() && before.is_none() {
            before = work.mesh.refine(&order, options.most);
            order.truncate(order.len() / 2);
        }
        let Some(before) = before else { break (error, mean) };
        passes += 1;
        // A triangle that was not cut keeps what is known of it.
        let mut children = vec![0u32; errors.len()];
        before.iter().for_each(|&b| children[b] += 1);
        errors = before.iter().map(|&b| errors[b].filter(|_| children[b] == 1)).collect();
    };
    work.join_sides(2.0 * options.tolerance * mean);
    Ok(LitSurface { triangles: work.lit(), error, mean, passes, counts: work.counts })
}

/// What is known of the light on a triangle.
#[derive(Clone, Copy, Debug)]
struct Looked {
    /// Square metres.
    area: f64,
    /// Mean irradiance of the points looked at, W/m^2.
    mean: DVec3,
    /// Mean square of their differences from what is linear, (W/m^2)^2.
    square: f64,
}

struct Work<'a, 'm> {
    scene: &'a Scene,
    light: &'a Light,
    wanted: &'a [bool],
    monitor: &'a Monitor<'m>,
    mesh: Conforming,
    /// Irradiance at a vertex as seen from a root.
    values: HashMap<(u32, u32), DVec3>,
    counts: IrradianceCounts,
}

impl Work<'_, '_> {
    /// The place of a point in the plane of a root, a little inside of it.
    fn place(&self, root: u32, p: DVec3) -> DVec2 {
        let root = &self.light.mesh.roots[root as usize];
        let x = self.light.mesh.faces[root.face as usize].frame.project(p);
        let [a, b, c] = root.corners;
        let centre = (a + b + c) / 3.0;
        // At the centre all weights are a third.
        let least = barycentric(&root.corners, x).min_element();
        let step = ((INSIDE / 3.0 - least) / (1.0 / 3.0 - least)).clamp(0.0, 1.0);
        x + step * (centre - x)
    }

    fn gather(&mut self, points: &BTreeMap<u32, Vec<DVec2>>) -> Result<Vec<Vec<DVec3>>> {
        let own =
            |(&root, points): (&u32, &Vec<DVec2>)| RootPoints { root, points: points.clone() };
        let asked: Vec<RootPoints> = points.iter().map(own).collect();
        let (values, counts) = irradiances(self.light, &asked, self.monitor)?;
        self.counts += counts;
        Ok(values)
    }

    /// Finds the values of corners that have none yet.
    fn gather_corners(&mut self) -> Result<()> {
        let mut wanted: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for t in self.mesh.triangles.iter().filter(|t| self.is_wanted(t)) {
            let unknown =
                t.corners.into_iter().filter(|&v| !self.values.contains_key(&(t.root, v)));
            wanted.entry(t.root).or_default().extend(unknown);
        }
        wanted.values_mut().for_each(|own| {
            own.sort_unstable();
            own.dedup();
        });
        wanted.retain(|_, own| !own.is_empty());
        let points = wanted.iter().map(|(&root, own)| {
            let places = own.iter().map(|&v| self.place(root, self.mesh.positions[v as usize]));
            (root, places.collect())
        });
        let points: BTreeMap<u32, Vec<DVec2>> = points.collect();
        let found = self.gather(&points)?;
        for ((root, own), values) in wanted.into_iter().zip(found) {
            for (v, value) in own.into_iter().zip(values) {
                self.values.insert((root, v), value);
            }
        }
        Ok(())
    }

    fn triangle(&self, t: &Tri) -> usize {
        let mesh = &self.light.mesh;
        mesh.faces[mesh.roots[t.root as usize].face as usize].triangle as usize
    }

    fn is_wanted(&self, t: &Tri) -> bool {
        self.wanted[self.triangle(t)]
    }

    fn corners(&self, t: &Tri) -> [DVec3; 3] {
        t.corners.map(|v| self.mesh.positions[v as usize])
    }

    /// Looks at triangles that have not been looked at, in points at most `spacing` apart.
    fn look(&mut self, errors: &mut [Option<Looked>], spacing: f64) -> Result<()> {
        let mut fresh: Vec<usize> = (0..errors.len()).filter(|&i| errors[i].is_none()).collect();
        fresh.retain(|&i| {
            let wanted = self.is_wanted(&self.mesh.triangles[i]);
            if !wanted {
                errors[i] = Some(Looked { area: 0.0, mean: DVec3::ZERO, square: 0.0 });
            }
            wanted
        });
        let mut points: BTreeMap<u32, Vec<DVec2>> = BTreeMap::new();
        // Where the points of each begin in those of its root, and its lattice.
        let mut begins = vec![];
        for &i in &fresh {
            let t = self.mesh.triangles[i];
            let parts = (self.mesh.size(&t) / spacing).ceil();
            let parts = parts.clamp(f64::from(LATTICE.0), f64::from(LATTICE.1)) as u32;
            let corners = self.corners(&t);
            let places: Vec<DVec2> =
                lattice(parts).map(|w| self.place(t.root, weighted(w, corners))).collect();
            let list = points.entry(t.root).or_default();
            begins.push((list.len(), parts));
            list.extend(places);
        }
        let found = self.gather(&points)?;
        let by_root: HashMap<u32, Vec<DVec3>> = points.into_keys().zip(found).collect();
        let whole = [DVec3::X, DVec3::Y, DVec3::Z];
        for (&i, (begin, parts)) in fresh.iter().zip(begins) {
            let t = self.mesh.triangles[i];
            let corners = self.corners(&t);
            let at_corners = t.corners.map(|v| self.values[&(t.root, v)]);
            let reflects = scene::reflectance(self.scene, self.triangle(&t), &whole) != DVec3::ZERO;
            let (mut sum, mut square, mut count) = (DVec3::ZERO, 0.0, 0.0);
            for (w, value) in lattice(parts).zip(&by_root[&t.root][begin..]) {
                let off = (*value - weighted(w, at_corners)).abs().max_element();
                sum += *value;
                square += off * off;
                count += 1.0;
            }
            let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let square = if reflects { square / count } else { 0.0 };
            errors[i] = Some(Looked { area, mean: sum / count, square });
        }
        Ok(())
    }

    /// Gives the sides of a vertex on one smooth surface their mean where all of them are within
    /// `allowed` of each other.
    fn join_sides(&mut self, allowed: f64) {
        let mut sides: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
        let mut all: Vec<(u32, u32)> = self.values.keys().copied().collect();
        all.sort_unstable();
        for (root, v) in all {
            let patch = self.light.mesh.roots[root as usize].patch;
            sides.entry((patch, v)).or_default().push(root);
        }
        for ((_, v), roots) in sides {
            let own: Vec<DVec3> = roots.iter().map(|&r| self.values[&(r, v)]).collect();
            let low = own.iter().copied().fold(DVec3::INFINITY, DVec3::min);
            let high = own.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
            if (high - low).max_element() <= allowed {
                let mean = own.iter().copied().sum::<DVec3>() / own.len() as f64;
                roots.iter().for_each(|&r| {
                    self.values.insert((r, v), mean);
                });
            }
        }
    }

    fn lit(&self) -> Vec<LitTriangle> {
        let mesh = &self.light.mesh;
        let mut lit: Vec<LitTriangle> = vec![];
        for t in &self.mesh.triangles {
            let face = &mesh.faces[mesh.roots[t.root as usize].face as usize];
            let corners = self.corners(t);
            lit.push(LitTriangle {
                triangle: face.triangle,
                back: face.back,
                corners,
                weights: corners.map(|p| face.triangle_weights(face.frame.project(p))),
                irradiance: t.corners.map(|v| {
                    let known = self.values.get(&(t.root, v)).copied();
                    known.map_or(DVec3::ZERO, |value| value.max(DVec3::ZERO))
                }),
            });
        }
        lit
    }
}

fn weighted(w: DVec3, x: [DVec3; 3]) -> DVec3 {
    w.x * x[0] + w.y * x[1] + w.z * x[2]
}

/// Weights of the points of a triangular lattice of so many parts an edge, without the corners, and
/// of the centroid where it is not one of them.
fn lattice(parts: u32) -> impl Iterator<Item = DVec3> {
    let n = f64::from(parts);
    let points = (0..=parts).flat_map(move |j| (0..=parts - j).map(move |i| (i, j)));
    let inner = points.filter(move |&(i, j)| i != parts && j != parts && i + j != 0);
    let centroid = (!parts.is_multiple_of(3)).then_some(DVec3::splat(1.0 / 3.0));
    inner
        .map(move |(i, j)| DVec3::new(f64::from(parts - i - j), f64::from(i), f64::from(j)) / n)
        .chain(centroid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_has_no_corners_and_sums_to_the_centroid() {
        for parts in 2..8 {
            let points: Vec<DVec3> = lattice(parts).collect();
            let whole = (parts + 1) * (parts + 2) / 2 - 3;
            assert_eq!(points.len() as u32, whole + u32::from(parts % 3 != 0));
            let mean = points.iter().copied().sum::<DVec3>() / points.len() as f64;
            assert!((mean - DVec3::splat(1.0 / 3.0)).length() < 1e-12);
            assert!(points.iter().all(|w| w.max_element() < 1.0 && w.min_element() >= 0.0));
        }
    }
}
