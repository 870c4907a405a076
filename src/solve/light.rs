//! From a scene to its light: mesh, occluders, operator, solution.

use glam::DVec3;

use super::{Solution, SolveOptions, solve};
use crate::cluster::Clusters;
use crate::error::Result;
use crate::mesh::{self, Mesh, MeshOptions};
use crate::monitor::Monitor;
use crate::operator::walk::{Counts, Stage, Walker, gather};
use crate::operator::{Operator, OperatorKind};
use crate::scene::Scene;
use crate::visibility::Occluders;

/// How a scene is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightOptions {
    /// Elements.
    pub mesh: MeshOptions,
    /// How the operator is represented.
    pub operator: OperatorKind,
    /// Stopping.
    pub solve: SolveOptions,
    /// Bytes that the operator may take.
    pub max_memory: u64,
}

/// A solved scene.
pub struct Light {
    /// The refined surface.
    pub mesh: Mesh,
    /// Its clusters.
    pub clusters: Clusters,
    /// What blocks light.
    pub occluders: Occluders,
    /// Reflectance rho at the nodes.
    pub reflectance: Vec<DVec3>,
    /// Exitance E at the nodes, W/m^2.
    pub exitance: Vec<DVec3>,
    /// Radiosity and irradiance at the nodes.
    pub solution: Solution,
    /// Bytes that were forecast for the operator before it was built.
    pub forecast: u64,
    /// Pairs of a node and an element that the operator stores.
    pub entries: usize,
    /// Bytes that the operator took.
    pub bytes: usize,
    /// What its rows met.
    pub counts: Counts,
    /// Smallest and largest sum of a row over pi: 1 where a node sees radiating sides all around.
    pub row_sums: (f64, f64),
}

/// Meshes a scene, builds the operator and solves for its light.
pub fn light(scene: &Scene, options: &LightOptions, monitor: &Monitor) -> Result<Light> {
    let mesh = mesh::build(scene, &options.mesh)?;
    let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
    let occluders = Occluders::build(&triangles);
    let (reflectance, exitance) = mesh::appearance(scene, &mesh);
    let clusters = Clusters::build(&mesh);
    let stage = Stage { mesh: &mesh, clusters: &clusters, occluders: &occluders };
    let operator = Operator::build(stage, options.operator, options.max_memory, monitor)?;
    let solution =
        solve(&|u, out| operator.apply(u, out), &reflectance, &exitance, &options.solve, monitor)?;
    let sums = operator.row_sums(mesh.nodes());
    let row_sums = sums.iter().fold((f64::MAX, f64::MIN), |(a, b), &s| (a.min(s), b.max(s)));
    Ok(Light {
        forecast: Operator::forecast(stage, options.operator),
        entries: operator.entries(),
        bytes: operator.bytes(),
        counts: operator.counts(),
        row_sums,
        clusters,
        mesh,
        occluders,
        reflectance,
        exitance,
        solution,
    })
}

impl Light {
    /// The surface that points look at.
    pub fn stage(&self) -> Stage<'_> {
        Stage { mesh: &self.mesh, clusters: &self.clusters, occluders: &self.occluders }
    }

    /// Irradiance at a point with a unit normal, by gathering the solution with exact visibility.
    pub fn irradiance(&self, walker: &mut Walker, point: DVec3, normal: DVec3) -> DVec3 {
        gather(walker, self.stage(), &self.solution.radiosity, point, normal)
    }
}
