//! Sparse gathering: many points of one plane, few of them gathered.
//!
//! Light that is smooth need not be gathered at every texel or pixel. A triangle that holds many of
//! the points asked for is sampled at the six nodes of a quadratic, then at the nine further nodes of
//! its four children: these tell whether the quadratic was right. Where it was, the points take
//! the values of the children's quadratics, about eight times better than what was checked; where
//! not, each child does the same with its own points, until there are so few that each is
//! gathered.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::mesh::{Mesh, barycentric, child};
use crate::monitor::Monitor;
use crate::operator::ray_gather::Estimated;
use crate::operator::walk::Walker;

/// Points that are gathered rather than sampled for: what a check costs.
const FEW: usize = 9;

/// Fewer than these are gathered each, even where corners and middle of a triangle would do.
const FEWEST: usize = 5;

/// Up to so many may be filled in from three of them, those so far beyond three of these, in units of
/// their triangle's weights.
const SMALL: usize = 48;
const BEYOND: f64 = 0.75;

/// How many points are looked at where regions may lie beside the surface.
const LOOKED_AT: usize = 3;

/// Most points of a task of its own.
const TASK: usize = 1024;

/// Most times that a region is cut for tasks, and then a task: points may coincide.
const DEEPEST_TASK: u32 = 20;
const DEEPEST: u32 = 20;

/// Nodes lie this share of a region's size inside it: on its rim other faces may touch it, from where
/// they would be seen edge on.
const INSIDE: f64 = 1e-5;

/// Points of one root.
#[derive(Clone, Debug, Default)]
pub struct RootPoints {
    /// The root.
    pub root: u32,
    /// Points in the plane of its face, in or on it.
    pub points: Vec<DVec2>,
}

impl RootPoints {
    /// The root with its points.
    pub fn region(&self, mesh: &Mesh) -> Region {
        let corners = mesh.roots[self.root as usize].corners;
        Region { root: self.root, corners, points: self.points.clone(), slack: 1.0 }
    }
}

/// Points of one plane in a triangle of it, which is on the surface or mostly so.
#[derive(Clone, Debug)]
pub struct Region {
    /// A root whose face's frame is that of the plane.
    pub root: u32,
    /// The triangle, counter-clockwise.
    pub corners: [DVec2; 3],
    /// Points in the plane, in the triangle or on it.
    pub points: Vec<DVec2>,
    /// Errors may be so many times as large here.
    pub slack: f64,
}

/// What was done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FillCounts {
    /// Points asked for.
    pub points: u64,
    /// Points gathered: of those asked for, and nodes.
    pub gathered: u64,
    /// Sum of the squares of the errors that the points are expected to have because they were filled
    /// in or estimated, (W/m^2)^2, each over its region's slack.
    pub squares: DVec3,
    /// The most that an accepted check was off by, W/m^2, over its region's slack: no filled in point is
    /// expected to be worse.
    pub largest: f64,
}

impl std::ops::AddAssign for FillCounts {
    fn add_assign(&mut self, more: FillCounts) {
        self.points += more.points;
        self.gathered += more.gathered;
        self.squares += more.squares;
        self.largest = self.largest.max(more.largest);
    }
}

/// Error of what is filled in, over what its check was off by (both root mean squares): an eighth for
/// the third derivatives that quadratics miss, more where light is not that smooth. Measured over
/// the shipped scenes.
const OF_CHECK: f64 = 0.3;

/// Of the square of what a check was off by, what filling in made: not what the check itself is off by.
fn of_filling(off: DVec3, check: &Estimated) -> DVec3 {
    (off * off - check.spread * check.spread).max(DVec3::ZERO)
}

/// Values at points, region by region in the order given: gathered, or filled in where the check finds
/// no difference above `allowed` in any channel. With `allowed` 0 every point is gathered. Where
/// `small`, regions of few points are filled in too, with a single check, and regions may lie beside the
/// surface: values are checked at points that were asked for.
///
/// `open` (root, triangle in its face's plane, what was made for a triangle around it) makes what
/// points of a triangle share; `gather` (that, root and slack, point) gathers. `most` says how many points of a
/// triangle may be filled in at once: few where something small might lie between the nodes.
pub fn fill<B>(
    asked: &[Region],
    (allowed, small): (f64, bool),
    open: impl Fn(u32, &[DVec2; 3], Option<&B>) -> B + Sync,
    gather: impl Fn(&mut Walker, &B, (u32, f64), DVec2) -> Estimated + Sync,
    most: impl Fn(&B) -> usize + Sync,
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, FillCounts)> {
    let mut tasks: Vec<Task> = vec![];
    for (place, own) in asked.iter().enumerate() {
        let centre = (own.corners[0] + own.corners[1] + own.corners[2]) / 3.0;
        let corners = own.corners.map(|x| x + INSIDE * (centre - x));
        let points: Vec<Asked> =
            own.points.iter().enumerate().map(|(k, &x)| Asked { x, place: k as u32 }).collect();
        cut(Task { place, root: own.root, corners, points }, DEEPEST_TASK, &mut tasks);
    }
    let stage = monitor.stage("gather", tasks.len() as u64);
    let done: Vec<Done> = tasks
        .par_iter_mut()
        .map_init(Walker::default, |walker, task| {
            let Region { corners: t, slack, .. } = &asked[task.place];
            let centre = (t[0] + t[1] + t[2]) / 3.0;
            let mut filler = Filler {
                open: |corners: &[DVec2; 3], around: Option<&B>| {
                    let whole = corners.map(|x| centre + (x - centre) / (1.0 - INSIDE));
                    open(task.root, &whole, around)
                },
                gather: |shared: &B, x| {
                    monitor.check()?;
                    Ok(gather(walker, shared, (task.root, *slack), x))
                },
                most: &most,
                allowed: slack * allowed,
                small,
                known: HashMap::new(),
                done: Done::default(),
            };
            let shared = (filler.open)(&task.corners, None);
            filler.triangle(&task.corners, &shared, None, DEEPEST, &mut task.points)?;
            stage.advance(1)?;
            Ok(filler.done)
        })
        .collect::<Result<_>>()?;
    let mut values: Vec<Vec<DVec3>> =
        asked.iter().map(|own| vec![DVec3::ZERO; own.points.len()]).collect();
    let mut counts = FillCounts::default();
    for (task, own) in tasks.iter().zip(done) {
        counts.points += own.values.len() as u64;
        counts.gathered += own.gathered;
        let slack = asked[task.place].slack;
        counts.squares += own.squares / (slack * slack);
        counts.largest = counts.largest.max(own.largest / slack);
        for (k, value) in own.values {
            values[task.place][k as usize] = value;
        }
    }
    Ok((values, counts))
}

/// What came of one task.
#[derive(Default)]
struct Done {
    /// Places and values of its points.
    values: Vec<(u32, DVec3)>,
    gathered: u64,
    /// See [`FillCounts`].
    squares: DVec3,
    largest: f64,
}

/// A point and where its value goes.
#[derive(Clone, Copy)]
struct Asked {
    x: DVec2,
    place: u32,
}

/// A triangle and the points in it.
struct Task {
    place: usize,
    root: u32,
    corners: [DVec2; 3],
    points: Vec<Asked>,
}

/// Cuts a task until none has too many points, at most `levels` times: points may coincide.
fn cut(task: Task, levels: u32, tasks: &mut Vec<Task>) {
    if task.points.is_empty() {
        return;
    }
    if task.points.len() <= TASK || levels == 0 {
        tasks.push(task);
        return;
    }
    let mut parts: [Vec<Asked>; 4] = Default::default();
    for point in task.points {
        parts[part_of(&task.corners, point.x)].push(point);
    }
    for (k, points) in parts.into_iter().enumerate() {
        cut(Task { corners: child(&task.corners, k), points, ..task }, levels - 1, tasks);
    }
}

/// The child that a point lies in, or nearest to.
fn part_of(corners: &[DVec2; 3], x: DVec2) -> usize {
    let w = barycentric(corners, x).to_array();
    w.iter().position(|&w| w >= 0.5).unwrap_or(3)
}

/// Corners, then the midpoints of the sides opposite to them.
type Six = [DVec3; 6];

struct Filler<O, G, M> {
    open: O,
    gather: G,
    most: M,
    allowed: f64,
    small: bool,
    /// What was gathered, by the bits of coordinates: neighbouring triangles share nodes.
    known: HashMap<[u64; 2], Estimated>,
    done: Done,
}

/// Points that are worth a beam of their own.
const WORTH_OPENING: usize = 6;

impl<O, G, M> Filler<O, G, M> {
    fn value<B>(&mut self, shared: &B, x: DVec2) -> Result<Estimated>
    where
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        let key = x.to_array().map(f64::to_bits);
        if let Some(known) = self.known.get(&key) {
            return Ok(*known);
        }
        self.done.gathered += 1;
        let found = (self.gather)(shared, x)?;
        self.known.insert(key, found);
        Ok(found)
    }

    fn each<B>(&mut self, shared: &B, points: &[Asked]) -> Result<()>
    where
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        for point in points {
            let value = self.value(shared, point.x)?;
            self.done.values.push((point.place, value.irradiance));
            self.done.squares += value.spread * value.spread;
        }
        Ok(())
    }

    /// Some points from those of them that are nearest to the corners of a triangle; whether that was
    /// right for those nearest to the middles of its sides and of itself.
    fn fan<B>(&mut self, corners: &[DVec2; 3], shared: &B, points: &[Asked]) -> Result<bool>
    where
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        let [a, b, c] = *corners;
        let nearest = |to: DVec2| {
            let distance = |k: &usize| points[*k].x.distance_squared(to);
            (0..points.len()).min_by(|i, j| distance(i).total_cmp(&distance(j))).unwrap_or(0)
        };
        let chosen = corners.map(nearest);
        let own = chosen.map(|k| points[k].x);
        let checks = [(a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)].map(nearest);
        let weights: Vec<DVec3> = points.iter().map(|p| barycentric(&own, p.x)).collect();
        // Not where it would be far beyond them, or they are in a line.
        let is_near = |w: &DVec3| w.min_element() >= -BEYOND && w.max_element() <= 1.0 + BEYOND;
        if chosen.contains(&checks[0]) || !weights.iter().all(is_near) {
            return Ok(false);
        }
        let mut at = [DVec3::ZERO; 3];
        let mut spread = DVec3::ZERO;
        for (value, x) in at.iter_mut().zip(own) {
            let found = self.value(shared, x)?;
            *value = found.irradiance;
            spread += found.spread * found.spread / 3.0;
        }
        let linear = |w: &DVec3| w.x * at[0] + w.y * at[1] + w.z * at[2];
        let (mut largest, mut squares) = (0.0f64, DVec3::ZERO);
        for k in 0..checks.len() {
            let check = checks[k];
            if chosen.contains(&check) || checks[..k].contains(&check) {
                continue;
            }
            let found = self.value(shared, points[check].x)?;
            let off = (linear(&weights[check]) - found.irradiance).abs();
            if off.max_element() > self.allowed {
                return Ok(false);
            }
            largest = largest.max(off.max_element());
            squares = squares.max(of_filling(off, &found));
        }
        self.done.largest = self.done.largest.max(largest);
        self.done.squares += points.len() as f64 * (OF_CHECK * OF_CHECK * squares + spread);
        for (point, w) in points.iter().zip(&weights) {
            self.done.values.push((point.place, linear(w)));
        }
        Ok(true)
    }

    /// Whether what was filled in is right at some of the points themselves: nodes may lie beside the
    /// surface.
    fn is_right_at<B>(
        &mut self,
        shared: &B,
        points: &[Asked],
        filled: impl Fn(DVec2) -> DVec3,
    ) -> Result<bool>
    where
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        for k in 0..LOOKED_AT {
            let x = points[(2 * k + 1) * points.len() / (2 * LOOKED_AT)].x;
            let off = (self.value(shared, x)?.irradiance - filled(x)).abs();
            if off.max_element() > self.allowed {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn triangle<B>(
        &mut self,
        corners: &[DVec2; 3],
        shared: &B,
        six: Option<Six>,
        levels: u32,
        points: &mut [Asked],
    ) -> Result<()>
    where
        M: Fn(&B) -> usize,
        O: FnMut(&[DVec2; 3], Option<&B>) -> B,
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        let cost = if six.is_some() { FEW } else { FEW + 6 };
        let fills = self.allowed > 0.0 && levels > 0;
        if fills
            && self.small
            && (FEWEST + 1..=SMALL).contains(&points.len())
            && self.fan(corners, shared, points)?
        {
            return Ok(());
        }
        if points.len() <= cost || !fills {
            return self.each(shared, points);
        }
        let [a, b, c] = *corners;
        let six = match six {
            Some(six) => six,
            None => {
                let mut six = [DVec3::ZERO; 6];
                let nodes = [a, b, c, 0.5 * (b + c), 0.5 * (c + a), 0.5 * (a + b)];
                for (value, x) in six.iter_mut().zip(nodes) {
                    *value = self.value(shared, x)?.irradiance;
                }
                six
            }
        };
        // The nine: on each side the quarter points (after the first corner, before the second),
        // and the midpoints of the inner triangle's sides.
        let mut nine = [DVec3::ZERO; 9];
        let nodes = nine_nodes(corners);
        let (mut worst, mut squares, mut spread) = (0.0f64, DVec3::ZERO, DVec3::ZERO);
        for (k, value) in nine.iter_mut().enumerate() {
            let w = NINE[k];
            let found = self.value(shared, nodes[k])?;
            *value = found.irradiance;
            let off = (quadratic(&six, w) - *value).abs();
            worst = worst.max(off.max_element());
            squares += of_filling(off, &found) / NINE.len() as f64;
            spread += found.spread * found.spread / NINE.len() as f64;
        }
        let four = children(&six, &nine);
        let filled = |x: DVec2| {
            let k = part_of(corners, x);
            quadratic(&four[k], barycentric(&child(corners, k), x))
        };
        let right = worst <= self.allowed;
        if right
            && points.len() <= (self.most)(shared)
            && (!self.small || self.is_right_at(shared, points, filled)?)
        {
            self.done.largest = self.done.largest.max(worst);
            self.done.squares += points.len() as f64 * (OF_CHECK * OF_CHECK * squares + spread);
            for point in points.iter() {
                self.done.values.push((point.place, filled(point.x)));
            }
            return Ok(());
        }
        // Where a line crosses that nothing smoothes, halving the triangle halves what lies beside it:
        // after the levels that smooth light would need, are there points left to win?
        let needed = (worst / self.allowed).log2() / 3.0;
        if !right && points.len() as f64 <= FEW as f64 * needed.exp2() {
            return self.each(shared, points);
        }
        points.sort_by_key(|p| part_of(corners, p.x));
        let mut begin = 0;
        for (k, six) in four.iter().enumerate() {
            let count = points[begin..].iter().take_while(|p| part_of(corners, p.x) == k).count();
            let (own, part) = (&mut points[begin..begin + count], child(corners, k));
            if count >= WORTH_OPENING {
                let narrowed = (self.open)(&part, Some(shared));
                self.triangle(&part, &narrowed, Some(*six), levels - 1, own)?;
            } else {
                self.triangle(&part, shared, Some(*six), levels - 1, own)?;
            }
            begin += count;
        }
        Ok(())
    }
}

/// The nine nodes of the children that are not the parent's.
const NINE: [DVec3; 9] = [
    // On the sides a-b, b-c, c-a.
    DVec3::new(0.75, 0.25, 0.0),
    DVec3::new(0.25, 0.75, 0.0),
    DVec3::new(0.0, 0.75, 0.25),
    DVec3::new(0.0, 0.25, 0.75),
    DVec3::new(0.25, 0.0, 0.75),
    DVec3::new(0.75, 0.0, 0.25),
    // Of the sides of the inner triangle: beside a, b, c.
    DVec3::new(0.5, 0.25, 0.25),
    DVec3::new(0.25, 0.5, 0.25),
    DVec3::new(0.25, 0.25, 0.5),
];

/// Their places in a triangle, as midpoints: the same bits from both triangles at a side.
fn nine_nodes(&[a, b, c]: &[DVec2; 3]) -> [DVec2; 9] {
    let middle = |x: DVec2, y: DVec2| 0.5 * (x + y);
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [
        middle(a, ab),
        middle(ab, b),
        middle(b, bc),
        middle(bc, c),
        middle(c, ca),
        middle(ca, a),
        middle(ab, ca),
        middle(ab, bc),
        middle(bc, ca),
    ]
}

/// The quadratic through six values at barycentric weights w.
fn quadratic(six: &Six, w: DVec3) -> DVec3 {
    let corner = |w: f64| w * (2.0 * w - 1.0);
    corner(w.x) * six[0]
        + corner(w.y) * six[1]
        + corner(w.z) * six[2]
        + 4.0 * (w.y * w.z * six[3] + w.z * w.x * six[4] + w.x * w.y * six[5])
}

/// The six values of each child as [`child`] numbers them and their corners: [a, ab, ca],
/// [ab, b, bc], [ca, bc, c], [bc, ca, ab].
fn children(six: &Six, nine: &[DVec3; 9]) -> [Six; 4] {
    let [a, b, c, bc, ca, ab] = *six;
    let [a_ab, ab_b, b_bc, bc_c, c_ca, ca_a, by_a, by_b, by_c] = *nine;
    [
        [a, ab, ca, by_a, ca_a, a_ab],
        [ab, b, bc, b_bc, by_b, ab_b],
        [ca, bc, c, bc_c, c_ca, by_c],
        [bc, ca, ab, by_a, by_b, by_c],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: [DVec2; 3] = [DVec2::ZERO, DVec2::new(2.0, 0.3), DVec2::new(0.4, 1.5)];

    fn filled(f: impl Fn(DVec2) -> DVec3, allowed: f64) -> (f64, u64) {
        let mut points = vec![];
        for i in 0..120 {
            for j in 0..120 - i {
                let w = DVec2::new(f64::from(i) + 0.3, f64::from(j) + 0.3) / 121.0;
                let x = T[0] + w.x * (T[1] - T[0]) + w.y * (T[2] - T[0]);
                points.push(Asked { x, place: points.len() as u32 });
            }
        }
        let all = points.clone();
        let gather = |_: &(), x| Ok(Estimated::exactly(f(x)));
        let open = |_: &[DVec2; 3], _: Option<&()>| ();
        let most = |_: &()| usize::MAX;
        let (known, done) = (HashMap::new(), Done::default());
        let mut filler = Filler { open, gather, most, allowed, small: false, known, done };
        filler.triangle(&T, &(), None, DEEPEST, &mut points).unwrap();
        assert_eq!(filler.done.values.len(), all.len());
        let off = |(place, value): &(u32, DVec3)| {
            (*value - f(all[*place as usize].x)).abs().max_element()
        };
        (filler.done.values.iter().map(off).fold(0.0, f64::max), filler.done.gathered)
    }

    #[test]
    fn quadratics_are_filled_in_exactly_and_at_once() {
        let f = |x: DVec2| DVec3::new(1.0 + x.x * x.y, x.x - 3.0 * x.y * x.y, 2.0);
        let (error, gathered) = filled(f, 1e-9);
        assert!(error < 1e-13 && gathered == 15, "{error:e} {gathered}");
    }

    #[test]
    fn nothing_is_gathered_twice() {
        let step = |x: DVec2| DVec3::splat(if x.x + 0.3 * x.y > 0.7 { 1.0 } else { 0.1 * x.y });
        let mut seen = std::collections::HashSet::new();
        let gather = |_: &(), x: DVec2| {
            assert!(seen.insert(x.to_array().map(f64::to_bits)), "{x}");
            Ok(Estimated::exactly(step(x)))
        };
        let points: Vec<DVec2> = (0..2000).map(|k| child(&T, k % 4)[k / 4 % 3]).collect();
        let mut points: Vec<Asked> = points
            .iter()
            .enumerate()
            .map(|(k, &x)| Asked { x: x.lerp(T[k % 3], 1e-3 * (k / 3) as f64), place: k as u32 })
            .collect();
        let mut filler = Filler {
            open: |_: &[DVec2; 3], _: Option<&()>| (),
            gather,
            most: |_: &()| usize::MAX,
            allowed: 1e-3,
            small: true,
            known: HashMap::new(),
            done: Done::default(),
        };
        filler.triangle(&T, &(), None, DEEPEST, &mut points).unwrap();
        assert_eq!(filler.done.values.len(), 2000);
        assert_eq!(filler.done.gathered as usize, filler.known.len());
    }

    #[test]
    fn slack_is_what_errors_are_counted_over() {
        let smooth = |x: DVec2| DVec3::splat((3.0 * x.x).sin() * x.y.exp());
        let points: Vec<DVec2> = (0..900)
            .map(|k| {
                T[0].lerp(T[1], (k % 30) as f64 / 60.0) + (k / 30) as f64 / 60.0 * (T[2] - T[0])
            })
            .collect();
        let with = |slack: f64| {
            let asked = [Region { root: 0, corners: T, points: points.clone(), slack }];
            let spread = DVec3::splat(1e-3);
            let gather = |_: &mut Walker, _: &(), (_, own): (u32, f64), x| {
                let irradiance = smooth(x);
                Estimated { irradiance, spread: own * spread, change: DVec3::ZERO }
            };
            let monitor = Monitor::silent();
            fill(&asked, (1e-3, false), |_, _, _| (), gather, |_| usize::MAX, &monitor).unwrap().1
        };
        let (strict, lax) = (with(1.0), with(8.0));
        assert!(lax.gathered < strict.gathered, "{lax:?} {strict:?}");
        assert!(lax.largest <= 1e-3 && strict.largest <= 1e-3, "{lax:?} {strict:?}");
        let rms = |counts: FillCounts| (counts.squares.x / counts.points as f64).sqrt();
        assert!(rms(strict) >= 1e-3 && rms(lax) >= 1e-3 && rms(lax) < 1.1e-3, "{lax:?} {strict:?}");
    }

    #[test]
    fn what_is_not_smooth_is_gathered_where_it_is_not() {
        let step = |x: DVec2| DVec3::splat(if x.x > 0.7 { 1.0 } else { 0.1 * x.y });
        let (error, gathered) = filled(step, 1e-3);
        assert!(error < 1e-3, "{error:e}");
        assert!((100..3000).contains(&gathered), "{gathered}");
        let smooth = |x: DVec2| DVec3::splat((3.0 * x.x).sin() * x.y.exp());
        let mut before = 0;
        for allowed in [1e-2, 1e-3, 1e-4] {
            let (error, gathered) = filled(smooth, allowed);
            assert!(error < 0.5 * allowed && gathered > before, "{error:e} {gathered}");
            before = gathered;
        }
        assert_eq!(filled(step, 0.0), (0.0, 7260));
    }
}
