//! Does light leave the scene, and where?
//!
//! Rays that meet nothing *escape*. Sides all of whose rays do look outward: the outside of a house,
//! the bottom of what stands on the floor. They do not count. If of the others' rays more than the
//! share [`OPEN`] escapes, the scene is open, and that is all that is said of it. Else what looks
//! outward in part ([`OUTSIDE`]), or mostly at black backs ([`super::buried`]), lies outside and does
//! not count either: what stands behind a wall, or was pushed through it. The rest is closed when no ray of it escapes, and *leaks* otherwise: where lines of escaped
//! rays cross, there is the gap.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::Surveyed;
use super::buried::is_buried;
use super::finding::{Finding, Kind, Severity, percent};
use super::look::direction_of;
use crate::geometry::Bounds;

/// Share of escaped rays above which a scene is open: a door is more, a gap under it less.
const OPEN: f64 = 0.02;

/// A point of a closed scene from which this share of the rays escapes lies outside of it.
const OUTSIDE: f64 = 0.25;

/// Lines of escaped rays that are used at most: pairs of them are compared.
const MOST_LINES: usize = 600;

/// Gaps are told apart when they are this share of the scene apart.
const APART: f64 = 1.0 / 64.0;

/// A gap is wider than a circle if twice the circle has so many times its lines.
const WIDER: f64 = 1.25;

/// Gaps are at most this many times as wide as [`APART`]: slits are more than one.
const WIDEST: f64 = 8.0;

/// Most gaps that are named.
const MOST_GAPS: usize = 8;

/// A gap is named if this share of all escaped rays goes through it.
const NAMED: f64 = 0.05;

/// Whether a scene holds its light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Enclosure {
    /// No ray escapes, but from what looks outward.
    Closed,
    /// A few do.
    Leaking,
    /// More do than by an oversight, or nothing meets anything.
    Open,
}

/// How much light finds its way out. Shares are of the rays of points that count.
#[derive(Clone, Debug, PartialEq)]
pub struct Closure {
    /// In a word.
    pub enclosure: Enclosure,
    /// Mean share of the rays that meet something, over the area.
    pub mean: f64,
    /// The smallest share at any point.
    pub least: f64,
    /// The object from which the largest share escapes.
    pub worst_object: Option<String>,
    /// The point with the smallest share, metres.
    pub worst_place: Option<DVec3>,
    /// Share of the area that does not count, because it looks outward.
    pub outward: f64,
}

/// Sums over points.
#[derive(Clone, Copy, Default)]
struct Sums {
    area: f64,
    /// Area times the share that escapes.
    escaped: f64,
    /// The largest share, and where.
    worst: f64,
    at: Option<DVec3>,
}

impl Sums {
    fn add(&mut self, area: f64, share: f64, at: DVec3) {
        self.area += area;
        self.escaped += area * share;
        if self.at.is_none() || share > self.worst {
            (self.worst, self.at) = (share, Some(at));
        }
    }

    /// Mean share that escapes.
    fn mean(&self) -> f64 {
        if self.area > 0.0 { self.escaped / self.area } else { self.worst }
    }
}

/// How closed the scene is, and findings; `turned` are parts whose backs do not count as black.
pub(super) fn find(survey: &Surveyed, turned: &[bool]) -> (Closure, Vec<Finding>) {
    let shares: Vec<f64> =
        survey.looks.iter().map(|look| survey.share(look.escaped.len() as u32)).collect();
    let sums = |counts: &dyn Fn(usize) -> bool| {
        let (mut all, mut objects) = (Sums::default(), BTreeMap::<u32, Sums>::new());
        for (i, point) in survey.points.iter().enumerate().filter(|(i, _)| counts(*i)) {
            let object = survey.parts.objects[point.part as usize];
            all.add(point.area, shares[i], point.position);
            objects.entry(object).or_default().add(point.area, shares[i], point.position);
        }
        (all, objects)
    };
    let sees = |i: usize| shares[i] < 1.0;
    let is_inside = |i: usize| shares[i] < OUTSIDE && !is_buried(survey, &survey.looks[i], turned);
    let (all, of_all) = sums(&sees);
    let is_open = all.at.is_none() || all.mean() > OPEN;
    let (counted, objects) = if is_open { (all, of_all.clone()) } else { sums(&is_inside) };
    let enclosure = if is_open {
        Enclosure::Open
    } else if counted.worst > 0.0 {
        Enclosure::Leaking
    } else {
        Enclosure::Closed
    };
    let escapes = enclosure != Enclosure::Closed;
    let worst_object = objects.iter().max_by(|a, b| a.1.mean().total_cmp(&b.1.mean()));
    let total: f64 = survey.points.iter().map(|point| point.area).sum();
    let closure = Closure {
        enclosure,
        mean: if counted.at.is_some() { 1.0 - counted.mean() } else { 0.0 },
        least: if counted.at.is_some() { 1.0 - counted.worst } else { 0.0 },
        worst_object: worst_object.filter(|_| escapes).map(|(&object, _)| survey.object(object)),
        worst_place: counted.at.filter(|_| escapes),
        outward: if total > 0.0 { 1.0 - counted.area / total } else { 0.0 },
    };
    if is_open {
        let findings = vec![open(&closure)];
        return (closure, findings);
    }
    let mut findings = if escapes { leaks(survey, &is_inside) } else { vec![] };
    for (&object, own) in of_all.iter().filter(|(_, own)| own.mean() >= OUTSIDE) {
        let share = percent(own.mean());
        let text = format!("it stands outside of a closed scene: {share} of its rays escape");
        let finding = Finding::new(Severity::Note, Kind::Outside, survey.object(object), text);
        findings.push(Finding { place: own.at, ..finding });
    }
    (closure, findings)
}

fn open(closure: &Closure) -> Finding {
    let most = match &closure.worst_object {
        Some(object) => format!(", most from {object}"),
        None => String::new(),
    };
    let text =
        format!("the scene is open: {} of all rays escape{most}", percent(1.0 - closure.mean));
    let finding = Finding::new(Severity::Note, Kind::Open, "scene", text);
    Finding { place: closure.worst_place, ..finding }
}

/// The way of an escaped ray.
#[derive(Clone, Copy)]
struct Line {
    /// Number of the point from which it comes.
    point: usize,
    origin: DVec3,
    direction: DVec3,
}

/// Gaps through which rays of points inside escape.
fn leaks(survey: &Surveyed, is_inside: &dyn Fn(usize) -> bool) -> Vec<Finding> {
    let mut lines = vec![];
    for (i, (point, look)) in survey.each().enumerate() {
        if !is_inside(i) {
            continue;
        }
        lines.extend(look.escaped.iter().map(|&k| Line {
            point: i,
            origin: point.position,
            direction: direction_of(point, k),
        }));
    }
    let all = survey.points.len() as f64 * f64::from(survey.rays);
    let escaped = lines.len() as f64;
    // Evenly over all points.
    let step = lines.len().div_ceil(MOST_LINES).max(1);
    let lines: Vec<Line> = lines.into_iter().step_by(step).collect();
    let bounds = survey.scene.bounds();
    let bounds = Bounds { min: bounds.0, max: bounds.1 };
    gaps(&lines, bounds)
        .into_iter()
        .map(|(place, share)| {
            let nearest = nearest_triangle(survey, place);
            let about = nearest.map_or("scene".into(), |i| survey.object_of(survey.parts.of[i]));
            let text = format!(
                "light leaks out of a closed scene beside it: {} of all rays escape here",
                percent(share * escaped / all)
            );
            Finding::new(Severity::Warning, Kind::Leak, about, text)
                .at(place)
                .remedy("close the gap, unless it is meant")
        })
        .collect()
}

/// Where lines leave, and which share of them there: the places where most of them cross.
fn gaps(lines: &[Line], bounds: Bounds) -> Vec<(DVec3, f64)> {
    let size = APART * bounds.extent();
    let mut left: Vec<Line> = lines.to_vec();
    let mut gaps = vec![];
    while gaps.len() < MOST_GAPS && !left.is_empty() {
        let Some(first) = crossing(&left, size) else { break };
        let (place, radius) = widen(&left, first, size);
        let before = left.len();
        left.retain(|line| line.distance(place) > radius);
        let share = (before - left.len()) as f64 / lines.len() as f64;
        if share < NAMED {
            break;
        }
        gaps.push((place, share));
    }
    if gaps.is_empty()
        && let Some(line) = lines.first()
    {
        // Lines that do not cross: where one leaves the scene's box.
        gaps.push((line.exit(bounds), 1.0));
    }
    gaps
}

/// The place where most pairs of lines come within `size` of each other.
fn crossing(lines: &[Line], size: f64) -> Option<DVec3> {
    // By cubes of that size: how many pairs, and the sum of their places.
    let mut cubes: BTreeMap<[i64; 3], (usize, DVec3)> = BTreeMap::new();
    for (i, a) in lines.iter().enumerate() {
        // Lines of one point cross there.
        for b in lines[i + 1..].iter().filter(|b| b.point != a.point) {
            if let Some((place, _)) = a.closest(b).filter(|(_, gap)| *gap <= size) {
                let cube = (place / size).floor().to_array().map(|x| x as i64);
                let own = cubes.entry(cube).or_insert((0, DVec3::ZERO));
                *own = (own.0 + 1, own.1 + place);
            }
        }
    }
    // Of several the first.
    let (_, (count, sum)) = cubes.into_iter().rev().max_by_key(|(_, (count, _))| *count)?;
    Some(sum / count as f64)
}

/// The middle of the gap at a place, and a radius about it within which its lines pass: as long as
/// twice the radius has clearly more lines, the gap is wider.
fn widen(lines: &[Line], mut place: DVec3, size: f64) -> (DVec3, f64) {
    let mut radius = size;
    let within = |place, radius| -> Vec<&Line> {
        lines.iter().filter(|line| line.distance(place) <= radius).collect()
    };
    loop {
        for _ in 0..3 {
            let near = within(place, radius);
            match common_point(&near).filter(|x| x.distance(place) <= radius) {
                Some(better) => place = better,
                None => break,
            }
        }
        let (near, wider) = (within(place, radius).len(), within(place, 2.0 * radius).len());
        if wider as f64 <= WIDER * near as f64 || 2.0 * radius > WIDEST * size {
            return (place, radius);
        }
        radius *= 2.0;
    }
}

/// The point with the least sum of squared distances from lines.
fn common_point(lines: &[&Line]) -> Option<DVec3> {
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    let base = lines.first()?.origin;
    for line in lines {
        let d = line.direction;
        let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        matrix += across;
        right += across * (line.origin - base);
    }
    // Lines that are all nearly parallel have no point in common that could be told.
    let n = lines.len() as f64;
    if matrix.determinant() < 1e-6 * n * n * n {
        return None;
    }
    Some(base + matrix.inverse() * right)
}

impl Line {
    /// Distance of a point from the line, infinite behind its origin.
    fn distance(&self, x: DVec3) -> f64 {
        let away = x - self.origin;
        let along = away.dot(self.direction);
        if along < 0.0 { f64::INFINITY } else { (away - along * self.direction).length() }
    }

    /// The point nearest to both of two lines, before their origins, and how far they pass each other.
    fn closest(&self, other: &Line) -> Option<(DVec3, f64)> {
        let between = other.origin - self.origin;
        let cosine = self.direction.dot(other.direction);
        let sine_squared = 1.0 - cosine * cosine;
        // Nearly parallel ones tell nothing.
        if sine_squared < 1e-4 {
            return None;
        }
        let (a, b) = (between.dot(self.direction), between.dot(other.direction));
        let (s, t) = ((a - cosine * b) / sine_squared, (cosine * a - b) / sine_squared);
        if s <= 0.0 || t <= 0.0 {
            return None;
        }
        let (p, q) = (self.origin + s * self.direction, other.origin + t * other.direction);
        Some((p.midpoint(q), p.distance(q)))
    }

    /// Where it leaves a box that holds its origin.
    fn exit(&self, bounds: Bounds) -> DVec3 {
        let to = |k: usize| {
            let wall = if self.direction[k] > 0.0 { bounds.max[k] } else { bounds.min[k] };
            let t = (wall - self.origin[k]) / self.direction[k];
            if t.is_finite() { t.max(0.0) } else { f64::INFINITY }
        };
        let t = to(0).min(to(1)).min(to(2));
        if t.is_finite() { self.origin + t * self.direction } else { self.origin }
    }
}

/// The triangle nearest to a point.
fn nearest_triangle(survey: &Surveyed, x: DVec3) -> Option<usize> {
    let triangles = survey.scene.triangles.iter();
    let distances = triangles.map(|t| distance_squared(&t.vertices, x));
    distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// Squared distance of a point from a triangle.
fn distance_squared([a, b, c]: &[DVec3; 3], x: DVec3) -> f64 {
    let segment = |p: DVec3, q: DVec3| {
        let along = q - p;
        let s = ((x - p).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (p + s * along).distance_squared(x)
    };
    let rim = segment(*a, *b).min(segment(*b, *c)).min(segment(*c, *a));
    let n = (*b - *a).cross(*c - *a);
    let inside =
        [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (**q - **p).cross(x - **p).dot(n) >= 0.0);
    let height = (x - *a).dot(n);
    if inside && n != DVec3::ZERO { rim.min(height * height / n.length_squared()) } else { rim }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: Bounds = Bounds { min: DVec3::ZERO, max: DVec3::ONE };

    /// Lines from points of a wall through points of gaps in the opposite one.
    fn lines(gaps: &[(DVec3, f64)]) -> Vec<Line> {
        (0..300)
            .map(|k| {
                let step = |by: f64| (0.5 + k as f64 * by).fract();
                let origin = DVec3::new(step(0.754_877_666), step(0.569_840_291), 0.0);
                let (middle, width) = gaps[k % gaps.len()];
                let off = DVec3::new(step(0.618) - 0.5, step(0.317) - 0.5, 0.0);
                let direction = (middle + width * off - origin).normalize();
                Line { point: k, origin, direction }
            })
            .collect()
    }

    #[test]
    fn lines_cross_in_the_gaps() {
        let at = DVec3::new;
        let two = [(at(0.2, 0.3, 1.0), 0.01), (at(0.8, 0.6, 1.0), 0.005)];
        let found = gaps(&lines(&two), ROOM);
        assert_eq!(found.len(), 2, "{found:?}");
        for (middle, width) in two {
            assert!(
                found
                    .iter()
                    .any(|(x, share)| x.distance(middle) < width && (share - 0.5).abs() < 0.05)
            );
        }
        let one = gaps(&lines(&two[..1]), ROOM);
        assert!(one.len() == 1 && one[0].1 > 0.99, "{one:?}");
        assert!(gaps(&[], ROOM).is_empty());
    }

    #[test]
    fn a_single_line_leaves_by_a_wall() {
        let origin = DVec3::new(0.5, 0.5, 0.0);
        let direction = DVec3::new(0.0, 0.6, 0.8);
        let found = gaps(&[Line { point: 0, origin, direction }], ROOM);
        assert_eq!(found.len(), 1);
        assert!(found[0].0.distance(DVec3::new(0.5, 1.0, 2.0 / 3.0)) < 1e-12);
    }

    #[test]
    fn distances_from_triangles() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (x, want) in [
            (DVec3::new(0.2, 0.2, 0.5), 0.25),
            (DVec3::new(0.2, -0.5, 0.0), 0.25),
            (DVec3::new(2.0, 0.0, 1.0), 2.0),
            (DVec3::new(1.0, 1.0, 0.0), 0.5),
        ] {
            assert!((distance_squared(&t, x) - want).abs() < 1e-15, "{x}");
        }
    }
}
