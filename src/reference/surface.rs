//! The 5-piece surface of AC section 5.

use glam::{DVec2, DVec3};

use crate::cluster::Clusters;
use crate::error::{Error, Result};
use crate::mesh::{self, Basis, Mesh, MeshOptions, Refinement};
use crate::operator::walk::Stage;
use crate::scene::{Material, Object, Scene, Triangle};
use crate::visibility::Occluders;

/// Side of S1, of the plate S2/S3, and of S4.
pub const A: f64 = 5.0;
/// Side of the plate S2/S3.
pub const B: f64 = 2.0;
/// Side of S4.
pub const C: f64 = 1.0;

/// Number of a piece: S1 is 0.
pub type Piece = usize;

/// S1 = `[0,A]^2` in z = 0 facing up, S2 and S3 the bottom and the top of `[0,B]^2` in z = 1,
/// S4 = `[0,C]^2` in z = 2 facing down, S5 = {y = A, 0 <= x <= A, 0 <= z <= 1} facing S1.
///
/// Two triangles each: S1 to S4 along (0,0)-(max,max), S5 along (A,A,0)-(0,A,1).
pub fn scene() -> Scene {
    let square = |side: f64, z: f64, up: bool| {
        let p = |x: f64, y: f64| DVec3::new(x * side, y * side, z);
        let (o, x, y, xy) = (p(0.0, 0.0), p(1.0, 0.0), p(0.0, 1.0), p(1.0, 1.0));
        if up { [[o, x, xy], [o, xy, y]] } else { [[o, xy, x], [o, y, xy]] }
    };
    let w = |x: f64, z: f64| DVec3::new(x, A, z);
    let wall = [[w(0.0, 0.0), w(A, 0.0), w(0.0, 1.0)], [w(A, 0.0), w(A, 1.0), w(0.0, 1.0)]];
    let pieces = [
        square(A, 0.0, true),
        square(B, 1.0, false),
        square(B, 1.0, true),
        square(C, 2.0, false),
        wall,
    ];
    let triangles = pieces
        .iter()
        .enumerate()
        .flat_map(|(piece, pair)| pair.map(|vertices| (piece, vertices)))
        .map(|(piece, vertices)| Triangle {
            vertices,
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: piece as u32,
        })
        .collect();
    Scene {
        triangles,
        materials: vec![Material::plain("rho", DVec3::splat(super::manufactured::RHO))],
        objects: (1..=5).map(|k| Object { name: format!("S{k}") }).collect(),
        ..Scene::default()
    }
}

/// The surface, refined, with all that looking at it needs.
pub struct Surface {
    /// Elements.
    pub mesh: Mesh,
    /// Their clusters.
    pub clusters: Clusters,
    /// What blocks light.
    pub occluders: Occluders,
}

impl Surface {
    /// The surface with n = 10 * 4^levels elements.
    pub fn new(basis: Basis, levels: u32) -> Result<Surface> {
        let scene = scene();
        let options = MeshOptions { basis, refinement: Refinement::Levels(levels) };
        let mesh = mesh::build(&scene, &options)?;
        let triangles: Vec<_> = scene.triangles.iter().map(|t| t.vertices).collect();
        let clusters = Clusters::build(&mesh);
        Ok(Surface { mesh, clusters, occluders: Occluders::build(&triangles) })
    }

    /// The surface with n elements, n = 10, 40, 160, ...
    pub fn of_size(basis: Basis, n: usize) -> Result<Surface> {
        let levels = (0..mesh::DEEPEST).find(|&l| 10usize << (2 * l) == n);
        let levels = levels.ok_or_else(|| {
            Error::Usage(format!("the paper's surface has 10 * 4^k elements, not {n}"))
        })?;
        Surface::new(basis, levels)
    }

    /// For walking.
    pub fn stage(&self) -> Stage<'_> {
        Stage { mesh: &self.mesh, clusters: &self.clusters, occluders: &self.occluders }
    }

    /// The piece that an element belongs to: its triangle's pair.
    pub fn piece(&self, element: usize) -> Piece {
        self.mesh.face_of(element).triangle as usize / 2
    }
}
