//! Attempts to refute, segment by segment, what is proved of pairs of triangles.

#[path = "common/random.rs"]
mod random;

use glam::DVec3;
use lumel::geometry::Frame;
use lumel::visibility::{Coverage, Occluders, Shaft};
use random::Random;
use rayon::prelude::*;

/// Scales, and distances from the origin in sizes, that change roundings most.
const PLACES: [(f64, f64); 6] =
    [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e3), (1e-6, 1e3), (1e6, 1e3)];

/// Coincidences within which a segment grazes an occluder.
const MARGIN: f64 = 32.0;

/// Elevation, radians, below which nothing is judged: occluders that continue the receiver's own
/// surface are left out, to 2e-6.
const LOW: f64 = 1e-5;

/// Point pairs tried against each proof.
const TRIED: usize = 2000;

type Triangle = [DVec3; 3];

/// Two triangles that face each other at least partly, by their windings, and what may be between.
#[derive(Clone, Debug)]
struct Pair {
    receiver: Triangle,
    source: Triangle,
    blockers: Vec<Triangle>,
}

/// What is known of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Segment {
    /// It misses every blocker, by a margin.
    Free,
    /// It crosses the inside of a blocker, by a margin.
    Blocked,
    /// Neither.
    Grazing,
}

/// Tests one segment by the signs of volumes, which shifts of the points by `margin` do not change.
fn segment(blockers: &[Triangle], (p, q): (DVec3, DVec3), margin: f64) -> Segment {
    let mut answer = Segment::Free;
    for t in blockers {
        let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
        let n = e1.cross(e2);
        let reach = t.iter().map(|w| w.distance(p)).fold(p.distance(q), f64::max);
        let slack = margin * (e1.length() + e2.length()) * reach;
        let sign = |value: f64, slack: f64| match value {
            v if v > slack => 1,
            v if v < -slack => -1,
            _ => 0,
        };
        let (from, to) = (sign(n.dot(p - t[0]), slack), sign(n.dot(q - t[0]), slack));
        if from * to > 0 {
            continue;
        }
        let around = [0, 1, 2].map(|k| {
            let (w, edge) = (t[k], t[(k + 1) % 3] - t[k]);
            sign((w - p).cross(edge).dot(q - p), margin * edge.length() * reach)
        });
        if around.contains(&1) && around.contains(&-1) {
            continue;
        }
        if from * to < 0 && !around.contains(&0) {
            return Segment::Blocked;
        }
        answer = Segment::Grazing;
    }
    answer
}

/// Weights of a point of a triangle: anywhere, at a corner, on an edge, or very near to these.
fn weights(r: &mut Random) -> DVec3 {
    let mut w = [r.unit(), r.unit(), r.unit()].map(|x| -(1.0 - x).ln());
    let small = match r.below(4) {
        0 => 1.0,
        1 => 0.0,
        _ => 10f64.powf(-r.within(0.0, 10.0)),
    };
    let first = r.below(3);
    w[first] *= small;
    if r.below(3) == 0 {
        w[(first + 1) % 3] *= small;
    }
    DVec3::from_array(w) / w.iter().sum::<f64>()
}

fn at(t: &Triangle, w: DVec3) -> DVec3 {
    w.x * t[0] + w.y * t[1] + w.z * t[2]
}

fn normal(t: &Triangle) -> DVec3 {
    Frame::of_triangle(t).unwrap().n
}

/// Two points, of which the second is seen from the first (or not) past a point near a blocker's
/// edge, where there is one.
fn points(r: &mut Random, pair: &Pair) -> (DVec3, DVec3) {
    let p = at(&pair.receiver, weights(r));
    let mut w = weights(r);
    if !pair.blockers.is_empty() && r.below(3) > 0 {
        let past = at(&pair.blockers[r.below(pair.blockers.len())], weights(r));
        let [a, b, c] = pair.source;
        let n = (b - a).cross(c - a);
        let (height, rest) = ((p - a).dot(n), (p - past).dot(n));
        let x = p + (past - p) * (height / rest) - a;
        let n = n / n.length_squared();
        let (v, z) = (x.cross(c - a).dot(n), (b - a).cross(x).dot(n));
        let found = DVec3::new(1.0 - v - z, v, z);
        if found.is_finite() {
            let inside = found.max(DVec3::ZERO);
            w = inside / (inside.x + inside.y + inside.z);
        }
    }
    (p, at(&pair.source, w))
}

#[derive(Default, Debug)]
struct Tally {
    full: usize,
    hidden: usize,
    partial: usize,
    /// Segments that refute nothing.
    tried: usize,
    grazing: usize,
    /// Pairs with nothing near, and those of them that are proved so.
    clear: usize,
    clear_proved: usize,
    /// Proofs that were refuted.
    wrong: Vec<String>,
}

impl Tally {
    fn add(mut self, o: Tally) -> Tally {
        self.full += o.full;
        self.hidden += o.hidden;
        self.partial += o.partial;
        self.tried += o.tried;
        self.grazing += o.grazing;
        self.clear += o.clear;
        self.clear_proved += o.clear_proved;
        self.wrong.extend(o.wrong);
        self
    }
}

/// Tries to refute what is said of a pair.
fn refute(pair: &Pair, said: Coverage, tau: f64, name: &str, r: &mut Random, tally: &mut Tally) {
    let (up, out) = (normal(&pair.receiver), normal(&pair.source));
    match said {
        Coverage::Full => tally.full += 1,
        Coverage::Hidden => tally.hidden += 1,
        Coverage::Partial => {
            tally.partial += 1;
            return;
        }
    }
    for _ in 0..TRIED {
        let (p, q) = points(r, pair);
        let (low, margin) = (LOW * p.distance(q), MARGIN * tau);
        if (q - p).dot(up) <= low + margin || (p - q).dot(out) <= margin {
            continue;
        }
        tally.tried += 1;
        let seen = segment(&pair.blockers, (p, q), margin);
        tally.grazing += usize::from(seen == Segment::Grazing);
        if matches!(
            (said, seen),
            (Coverage::Full, Segment::Blocked) | (Coverage::Hidden, Segment::Free)
        ) {
            tally.wrong.push(format!("{name}: {said:?}, but {p} to {q} is {seen:?} in {pair:?}"));
            return;
        }
    }
}

/// Part `k` of a triangle cut in four.
fn child(t: &Triangle, k: usize) -> Triangle {
    let m = [0, 1, 2].map(|i| 0.5 * (t[i] + t[(i + 1) % 3]));
    match k {
        0 => [t[0], m[0], m[2]],
        1 => [m[0], t[1], m[1]],
        2 => [m[2], m[1], t[2]],
        _ => m,
    }
}

/// Asks the library as an operator does: one search, then the list is narrowed on the way down.
fn examine(pair: &Pair, seed: u64, name: &str) -> Tally {
    let (mut r, mut tally) = (Random::new(seed ^ 0x51A7), Tally::default());
    let occluders = Occluders::build(&pair.blockers);
    let tau = occluders.coincidence();
    let (up, out) = (normal(&pair.receiver), normal(&pair.source));
    let mut list = vec![];
    Shaft::new(&occluders, (pair.receiver, up), (pair.source, out)).find(&mut list);
    let (mut own, mut begin) = (pair.clone(), 0);
    for depth in 0..4 {
        let end = list.len();
        let shaft = Shaft::new(&occluders, (own.receiver, up), (own.source, out));
        let said = shaft.narrow(&mut list, (begin as u32, end as u32));
        assert!(said == Coverage::Partial || list.len() == end);
        if depth == 0 {
            assert_eq!(said == Coverage::Full, end == 0, "{name}: `find` knows as much");
            if clearly_full(pair, tau, &mut r) {
                tally.clear += 1;
                tally.clear_proved += usize::from(said == Coverage::Full);
            }
        }
        refute(&own, said, tau, &format!("{name}, depth {depth}"), &mut r, &mut tally);
        if said != Coverage::Partial {
            break;
        }
        begin = end;
        if r.below(4) > 0 {
            own.receiver = child(&own.receiver, r.below(4));
        }
        if r.below(4) > 0 {
            own.source = child(&own.source, r.below(4));
        }
    }
    tally
}

/// Whether no segment comes near to a blocker, as far as many of them show. Blockers at or below
/// either plane do not count.
fn clearly_full(pair: &Pair, tau: f64, r: &mut Random) -> bool {
    let all: Vec<DVec3> = pair.receiver.into_iter().chain(pair.source).collect();
    let size = all.iter().map(|x| x.distance(all[0])).fold(0.0, f64::max);
    let below = |t: &Triangle, own: &Triangle| {
        let n = normal(own);
        t.iter().all(|&w| (w - own[0]).dot(n) <= MARGIN * tau)
    };
    let blockers: Vec<_> = pair
        .blockers
        .iter()
        .filter(|t| !below(t, &pair.receiver) && !below(t, &pair.source))
        .collect();
    (0..400).all(|k| {
        let (p, q) = match k {
            0..9 => (pair.receiver[k / 3], pair.source[k % 3]),
            _ => (at(&pair.receiver, weights(r)), at(&pair.source, weights(r))),
        };
        blockers.iter().all(|t| distance((p, q), t) > 0.03 * size)
    })
}

/// Distance of a segment from a triangle.
fn distance((p, q): (DVec3, DVec3), t: &Triangle) -> f64 {
    let n = (t[1] - t[0]).cross(t[2] - t[0]).normalize();
    let within = |x: DVec3| (0..3).all(|k| (t[(k + 1) % 3] - t[k]).cross(x - t[k]).dot(n) >= 0.0);
    let (from, to) = ((p - t[0]).dot(n), (q - t[0]).dot(n));
    if from * to < 0.0 && within(p.lerp(q, from / (from - to))) {
        return 0.0;
    }
    let edges = (0..3).map(|k| between_segments((p, q), (t[k], t[(k + 1) % 3])));
    let ends = [(p, from), (q, to)];
    let ends = ends.into_iter().filter(|(x, _)| within(*x)).map(|(_, h)| h.abs());
    edges.chain(ends).fold(f64::INFINITY, f64::min)
}

/// Distance of two segments (Eberly 2015: the quadratic's minimum on its square, or on a side).
fn between_segments((p, q): (DVec3, DVec3), (v, w): (DVec3, DVec3)) -> f64 {
    let nearest = |x: DVec3, (a, b): (DVec3, DVec3)| {
        let e = b - a;
        a + e * ((x - a).dot(e) / e.length_squared()).clamp(0.0, 1.0)
    };
    let ends = [p, q].map(|x| x.distance(nearest(x, (v, w))));
    let others = [v, w].map(|x| x.distance(nearest(x, (p, q))));
    let (d, e, r) = (q - p, w - v, p - v);
    let (a, b, c) = (d.length_squared(), d.dot(e), e.length_squared());
    let s = (b * e.dot(r) - c * d.dot(r)) / (a * c - b * b);
    let t = (a * e.dot(r) - b * d.dot(r)) / (a * c - b * b);
    let crossing = if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
        (p + s * d).distance(v + t * e)
    } else {
        f64::INFINITY
    };
    ends.into_iter().chain(others).fold(crossing, f64::min)
}

fn quad([a, b, c, d]: [DVec3; 4]) -> [Triangle; 2] {
    [[a, b, c], [a, c, d]]
}

/// Whether the triangles have area and face each other at least partly.
fn facing(receiver: &Triangle, source: &Triangle) -> bool {
    let (Some(own), Some(other)) = (Frame::of_triangle(receiver), Frame::of_triangle(source))
    else {
        return false;
    };
    let above = |frame: &Frame, t: &Triangle| t.iter().any(|&x| frame.height(x) > 1e-3);
    above(&own, source) && above(&other, receiver)
}

/// Two triangles of any shapes: apart, close together, with a common corner or edge.
fn two_triangles(r: &mut Random) -> (Triangle, Triangle) {
    loop {
        let size = |r: &mut Random| if r.below(3) == 0 { r.within(0.02, 0.2) } else { 1.0 };
        let thin = |r: &mut Random, t: &mut Triangle| {
            if r.below(5) == 0 {
                let along = t[0].lerp(t[1], r.within(-0.2, 1.2));
                t[2] = along + (t[2] - along) * 10f64.powf(-r.within(1.0, 7.0));
            }
        };
        let (small, large) = (size(r), size(r));
        let mut receiver = [r.point(small), r.point(small), r.point(small)];
        thin(r, &mut receiver);
        let away = r.within(0.0, 3.0) * r.direction();
        let mut source = [0, 1, 2].map(|_| away + r.point(large));
        thin(r, &mut source);
        let near = if r.below(2) == 0 { 0.0 } else { 10f64.powf(-r.within(1.0, 10.0)) };
        match r.below(5) {
            0 => source[0] = receiver[0] + near * r.direction(),
            1 => {
                source[0] = receiver[1] + near * r.direction();
                source[1] = receiver[0] + near * r.direction();
            }
            2 => source[0] = at(&receiver, weights(r)) + near * r.direction(),
            _ => {}
        }
        if facing(&receiver, &source) {
            return (receiver, source);
        }
    }
}

/// Real numbers: boxes, slats, plates with holes, slivers, and blockers that touch, continue,
/// cross or nearly touch the triangles.
fn random_pair(seed: u64) -> Pair {
    let mut r = Random::new(seed);
    let (receiver, source) = two_triangles(&mut r);
    let mut blockers = vec![];
    for _ in 0..1 + r.below(4) {
        let (w, v) = (at(&receiver, weights(&mut r)), at(&source, weights(&mut r)));
        let size = r.within(0.05, 1.0);
        let off = 0.5 * r.unit();
        let middle = w.lerp(v, r.within(-0.2, 1.2)) + r.point(off);
        let turn = r.turn();
        let [x, y, z] = [turn.x_axis, turn.y_axis, turn.z_axis].map(|a| size * a);
        let own = if r.below(2) == 0 { receiver } else { source };
        let other = if own == receiver { source } else { receiver };
        let up = normal(&own);
        match r.below(12) {
            0 => {
                let corner = |k: usize| {
                    let side = |bit: usize| if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
                    middle + side(0) * x + side(1) * y + side(2) * z
                };
                for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3]] {
                    blockers.extend(quad(face.map(corner)));
                }
                for face in [[0, 4, 6, 2], [1, 3, 7, 5]] {
                    blockers.extend(quad(face.map(corner)));
                }
            }
            1 => {
                let (step, width) = (r.within(0.1, 0.5), r.within(0.01, 0.4));
                for k in 0..4 {
                    let from = middle + step * f64::from(k - 2) * y - x;
                    let (along, across) = (2.0 * x, width * (y + 0.3 * z));
                    blockers.extend(quad([
                        from,
                        from + along,
                        from + along + across,
                        from + across,
                    ]));
                }
            }
            2 => {
                let hole = r.within(0.05, 0.6);
                let rim = |s: f64, k: usize| {
                    let (i, j) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][k % 4];
                    middle + 2.0 * s * (i * x + j * y)
                };
                for k in 0..4 {
                    blockers.extend(quad([
                        rim(1.0, k),
                        rim(1.0, k + 1),
                        rim(hole, k + 1),
                        rim(hole, k),
                    ]));
                }
            }
            3 => {
                let width = 10f64.powf(-r.within(1.0, 8.0));
                blockers.push([
                    middle - x,
                    middle + x,
                    middle + r.within(-1.2, 1.2) * x + width * y,
                ]);
            }
            4 => {
                // Along an edge, or with a corner on it.
                let k = r.below(3);
                let (a, b) = (own[k], own[(k + 1) % 3]);
                let a = if r.below(2) == 0 { a } else { a.lerp(b, r.unit()) };
                blockers.push([a, b, middle]);
            }
            5 => {
                // In its plane.
                let corner = |r: &mut Random| {
                    let (s, t) = (r.within(-1.0, 2.0), r.within(-1.0, 2.0));
                    own[0] + s * (own[1] - own[0]) + t * (own[2] - own[0])
                };
                blockers.push([corner(&mut r), corner(&mut r), corner(&mut r)]);
            }
            6 => {
                // Through it.
                let on = at(&own, weights(&mut r));
                blockers.push([on + x, on - x + 0.2 * y, on + y]);
            }
            7 => {
                // Nearly on it.
                let height = 10f64.powf(-r.within(2.0, 10.0));
                let grow = r.within(0.3, 3.0);
                let centre = at(&own, weights(&mut r));
                blockers.push(own.map(|w| centre + grow * (w - centre) + height * up));
            }
            8 => {
                // All across.
                let between = (own[0] + own[1] + own[2] + other[0] + other[1] + other[2]) / 6.0;
                let wide = r.within(1.0, 8.0);
                let (x, y) = (wide * x, wide * y);
                blockers.extend(quad([
                    between - x - y,
                    between + x - y,
                    between + x + y,
                    between - x + y,
                ]));
            }
            9 => {
                // A polygon of many triangles.
                let n = 4 + r.below(6);
                let rim = |k: usize| {
                    let (s, c) = (std::f64::consts::TAU * (k % n) as f64 / n as f64).sin_cos();
                    middle + c * x + s * y
                };
                blockers.extend((0..n).map(|k| [middle, rim(k), rim(k + 1)]));
            }
            10 => {
                // A triangle without a corner: a very short edge.
                let (a, b, c) = (middle - x - y, middle + x, middle + y);
                let short = 10f64.powf(-r.within(2.0, 14.0));
                let (p, q) = (a + short * (b - a), a + r.within(0.5, 2.0) * short * (c - a));
                blockers.extend([[p, b, c], [p, c, q]]);
            }
            _ => blockers.push([middle + x, middle + y, middle + z]),
        }
    }
    with_own(&mut r, receiver, source, blockers)
}

/// On the grid {0..n}^3, n = 1 to 4.
fn grid_pair(seed: u64) -> Pair {
    let mut r = Random::new(!seed);
    let n = 1 + r.below(4);
    let corner = |r: &mut Random| {
        DVec3::new(r.below(n + 1) as f64, r.below(n + 1) as f64, r.below(n + 1) as f64)
    };
    let any = |r: &mut Random| [corner(r), corner(r), corner(r)];
    loop {
        let (receiver, source) = (any(&mut r), any(&mut r));
        let area = |t: &Triangle| (t[1] - t[0]).cross(t[2] - t[0]).length();
        if area(&receiver).min(area(&source)) == 0.0 || !facing(&receiver, &source) {
            continue;
        }
        let mut blockers = vec![];
        for _ in 0..1 + r.below(5) {
            let t = any(&mut r);
            blockers.push(t);
            if r.below(2) == 0 {
                blockers.push([t[2], t[1], t[1] + t[2] - t[0]]);
            }
        }
        return with_own(&mut r, receiver, source, blockers);
    }
}

fn with_own(
    r: &mut Random,
    receiver: Triangle,
    source: Triangle,
    mut blockers: Vec<Triangle>,
) -> Pair {
    if r.below(2) == 0 {
        blockers.extend([receiver, source]);
    }
    blockers.retain(|t| (t[1] - t[0]).cross(t[2] - t[0]) != DVec3::ZERO);
    Pair { receiver, source, blockers }
}

/// The pair turned at random (but for one in four), scaled, and shifted by `far` times its size.
fn placed(pair: &Pair, seed: u64, (scale, far): (f64, f64)) -> Pair {
    let mut r = Random::new(seed ^ 0xF00D);
    let turn = if seed.is_multiple_of(4) { glam::DMat3::IDENTITY } else { r.turn() };
    let shift: DVec3 = r.direction() * far * scale;
    let place = |t: &Triangle| t.map(|x| scale * (turn * x) + shift);
    Pair {
        receiver: place(&pair.receiver),
        source: place(&pair.source),
        blockers: pair.blockers.iter().map(place).collect(),
    }
}

fn refute_all(make: fn(u64) -> Pair, count: u64) {
    let mut all = Tally::default();
    for place in PLACES {
        let tally = (0..count)
            .into_par_iter()
            .map(|seed| {
                let pair = placed(&make(seed), seed, place);
                examine(&pair, seed, &format!("seed {seed} at {place:?}"))
            })
            .reduce(Tally::default, Tally::add);
        let Tally { full, hidden, partial, tried, grazing, clear, clear_proved, .. } = &tally;
        println!(
            "{place:?}: {full} full, {hidden} hidden, {partial} partial; {clear_proved} of {clear} \
             clear ones found; {grazing} of {tried} segments graze; {} wrong",
            tally.wrong.len()
        );
        all = all.add(tally);
    }
    assert!(all.wrong.is_empty(), "{}, such as {:#?}", all.wrong.len(), &all.wrong[..1]);
    let said = all.full + all.hidden + all.partial;
    assert!(all.full > said / 10 && all.hidden > said / 30, "{all:?}");
    assert!(all.clear_proved as f64 > 0.95 * all.clear as f64, "{all:?}");
}

#[test]
fn no_segment_refutes_what_is_proved_of_random_pairs() {
    refute_all(random_pair, 2000);
}

#[test]
fn no_segment_refutes_what_is_proved_on_a_grid() {
    refute_all(grid_pair, 4000);
}

/// A triangle that touches an edge of the other, or nearly: the plane through the edge and that
/// point is turned by roundings, and holds a side of the shaft as little as any plane. A blocker
/// right between the two was taken to be beyond it.
#[test]
fn a_plane_through_points_close_together_separates_nothing_by_itself() {
    let mut r = Random::new(1);
    for near in [0.0, 1e-14, 1e-12, 1e-10] {
        for scale in [1e-6, 1.0, 1e6] {
            for _ in 0..20 {
                let turn = r.turn();
                let place = |x: f64, y: f64, z: f64| scale * (turn * DVec3::new(x, y, z));
                // A riser 1e-7 high at the side x = 0 of a floor, which a corner of it touches.
                let high = 1e-7;
                let foot = r.within(0.2, 0.8);
                let receiver = [place(0.0, 0.0, 0.0), place(0.0, 1.0, 0.0), place(0.0, 0.5, high)];
                let source = [place(near, foot, 0.0), place(1.0, 0.0, 0.0), place(1.0, 1.0, 0.0)];
                // A lower one, in front of it.
                let blocker =
                    [place(0.1, -1.0, 0.0), place(0.1, 2.0, 0.0), place(0.1, 0.5, 0.5 * high)];
                let occluders = Occluders::build(&[blocker]);
                let normals = (turn * DVec3::X, turn * DVec3::Z);
                let mut found = vec![];
                Shaft::new(&occluders, (receiver, normals.0), (source, normals.1)).find(&mut found);
                assert_eq!(found, [0], "{near:e} at scale {scale:e}");
            }
        }
    }
}
