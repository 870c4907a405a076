//! Furnished rooms that follow from a seed: what a tolerance has to be good for.

use glam::{DVec3, dvec3};
use lumel::scene::{Scene, Triangle};

use super::common::{box_quads, material, scene, triangle};
use super::random::Random;

type Quads = Vec<([DVec3; 4], u32)>;

/// A closed room with boxes, tables and slats, and lamps of several shapes.
pub fn furnished(seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let size = dvec3(random.within(3.0, 7.0), random.within(2.2, 3.5), random.within(3.0, 7.0));
    let mut materials = vec![];
    for (name, share) in [("walls", 0.8), ("floor", 0.6), ("wood", 0.6), ("metal", 0.4)] {
        let mut own = material(name, 1.0, 0.0);
        own.reflectance = share * (DVec3::splat(0.3) + 0.7 * (random.point(0.5) + 0.5));
        materials.push(own);
    }
    // A lamp that reflects, and one that does not.
    for (name, reflectance) in [("lamp", 0.7), ("tube", 0.0)] {
        let mut own = material(name, reflectance, 1.0);
        own.radiance = dvec3(5.0, 4.0, 3.0) + random.point(2.0);
        materials.push(own);
    }
    let mut quads: Quads = vec![];
    for (k, quad) in box_quads(DVec3::ZERO, size, false).into_iter().enumerate() {
        // The third is the floor.
        quads.push((quad, u32::from(k == 2)));
    }
    for _ in 0..1 + random.below(4) {
        let at = dvec3(random.within(0.15, 0.85) * size.x, 0.0, random.within(0.15, 0.85) * size.z);
        let angle = random.within(0.0, 3.0);
        let own = match random.below(4) {
            0 | 1 => block(&mut random),
            2 => table(&mut random),
            _ => slats(&mut random),
        };
        place(&mut quads, &own, at, angle, size);
    }
    let mut triangles: Vec<Triangle> = vec![];
    for _ in 0..1 + random.below(2) {
        let at = dvec3(random.within(0.2, 0.8) * size.x, 0.0, random.within(0.2, 0.8) * size.z);
        let own = match random.below(3) {
            // A panel below the ceiling, a tube, a disc of triangles.
            0 => {
                let half = dvec3(random.within(0.1, 0.5), 0.0, random.within(0.1, 0.5));
                let y = random.within(0.85, 0.97) * size.y;
                vec![(down(dvec3(0.0, y, 0.0), half), 4)]
            }
            1 => {
                let (y, r) = (random.within(0.6, 0.9) * size.y, random.within(0.02, 0.05));
                let half = dvec3(random.within(0.2, 0.6), r, r);
                let middle = dvec3(0.0, y, 0.0);
                box_quads(middle - half, middle + half, true).into_iter().map(|q| (q, 5)).collect()
            }
            _ => {
                let (y, r) = (random.within(0.7, 0.95) * size.y, random.within(0.1, 0.3));
                let count = 5 + random.below(12);
                let rim = |k: usize| {
                    let (s, c) = (std::f64::consts::TAU * k as f64 / count as f64).sin_cos();
                    at + dvec3(r * c, y, r * s)
                };
                let centre = at + dvec3(0.0, y, 0.0);
                triangles.extend((0..count).map(|k| triangle([centre, rim(k), rim(k + 1)], 4)));
                vec![]
            }
        };
        place(&mut quads, &own, at, 0.0, size);
    }
    let mut room = scene(&quads, materials);
    room.triangles.extend(triangles);
    room
}

/// A furnished room with a few small bright lamps, each close to a wall and facing it: spots of light
/// that are smaller than elements, and lamps that are in the way of their light. Other lamps are dim.
pub fn with_spots(seed: u64) -> Scene {
    let mut room = furnished(seed);
    let mut random = Random::new(seed ^ 0x5907);
    for own in &mut room.materials {
        own.radiance *= random.within(0.0, 0.05);
    }
    let corners = || room.triangles.iter().flat_map(|t| t.vertices);
    let size = corners().fold(DVec3::ZERO, DVec3::max);
    let lamp = room.materials.len() as u32;
    room.materials.push(material("spot", 0.0, random.within(10.0, 40.0)));
    for _ in 0..1 + random.below(3) {
        let (half, away) = (random.within(0.01, 0.05), random.within(0.02, 0.2));
        let across = size.z * random.within(0.05, 0.95);
        let up = size.y * random.within(0.3, 0.95);
        let p = |y: f64, z: f64| dvec3(away, up + y * half, across + z * half);
        let quad = [p(-1.0, -1.0), p(-1.0, 1.0), p(1.0, 1.0), p(1.0, -1.0)];
        // On one wall or on the one opposite; the order of the corners has it face the wall.
        let opposite = random.below(2) == 1;
        let turned = |p: DVec3| dvec3(size.x - p.x, p.y, p.z);
        let quad = if opposite { [0, 3, 2, 1].map(|k| turned(quad[k])) } else { quad };
        room.triangles.push(triangle([quad[0], quad[1], quad[2]], lamp));
        room.triangles.push(triangle([quad[0], quad[2], quad[3]], lamp));
    }
    room
}

/// Adds quads, turned about the vertical and moved, but kept inside the room.
fn place(quads: &mut Quads, own: &Quads, at: DVec3, angle: f64, size: DVec3) {
    let (s, c) = angle.sin_cos();
    let turned = |p: DVec3| dvec3(c * p.x - s * p.z, p.y, s * p.x + c * p.z);
    let corners = || own.iter().flat_map(|(q, _)| q.map(turned));
    let (low, high) =
        corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let wall = DVec3::splat(0.02);
    let mut shift = at.max(wall - low).min(size - wall - high);
    shift.y = 0.0;
    quads.extend(own.iter().map(|(q, m)| (q.map(|p| turned(p) + shift), *m)));
}

fn down(middle: DVec3, half: DVec3) -> [DVec3; 4] {
    let p = |x: f64, z: f64| middle + dvec3(x * half.x, 0.0, z * half.z);
    [p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]
}

fn solid(min: DVec3, max: DVec3, material: u32) -> Quads {
    box_quads(min, max, true).into_iter().map(|q| (q, material)).collect()
}

/// A box on the floor.
fn block(random: &mut Random) -> Quads {
    let half = dvec3(random.within(0.1, 0.6), 0.0, random.within(0.1, 0.6));
    let up = DVec3::Y * random.within(0.2, 1.8);
    solid(-half, half + up, 2)
}

/// A top on four legs.
fn table(random: &mut Random) -> Quads {
    let half = dvec3(random.within(0.3, 0.7), 0.0, random.within(0.25, 0.5));
    let (under, over, leg) = (random.within(0.4, 0.75), random.within(0.02, 0.06), 0.03);
    let mut quads = solid(-half + DVec3::Y * under, half + DVec3::Y * (under + over), 2);
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = dvec3(x * (half.x - 2.0 * leg), 0.0, z * (half.z - 2.0 * leg));
        let wide = dvec3(leg, 0.0, leg);
        quads.extend(solid(foot - wide, foot + wide + DVec3::Y * under, 3));
    }
    quads
}

/// A rack of upright boards.
fn slats(random: &mut Random) -> Quads {
    let count = 3 + random.below(4);
    let (depth, gap) = (random.within(0.1, 0.4), random.within(0.08, 0.25));
    let (low, high) = (random.within(0.0, 0.3), random.within(0.8, 1.8));
    (0..count)
        .flat_map(|k| {
            let x = gap * k as f64;
            solid(dvec3(x, low, -depth), dvec3(x + 0.02, high, depth), 3)
        })
        .collect()
}
