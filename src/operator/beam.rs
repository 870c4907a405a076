//! What all points of a small patch see: beams from a radiant field to a triangle.
//!
//! Points that lie close together share most of what they would find out: which faces are turned
//! away, which occluders stand between, how far down a cell has to be opened. A [`Beam`] holds that for
//! a whole triangle, by proofs that hold for all its points, and is narrowed from the triangle to its
//! parts.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::gather::{Cell, Radiant};
use super::runs::Runs;
use super::walk::{Scope, Stage, Walker};
use crate::kernel::View;
use crate::mesh::child;
use crate::visibility::{Coverage, Observer, Shadows, Shaft, faces_away};

/// A receiving triangle.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Corners, metres.
    pub corners: [DVec3; 3],
    /// Unit normal of the side that receives.
    pub normal: DVec3,
    centre: DVec3,
    radius: f64,
}

impl Patch {
    /// The patch with these corners.
    pub fn new(corners: [DVec3; 3], normal: DVec3) -> Patch {
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.iter().map(|x| x.distance(centre)).fold(0.0, f64::max);
        Patch { corners, normal, centre, radius }
    }

    fn height(&self, x: DVec3) -> f64 {
        (x - self.corners[0]).dot(self.normal)
    }
}

/// A cell that radiates towards a patch, and what may stand between.
#[derive(Clone, Copy, Debug)]
struct Source {
    face: u32,
    number: u32,
    corners: [DVec2; 3],
    radius: f64,
    area: f64,
    /// A range of [`Beam::occluders`].
    between: (u32, u32),
}

/// All that radiates towards a patch.
#[derive(Clone, Debug, Default)]
pub struct Beam {
    /// Face by face.
    sources: Vec<Source>,
    occluders: Vec<u32>,
    runs: Runs,
}

impl Beam {
    /// From all of a field to a patch, good for errors of `allowed` a cell.
    pub fn new(radiant: &Radiant, stage: Stage, patch: &Patch, allowed: f64) -> Beam {
        let Stage { mesh, occluders, .. } = stage;
        let tau = occluders.coincidence();
        let mut beam = Beam::default();
        let mut found = vec![];
        for &index in radiant.faces() {
            let face = &mesh.faces[index as usize];
            let space = face.corners.map(|x| face.frame.lift(x));
            if patch.corners.iter().all(|&x| face.frame.height(x) <= tau)
                || space.iter().all(|&x| patch.height(x) <= tau)
                || faces_away(patch.normal, face.frame.n)
            {
                continue;
            }
            found.clear();
            Shaft::new(occluders, (patch.corners, patch.normal), (space, face.frame.n))
                .find(&mut found);
            let begin = beam.occluders.len() as u32;
            beam.occluders.extend(&found);
            let between = (begin, beam.occluders.len() as u32);
            for root in face.roots.0..face.roots.1 {
                let cell = Cell::root(stage, root);
                let source = Source {
                    face: index,
                    number: root,
                    corners: *cell.corners,
                    radius: cell.radius,
                    area: cell.area,
                    between,
                };
                beam.add(radiant, stage, patch, allowed, &source);
            }
        }
        beam.group();
        beam
    }

    /// The same for a part of the patch.
    pub fn narrowed(&self, radiant: &Radiant, stage: Stage, patch: &Patch, allowed: f64) -> Beam {
        let mut beam = Beam { occluders: self.occluders.clone(), ..Beam::default() };
        for source in &self.sources {
            beam.add(radiant, stage, patch, allowed, source);
        }
        beam.group();
        beam
    }

    /// Adds what a patch may see of a source: all of it, or parts that are no larger than the patch or
    /// good enough.
    fn add(
        &mut self,
        radiant: &Radiant,
        stage: Stage,
        patch: &Patch,
        allowed: f64,
        source: &Source,
    ) {
        let Stage { mesh, occluders, .. } = stage;
        if radiant.field.is_dark(source.number) {
            return;
        }
        let tau = occluders.coincidence();
        let frame = &mesh.faces[source.face as usize].frame;
        let space = source.corners.map(|x| frame.lift(x));
        let highest = |heights: [f64; 3]| heights.into_iter().fold(f64::MIN, f64::max);
        let over_source = highest(patch.corners.map(|x| frame.height(x)));
        let over_patch = highest(space.map(|x| patch.height(x)));
        if over_source <= tau || over_patch <= tau {
            return;
        }
        let mut between = source.between;
        if between.0 < between.1 {
            let shaft = Shaft::new(occluders, (patch.corners, patch.normal), (space, frame.n));
            let begin = self.occluders.len();
            if shaft.narrow(&mut self.occluders, between) == Coverage::Hidden {
                return;
            }
            between = (begin as u32, self.occluders.len() as u32);
        }
        let source = Source { between, ..*source };
        let children = radiant.field.tree.children(source.number);
        if let Some(first) = children
            && source.radius > patch.radius
            && !self.good(radiant, patch, allowed, &source, (space, over_source, over_patch))
        {
            for k in 0..4 {
                let below = Source {
                    number: first + k,
                    corners: child(&source.corners, k as usize),
                    radius: 0.5 * source.radius,
                    area: 0.25 * source.area,
                    ..source
                };
                self.add(radiant, stage, patch, allowed, &below);
            }
        } else {
            self.sources.push(source);
        }
    }

    /// Whether the source's fit is good enough for all points of the patch.
    fn good(
        &self,
        radiant: &Radiant,
        patch: &Patch,
        allowed: f64,
        source: &Source,
        (space, over_source, over_patch): ([DVec3; 3], f64, f64),
    ) -> bool {
        let centre = (space[0] + space[1] + space[2]) / 3.0;
        let from_centre = patch.centre.distance(centre) - patch.radius;
        let nearest = from_centre - source.radius;
        if nearest <= 0.0 {
            return false;
        }
        let cosines = (over_source / nearest).min(1.0) * (over_patch / nearest).min(1.0);
        let factor = source.area * cosines / (PI * nearest * nearest);
        let clear = source.between.0 == source.between.1;
        let above = space.iter().all(|&x| patch.height(x) >= 0.0);
        let curved = if clear && above { (source.radius / from_centre).powi(2) } else { 1.0 };
        radiant.field.deviation[source.number as usize] * factor * curved.min(1.0) <= allowed
    }

    fn group(&mut self) {
        self.runs.find(&self.sources, 0, &self.occluders, |s| (s.face, s.between));
    }

    /// Whether every point of the patch sees all of the sources that are above its horizon.
    pub fn is_clear(&self) -> bool {
        self.sources.iter().all(|source| source.between.0 == source.between.1)
    }

    /// As [`Radiant::gather`], for a point of the patch and its normal.
    pub fn gather(
        &self,
        radiant: &Radiant,
        walker: &mut Walker,
        stage: Stage,
        point: DVec3,
        normal: DVec3,
        allowed: f64,
    ) -> DVec3 {
        let Stage { mesh, occluders, .. } = stage;
        let observer = Observer { occluders, point, normal };
        walker.shadows.look_from(&observer);
        let mut clip = std::mem::take(&mut walker.clip);
        let mut numbers = std::mem::take(&mut walker.numbers);
        let mut sum = DVec3::ZERO;
        for group in &self.runs.list {
            let sources = &self.sources[group.sources.0..group.sources.1];
            let index = sources[0].face;
            let face = &mesh.faces[index as usize];
            let view = View::new(&face.frame, point, normal);
            if view.d <= occluders.coincidence() || observer.faces_away(face.frame.n) {
                continue;
            }
            let horizon = view.horizon(occluders.magnitude);
            numbers.clear();
            let (first, end) = group.candidates;
            if first < end {
                let list = &self.runs.candidates[first..end];
                walker.shadows.cast(&observer, &face.frame, &face.corners, list, &mut numbers);
            }
            let scope = Scope { face, index, view, horizon };
            let mut place = group.places;
            for source in sources {
                let places = place..place + (source.between.1 - source.between.0) as usize;
                place = places.end;
                walker.active.clear();
                let shadows = self.runs.places[places].iter().map(|&p| numbers[p as usize]);
                walker.active.extend(shadows.filter(|&number| number != Shadows::NONE));
                // Faces of one body have the same shadow.
                walker.active.sort_unstable();
                walker.active.dedup();
                let cell = Cell {
                    number: source.number,
                    corners: &source.corners,
                    radius: source.radius,
                    area: source.area,
                };
                sum += radiant.descend(walker, &scope, cell, 0, allowed, &mut clip);
            }
        }
        walker.clip = clip;
        walker.numbers = numbers;
        sum / PI
    }
}
