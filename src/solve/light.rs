//! From a scene to its light: mesh, occluders, operator, solution.

use glam::DVec3;

use super::levels::{FastSolve, Start, largest_irradiance, solve_fast};
use super::within::Estimate;
use super::{Solution, SolveOptions, solve};
use crate::cluster::Clusters;
use crate::error::{Error, Result};
use crate::mesh::{self, Mesh, MeshOptions};
use crate::monitor::Monitor;
use crate::operator::bundles::RayScene;
use crate::operator::clustered::ClusteredSource;
use crate::operator::fast::FitSource;
use crate::operator::gather::Radiant;
use crate::operator::lamps::{Lamps, Place};
use crate::operator::ray_gather::{Enough, Estimated, RayCounts, RayRadiant, Sources};
use crate::operator::walk::{Stage, Walker, gather};
use crate::operator::{Operator, OperatorKind};
use crate::scene::Scene;
use crate::visibility::Occluders;

/// From so many roots on, memory is forecast before the fast operator is built.
pub(super) const FORECAST_FROM: usize = 2000;

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
    /// The radiosity made ready for gathering as the operator does.
    pub(super) source: Source,
    /// Bytes that were forecast for the operator before it was built, where that was done.
    pub forecast: Option<u64>,
    /// Pairs of a node and an element that the operator stores.
    pub entries: usize,
    /// Bytes that the operator took.
    pub bytes: usize,
    /// What its rows met, by name.
    pub counts: Vec<(&'static str, u64)>,
    /// Seconds of all threads that parts of the operator took, by name.
    pub seconds: Vec<(&'static str, f64)>,
    /// Smallest and largest sum of a row over pi: 1 where a node sees radiating sides all around.
    /// Of the fast operator, rows are those of surfaces that reflect, and dark sides are left out.
    pub row_sums: (f64, f64),
}

/// A solution as points gather it.
pub(super) enum Source {
    Exact,
    Fits(FitSource),
    Clustered(ClusteredSource),
    Apart(Box<ApartSource>),
}

/// Reflected light, ready for gathering.
pub enum Reflected {
    /// By cells, with exact visibility.
    Cells(Radiant),
    /// By bundles of rays.
    Rays(Box<RayRadiant>),
}

/// What gathering by rays needs.
pub struct RaySource {
    /// What rays meet.
    pub scene: RayScene,
    /// What emits.
    pub lamps: Lamps,
    /// How many rays are cast.
    pub counts: RayCounts,
    /// Share of the mean irradiance that is reflected light: what rays estimate at least.
    pub share: f64,
    /// What they are off by at the samples, root mean square, relative to the mean irradiance.
    pub error: f64,
    /// What they may be off by at many points, root mean square, W/m^2: what the solution left of the
    /// tolerance.
    pub allowed: f64,
    /// The same by the square root of their number ([`Enough::per_root`]), for points spread over all of the
    /// surface.
    pub per_root: f64,
}

/// A solution with direct light apart, made to a tolerance.
pub struct ApartSource {
    /// What emits: E.
    pub emitters: Radiant,
    /// What is reflected: rho H.
    pub reflected: Reflected,
    /// The same from the next coarser mesh, where there was one: what changed tells the error.
    pub coarser: Option<Reflected>,
    /// Where reflected light is gathered by rays.
    pub rays: Option<RaySource>,
    /// Errors that a cell may make in gathering reflected light, W/m^2.
    pub allowed: f64,
    /// Those in gathering emitted light.
    pub allowed_direct: f64,
    /// What is known of the error.
    pub estimate: Estimate,
    /// What was asked for.
    pub tolerance: f64,
    /// Why that was not reached, where it was not.
    pub shortfall: Option<String>,
    /// Whether refining was ended by the time limit.
    pub out_of_time: bool,
}

/// Meshes a scene, builds the operator and solves for its light.
pub fn light(scene: &Scene, options: &LightOptions, monitor: &Monitor) -> Result<Light> {
    let mesh = mesh::build(scene, &options.mesh)?;
    let triangles: Vec<[DVec3; 3]> = scene.triangles.iter().map(|t| t.vertices).collect();
    let occluders = Occluders::build(&triangles);
    let (reflectance, exitance) = mesh::appearance(scene, &mesh);
    let clusters = Clusters::build(&mesh);
    let stage = Stage { mesh: &mesh, clusters: &clusters, occluders: &occluders };
    // The fast operator keeps count of its memory as it grows: a forecast is worth its time where
    // that would take long.
    let fast = matches!(options.operator, OperatorKind::Fast(_));
    let forecast = (!fast || mesh.roots.len() > FORECAST_FROM)
        .then(|| Operator::forecast(stage, options.operator));
    if let Some(bytes) = forecast
        && fast
        && bytes > options.max_memory
    {
        return Err(Error::Memory {
            what: format!("the operator of {} elements", mesh.elements()),
            needed: bytes,
            allowed: options.max_memory,
            remedy: "choose a larger --operator-tolerance, a scene of fewer faces, or raise \
                     --max-memory"
                .into(),
        });
    }
    let (operator, solution, receives, left_out) = match options.operator {
        OperatorKind::Fast(fast) => {
            let how = FastSolve {
                start: Start::Scene(scene),
                fast,
                solve: options.solve,
                max_memory: options.max_memory,
            };
            let solved = solve_fast(stage, &reflectance, &exitance, &how, monitor)?;
            (solved.operator, solved.solution, solved.receives, solved.counts)
        }
        kind => {
            let operator = Operator::build(stage, kind, options.max_memory, monitor)?;
            let solution =
                solve(&operator, &reflectance, &exitance, None, &options.solve, monitor)?;
            (operator, solution, vec![true; mesh.roots.len()], vec![])
        }
    };
    let mut counts = operator.counts();
    counts.extend(left_out);
    counts.push(("channels solved", solution.channels as u64));
    let row_sums = range_of_rows(&operator.row_sums(mesh.nodes()), &mesh, &receives);
    let radiosity = &solution.radiosity;
    let source = match options.operator {
        OperatorKind::Exact => Source::Exact,
        OperatorKind::Fast(fast) => {
            let largest = largest_irradiance(&solution);
            Source::Fits(FitSource::new(stage, &fast, radiosity, largest))
        }
        OperatorKind::Clustered(clustering) => {
            Source::Clustered(ClusteredSource::new(stage, clustering, radiosity))
        }
    };
    Ok(Light {
        source,
        forecast,
        entries: operator.entries(),
        bytes: operator.bytes(),
        counts,
        seconds: operator.seconds(),
        row_sums,
        clusters,
        mesh,
        occluders,
        reflectance,
        exitance,
        solution,
    })
}

/// Smallest and largest sum of a row over pi, of roots that receive.
pub(super) fn range_of_rows(sums: &[f64], mesh: &Mesh, receives: &[bool]) -> (f64, f64) {
    sums.iter()
        .enumerate()
        .filter(|(node, _)| receives[mesh.element_root[node / mesh.basis.nodes()] as usize])
        .fold((f64::MAX, f64::MIN), |(a, b), (_, &s)| (a.min(s), b.max(s)))
}

/// A face that emits costs as much exactly as about so many rays and points of what emits.
const EXACT: u32 = 512;

/// Where rays and points of what emits are looked at together, so many times fewer of each come first: many
/// points need no more.
const OF_FIRST: u32 = 4;

impl RaySource {
    /// Irradiance from some `sources` at a point with a unit normal, with a spread that is
    /// `enough`. Emitted light is gathered exactly (from `emitters`, whose cells may make
    /// the error given with them) where that costs no more than the rays that it would take.
    pub fn gather(
        &self,
        sources: &Sources,
        (emitters, allowed_direct): (&Radiant, f64),
        walker: &mut Walker,
        stage: Stage,
        place: Place,
        enough: Enough,
    ) -> Estimated {
        let scene = (&self.scene, stage.mesh);
        if sources.emitted.is_none() {
            return sources.gather(walker, scene, place, enough, self.counts);
        }
        // As many points of what emits are looked at as rays are cast.
        let least = (self.counts.least / OF_FIRST).max(8);
        let most = EXACT.saturating_mul(self.lamps.len() as u32).next_power_of_two();
        if least <= most && self.lamps.are_even() {
            let counts = RayCounts { least, most: most.min(self.counts.most) };
            let found = sources.gather(walker, scene, place, enough, counts);
            if found.is_within(enough, counts.most) {
                return found;
            }
        }
        let direct = emitters.gather(walker, stage, place.point, place.normal, allowed_direct);
        if sources.reflected.is_none() {
            return Estimated::exactly(direct);
        }
        let reflected = Sources { emitted: None, ..*sources };
        let more = reflected.gather(walker, scene, place, enough, self.counts);
        Estimated { irradiance: direct + more.irradiance, ..more }
    }
}

impl ApartSource {
    /// Irradiance from `reflected` light (of this solution or the coarser one) at a point.
    pub fn gather_reflected(
        &self,
        reflected: &Reflected,
        walker: &mut Walker,
        stage: Stage,
        point: DVec3,
        normal: DVec3,
    ) -> DVec3 {
        match (reflected, &self.rays) {
            (Reflected::Cells(radiant), _) => {
                radiant.gather(walker, stage, point, normal, self.allowed)
            }
            (Reflected::Rays(radiant), Some(rays)) => {
                let sources = Sources::reflected(radiant, &rays.lamps);
                let (scene, place) = ((&rays.scene, stage.mesh), Place::new(point, normal));
                let enough = Enough::of(self.allowed);
                sources.gather(walker, scene, place, enough, rays.counts).irradiance
            }
            (Reflected::Rays(_), None) => DVec3::ZERO,
        }
    }
}

impl Light {
    /// The surface that points look at.
    pub fn stage(&self) -> Stage<'_> {
        Stage { mesh: &self.mesh, clusters: &self.clusters, occluders: &self.occluders }
    }

    /// What a light that was made to a tolerance is made of.
    pub fn apart(&self) -> Option<&ApartSource> {
        match &self.source {
            Source::Apart(source) => Some(source),
            _ => None,
        }
    }

    /// Irradiance at a point with a unit normal, by gathering the solution with exact visibility,
    /// and with the clusters of the operator where it had any.
    pub fn irradiance(&self, walker: &mut Walker, point: DVec3, normal: DVec3) -> DVec3 {
        match &self.source {
            Source::Fits(source) => source.gather(walker, self.stage(), point, normal),
            Source::Clustered(source) => source.gather(walker, self.stage(), point, normal),
            Source::Apart(source) => {
                let direct = &source.emitters;
                let stage = self.stage();
                direct.gather(walker, stage, point, normal, source.allowed_direct)
                    + source.gather_reflected(&source.reflected, walker, stage, point, normal)
            }
            Source::Exact => gather(walker, self.stage(), &self.solution.radiosity, point, normal),
        }
    }
}
