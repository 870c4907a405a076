//! Closure of rooms full of things: what a point of them sees adds up to one, whatever touches what.

mod common;
#[path = "common/packed.rs"]
mod packed;
#[path = "common/random.rs"]
#[allow(dead_code)]
mod random;
#[path = "visibility_area/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use common::{Prepared, box_quads, material, rotated, scene, triangle};
use glam::{DMat3, DVec3};
use lumel::geometry::Frame;
use lumel::mesh::{Basis, Refinement};
use lumel::operator::Walker;
use lumel::scene::Scene;
use packed::packed;
use random::Random;

/// How a scene is placed in space: scale, shift in sizes, and how near to one the sums must be.
///
/// A shift by a thousand sizes leaves a thousand times the rounding: 2e-13 of a size in each corner,
/// times some hundred shadow lines, seen from as near as a tenth of a size. Points nearer than that
/// to the edges around them see each shift of a corner the larger: [`check`] is told.
const PLACES: [(f64, f64, f64); 4] =
    [(1.0, 0.0, 1e-11), (1e-6, 0.0, 1e-11), (1e6, 0.0, 1e-11), (1.0, 1e3, 1e-9)];

/// Weights of a triangle's corners: points on no line that matters, and not near its edges.
const POINTS: [[f64; 3]; 3] = [[0.55, 0.29, 0.16], [0.31, 0.18, 0.51], [0.19, 0.57, 0.24]];

/// Checks what points on all sides of all triangles see, where they count, in every place, as the
/// scene is and turned. The scene has about the given size; points are `tenth` times a tenth of it
/// from the nearest edges. Returns how many sums were checked.
fn check(
    still: &Scene,
    size: f64,
    seed: u64,
    (basis, levels): (Basis, u32),
    tenth: f64,
    counts: impl Fn(DVec3, DVec3) -> bool,
) -> usize {
    let mut r = Random::new(seed);
    let (mut checked, mut walker) = (0, Walker::default());
    for (scale, far, close) in PLACES {
        for turn in [DMat3::IDENTITY, r.turn()] {
            let shift = r.direction() * far * scale * size;
            let moved = rotated(still, turn, scale, shift);
            let prepared = Prepared::new(&moved, basis, Refinement::Levels(levels));
            for (triangle, at) in moved.triangles.iter().zip(&still.triangles) {
                let two_sided = still.materials[at.material as usize].two_sided;
                let normal = Frame::of_triangle(&triangle.vertices).unwrap().n;
                for (side, w) in [1.0, -1.0].into_iter().flat_map(|s| POINTS.map(|w| (s, w))) {
                    let point = |v: &[DVec3; 3]| w[0] * v[0] + w[1] * v[1] + w[2] * v[2];
                    let (x, n) = (point(&at.vertices), side * (turn.transpose() * normal));
                    if (side < 0.0 && !two_sided) || !counts(x, n) {
                        continue;
                    }
                    let mut sum = 0.0;
                    walker.row(
                        prepared.stage(),
                        point(&triangle.vertices),
                        side * normal,
                        |_, c| {
                            sum += c.iter().sum::<f64>() / std::f64::consts::PI;
                        },
                    );
                    assert!(
                        (sum - 1.0).abs() <= close / tenth,
                        "seed {seed}, scale {scale}, {far} sizes away, {turn:?}: {x} looking \
                         along {n} sees {sum}"
                    );
                    checked += 1;
                }
            }
        }
    }
    checked
}

fn quads_scene(quads: impl IntoIterator<Item = [DVec3; 4]>) -> Scene {
    let quads: Vec<_> = quads.into_iter().map(|q| (q, 0)).collect();
    scene(&quads, vec![material("grey", 0.5, 0.0)])
}

type Block = (DVec3, DVec3);

#[test]
fn rooms_of_touching_blocks_are_closed() {
    let mut checked = 0;
    for seed in 0..24 {
        let mut r = Random::new(seed);
        let n = 2 + r.below(3);
        let wanted = 1 + r.below(8);
        let blocks = packed(&mut r, n, wanted);
        let walls = box_quads(DVec3::ZERO, DVec3::splat(n as f64), false);
        let sides = blocks.iter().flat_map(|&(min, max)| box_quads(min, max, true));
        let still = quads_scene(walls.into_iter().chain(sides));
        let kind = ([Basis::Constant, Basis::Linear][seed as usize % 2], u32::from(seed % 5 == 0));
        // Not those between two faces that touch: there a step ahead is inside of a block.
        checked += check(&still, n as f64, seed, kind, 1.0, |x, normal| {
            let ahead = x + 1e-3 * normal;
            let inside = |b: &Block| ahead.cmpgt(b.0).all() && ahead.cmplt(b.1).all();
            inside(&(DVec3::ZERO, DVec3::splat(n as f64))) && !blocks.iter().any(inside)
        });
    }
    assert!(checked > 5_000, "{checked}");
}

/// Blocks through each other at any angle, all faces two-sided: the insides are closed as well.
#[test]
fn rooms_of_overlapping_two_sided_blocks_are_closed() {
    for seed in 0..10 {
        let mut r = Random::new(seed);
        let mut quads: Vec<_> =
            box_quads(DVec3::splat(-1.0), DVec3::ONE, false).into_iter().map(|q| (q, 0)).collect();
        for _ in 0..1 + r.below(6) {
            let half = DVec3::new(r.within(0.05, 0.4), r.within(0.05, 0.4), r.within(0.05, 0.4));
            let (turn, centre) = (r.turn(), r.point(0.3));
            let sides = box_quads(-half, half, true);
            quads.extend(sides.into_iter().map(|q| (q.map(|x| centre + turn * x), 1)));
        }
        let mut both = material("both", 0.5, 0.0);
        both.two_sided = true;
        let still = scene(&quads, vec![material("grey", 0.5, 0.0), both]);
        check(&still, 1.0, seed, (Basis::Linear, u32::from(seed % 5 == 0)), 1.0, |_, _| true);
    }
}

/// Thin plates of two one-sided faces, back to back, cut along different diagonals: the two faces
/// are in one plane only but for roundings, and neither may hide the other.
#[test]
fn rooms_of_plates_cut_differently_on_both_sides_are_closed() {
    for seed in 0..24 {
        let mut r = Random::new(seed);
        let mut still = quads_scene(box_quads(DVec3::splat(-1.0), DVec3::ONE, false));
        for _ in 0..4 {
            let thin = 10f64.powf(-r.within(0.0, 5.0));
            let (turn, centre) = (r.turn(), r.point(0.3));
            let [a, b, c, d] = [(-0.5, -thin), (0.5, -thin), (0.5, thin), (-0.5, thin)]
                .map(|(x, y)| centre + turn * DVec3::new(x, 0.5 * y, 0.0));
            let faces = [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
            still.triangles.extend(faces.map(|t| triangle(t, 0)));
        }
        check(&still, 1.0, seed, (Basis::Constant, u32::from(seed % 3 == 0)), 1.0, |_, _| true);
    }
}

/// Walls and a block cut into strips, the narrowest a millionth of the room wide.
#[test]
fn rooms_of_narrow_strips_are_closed() {
    for seed in 0..12 {
        let mut r = Random::new(seed);
        let low = DVec3::new(r.within(0.1, 0.3), r.within(0.1, 0.3), 0.0);
        let block = box_quads(low, low + DVec3::new(0.4, 0.5, 0.3), true);
        let mut strips = vec![];
        for [a, b, c, d] in box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().chain(block) {
            let mut cuts: Vec<f64> = (0..3).map(|_| r.within(0.2, 0.8)).collect();
            cuts.push(cuts[0] + 10f64.powf(-r.within(2.0, 6.0)));
            cuts.push(10f64.powf(-r.within(2.0, 6.0)));
            cuts.extend([0.0, 1.0]);
            cuts.sort_by(f64::total_cmp);
            let strip =
                |w: &[f64]| [a.lerp(b, w[0]), a.lerp(b, w[1]), d.lerp(c, w[1]), d.lerp(c, w[0])];
            strips.extend(cuts.windows(2).map(strip));
        }
        // Linear coefficients of an element lose its length over its width, 1e6, in rounding.
        let basis = if seed % 4 == 0 { Basis::Linear } else { Basis::Constant };
        check(&quads_scene(strips), 1.0, seed, (basis, 0), 1e-2, |x, normal| {
            // The floor under the block sees nothing, and what is just inside its walls as little.
            let ahead = x + 1e-9 * normal;
            let high = low + DVec3::new(0.4, 0.5, 0.3);
            !(ahead.cmpgt(low).all() && ahead.cmplt(high).all()) && ahead.z > 0.0
        });
    }
}

/// A plate of horizontal strips in front and of vertical ones behind: each strip's plane is known
/// to a rounding along the strip only, and where two cross neither may hide the other.
#[test]
fn rooms_of_plates_of_crossing_strips_are_closed() {
    for seed in 0..12 {
        let mut r = Random::new(seed);
        let mut quads = box_quads(DVec3::splat(-1.0), DVec3::ONE, false);
        let (turn, centre, strips) = (r.turn(), r.point(0.1), 5 + r.below(30));
        let p = |x: f64, y: f64| centre + turn * DVec3::new(x - 0.5, y - 0.5, 0.0);
        for k in 0..strips {
            let (low, high) = (k as f64 / strips as f64, (k + 1) as f64 / strips as f64);
            quads.push([p(0.0, low), p(1.0, low), p(1.0, high), p(0.0, high)]);
            quads.push([p(low, 0.0), p(low, 1.0), p(high, 1.0), p(high, 0.0)]);
        }
        check(&quads_scene(quads), 1.0, seed, (Basis::Constant, 0), 1.0, |_, _| true);
    }
}
