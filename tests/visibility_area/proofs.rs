//! Attempts to refute, ray by ray, what is said to be visible or hidden.

use glam::DVec2;
use lumel::visibility::Coverage;

use super::look::{Cell, Look, look};
use super::rays::{Line, lattice, line};
use super::scenes::{Sight, grid_sight, random_sight};
use super::{PLACES, oracle, placed};

/// Distance from a piece's boundary, relative to the source's size, within which nothing is judged.
const EDGE: f64 = 1e-6;

/// Elevation over the horizon, radians, below which nothing is judged: there blockers that
/// continue the observer's own surface are left out, to 2e-6.
const LOW: f64 = 1e-5;

#[derive(Default, Debug)]
struct Tally {
    full: usize,
    hidden: usize,
    inside: usize,
    outside: usize,
    grazing: usize,
}

/// Twice the area of a triangle.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Distance from `x` to the nearest side's line of a convex polygon, negative outside.
fn depth(polygon: &[DVec2], x: DVec2) -> f64 {
    (0..polygon.len())
        .filter_map(|i| {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            let length = p.distance(q);
            (length > 0.0).then(|| turn(p, q, x) / length)
        })
        .fold(f64::INFINITY, f64::min)
}

/// Twice the signed area of a polygon.
fn twice_area(polygon: &[DVec2]) -> f64 {
    let Some((&first, rest)) = polygon.split_first() else { return 0.0 };
    rest.windows(2).map(|w| turn(first, w[0], w[1])).sum()
}

/// Twice the area common to two convex polygons (Sutherland & Hodgman 1974).
fn overlap(polygon: &[DVec2], window: &[DVec2]) -> f64 {
    let mut rest = polygon.to_vec();
    for i in 0..window.len() {
        let (p, q) = (window[i], window[(i + 1) % window.len()]);
        let mut kept = vec![];
        for k in 0..rest.len() {
            let (a, b) = (rest[k], rest[(k + 1) % rest.len()]);
            let (fa, fb) = (turn(p, q, a), turn(p, q, b));
            if fa >= 0.0 {
                kept.push(a);
            }
            if (fa > 0.0 && fb < 0.0) || (fa < 0.0 && fb > 0.0) {
                kept.push(a + (b - a) * (fa / (fa - fb)));
            }
        }
        rest = kept;
    }
    twice_area(&rest)
}

/// What rays say of `x`, or `None` where it is too low over the horizon or grazes something.
fn judge(sight: &Sight, look: &Look, x: DVec2, tally: &mut Tally) -> Option<Line> {
    let to = look.frame.lift(x) - sight.point;
    if to.dot(sight.normal) <= LOW * to.length() {
        return None;
    }
    match line(sight, look.frame.lift(x)) {
        Line::Grazing => {
            tally.grazing += 1;
            None
        }
        certain => Some(certain),
    }
}

fn refute(sight: &Sight, levels: u32, name: &str, tally: &mut Tally) {
    let look = look(sight, levels);
    let size = look.frame.origin.distance(sight.source[1]);
    let points = |cell: &Cell, count: usize| {
        let [a, b, c] = cell.corners;
        (0..count).map(move |i| {
            let (s, t) = lattice(i);
            a + s * (b - a) + t * (c - a)
        })
    };
    for cell in &look.cells {
        let count = if cell.depth == 0 { 60 } else { 12 };
        match cell.coverage {
            Coverage::Full => {
                for x in points(cell, count) {
                    let said = judge(sight, &look, x, tally);
                    assert_ne!(said, Some(Line::Blocked), "{name}: {x} is said to be visible");
                    tally.full += 1;
                }
            }
            Coverage::Hidden => {
                for x in points(cell, count) {
                    let said = judge(sight, &look, x, tally);
                    assert_ne!(said, Some(Line::Free), "{name}: {x} is said to be hidden");
                    tally.hidden += 1;
                }
            }
            Coverage::Partial => {}
        }
        let (Coverage::Partial, Some(pieces)) = (cell.coverage, &cell.pieces) else { continue };
        for x in points(cell, 40) {
            let nearest = pieces.iter().map(|p| depth(p, x)).fold(f64::NEG_INFINITY, f64::max);
            if nearest.abs() <= EDGE * size {
                continue;
            }
            let said = judge(sight, &look, x, tally);
            if nearest > 0.0 {
                assert_ne!(said, Some(Line::Blocked), "{name}: {x} in a visible piece");
                tally.inside += 1;
            } else {
                assert_ne!(said, Some(Line::Free), "{name}: {x} outside of the pieces");
                tally.outside += 1;
            }
        }
    }
    assert!(!look.clear || look.cells.iter().all(|c| c.coverage == Coverage::Full));
}

fn refute_all(make: fn(u64) -> Sight, count: u64) {
    let mut tally = Tally::default();
    for place in PLACES {
        for seed in 0..count {
            let sight = placed(&make(seed), seed, place);
            refute(&sight, seed as u32 % 4, &format!("seed {seed} at {place:?}"), &mut tally);
        }
    }
    println!("{tally:?}");
    let judged = tally.full + tally.hidden + tally.inside + tally.outside;
    assert!(tally.full.min(tally.hidden).min(tally.inside).min(tally.outside) > judged / 50);
    assert!(tally.grazing < judged / 50, "{tally:?}");
}

#[test]
fn no_ray_refutes_what_is_said_of_random_scenes() {
    refute_all(random_sight, 400);
}

#[test]
fn no_ray_refutes_what_is_said_of_scenes_on_a_grid() {
    refute_all(grid_sight, 1500);
}

/// Pieces are convex and counter-clockwise, lie in their element, and overlap nowhere.
#[test]
fn pieces_are_convex_and_disjoint() {
    let (mut pieces_seen, mut pairs) = (0, 0);
    for (make, count) in [(random_sight as fn(u64) -> Sight, 600), (grid_sight, 3000)] {
        for seed in 0..count {
            let sight = placed(&make(seed), seed, PLACES[seed as usize % PLACES.len()]);
            let look = look(&sight, seed as u32 % 3);
            for cell in &look.cells {
                let Some(pieces) = &cell.pieces else { continue };
                let [a, b, c] = cell.corners;
                let tiny = 1e-14 * (b - a).length().max((c - a).length()).powi(2);
                for (i, piece) in pieces.iter().enumerate() {
                    let n = piece.len();
                    let corner = |k: usize| piece[k % n];
                    assert!(
                        (0..n).all(|k| turn(corner(k), corner(k + 1), corner(k + 2)) >= -tiny),
                        "seed {seed}: not convex: {piece:?}"
                    );
                    let twice = twice_area(piece);
                    assert!(twice >= 0.0, "seed {seed}: clockwise: {piece:?}");
                    assert!((overlap(piece, &cell.corners) - twice).abs() <= 4.0 * tiny);
                    for other in &pieces[..i] {
                        let common = overlap(piece, other);
                        assert!(common <= 4.0 * tiny, "seed {seed}: {common:e} is there twice");
                        pairs += 1;
                    }
                    pieces_seen += 1;
                }
            }
        }
    }
    println!("{pieces_seen} pieces, {pairs} pairs");
    assert!(pieces_seen > 10_000);
}

/// The share of an even lattice's points that rays find visible is the visible share of the area.
#[test]
fn dense_rays_see_the_same_area() {
    const POINTS: usize = 5000;
    for (make, count) in [(random_sight as fn(u64) -> Sight, 100), (grid_sight, 150)] {
        for seed in 0..count {
            let sight = make(seed);
            let areas = oracle::areas(&sight);
            let share = look(&sight, 2).visible / areas.source;
            let [a, b, c] = sight.source;
            let (mut free, mut unsure) = (0, 0);
            for i in 0..POINTS {
                let (s, t) = lattice(i);
                let x = a + s * (b - a) + t * (c - a);
                if (x - sight.point).dot(sight.normal) <= 0.0 {
                    continue;
                }
                match line(&sight, x) {
                    Line::Free => free += 1,
                    Line::Grazing => unsure += 1,
                    Line::Blocked => {}
                }
            }
            // Four standard deviations of as many random points; a lattice does better.
            let deviation = (share * (1.0 - share) / POINTS as f64).max(0.0).sqrt();
            let slack = 4.0 * deviation + (unsure + 2) as f64 / POINTS as f64;
            let seen = free as f64 / POINTS as f64;
            assert!((seen - share).abs() <= slack, "seed {seed}: rays {seen}, area {share}");
            assert!(unsure <= POINTS / 50, "seed {seed}: {unsure} graze");
        }
    }
}
