//! Solving with the fast operator: coarse meshes tell what fine ones need.
//!
//! How fine the clusters of a link must be depends on the radiosity: on how far it is from linear on
//! each cluster. A solution on a mesh of a sixteenth as many elements tells, and is where the
//! iteration on the finer one starts; it was found in the same way. Whether the deviations were as
//! expected is checked with the solution at hand, and what was taken too coarsely is built again.

use glam::DVec3;
use rayon::prelude::*;

use super::{Solution, SolveOptions, solve};
use crate::cluster::Clusters;
use crate::cluster::fit::{Deviation, deviations};
use crate::error::Result;
use crate::mesh::{self, Mesh};
use crate::monitor::Monitor;
use crate::operator::reach::lit;
use crate::operator::{Demand, FastOperator, FastOptions, Operator, Stage};
use crate::scene::Scene;

/// Levels between a mesh and the coarser one that it starts from.
const STEP: u32 = 2;

/// A mesh of at most this many elements needs no coarser one.
const COARSEST: usize = 1000;

/// A coarse solution may be this much less accurate.
const LOOSER: f64 = 10.0;

/// Deviations of a solution may be this many times those that its operator was built for.
const SURPRISE: f64 = 2.0;

/// How often an operator is built again.
const MOST_REPEATS: u64 = 3;

/// How to solve.
#[derive(Clone, Copy)]
pub struct FastSolve<'a> {
    /// Where the iteration starts.
    pub start: Start<'a>,
    /// The operator.
    pub fast: FastOptions,
    /// Stopping.
    pub solve: SolveOptions,
    /// Bytes that the operator may take.
    pub max_memory: u64,
}

/// What is known of a solution before it is sought.
#[derive(Clone, Copy)]
pub enum Start<'a> {
    /// Nothing: coarser meshes are solved on first, with the lights of the scene.
    Scene(&'a Scene),
    /// Nothing, and it is not worth a coarser mesh.
    Unknown,
    /// A solution on a coarser mesh with the same roots.
    Coarse(&'a Coarse<'a>),
}

/// A solution on a mesh.
pub struct Coarse<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Its clusters.
    pub clusters: &'a Clusters,
    /// The solution.
    pub solution: &'a Solution,
}

/// A solution and its operator.
pub struct FastSolved<'a> {
    /// The operator.
    pub operator: Operator<'a>,
    /// The solution.
    pub solution: Solution,
    /// Roots whose irradiance is known: those that reflect what reaches them, and their patches.
    pub receives: Vec<bool>,
    /// What was left out and done again, by name.
    pub counts: Vec<(&'static str, u64)>,
}

/// Which roots take part.
struct Active {
    /// They send out light.
    sends: Vec<bool>,
    /// Their irradiance is needed.
    receives: Vec<bool>,
    /// How many reflect nothing, and how many others no light reaches.
    black: u64,
    dark: u64,
}

/// What is expected of a solution before it is there.
struct Expected {
    /// Of each cluster, W/m^2.
    deviation: Vec<Deviation>,
    largest_irradiance: f64,
    guess: Option<Vec<DVec3>>,
}

/// Solves for the light of a scene on a mesh.
pub fn solve_fast<'a>(
    stage: Stage<'a>,
    reflectance: &[DVec3],
    exitance: &[DVec3],
    how: &FastSolve,
    monitor: &Monitor,
) -> Result<FastSolved<'a>> {
    let Stage { mesh, clusters, .. } = stage;
    let active = active(stage, reflectance, exitance);
    let mut expected = expect(stage, how, monitor)?;
    let mut builds: u64 = 0;
    loop {
        let demand = Demand::new(
            &how.fast,
            &expected.deviation,
            expected.largest_irradiance,
            &active.sends,
            &active.receives,
        );
        let operator = FastOperator::build(stage, &demand, how.max_memory, monitor)?;
        let operator = Operator::Fast(Box::new(operator));
        builds += 1;
        let guess = expected.guess.as_deref();
        let solution = solve(&operator, reflectance, exitance, guess, &how.solve, monitor)?;
        let values: Vec<[f64; 3]> = solution.radiosity.iter().map(|u| u.to_array()).collect();
        let deviation = deviations(mesh, clusters, &values);
        let largest = largest_irradiance(&solution);
        let Operator::Fast(fast) = &operator else { unreachable!("made above") };
        let allowed = SURPRISE * how.fast.allowed(largest);
        if fast.largest_link_error(&deviation) <= allowed || builds > MOST_REPEATS {
            let counts = vec![
                ("operator builds", builds),
                ("roots that reflect nothing", active.black),
                ("roots that no light reaches", active.dark),
            ];
            return Ok(FastSolved { operator, solution, receives: active.receives, counts });
        }
        let larger = |(a, b): (Deviation, &Deviation)| a.or_larger(*b);
        expected = Expected {
            deviation: deviation.into_iter().zip(&expected.deviation).map(larger).collect(),
            largest_irradiance: largest,
            guess: Some(solution.radiosity),
        };
    }
}

/// Largest irradiance at a node, of all channels.
pub fn largest_irradiance(solution: &Solution) -> f64 {
    solution.irradiance.iter().map(|h| h.max_element()).fold(0.0, f64::max)
}

fn active(stage: Stage, reflectance: &[DVec3], exitance: &[DVec3]) -> Active {
    let mesh = stage.mesh;
    let any = |values: &[DVec3]| -> Vec<bool> {
        mesh.roots
            .iter()
            .map(|root| {
                let nodes = mesh.basis.nodes();
                let first = root.first as usize * nodes;
                let own = &values[first..first + (nodes << (2 * root.level))];
                own.iter().any(|v| *v != DVec3::ZERO)
            })
            .collect()
    };
    let (reflects, emits) = (any(reflectance), any(exitance));
    let sends = lit(stage, &emits, &reflects);
    // Values are averaged over a patch: all of it, or nothing.
    let mut patches = vec![false; mesh.roots.len()];
    for (r, root) in mesh.roots.iter().enumerate() {
        patches[root.patch as usize] |= reflects[r] && sends[r];
    }
    let receives = mesh.roots.iter().map(|root| patches[root.patch as usize]).collect();
    let black = reflects.iter().filter(|r| !**r).count() as u64;
    let dark = reflects.iter().zip(&sends).filter(|(r, s)| **r && !**s).count() as u64;
    Active { sends, receives, black, dark }
}

/// What a coarser mesh tells of the solution.
fn expect(stage: Stage, how: &FastSolve, monitor: &Monitor) -> Result<Expected> {
    let Stage { mesh, clusters, occluders } = stage;
    let unknown = |n: usize| Expected {
        deviation: vec![Deviation::UNKNOWN; n],
        largest_irradiance: 0.0,
        guess: None,
    };
    let scene = match how.start {
        Start::Coarse(coarse) => return Ok(known_from(stage, coarse)),
        Start::Scene(scene) if mesh.elements() > COARSEST => scene,
        Start::Scene(_) | Start::Unknown => return Ok(unknown(clusters.len())),
    };
    let coarse = mesh.coarsened(STEP)?;
    if 2 * coarse.elements() > mesh.elements() {
        return Ok(unknown(clusters.len()));
    }
    let coarse_clusters = Clusters::build(&coarse);
    let (reflectance, exitance) = mesh::appearance(scene, &coarse);
    let tolerance = (LOOSER * how.fast.tolerance).min(1e-2);
    let looser = FastSolve {
        fast: FastOptions { tolerance, ..how.fast },
        solve: SolveOptions { residual: how.solve.residual.max(tolerance), ..how.solve },
        ..*how
    };
    let coarse_stage = Stage { mesh: &coarse, clusters: &coarse_clusters, occluders };
    let solved = solve_fast(coarse_stage, &reflectance, &exitance, &looser, monitor)?;
    let solution = &solved.solution;
    Ok(known_from(stage, &Coarse { mesh: &coarse, clusters: &coarse_clusters, solution }))
}

fn known_from(stage: Stage, coarse: &Coarse) -> Expected {
    let radiosity = &coarse.solution.radiosity;
    let values: Vec<[f64; 3]> = radiosity.iter().map(|u| u.to_array()).collect();
    let known = deviations(coarse.mesh, coarse.clusters, &values);
    Expected {
        deviation: refined(stage, (coarse.mesh, coarse.clusters), &known),
        largest_irradiance: largest_irradiance(coarse.solution),
        guess: Some(prolonged(stage.mesh, coarse.mesh, radiosity)),
    }
}

/// Deviations on a finer mesh: those of the coarser one where it has clusters of elements; below,
/// each level gains as much as the last one known there did: half where a shadow line bends the
/// light, nothing where light jumps. (Where all is smooth a quarter is left; half is supposed.)
fn refined(
    stage: Stage,
    (coarse, tree): (&Mesh, &Clusters),
    known: &[Deviation],
) -> Vec<Deviation> {
    let Stage { mesh, clusters, .. } = stage;
    let mut deviation = vec![Deviation::UNKNOWN; clusters.len()];
    for (root, r) in mesh.roots.iter().enumerate() {
        let known_depths = coarse.roots[root].level;
        if known_depths == 0 {
            continue;
        }
        let of_coarse = |depth: u32, index: u32| known[tree.number(root, depth, index) as usize];
        for depth in 0..=r.level {
            for index in 0..1u32 << (2 * depth) {
                let own = clusters.number(root, depth, index) as usize;
                deviation[own] = if depth < known_depths {
                    of_coarse(depth, index)
                } else {
                    let last = index >> (2 * (depth - known_depths + 1));
                    let gain = match known_depths {
                        1 => 1.0,
                        d => of_coarse(d - 1, last).mean / of_coarse(d - 2, last / 4).mean,
                    };
                    // Of nothing to nothing nothing is known, nor needed.
                    let gain = if gain >= 0.5 { gain.min(1.0) } else { 0.5 };
                    let above = deviation[clusters.number(root, depth - 1, index / 4) as usize];
                    Deviation { largest: gain * above.largest, mean: gain * above.mean }
                };
            }
        }
    }
    deviation
}

/// A coarse solution at the nodes of the finer mesh.
pub fn prolonged(mesh: &Mesh, coarse: &Mesh, values: &[DVec3]) -> Vec<DVec3> {
    let basis = mesh.basis;
    (0..mesh.nodes())
        .into_par_iter()
        .map(|node| {
            let (element, k) = (node / basis.nodes(), node % basis.nodes());
            let root = mesh.element_root[element] as usize;
            let (fine, rough) = (&mesh.roots[root], &coarse.roots[root]);
            let levels = fine.level - rough.level;
            let parent = rough.first as usize + ((element - fine.first as usize) >> (2 * levels));
            let [v1, v2, v3] = mesh.element_corners[element];
            let w = basis.node(k);
            let x = w.x * v1 + w.y * v2 + w.z * v3;
            let phi = basis.values(coarse.weights(parent, x));
            let own = &values[parent * basis.nodes()..][..basis.nodes()];
            own.iter().zip(phi).map(|(u, phi)| phi * *u).sum()
        })
        .collect()
}
