//! One solution with direct light apart: a mesh, its operator, and what is ready for gathering.

use glam::DVec3;
use rayon::prelude::*;

use super::balance::balancing;
use super::direct::{DirectField, Fineness};
use super::levels::{Coarse, FastSolve, Start, prolonged, solve_fast};
use super::light::{Light, Source, range_of_rows};
use super::missed::missed;
use super::{Solution, SolveOptions};
use crate::cluster::Clusters;
use crate::error::Result;
use crate::mesh::{self, Mesh};
use crate::monitor::Monitor;
use crate::operator::FastOptions;
use crate::operator::beam::{Beam, Patch};
use crate::operator::gather::Radiant;
use crate::operator::walk::{Stage, Walker};
use crate::scene::Scene;
use crate::visibility::Occluders;

/// How a mesh is solved on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApartOptions {
    /// Representation of direct light.
    pub fineness: Fineness,
    /// The operator.
    pub fast: FastOptions,
    /// Stopping, relative to the mean irradiance.
    pub solve: SolveOptions,
    /// About the mean irradiance, W/m^2.
    pub mean: DVec3,
    /// Bytes that the operator may take.
    pub max_memory: u64,
    /// Gather indirect light at the nodes from the coarser solution instead of solving; errors that a
    /// cell may make, W/m^2.
    pub sweep: Option<f64>,
}

/// Share of the squared difference between two solutions that is left where it is.
const LEFT: f64 = 0.03;

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
    counts: Vec<(&'static str, u64)>,
    stored: Stored,
}

/// What is known of the operator that was solved with.
#[derive(Clone, Default)]
struct Stored {
    entries: usize,
    bytes: usize,
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
        let field = DirectField::new(scene, stage, emitters, &options.fineness, monitor)?;
        let (reflectance, _) = mesh::appearance(scene, &mesh);
        let coarse =
            coarser.map(|c| Coarse { mesh: &c.mesh, clusters: &c.clusters, solution: &c.solution });
        let once = field.reflected_once();
        let first = field.at_nodes(&once, &mesh);
        let mut counts = vec![("cells of direct light", field.len() as u64)];
        let (solution, stored) = match (coarser, options.sweep) {
            (Some(coarser), Some(allowed)) => {
                let w = coarser.swept(stage, allowed, monitor)?;
                let reflected = first.iter().zip(&reflectance).zip(&w);
                let radiosity = reflected.map(|((b, rho), w)| *b + *rho * *w).collect();
                (Solution { radiosity, irradiance: w, ..coarser.solution.clone() }, None)
            }
            _ => {
                let least = options.fineness.deviation;
                let missed = missed((&field, &once), stage, &reflectance, least, monitor)?;
                drop(once);
                let spots = missed.as_ref().map_or(&[][..], |missed| &missed.elements);
                counts.push(("elements with spots", spots.len() as u64));
                let mut sent = first;
                if let Some(missed) = &missed {
                    for ((b, rho), w) in sent.iter_mut().zip(&reflectance).zip(&missed.irradiance) {
                        *b += *rho * *w;
                    }
                }
                let how = FastSolve {
                    start: coarse.as_ref().map_or(Start::Unknown, Start::Coarse),
                    fast: options.fast,
                    solve: options.solve.relative_to(options.mean, sent.iter().copied()),
                    max_memory: options.max_memory,
                };
                let solved = solve_fast(stage, &reflectance, &sent, &how, monitor)?;
                counts.extend(solved.operator.counts());
                counts.extend(&solved.counts);
                counts.push(("channels solved", solved.solution.channels as u64));
                let sums = solved.operator.row_sums(mesh.nodes());
                let stored = Stored {
                    entries: solved.operator.entries(),
                    bytes: solved.operator.bytes(),
                    seconds: solved.operator.seconds(),
                    row_sums: range_of_rows(&sums, &mesh, &solved.receives),
                };
                let mut solution = solved.solution;
                let accuracy = options.fast.tolerance;
                let factor = balancing(
                    &mesh,
                    &solved.operator,
                    &sums,
                    &reflectance,
                    &solution,
                    spots,
                    accuracy,
                );
                let nodes = solution.radiosity.iter_mut().zip(&mut solution.irradiance);
                for ((b, w), rho) in nodes.zip(&reflectance) {
                    *b += *rho * (factor - 1.0) * *w;
                    *w *= factor;
                }
                if let Some(missed) = &missed {
                    for (w, missed) in solution.irradiance.iter_mut().zip(&missed.irradiance) {
                        *w += *missed;
                    }
                }
                (solution, Some(stored))
            }
        };
        let stored = stored.or_else(|| coarser.map(|c| c.stored.clone())).unwrap_or_default();
        let reflected = Radiant::new(stage, field.reflected(&mesh, &solution.irradiance));
        let direct = field.at_nodes(&field.irradiance(), &mesh);
        Ok(Apart { reflected, solution, reflectance, direct, counts, stored, clusters, mesh })
    }

    /// The surface that points look at.
    pub fn stage<'a>(&'a self, occluders: &'a Occluders) -> Stage<'a> {
        Stage { mesh: &self.mesh, clusters: &self.clusters, occluders }
    }

    /// About how much the reflected radiosity varies over a root, W/m^2: the range of its linear fit,
    /// and three times its rms deviation from that.
    pub fn variation(&self, root: usize) -> f64 {
        let field = &self.reflected.field;
        // The interior nodes at 1/6 span half of the triangle.
        let [a, b, c] = field.fits[root].map(DVec3::from_array);
        let range = 2.0 * (a.max(b).max(c) - a.min(b).min(c));
        range.max_element() + 3.0 * field.deviation[root]
    }

    /// Indirect irradiance at the nodes of a finer mesh, gathered: one step of iterated collocation.
    fn swept(&self, finer: Stage, allowed: f64, monitor: &Monitor) -> Result<Vec<DVec3>> {
        let nodes = finer.mesh.basis.nodes();
        let stage = self.stage(finer.occluders);
        let each: Vec<Vec<DVec3>> = (0..self.mesh.elements())
            .into_par_iter()
            .map_init(Walker::default, |walker, element| {
                monitor.check()?;
                let root = self.mesh.element_root[element] as usize;
                let (own, below) = (&self.mesh.roots[root], &finer.mesh.roots[root]);
                let frame = &self.mesh.face_of(element).frame;
                let corners = self.mesh.element_corners[element].map(|x| frame.lift(x));
                let beam =
                    Beam::new(&self.reflected, stage, &Patch::new(corners, frame.n), allowed);
                let many = 1 << (2 * (below.level - own.level));
                let first = below.first as usize + (element - own.first as usize) * many;
                let gather = |node| {
                    let (point, normal) = finer.mesh.node(node);
                    beam.gather(&self.reflected, walker, stage, point, normal, allowed)
                };
                Ok((first * nodes..(first + many) * nodes).map(gather).collect())
            })
            .collect::<Result<_>>()?;
        Ok(each.concat())
    }

    /// The mesh with one level more on the roots that hold nearly all of the squared difference in
    /// indirect irradiance between this solution and a coarser one.
    pub(super) fn refined_where_it_differs(&self, coarser: &Apart) -> Result<Mesh> {
        let before = prolonged(&self.mesh, &coarser.mesh, &coarser.solution.irradiance);
        let mut squares = vec![0.0; self.mesh.roots.len()];
        for (node, (w, before)) in self.solution.irradiance.iter().zip(&before).enumerate() {
            let element = node / self.mesh.basis.nodes();
            let root = self.mesh.element_root[element] as usize;
            squares[root] += self.mesh.area(element) * (*w - *before).length_squared();
        }
        let total: f64 = squares.iter().sum();
        let mut order: Vec<usize> = (0..squares.len()).collect();
        order.sort_by(|&a, &b| squares[a].total_cmp(&squares[b]).then(a.cmp(&b)));
        let mut levels: Vec<u32> = self.mesh.roots.iter().map(|r| r.level + 1).collect();
        let mut left = 0.0;
        for root in order {
            left += squares[root];
            if left > LEFT * total {
                break;
            }
            levels[root] -= 1;
        }
        self.mesh.with_levels(&levels)
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
            entries: self.stored.entries,
            bytes: self.stored.bytes,
            counts: self.counts,
            seconds: self.stored.seconds,
            row_sums: self.stored.row_sums,
        }
    }
}
