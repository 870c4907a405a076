//! One solution with direct light apart: a mesh, its operator, and what is ready for gathering.

use glam::DVec3;

use super::direct::{DirectField, Fineness};
use super::levels::{Coarse, FastSolve, Start, solve_fast};
use super::light::{Light, Source, row_sums};
use super::{Solution, SolveOptions};
use crate::cluster::Clusters;
use crate::error::Result;
use crate::mesh::{self, Mesh};
use crate::monitor::Monitor;
use crate::operator::FastOptions;
use crate::operator::gather::Radiant;
use crate::operator::walk::Stage;
use crate::scene::Scene;
use crate::visibility::Occluders;

/// How a mesh is solved on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApartOptions {
    /// Representation of direct light.
    pub fineness: Fineness,
    /// The operator.
    pub fast: FastOptions,
    /// Stopping.
    pub solve: SolveOptions,
    /// Bytes that the operator may take.
    pub max_memory: u64,
}

/// A solution with direct light apart.
pub struct Apart {
    /// The mesh of indirect light, and its clusters.
    mesh: Mesh,
    clusters: Clusters,
    /// Reflected radiosity rho H, ready for gathering.
    pub reflected: Radiant,
    /// Radiosity that is reflected, as the mesh sees it, and indirect irradiance, at the nodes.
    solution: Solution,
    reflectance: Vec<DVec3>,
    /// Direct irradiance at the nodes.
    direct: Vec<DVec3>,
    entries: usize,
    bytes: usize,
    counts: Vec<(&'static str, u64)>,
    seconds: Vec<(&'static str, f64)>,
    row_sums: (f64, f64),
}

impl Apart {
    /// Solves on a mesh; `coarser` is a solution on a coarser one with the same roots.
    pub fn new(
        scene: &Scene,
        mesh: Mesh,
        occluders: &Occluders,
        emitters: &Radiant,
        coarser: Option<&Apart>,
        options: &ApartOptions,
        monitor: &Monitor,
    ) -> Result<Apart> {
        let clusters = Clusters::build(&mesh);
        let stage = Stage { mesh: &mesh, clusters: &clusters, occluders };
        let field = DirectField::new(scene, stage, emitters, &options.fineness)?;
        monitor.check()?;
        let (reflectance, _) = mesh::appearance(scene, &mesh);
        let coarse =
            coarser.map(|c| Coarse { mesh: &c.mesh, clusters: &c.clusters, solution: &c.solution });
        let how = FastSolve {
            start: coarse.as_ref().map_or(Start::Unknown, Start::Coarse),
            fast: options.fast,
            solve: options.solve,
            max_memory: options.max_memory,
        };
        let first = field.first_reflection(&mesh);
        let solved = solve_fast(stage, &reflectance, &first, &how, monitor)?;
        let (entries, bytes) = (solved.operator.entries(), solved.operator.bytes());
        let mut counts = solved.operator.counts();
        counts.extend(&solved.counts);
        counts.push(("channels solved", solved.solution.channels as u64));
        counts.push(("cells of direct light", field.len() as u64));
        let seconds = solved.operator.seconds();
        let row_sums = row_sums(&solved.operator, &mesh, &solved.receives);
        drop(solved.operator);
        let solution = solved.solution;
        let reflected = Radiant::new(stage, field.reflected(&mesh, &solution.irradiance));
        let direct = field.irradiance(&mesh);
        Ok(Apart {
            reflected,
            solution,
            reflectance,
            direct,
            entries,
            bytes,
            counts,
            seconds,
            row_sums,
            clusters,
            mesh,
        })
    }

    /// The surface that points look at.
    pub fn stage<'a>(&'a self, occluders: &'a Occluders) -> Stage<'a> {
        Stage { mesh: &self.mesh, clusters: &self.clusters, occluders }
    }

    /// Makes it the light of a scene: emitted and reflected light together again at the nodes.
    pub(super) fn into_light(
        self,
        scene: &Scene,
        occluders: Occluders,
        source: impl FnOnce(Radiant) -> Source,
    ) -> Light {
        let (_, exitance) = mesh::appearance(scene, &self.mesh);
        let mut solution = self.solution;
        for (h, direct) in solution.irradiance.iter_mut().zip(&self.direct) {
            *h += *direct;
        }
        let nodes = exitance.iter().zip(&self.reflectance).zip(&solution.irradiance);
        solution.radiosity = nodes.map(|((e, rho), h)| *e + *rho * *h).collect();
        Light {
            source: source(self.reflected),
            mesh: self.mesh,
            clusters: self.clusters,
            occluders,
            reflectance: self.reflectance,
            exitance,
            solution,
            forecast: None,
            entries: self.entries,
            bytes: self.bytes,
            counts: self.counts,
            seconds: self.seconds,
            row_sums: self.row_sums,
        }
    }
}
