//! Seeded scenes of one source triangle, one observer and many blockers.

use glam::{DMat3, DVec3};

use super::random::Random;

/// A point that looks at one side of a triangle past others.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The triangle that is looked at; the side that its winding shows.
    pub source: [DVec3; 3],
    /// The observer.
    pub point: DVec3,
    /// Its unit normal.
    pub normal: DVec3,
    /// Everything that blocks; may contain the source and the observer's own surface.
    pub blockers: Vec<[DVec3; 3]>,
}

impl Sight {
    /// The scene turned, then scaled, then shifted.
    pub fn moved(&self, turn: DMat3, scale: f64, shift: DVec3) -> Sight {
        let place = |x: DVec3| scale * (turn * x) + shift;
        Sight {
            source: self.source.map(place),
            point: place(self.point),
            normal: (turn * self.normal).normalize(),
            blockers: self.blockers.iter().map(|t| t.map(place)).collect(),
        }
    }

    /// Height of the observer above the source plane over the source's size.
    fn rises(&self) -> f64 {
        let [a, b, c] = self.source;
        let n = (b - a).cross(c - a);
        (self.point - a).dot(n) / n.length_squared().powf(0.75)
    }
}

fn quad([a, b, c, d]: [DVec3; 4]) -> [[DVec3; 3]; 2] {
    [[a, b, c], [a, c, d]]
}

/// A scene of real numbers: triangles, parallelograms, polygons cut into fans and folded sheets
/// between the observer and the source, some through the source plane or beyond it.
pub fn random_sight(seed: u64) -> Sight {
    let mut r = Random::new(seed);
    loop {
        let source = [r.point(1.0), r.point(1.0), r.point(1.0)];
        let (point, centre) = (r.point(1.5), (source[0] + source[1] + source[2]) / 3.0);
        let normal = ((centre - point).normalize() + 0.9 * r.direction()).normalize();
        let mut sight = Sight { source, point, normal, blockers: vec![] };
        let n = (source[1] - source[0]).cross(source[2] - source[0]);
        if !(sight.rises() > 0.02 && n.length() > 0.05) {
            continue;
        }
        let count = 1 + r.below(12);
        for _ in 0..count {
            let along = r.within(-0.1, 1.2);
            let middle = point.lerp(centre, along) + r.point(0.4);
            let size = r.within(0.1, 1.0);
            let (u, v) = (size * r.direction(), size * r.direction());
            match r.below(4) {
                0 => sight.blockers.push([middle + u, middle + v, middle + size * r.direction()]),
                1 => sight.blockers.extend(quad([middle, middle + u, middle + u + v, middle + v])),
                2 => sight.blockers.extend(fan(middle, u, v, 3 + r.below(6), r.below(2) == 1)),
                _ => sight.blockers.extend(sheet(&mut r, middle, u, v)),
            }
        }
        sight.blockers.push(source);
        return sight;
    }
}

/// A convex polygon (an affine image of a regular one) as triangles about its middle, or as
/// triangles about a corner.
fn fan(middle: DVec3, u: DVec3, v: DVec3, corners: usize, inner: bool) -> Vec<[DVec3; 3]> {
    let rim = |k: usize| {
        let (s, c) = (std::f64::consts::TAU * (k % corners) as f64 / corners as f64).sin_cos();
        middle + c * u + s * v
    };
    if inner {
        (0..corners).map(|k| [middle, rim(k), rim(k + 1)]).collect()
    } else {
        (1..corners - 1).map(|k| [rim(0), rim(k), rim(k + 1)]).collect()
    }
}

/// Two by two quads with common corners, flat or folded at random.
fn sheet(r: &mut Random, middle: DVec3, u: DVec3, v: DVec3) -> Vec<[DVec3; 3]> {
    let fold = [0.0, 0.3][r.below(2)] * u.length();
    let mut corner =
        |i: i32, j: i32| middle + f64::from(i - 1) * u + f64::from(j - 1) * v + r.point(1.0) * fold;
    let grid: Vec<DVec3> = (0..9).map(|k| corner(k % 3, k / 3)).collect();
    [0, 1, 3, 4]
        .into_iter()
        .flat_map(|k: usize| quad([grid[k], grid[k + 1], grid[k + 4], grid[k + 3]]))
        .collect()
}

/// A scene on the grid {0..4}^3: everything touches, coincides and is in one plane all the time.
pub fn grid_sight(seed: u64) -> Sight {
    let mut r = Random::new(seed);
    let top = 1 + r.below(4);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    loop {
        let mut corner = || {
            DVec3::new(r.below(top + 1) as f64, r.below(top + 1) as f64, r.below(top + 1) as f64)
        };
        let source = [corner(), corner(), corner()];
        let mut point = corner();
        let third = corner();
        match r.below(3) {
            0 => {}
            1 => point += 0.5 * axes[r.below(3)],
            // A point inside a triangle of the grid, such as a node is.
            _ => point = (point + third + source[0]) / 3.0,
        }
        let normal = match r.below(3) {
            0 => r.direction(),
            k => axes[r.below(3)] * if k == 1 { 1.0 } else { -1.0 },
        };
        let mut sight = Sight { source, point, normal, blockers: vec![] };
        let rises = sight.rises();
        if !(rises.is_finite() && rises > 1e-3) {
            continue;
        }
        let most = if r.below(4) == 0 { 30 } else { 6 };
        let count = 1 + r.below(most);
        while sight.blockers.len() < count {
            let mut corner = || {
                DVec3::new(
                    r.below(top + 1) as f64,
                    r.below(top + 1) as f64,
                    r.below(top + 1) as f64,
                )
            };
            let (a, b, c) = (corner(), corner(), corner());
            if (b - a).cross(c - a) == DVec3::ZERO {
                continue;
            }
            match r.below(5) {
                0 => sight.blockers.extend(quad([a, b, b + c - a, c])),
                1 => sight.blockers.extend([[a, b, c], [a, c, b]]),
                // An edge or a corner of the source itself.
                2 if (c - source[0]).cross(source[1] - source[0]) != DVec3::ZERO => {
                    sight.blockers.push([source[0], source[1], c]);
                }
                _ => sight.blockers.push([a, b, c]),
            }
        }
        match r.below(3) {
            0 => sight.blockers.push(source),
            1 => sight.blockers.push([source[0], source[2], source[1]]),
            _ => {}
        }
        return sight;
    }
}

/// A scene with many things that almost coincide: corners, or the observer, moved by 1e-3 to 1e-9.
pub fn nearly_coincident_sight(seed: u64) -> Sight {
    let mut r = Random::new(!seed);
    let mut sight = if r.below(3) == 0 { random_sight(seed) } else { grid_sight(seed) };
    let shift = 10f64.powf(-r.within(3.0, 9.0));
    if r.below(3) == 0 {
        let t = sight.blockers[r.below(sight.blockers.len())];
        let (s, t, x) = (r.within(0.0, 0.5), r.within(0.0, 0.5), t);
        sight.point = x[0] + s * (x[1] - x[0]) + t * (x[2] - x[0]) + shift * r.direction();
    } else {
        for x in sight.blockers.iter_mut().flatten() {
            if r.below(3) == 0 {
                *x += shift * r.direction();
            }
        }
    }
    sight
}

/// A random scene whose blockers have corners cut off, and needles split off, 1e-4 to 1e-11 long.
pub fn short_edged_sight(seed: u64) -> Sight {
    let mut r = Random::new(!seed);
    let mut sight = random_sight(seed);
    let short = 10f64.powf(-r.within(4.0, 11.0));
    sight.blockers = sight
        .blockers
        .iter()
        .flat_map(|&[a, b, c]| match r.below(3) {
            0 => {
                let p = a + short * r.within(0.5, 1.0) * (b - a);
                let q = a + short * r.within(0.5, 1.0) * (c - a);
                vec![[p, b, c], [p, c, q]]
            }
            1 => {
                let p = b + short * (c - b);
                vec![[a, b, p], [a, p, c]]
            }
            _ => vec![[a, b, c]],
        })
        .collect();
    sight
}

/// Faces of a prism or a pyramid over a polygon of 3 to 8 corners: the rim of its base, and where each of
/// its corners, or all, are lifted to. Some of them may be missing.
fn solid(r: &mut Random, base: &[DVec3], lift: DVec3, pointed: bool) -> Vec<[DVec3; 3]> {
    let n = base.len();
    let apex = base.iter().sum::<DVec3>() / n as f64 + lift;
    let rim = |k: usize| base[k % n];
    let up = |k: usize| rim(k) + lift;
    let turn = r.below(2) == 1;
    let end = |at: &dyn Fn(usize) -> DVec3| -> Vec<[DVec3; 3]> {
        (1..n - 1).map(|k| [at(0), at(k), at(k + 1)]).collect()
    };
    let mut faces: Vec<Vec<[DVec3; 3]>> = (0..n)
        .map(|k| match pointed {
            true => vec![[rim(k), rim(k + 1), apex]],
            false => quad([rim(k), rim(k + 1), up(k + 1), up(k)]).to_vec(),
        })
        .collect();
    faces.push(end(&rim));
    if !pointed {
        faces.push(end(&up));
    }
    // Closed, without a base, or without any one or two faces.
    match r.below(4) {
        0 => {}
        1 => drop(faces.remove(n)),
        k => (1..k).for_each(|_| drop(faces.remove(r.below(faces.len())))),
    }
    // The direction of corners must not matter.
    let flip = |[a, b, c]: [DVec3; 3]| if turn { [a, c, b] } else { [a, b, c] };
    faces.concat().into_iter().map(flip).collect()
}

/// Solids between the observer and the source, around either, or through the source's plane.
pub fn solid_sight(seed: u64) -> Sight {
    let mut r = Random::new(seed);
    loop {
        let source = [r.point(1.0), r.point(1.0), r.point(1.0)];
        let (point, centre) = (r.point(1.5), (source[0] + source[1] + source[2]) / 3.0);
        let normal = ((centre - point).normalize() + 0.9 * r.direction()).normalize();
        let mut sight = Sight { source, point, normal, blockers: vec![] };
        let n = (source[1] - source[0]).cross(source[2] - source[0]);
        if !(sight.rises() > 0.02 && n.length() > 0.05) {
            continue;
        }
        for _ in 0..1 + r.below(3) {
            let middle = point.lerp(centre, r.within(0.0, 1.1)) + r.point(0.3);
            let size = r.within(0.1, 0.7);
            let (u, v) = (size * r.direction(), size * r.direction());
            let corners = 3 + r.below(6);
            let base: Vec<DVec3> = (0..corners)
                .map(|k| {
                    let (s, c) = (std::f64::consts::TAU * k as f64 / corners as f64).sin_cos();
                    middle + c * u + s * v
                })
                .collect();
            let (lift, pointed) = (size * r.direction(), r.below(3) == 0);
            sight.blockers.extend(solid(&mut r, &base, lift, pointed));
        }
        sight.blockers.push(source);
        return sight;
    }
}

/// Boxes and pyramids on the grid {0..4}^3, which touch each other, the source and the observer.
pub fn solid_grid_sight(seed: u64) -> Sight {
    let mut r = Random::new(seed);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    loop {
        let corner =
            |r: &mut Random| DVec3::new(r.below(5) as f64, r.below(5) as f64, r.below(5) as f64);
        let source = [corner(&mut r), corner(&mut r), corner(&mut r)];
        let mut point = corner(&mut r);
        if r.below(2) == 1 {
            point += 0.5 * axes[r.below(3)];
        }
        let normal = match r.below(3) {
            0 => r.direction(),
            k => axes[r.below(3)] * if k == 1 { 1.0 } else { -1.0 },
        };
        let mut sight = Sight { source, point, normal, blockers: vec![] };
        let rises = sight.rises();
        if !(rises.is_finite() && rises > 1e-3) {
            continue;
        }
        for _ in 0..1 + r.below(4) {
            let (a, b) = (corner(&mut r), corner(&mut r));
            let size = b - a;
            if size.x * size.y * size.z == 0.0 {
                continue;
            }
            let (x, y) = (DVec3::X * size.x, DVec3::Y * size.y);
            let base = [a, a + x, a + x + y, a + y];
            let pointed = r.below(3) == 0;
            sight.blockers.extend(solid(&mut r, &base, DVec3::Z * size.z, pointed));
        }
        sight.blockers.push(source);
        return sight;
    }
}
