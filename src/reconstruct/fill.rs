//! Sparse gathering: many points of one plane, few of them gathered.
//!
//! Light that is smooth need not be gathered at every texel or pixel. A triangle that holds many of
//! the points asked for is sampled at the six nodes of a quadratic, then at the nine further nodes of
//! its four children. Where the polynomial of degree four through all fifteen and the children's
//! quadratics differ little, the points take its values; where not, each child does the same with its
//! own points, until there are so few that each is gathered. Values that are noisy take the children's
//! quadratics, where the whole triangle's was right at the nine nodes: of degree four, noise would grow.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::lattice::{Fifteen, NINE, Six, nine_nodes, part_of, quadratic};
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

/// Triangles of more points than this are a task of their own.
const TASK: usize = 1024;

/// Most times that a region is cut: points may coincide.
const DEEPEST: u32 = 40;

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
    /// The most that a filled in point is expected to be off by, W/m^2, over its region's slack.
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

/// Error of what is filled in by quadratics, over what its check was off by (both root mean squares): an
/// eighth for the third derivatives that quadratics miss, more where light is not that smooth. Measured
/// over the shipped scenes.
const OF_CHECK: f64 = 0.3;

/// Where degree four is used, the check may be off by so many times what is allowed, if the
/// polynomials differ by at most this share of it.
const COARSE: f64 = 8.0;
const DIFFER: f64 = 0.3;

/// Error of degree four over that difference, largest and root mean square: of kinks and creases as the
/// tests of [`super::lattice`] have them. Over the shipped scenes it was 0.6 to 1.3 (root mean square).
const OF_DIFFERENCE: f64 = 2.5;
const OF_DIFFERENCE_RMS: f64 = 1.4;

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
/// points of a triangle share; `gather` (that, root and slack, point) gathers. `most` says how many
/// points of a triangle may be filled in at once: few where something small might lie between nodes.
pub fn fill<B>(
    asked: &[Region],
    (allowed, small): (f64, bool),
    open: impl Fn(u32, &[DVec2; 3], Option<&B>) -> B + Sync,
    gather: impl Fn(&mut Walker, &B, (u32, f64), DVec2) -> Estimated + Sync,
    most: impl Fn(&B) -> usize + Sync,
    monitor: &Monitor,
) -> Result<(Vec<Vec<DVec3>>, FillCounts)> {
    let (mut values, mut counts) = (vec![], FillCounts::default());
    let mut tasks: Vec<Task> = vec![];
    for (place, own) in asked.iter().enumerate() {
        values.push(vec![DVec3::ZERO; own.points.len()]);
        if own.points.is_empty() {
            continue;
        }
        let centre = (own.corners[0] + own.corners[1] + own.corners[2]) / 3.0;
        let corners = own.corners.map(|x| x + INSIDE * (centre - x));
        let points: Vec<Asked> =
            own.points.iter().enumerate().map(|(k, &x)| Asked { x, place: k as u32 }).collect();
        counts.points += points.len() as u64;
        tasks.push(Task { place, part: Part { corners, points, six: None, levels: DEEPEST } });
    }
    let stage = monitor.stage("gather", counts.points);
    while !tasks.is_empty() {
        let run = |walker: &mut Walker, task: &Task| {
            let Region { root, corners: t, slack, .. } = asked[task.place];
            let centre = (t[0] + t[1] + t[2]) / 3.0;
            let mut filler = Filler {
                open: |corners: &[DVec2; 3], around: Option<&B>| {
                    let whole = corners.map(|x| centre + (x - centre) / (1.0 - INSIDE));
                    open(root, &whole, around)
                },
                gather: |shared: &B, x| {
                    monitor.check()?;
                    Ok(gather(walker, shared, (root, slack), x))
                },
                most: &most,
                allowed: slack * allowed,
                small,
                known: HashMap::new(),
                done: Done::default(),
            };
            let Part { corners, points, six, levels } = &task.part;
            let shared = (filler.open)(corners, None);
            filler.triangle(corners, &shared, *six, *levels, points)?;
            stage.advance(filler.done.values.len() as u64)?;
            Ok(filler.done)
        };
        let done: Vec<Done> =
            tasks.par_iter().map_init(Walker::default, run).collect::<Result<_>>()?;
        let mut parts = vec![];
        for (task, own) in tasks.iter().zip(done) {
            let slack = asked[task.place].slack;
            counts.gathered += own.gathered;
            counts.squares += own.squares / (slack * slack);
            counts.largest = counts.largest.max(own.largest / slack);
            for (k, value) in own.values {
                values[task.place][k as usize] = value;
            }
            let place = task.place;
            parts.extend(own.parts.into_iter().map(|part| Task { place, part }));
        }
        tasks = parts;
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
    /// What is left to do: quarters of it, where there are too many points to go on with.
    parts: Vec<Part>,
}

/// A point and where its value goes.
#[derive(Clone, Copy)]
struct Asked {
    x: DVec2,
    place: u32,
}

/// A triangle in the plane of a region and the points in it.
struct Part {
    corners: [DVec2; 3],
    points: Vec<Asked>,
    /// What is known of it.
    six: Option<Six>,
    /// How many times it may be cut.
    levels: u32,
}

/// A part of a region.
struct Task {
    /// The region.
    place: usize,
    part: Part,
}

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
        points: &[Asked],
    ) -> Result<()>
    where
        M: Fn(&B) -> usize,
        O: FnMut(&[DVec2; 3], Option<&B>) -> B,
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        let cost = if six.is_some() { FEW } else { FEW + 6 };
        let fills = self.allowed > 0.0;
        if fills
            && levels > 0
            && self.small
            && (FEWEST + 1..=SMALL).contains(&points.len())
            && self.fan(corners, shared, points)?
        {
            return Ok(());
        }
        if levels == 0 || points.len() <= cost || !fills && points.len() <= TASK {
            return self.each(shared, points);
        }
        if !fills {
            return self.quarters(corners, shared, [None; 4], levels, points);
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
        let values = Fifteen::new(&six, &nine);
        let four = values.children();
        // How many times too far off, and what errors are expected.
        let (over, squares, largest) = if self.small {
            (worst / self.allowed, OF_CHECK * OF_CHECK * squares, worst)
        } else {
            let (squares, most) = values.difference();
            let over = (worst / COARSE).max(most / DIFFER) / self.allowed;
            (over, OF_DIFFERENCE_RMS * OF_DIFFERENCE_RMS * squares, OF_DIFFERENCE * most)
        };
        let small = self.small;
        let filled = |x: DVec2| {
            if !small {
                return values.quartic(barycentric(corners, x));
            }
            let k = part_of(corners, x);
            quadratic(&four[k], barycentric(&child(corners, k), x))
        };
        if over <= 1.0
            && points.len() <= (self.most)(shared)
            && (!small || self.is_right_at(shared, points, filled)?)
        {
            self.done.largest = self.done.largest.max(largest);
            self.done.squares += points.len() as f64 * (squares + spread);
            for point in points.iter() {
                self.done.values.push((point.place, filled(point.x)));
            }
            return Ok(());
        }
        // Where a line crosses that nothing smoothes, halving the triangle halves what lies beside it:
        // after the levels that smooth light would need, are there points left to win?
        let needed = over.log2() / 3.0;
        let is_hopeless = over > 1.0 && points.len() as f64 <= FEW as f64 * needed.exp2();
        if is_hopeless && points.len() <= TASK {
            return self.each(shared, points);
        }
        self.quarters(corners, shared, four.map(Some), levels, points)
    }

    /// Goes on with the four children of a triangle: at once, or as tasks of their own.
    fn quarters<B>(
        &mut self,
        corners: &[DVec2; 3],
        shared: &B,
        six: [Option<Six>; 4],
        levels: u32,
        points: &[Asked],
    ) -> Result<()>
    where
        M: Fn(&B) -> usize,
        O: FnMut(&[DVec2; 3], Option<&B>) -> B,
        G: FnMut(&B, DVec2) -> Result<Estimated>,
    {
        let mut of_child: [Vec<Asked>; 4] = Default::default();
        for point in points {
            of_child[part_of(corners, point.x)].push(*point);
        }
        let (apart, levels) = (points.len() > TASK, levels - 1);
        for (k, (own, six)) in of_child.into_iter().zip(six).enumerate() {
            let part = child(corners, k);
            if own.is_empty() {
                continue;
            }
            if apart {
                self.done.parts.push(Part { corners: part, points: own, six, levels });
            } else if own.len() >= WORTH_OPENING {
                let narrowed = (self.open)(&part, Some(shared));
                self.triangle(&part, &narrowed, six, levels, &own)?;
            } else {
                self.triangle(&part, shared, six, levels, &own)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: [DVec2; 3] = [DVec2::ZERO, DVec2::new(2.0, 0.3), DVec2::new(0.4, 1.5)];

    fn filled(f: impl Fn(DVec2) -> DVec3 + Sync, allowed: f64) -> (f64, u64) {
        let mut points = vec![];
        for i in 0..120 {
            for j in 0..120 - i {
                let w = DVec2::new(f64::from(i) + 0.3, f64::from(j) + 0.3) / 121.0;
                let x = T[0] + w.x * (T[1] - T[0]) + w.y * (T[2] - T[0]);
                points.push(x);
            }
        }
        let asked = [Region { root: 0, corners: T, points: points.clone(), slack: 1.0 }];
        let gather = |_: &mut Walker, _: &(), _: (u32, f64), x| Estimated::exactly(f(x));
        let (silent, most) = (Monitor::silent(), |_: &()| usize::MAX);
        let (values, counts) =
            fill(&asked, (allowed, false), |_, _, _| (), gather, most, &silent).unwrap();
        let off = values[0].iter().zip(&points).map(|(v, x)| (*v - f(*x)).abs().max_element());
        (off.fold(0.0, f64::max), counts.gathered)
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
        let points: Vec<DVec2> = (0..TASK).map(|k| child(&T, k % 4)[k / 4 % 3]).collect();
        let points: Vec<Asked> = points
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
        filler.triangle(&T, &(), None, DEEPEST, &points).unwrap();
        assert_eq!(filler.done.values.len(), TASK);
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
                Estimated { spread: own * spread, ..Estimated::exactly(irradiance) }
            };
            let monitor = Monitor::silent();
            fill(&asked, (1e-3, false), |_, _, _| (), gather, |_| usize::MAX, &monitor).unwrap().1
        };
        let (strict, lax) = (with(1.0), with(8.0));
        assert!(lax.gathered < strict.gathered, "{lax:?} {strict:?}");
        let most = OF_DIFFERENCE * DIFFER * 1e-3;
        assert!(lax.largest <= most && strict.largest <= most, "{lax:?} {strict:?}");
        let rms = |counts: FillCounts| (counts.squares.x / counts.points as f64).sqrt();
        assert!(rms(strict) >= 1e-3 && rms(lax) >= 1e-3 && rms(lax) < 1.2e-3, "{lax:?} {strict:?}");
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
