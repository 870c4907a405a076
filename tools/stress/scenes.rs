//! Scenes that are hard on purpose: each follows from the name of its family and a seed.

use glam::{DMat3, DVec3};
use lumel::mesh::Basis;
use lumel::scene::{Material, Scene, Triangle, resolve_overlaps};

use super::common::{box_quads, material, rotated, scene, triangle};
use super::packed::packed;
use super::random::Random;

type Quad = [DVec3; 4];

/// A scene, and what is known of it.
pub struct Case {
    /// As a reader of files would hand it over: overlaps in one plane are resolved.
    pub scene: Scene,
    /// Whether whatever points see that are not inside of something adds up to one.
    pub closed: bool,
    /// Points to look from, with unit normals, apart from the nodes of a mesh.
    pub points: Vec<(DVec3, DVec3)>,
    /// Edges of gaps that are so narrow that their sides count as touching, and their widths: what is
    /// inside of them does not radiate.
    pub rims: Vec<([DVec3; 2], f64)>,
}

impl Case {
    /// What a point may miss of the light of narrow gaps, a share of all that it can receive: a strip of
    /// width g at a distance d spans g / d, and sends half of that at most.
    pub fn lost_in_gaps(&self, point: DVec3) -> f64 {
        let lost = |&([a, b], gap): &([DVec3; 2], f64)| {
            let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            0.5 * gap / point.distance(a.lerp(b, along))
        };
        self.rims.iter().map(lost).sum()
    }
}

/// A kind of scenes, and how large errors may be: some hundred times the rounding of a coordinate over
/// the least distance between an edge and a point that looks at it.
pub struct Family {
    /// In a few words.
    pub name: &'static str,
    /// Makes the scene of a seed.
    pub make: fn(u64) -> Case,
    /// Elements: coefficients of linear ones lose a digit for each digit of an element's length over
    /// its width, so slivers have constant ones.
    pub basis: Basis,
    /// Of sums of rows.
    pub closure: f64,
    /// Of irradiance in scenes that are turned and scaled.
    pub turned: f64,
    /// Of irradiance in scenes that are moved by 1e6 sizes: coordinates are rounded to 1e-10 sizes.
    pub far: f64,
}

const fn family(
    name: &'static str,
    make: fn(u64) -> Case,
    basis: Basis,
    [closure, turned, far]: [f64; 3],
) -> Family {
    Family { name, make, basis, closure, turned, far }
}

/// All families.
pub const FAMILIES: [Family; 10] = [
    family("corners on a grid", grid, Basis::Linear, [1e-13, 1e-13, 1e-7]),
    family("blocks that touch on a grid", touching, Basis::Linear, [1e-13, 1e-13, 1e-7]),
    family("bottomless blocks side by side", bottomless, Basis::Linear, [1e-13, 1e-13, 1e-7]),
    family("T-junctions", junctions, Basis::Linear, [1e-13, 1e-13, 1e-7]),
    family("faces that cross", crossing, Basis::Linear, [1e-11, 1e-11, 1e-5]),
    // Nodes are as near as 1e-9 to edges.
    family("slivers, aspect to 1e-8", slivers, Basis::Constant, [1e-8, 1e-8, 1e-2]),
    // Nodes are as near as 1e-12 to a plate.
    family("plates 1e-12 to 1e-3 apart", plates, Basis::Linear, [1e-10, 1e-10, 1e-4]),
    // Points are as near as 1e-12 to edges and corners (not where they are moved far away).
    family("points 1e-12 to 1e-3 from edges", near_edges, Basis::Linear, [1e-4, 1e-3, 1e-7]),
    family("planes and edges seen edge-on", edge_on, Basis::Linear, [1e-11, 1e-11, 1e-5]),
    family("open heaps", heap, Basis::Linear, [0.0, 1e-11, 1e-5]),
];

fn case(quads: &[(Quad, u32)], closed: bool) -> Case {
    let mut scene = scene(quads, materials());
    resolve_overlaps(&mut scene);
    Case { scene, closed, points: vec![], rims: vec![] }
}

/// Grey, a lamp, and grey on both sides.
fn materials() -> Vec<Material> {
    let both = Material { two_sided: true, ..material("both", 0.5, 0.0) };
    vec![material("grey", 0.5, 0.0), material("lamp", 0.5, 1.0), both]
}

fn walls(size: DVec3) -> Vec<(Quad, u32)> {
    let mut quads: Vec<(Quad, u32)> =
        box_quads(DVec3::ZERO, size, false).into_iter().map(|q| (q, 0)).collect();
    // The ceiling shines.
    quads[1].1 = 1;
    quads
}

/// Blocks and parallelograms with corners on a grid in a room, through each other and the walls.
fn grid(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let size = DVec3::new(4.0, 4.0, 3.0);
    let mut quads = walls(size);
    for _ in 0..2 + r.below(4) {
        let mut corner = || DVec3::new(r.below(5) as f64, r.below(5) as f64, r.below(4) as f64);
        let (a, b, c) = (corner(), corner(), corner());
        if (a - b).abs().min_element() > 0.0 && c.x > 1.0 {
            quads.extend(box_quads(a.min(b), a.max(b), true).into_iter().map(|q| (q, 0)));
        } else if (b - a).cross(c - a) != DVec3::ZERO
            && (b + c - a).clamp(DVec3::ZERO, size) == b + c - a
        {
            quads.push(([a, b, b + c - a, c], 2));
        }
    }
    case(&quads, true)
}

/// Blocks on a grid that touch each other and the walls.
fn touching(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let n = 2 + r.below(3);
    let mut quads = walls(DVec3::splat(n as f64));
    let wanted = 1 + r.below(6);
    for (min, max) in packed(&mut r, n, wanted) {
        quads.extend(box_quads(min, max, true).into_iter().map(|q| (q, 0)));
    }
    case(&quads, true)
}

/// Blocks without bottoms in a row on the floor, side to side, turned or not; sides of a pair agree
/// in all, some or no corners.
fn bottomless(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let mut quads = walls(DVec3::splat(3.0));
    let turn =
        DMat3::from_rotation_z(if seed.is_multiple_of(3) { 0.0 } else { r.within(0.0, 1.5) });
    let (mut x, middle) = (-0.8, DVec3::new(1.5, 1.5, 0.0));
    for _ in 0..2 + r.below(3) {
        let wide = 0.1 * (1 + r.below(4)) as f64;
        let (deep, high) = (0.2 * (1 + r.below(4)) as f64, 0.3 * (1 + r.below(4)) as f64);
        let low = DVec3::new(x, -deep, 0.0);
        let block = box_quads(low, DVec3::new(x + wide, deep, high), true);
        quads.extend(block[1..].iter().map(|q| (q.map(|p| middle + turn * p), 0)));
        x += wide;
    }
    case(&quads, true)
}

/// Walls cut into strips without regard to each other: corners lie on edges of neighbours.
fn junctions(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let size = DVec3::new(1.0, r.within(0.5, 1.5), r.within(0.4, 1.2));
    let low = size * DVec3::new(0.3, 0.35, 0.0);
    let block = box_quads(low, low + 0.3 * size, true).into_iter().map(|q| (q, 0));
    let mut quads = vec![];
    for ([a, b, c, d], m) in walls(size).into_iter().chain(block) {
        let mut cuts: Vec<f64> = (0..1 + r.below(3)).map(|_| r.within(0.05, 0.95)).collect();
        cuts.extend([0.0, 1.0]);
        cuts.sort_by(f64::total_cmp);
        for w in cuts.windows(2) {
            let q = [a.lerp(b, w[0]), a.lerp(b, w[1]), d.lerp(c, w[1]), d.lerp(c, w[0])];
            quads.push((q, m));
        }
    }
    case(&quads, true)
}

/// Two-sided blocks and plates through each other and the walls at any angle.
fn crossing(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let mut quads = walls(DVec3::splat(2.0));
    for _ in 0..1 + r.below(4) {
        let half = DVec3::new(r.within(0.05, 0.5), r.within(0.05, 0.5), r.within(0.05, 0.5));
        let (turn, centre) = (r.turn(), DVec3::ONE + r.point(0.4));
        let place = |x: DVec3| centre + turn * x;
        if r.below(3) == 0 {
            let p = |x: f64, y: f64| place(1.5 * DVec3::new(x * half.x, y * half.y, 0.0));
            quads.push(([p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)], 2));
        } else {
            quads.extend(box_quads(-half, half, true).into_iter().map(|q| (q.map(place), 2)));
        }
    }
    case(&quads, true)
}

/// A room and a block in it with triangles of all aspects down to 1e-8 along their edges.
fn slivers(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let mut made = case(&[], true);
    let low = DVec3::new(r.within(0.1, 0.3), r.within(0.1, 0.3), r.within(0.1, 0.3));
    let block = box_quads(low, low + DVec3::new(0.4, 0.5, 0.3), true).into_iter().map(|q| (q, 0));
    for (quad, m) in walls(DVec3::ONE).into_iter().chain(block) {
        // A point near the middle of an edge, or near a corner: a fan around it.
        let k = r.below(4);
        let [a, b, c] = [0, 1, 2].map(|i| quad[(k + i) % 4]);
        let along = r.within(0.1, 0.9);
        let thin = 10f64.powf(-r.within(1.0, 8.0));
        let apex = a.lerp(b, along) + thin * (c - b);
        for i in 0..4 {
            made.scene.triangles.push(triangle([quad[i], quad[(i + 1) % 4], apex], m));
        }
    }
    made
}

/// A distance from 1e-12 to 1e-3, even by its logarithm, but for those that may count as touching or
/// not: that distance follows from the longest side of a box, which is another one in a turned scene.
fn gap(r: &mut Random) -> f64 {
    let digits = r.within(0.0, 8.0);
    10f64.powf(if digits < 2.0 { -3.0 - digits } else { -4.0 - digits })
}

/// Gaps below this count as touching: between the distances that are left out.
const TOUCHING: f64 = 3e-6;

/// Plates close to each other, to the floor and to a wall, in a room.
fn plates(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let mut quads = walls(DVec3::splat(2.0));
    let mut rims = vec![];
    let mut narrow = |quads: &[(Quad, u32)], gap: f64| {
        if gap < TOUCHING {
            for (q, _) in quads {
                rims.extend((0..4).map(|k| ([q[k], q[(k + 1) % 4]], gap)));
            }
        }
    };
    for _ in 0..2 {
        let gap = gap(&mut r);
        let turn = if r.below(3) == 0 { DMat3::IDENTITY } else { r.turn() };
        let centre = DVec3::ONE + r.point(0.4);
        let rectangle = |x: (f64, f64), y: (f64, f64), z: f64| {
            [(x.0, y.0), (x.1, y.0), (x.1, y.1), (x.0, y.1)]
                .map(|(x, y)| centre + turn * (0.4 * DVec3::new(x, y, z / 0.4)))
        };
        quads.push((rectangle((-1.0, 1.0), (-1.0, 1.0), 0.0), 2));
        let off = r.within(-0.5, 0.5);
        match r.below(3) {
            0 => quads.push((rectangle((-1.0, 1.0), (-1.0, 1.0), gap), 2)),
            1 => quads.push((rectangle((off - 1.0, off + 0.8), (-0.6, 1.1), gap), 2)),
            // Inside of the other one's outline.
            _ => quads.push((rectangle((-0.4, 0.7), (-0.6, 0.5), gap), 2)),
        }
        narrow(&quads[quads.len() - 2..], gap);
    }
    // As near to the floor and a wall.
    let gap = gap(&mut r);
    let corner = |x: f64, y: f64| DVec3::new(x, y, gap);
    quads.push(([corner(gap, 0.3), corner(0.5, 0.3), corner(0.5, 0.8), corner(gap, 0.8)], 2));
    narrow(&quads[quads.len() - 1..], gap);
    Case { rims, ..case(&quads, true) }
}

/// A room with a turned block, looked at from points as near as 1e-12 to the edges of faces.
fn near_edges(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let mut quads = walls(DVec3::ONE);
    let (turn, half) = (r.turn(), DVec3::new(0.2, 0.15, 0.1));
    let centre = DVec3::splat(0.5) + r.point(0.15);
    let place = |x: DVec3| centre + turn * x;
    quads.extend(box_quads(-half, half, true).into_iter().map(|q| (q.map(place), 0)));
    let mut made = case(&quads, true);
    made.points = beside_edges(&made.scene.triangles, &mut r, 60);
    made
}

/// Points of triangles that are near to their edges, and to their corners.
fn beside_edges(triangles: &[Triangle], r: &mut Random, count: usize) -> Vec<(DVec3, DVec3)> {
    (0..count)
        .map(|_| {
            let t = &triangles[r.below(triangles.len())];
            let k = r.below(3);
            let [a, b, c] = [0, 1, 2].map(|i| t.vertices[(k + i) % 3]);
            let near = 10f64.powf(-r.within(3.0, 12.0));
            let along = if r.below(4) == 0 { 2.0 * near } else { r.within(0.05, 0.95) };
            (a.lerp(b, along) + near * (c - a.lerp(b, along)), t.normal_and_area().0)
        })
        .collect()
}

/// Plates and blocks whose planes, or edges, pass points of the floor by 1 to 1e6 roundings, seen
/// from these points.
fn edge_on(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let mut quads = walls(DVec3::ONE);
    let mut points = vec![];
    for _ in 0..4 {
        let foot = DVec3::new(r.within(0.4, 0.6), r.within(0.4, 0.6), 0.0);
        let towards = DVec3::new(r.within(-0.5, 0.5), r.within(-0.5, 0.5), 1.0).normalize();
        let across = towards.cross(r.direction()).normalize();
        let n = towards.cross(across);
        let mut hair = || 1.8e-15 * 10f64.powf(r.within(0.0, 6.0));
        let off = hair() * n + hair() * across;
        let near = foot + r.within(0.1, 0.4) * towards + off;
        let turn = DMat3::from_cols(towards, across, n);
        let (long, wide) = (r.within(0.1, 0.3), r.within(0.02, 0.07));
        // The line along `towards` through y = z = 0 passes the point.
        let (low, high) = match r.below(3) {
            0 => (DVec3::new(0.0, -wide, -wide), DVec3::new(long, wide, 0.0)),
            _ => (DVec3::new(0.0, 0.0, -wide), DVec3::new(long, wide, 0.0)),
        };
        let block = box_quads(low, high, true);
        // All of the block, or its top alone.
        let sides = if r.below(2) == 0 { &block[..] } else { &block[1..2] };
        quads.extend(sides.iter().map(|q| (q.map(|x| near + turn * x), 2)));
        points.push((foot, DVec3::Z));
    }
    let mut made = case(&quads, true);
    made.points = points;
    made
}

/// Triangles and blocks in any place, a floor, nothing around: an open scene.
fn heap(seed: u64) -> Case {
    let mut r = Random::new(seed);
    let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let mut quads: Vec<(Quad, u32)> =
        vec![([p(-2.0, -2.0), p(2.0, -2.0), p(2.0, 2.0), p(-2.0, 2.0)], 0)];
    let lamp = |x: f64, y: f64| DVec3::new(x, y, 2.5);
    quads.push(([lamp(-0.5, -0.5), lamp(-0.5, 0.5), lamp(0.5, 0.5), lamp(0.5, -0.5)], 1));
    for _ in 0..2 + r.below(5) {
        let half = DVec3::new(r.within(0.1, 0.5), r.within(0.1, 0.5), r.within(0.1, 0.5));
        let (turn, centre) = (r.turn(), r.point(1.0) + 1.2 * DVec3::Z);
        let place = |x: DVec3| centre + turn * x;
        quads.extend(box_quads(-half, half, true).into_iter().map(|q| (q.map(place), 0)));
    }
    let mut made = case(&quads, false);
    for _ in 0..6 {
        let centre = r.point(1.0) + 1.2 * DVec3::Z;
        let corners = [0; 3].map(|_| centre + r.point(0.5));
        made.scene.triangles.push(triangle(corners, r.below(3) as u32));
    }
    made
}

/// A place in space: a scale, a rotation and a shift in sizes of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub scale: f64,
    pub turn: DMat3,
    /// In sizes of the scene.
    pub far: DVec3,
}

/// Where scenes are put: turned and scaled, then moved by 1e6 sizes.
pub fn places(seed: u64) -> ([Place; 4], [Place; 2]) {
    let mut r = Random::new(seed);
    let (turn, direction) = (r.turn(), r.direction());
    let at = |scale, turn, far| Place { scale, turn, far: far * direction };
    (
        [at(1.0, turn, 0.0), at(1e-6, turn, 0.0), at(1e6, turn, 0.0), at(1e3, turn, 1.0)],
        [at(1.0, DMat3::IDENTITY, 1e6), at(1e-3, turn, 1e6)],
    )
}

impl Place {
    /// The scene put there, with how points of it go there.
    pub fn put(&self, scene: &Scene) -> (Scene, impl Fn(DVec3) -> DVec3 + Sync + use<>) {
        let (scale, turn) = (self.scale, self.turn);
        let shift = scale * scene.extent() * self.far;
        let mut moved = rotated(scene, turn, scale, shift);
        // Coordinates are known as well as they can be.
        moved.rounding = 0.0;
        resolve_overlaps(&mut moved);
        (moved, move |x| scale * (turn * x) + shift)
    }
}
