//! Points of flat surfaces, taken together however many faces these are made of.
//!
//! A wall of a thousand triangles is lit as smoothly as one of two. Where light is gathered at any point
//! at the same cost, the points asked for on one flat surface are filled in over rectangles of its
//! plane. Where such a rectangle is not on the surface, values differ, and it is cut
//! ([`super::fill`]).

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::fill::{Region, RootPoints};
use crate::geometry::COINCIDENCE;
use crate::mesh::Mesh;

/// Rectangles are cut until they are at most so many times as long as they are wide.
const LONGEST: f64 = 2.0;

/// But into at most so many, and not beyond so few points each.
const MOST: f64 = 64.0;
const POINTS: f64 = 32.0;

/// Least width of a rectangle, relative to its length; and to the numbers that coordinates are made
/// of.
const THINNEST: f64 = 1e-3;
const ROUNDINGS: f64 = 1e-9;

/// Corners of faces that roundings moved off their surface's plane would be seen from behind, so those
/// are taken together that are in one plane exactly; with so many planes they are compared.
const PLANES: usize = 4;

/// Points by flat surface.
pub struct Sheets {
    /// Triangles that hold all points, two for each rectangle.
    pub regions: Vec<Region>,
    /// Of each region's points the index of the root that they were asked for, and that among its
    /// points.
    places: Vec<Vec<(u32, u32)>>,
}

impl Sheets {
    /// Groups points by the flat surfaces that they lie on. Where a region holds points of roots with
    /// different `slack` (by place in `asked`), it has the least.
    pub fn new(mesh: &Mesh, asked: &[RootPoints], slack: impl Fn(usize) -> f64) -> Sheets {
        let face = |place: usize| &mesh.faces[mesh.roots[asked[place].root as usize].face as usize];
        let off = COINCIDENCE * mesh.magnitude;
        let mut planes: HashMap<u32, Vec<usize>> = HashMap::new();
        let mut groups: Vec<Vec<usize>> = vec![];
        for (place, own) in asked.iter().enumerate() {
            if own.points.is_empty() {
                continue;
            }
            let own = face(place);
            let known = planes.entry(own.surface).or_default();
            let found = known.iter().rev().take(PLANES).find(|&&group| {
                let plane = &face(groups[group][0]).frame;
                own.corners.iter().all(|&x| plane.height(own.frame.lift(x)).abs() <= off)
            });
            match found {
                Some(&group) => groups[group].push(place),
                None => {
                    known.push(groups.len());
                    groups.push(vec![place]);
                }
            }
        }
        let mut sheets = Sheets { regions: vec![], places: vec![] };
        for group in groups {
            sheets.add(mesh, asked, &group, &slack);
        }
        sheets
    }

    /// Cuts the rectangle around the points of some roots of one surface.
    fn add(
        &mut self,
        mesh: &Mesh,
        asked: &[RootPoints],
        group: &[usize],
        slack: &impl Fn(usize) -> f64,
    ) {
        let root = asked[group[0]].root;
        let plane = mesh.root_frame(root);
        let mut points = vec![];
        for &own in group {
            let from = mesh.root_frame(asked[own].root);
            for (k, &x) in asked[own].points.iter().enumerate() {
                points.push((plane.project(from.lift(x)), (own as u32, k as u32)));
            }
        }
        let (mut low, mut high) = (points[0].0, points[0].0);
        for (x, _) in &points {
            (low, high) = (low.min(*x), high.max(*x));
        }
        let longest = (high - low).max_element();
        let least = (THINNEST * longest).max(ROUNDINGS * mesh.magnitude);
        let size = (high - low).max(DVec2::splat(least));
        low = 0.5 * (low + high) - 0.5 * size;
        let wide = size.min_element();
        let most = (points.len() as f64 / POINTS).clamp(1.0, MOST);
        let count = (size / (LONGEST * wide)).ceil().max(DVec2::ONE).min(DVec2::splat(most).ceil());
        let side = size / count;
        // By rectangle, row by row; below its diagonal, then above it.
        let mut parts = vec![(vec![], vec![]); 2 * (count.x * count.y) as usize];
        for (x, place) in points {
            let at = ((x - low) / side).floor().clamp(DVec2::ZERO, count - 1.0);
            let above = side.perp_dot(x - (low + at * side)) > 0.0;
            let own = &mut parts[2 * (at.y * count.x + at.x) as usize + usize::from(above)];
            own.0.push(x);
            own.1.push(place);
        }
        for (number, (points, places)) in parts.into_iter().enumerate() {
            if points.is_empty() {
                continue;
            }
            let rectangle = (number / 2) as f64;
            let at = DVec2::new(rectangle % count.x, (rectangle / count.x).floor());
            let low = low + at * side;
            let (right, top) = (low + DVec2::new(side.x, 0.0), low + DVec2::new(0.0, side.y));
            let corners = match number % 2 {
                0 => [low, right, low + side],
                _ => [low, low + side, top],
            };
            let own = places.iter().map(|&(own, _)| slack(own as usize));
            let slack = own.fold(f64::INFINITY, f64::min);
            self.regions.push(Region { root, corners, points, slack });
            self.places.push(places);
        }
    }

    /// Values at the points of the regions, as they were asked for.
    pub fn in_order(&self, asked: &[RootPoints], values: Vec<Vec<DVec3>>) -> Vec<Vec<DVec3>> {
        let mut sorted: Vec<Vec<DVec3>> =
            asked.iter().map(|own| vec![DVec3::ZERO; own.points.len()]).collect();
        for (places, values) in self.places.iter().zip(values) {
            for (&(own, k), value) in places.iter().zip(values) {
                sorted[own as usize][k as usize] = value;
            }
        }
        sorted
    }
}
