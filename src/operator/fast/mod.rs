//! The fast operator: both sides clustered, O(n) work and storage at a fixed tolerance.
//!
//! The product has two parts. Far pairs of clusters ([`super::pairs`]) interact through
//! interpolation nodes ([`crate::far::interpolation`]): moments go up the quadtrees, a matrix
//! takes them across, values go down (an H^2 matrix). Everything else are links of nodes to
//! clusters ([`super::links`]), integrated exactly over what is visible of a cluster, on which the
//! radiosity is taken for linear where its deviation from that allows it: gray pairs need not go
//! down to the elements, which is where the O(n sqrt n) of AC (3.12) comes from.

mod collect;
pub mod forecast;
mod gather;
mod options;
mod slots;
mod store;

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use self::collect::{Collector, Seconds};
use self::slots::{NONE, Slots};
use self::store::{FarPairs, Links};
use super::pairs::{Cell, Descent, PairCounts, Pending, Rules, sources_of};
use super::walk::Stage;
use crate::cluster::fit::{Deviation, Fit, fits};
use crate::error::{Error, Result};
use crate::far::Interpolation;
use crate::far::interpolation::DIRECT_LEVELS;
use crate::geometry::triangle_area;
use crate::kernel::Precision;
use crate::mesh::{Mesh, Root};
use crate::monitor::Monitor;

pub use gather::FitSource;
pub use options::{Demand, FastOptions};

/// Links of this precision or looser are kept in f32.
const SINGLE_FROM: f64 = 1e-8;

/// Levels of the clusters whose rows one task builds: 256 elements.
const TASK_LEVEL: u32 = 4;

/// See the module's text.
pub struct FastOperator<'a> {
    stage: Stage<'a>,
    interpolation: Interpolation,
    far: Vec<FarPairs>,
    blocks: Vec<Block>,
    sources: Slots,
    receivers: Slots,
    /// For each receiving slot its pairs.
    arrivals: Vec<Vec<Arrival>>,
    /// How pairs were settled.
    pub counts: PairCounts,
    /// How long that took.
    pub seconds: Seconds,
}

/// Rows of the elements of one cluster.
struct Block {
    /// First node and number of nodes.
    nodes: (usize, usize),
    links: Links,
    /// Receiving clusters whose values go straight to nodes of this block: slot, levels, node.
    down: Vec<(u32, u32, u32)>,
}

/// A far pair as its receiver sees it.
#[derive(Clone, Copy)]
struct Arrival {
    /// Chunk of the far field, and first column there.
    chunk: u32,
    column: u32,
    /// Number of the cluster when it is represented by its fit, else slot of the source.
    source: u32,
    by_fit: bool,
}

/// What has been stored so far.
struct Memory<'a> {
    taken: AtomicU64,
    /// Receivers done, and in all.
    done: AtomicU64,
    total: u64,
    allowed: u64,
    mesh: &'a Mesh,
}

impl Memory<'_> {
    fn take(&self, bytes: usize) -> Result<()> {
        let taken = self.taken.fetch_add(bytes as u64, Ordering::Relaxed) + bytes as u64;
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if taken <= self.allowed {
            return Ok(());
        }
        // Others take about as much.
        let needed = (taken as f64 * self.total.max(done) as f64 / done as f64) as u64;
        Err(Error::Memory {
            what: format!("the operator of {} elements", self.mesh.elements()),
            needed,
            allowed: self.allowed,
            remedy: "choose larger elements (--max-edge, --subdivide), a larger \
                     --operator-tolerance, or raise --max-memory"
                .into(),
        })
    }
}

impl<'a> FastOperator<'a> {
    /// Descends all pairs, links and expands, in at most `max_memory` bytes.
    pub fn build(
        stage: Stage<'a>,
        demand: &Demand,
        max_memory: u64,
        monitor: &Monitor,
    ) -> Result<FastOperator<'a>> {
        let Stage { mesh, .. } = stage;
        let interpolation = Interpolation::new(demand.order, mesh.basis);
        let receiving = |(r, root): (usize, &Root)| {
            if demand.receives[r] { 1u64 << (2 * root.level.saturating_sub(TASK_LEVEL)) } else { 0 }
        };
        let memory = Memory {
            taken: AtomicU64::new(0),
            done: AtomicU64::new(0),
            total: mesh.roots.iter().enumerate().map(receiving).sum(),
            allowed: max_memory,
            mesh,
        };
        // Integrals of links cost about twenty times as much as entries of a matrix.
        let n = interpolation.count();
        let link_levels = (0..8).take_while(|l| mesh.basis.nodes() << (2 * l) <= n).count() as u32;
        let rules = Rules {
            eta: demand.eta,
            deviation: demand.deviation,
            allowed: demand.allowed,
            link_levels: link_levels.saturating_sub(1),
            few_links: n * n / 20 / mesh.basis.nodes(),
            sends: demand.sends,
        };
        let single = demand.precision >= SINGLE_FROM;
        let collector = || {
            let precision = Precision::within(demand.precision);
            Collector::new(stage, &interpolation, precision, single)
        };
        let roots: Vec<u32> =
            (0..mesh.roots.len() as u32).filter(|&r| demand.receives[r as usize]).collect();
        let progress = monitor.stage("pairs", roots.len() as u64);
        let descend = |collector: &mut Collector, receiver: &Cell, pending, task_level| {
            let start = Instant::now();
            let counts = PairCounts::default();
            let mut descent =
                Descent { stage, rules, task_level, pending, counts, out: &mut *collector };
            descent.visit(receiver, 0);
            let counts = descent.counts;
            let mut seconds = std::mem::take(&mut collector.seconds);
            seconds.all = start.elapsed().as_secs_f64();
            (collector.take(), counts, seconds)
        };
        let upper: Vec<_> = roots
            .par_iter()
            .map_init(collector, |collector, &root| {
                let receiver = Cell::root(stage, root);
                let mut counts = PairCounts::default();
                let pending = sources_of(stage, &receiver, demand.sends, &mut counts);
                progress.advance(1)?;
                if receiver.level <= TASK_LEVEL {
                    return Ok((None, counts, Seconds::default(), vec![(receiver, pending)]));
                }
                let ((far, _), own, seconds) =
                    descend(collector, &receiver, pending, Some(TASK_LEVEL));
                counts += own;
                Ok((Some(far), counts, seconds, std::mem::take(&mut collector.tasks)))
            })
            .collect::<Result<_>>()?;
        let (mut counts, mut seconds) = (PairCounts::default(), Seconds::default());
        let (mut far, mut tasks): (Vec<FarPairs>, Vec<(Cell, Pending)>) = (vec![], vec![]);
        for (pairs, own, time, list) in upper {
            far.extend(pairs);
            counts += own;
            seconds += time;
            tasks.extend(list);
        }
        let progress = monitor.stage("rows", tasks.len() as u64);
        let lower: Vec<_> = tasks
            .into_par_iter()
            .map_init(collector, |collector, (receiver, pending)| {
                let ((far, links), counts, seconds) = descend(collector, &receiver, pending, None);
                progress.advance(1)?;
                memory.take(far.bytes() + links.bytes())?;
                let basis = mesh.basis.nodes();
                let first = receiver.first_element(stage) as usize * basis;
                let nodes = (first, basis << (2 * receiver.level));
                Ok((far, counts, seconds, Block { nodes, links, down: vec![] }))
            })
            .collect::<Result<_>>()?;
        let mut blocks = vec![];
        for (pairs, own, time, block) in lower {
            far.push(pairs);
            counts += own;
            seconds += time;
            blocks.push(block);
        }
        let mut operator = FastOperator {
            stage,
            interpolation,
            far,
            blocks,
            sources: Slots::default(),
            receivers: Slots::default(),
            arrivals: vec![],
            counts,
            seconds,
        };
        operator.arrange();
        Ok(operator)
    }

    /// Gives slots to the clusters of the far field.
    fn arrange(&mut self) {
        let Stage { mesh, clusters, .. } = self.stage;
        let (mut receives, mut sends) = (vec![NONE; clusters.len()], vec![NONE; clusters.len()]);
        for pair in self.far.iter().flat_map(|f| &f.pairs) {
            receives[pair.receiver as usize] = 0;
            if !pair.by_fit {
                sends[pair.source as usize] = 0;
            }
        }
        self.sources = Slots::new(self.stage, &mut sends, false);
        self.receivers = Slots::new(self.stage, &mut receives, true);
        self.arrivals = vec![vec![]; self.receivers.clusters.len()];
        for (chunk, far) in self.far.iter().enumerate() {
            for pair in &far.pairs {
                let source = pair.source;
                self.arrivals[receives[pair.receiver as usize] as usize].push(Arrival {
                    chunk: chunk as u32,
                    column: pair.column,
                    source: if pair.by_fit { source } else { sends[source as usize] },
                    by_fit: pair.by_fit,
                });
            }
        }
        let basis = mesh.basis.nodes();
        for (slot, c) in self.receivers.clusters.iter().enumerate() {
            if c.level > DIRECT_LEVELS {
                continue;
            }
            let element = mesh.roots[c.root as usize].first + (c.index << (2 * c.level));
            let node = element as usize * basis;
            let block = self.blocks.partition_point(|b| b.nodes.0 <= node) - 1;
            let from = (node - self.blocks[block].nodes.0) as u32;
            self.blocks[block].down.push((slot as u32, c.level, from));
        }
    }

    /// Links stored.
    pub fn links(&self) -> usize {
        self.blocks.iter().map(|b| b.links.clusters.len()).sum()
    }

    /// Far pairs stored.
    pub fn far_pairs(&self) -> usize {
        self.far.iter().map(|f| f.pairs.len()).sum()
    }

    /// Bytes stored.
    pub fn bytes(&self) -> usize {
        self.far_bytes() + self.link_bytes()
    }

    fn far_bytes(&self) -> usize {
        self.far.iter().map(|f| f.bytes()).sum()
    }

    fn link_bytes(&self) -> usize {
        self.blocks.iter().map(|b| b.links.bytes()).sum()
    }

    /// How pairs were settled and what is stored, by name.
    pub fn named_counts(&self) -> Vec<(&'static str, u64)> {
        let counts = &self.counts;
        vec![
            ("pairs behind each other", counts.away),
            ("pairs hidden", counts.hidden),
            ("pairs clear of occluders", counts.clear),
            ("pairs with occluders between", counts.shaded),
            ("far pairs", self.far_pairs() as u64),
            ("far field bytes", self.far_bytes() as u64),
            ("links", self.links() as u64),
            ("link bytes", self.link_bytes() as u64),
        ]
    }

    /// Seconds that the parts took, by name.
    pub fn named_seconds(&self) -> Vec<(&'static str, f64)> {
        let Seconds { far, links, all } = self.seconds;
        vec![
            ("far field seconds", far),
            ("link seconds", links),
            ("pair seconds", all - far - links),
        ]
    }

    /// Largest product of a cluster's mean deviation and its form factor in any link of a node.
    pub fn largest_link_error(&self, deviation: &[Deviation]) -> f64 {
        let of_block = |block: &Block| {
            let mut largest: f64 = 0.0;
            block.links.form_factors(|cluster, factor| {
                largest = largest.max(deviation[cluster as usize].mean * factor);
            });
            largest
        };
        self.blocks.par_iter().map(of_block).reduce(|| 0.0, f64::max)
    }

    /// out = A u for C channels, one value a node.
    pub fn apply<const C: usize>(&self, u: &[[f64; C]], out: &mut [[f64; C]]) {
        let Stage { mesh, clusters, .. } = self.stage;
        let fits = fits(mesh, clusters, u);
        let moments = self.moments(u);
        let locals = self.locals(&moments, &fits);
        let n = self.interpolation.count();
        let mut slices = vec![];
        let mut rest = out;
        let mut at = 0;
        for block in &self.blocks {
            let (gap, after) = rest.split_at_mut(block.nodes.0 - at);
            gap.fill([0.0; C]);
            let (mine, after) = after.split_at_mut(block.nodes.1);
            slices.push(mine);
            (rest, at) = (after, block.nodes.0 + block.nodes.1);
        }
        rest.fill([0.0; C]);
        self.blocks.par_iter().zip(slices).for_each(|(block, out)| {
            out.fill([0.0; C]);
            for &(slot, level, node) in &block.down {
                let nodes = mesh.basis.nodes() << (2 * level);
                let local = &locals[slot as usize * n..][..n];
                self.interpolation.add_values(level, local, &mut out[node as usize..][..nodes]);
            }
            block.links.add(&fits, out);
        });
    }

    /// Moments of all radiating clusters that are needed.
    fn moments<const C: usize>(&self, u: &[[f64; C]]) -> Vec<[f64; C]> {
        let Stage { mesh, .. } = self.stage;
        let n = self.interpolation.count();
        let basis = mesh.basis.nodes();
        let slots = &self.sources;
        let mut all = vec![[0.0; C]; slots.clusters.len() * n];
        let mut begin = 0;
        for &(level, end) in &slots.levels {
            let (below, here) = all.split_at_mut(begin * n);
            here[..(end - begin) * n].par_chunks_mut(n).enumerate().for_each(|(k, moments)| {
                let slot = begin + k;
                let cluster = &slots.clusters[slot];
                if level <= DIRECT_LEVELS {
                    let root = &mesh.roots[cluster.root as usize];
                    let area = triangle_area(&root.corners) * 0.25f64.powi(cluster.depth as i32);
                    let first = (root.first + (cluster.index << (2 * level))) as usize * basis;
                    let u = &u[first..][..basis << (2 * level)];
                    self.interpolation.add_moments(level, area, u, moments);
                } else if let Some(first) = slots.kin[slot] {
                    for k in 0..4 {
                        let child = &below[(first as usize + k) * n..][..n];
                        self.interpolation.add_child(k, child, moments);
                    }
                }
            });
            begin = end;
        }
        all
    }

    /// Values at the nodes of all receiving clusters that are needed.
    fn locals<const C: usize>(&self, moments: &[[f64; C]], fits: &[Fit<C>]) -> Vec<[f64; C]> {
        let n = self.interpolation.count();
        let slots = &self.receivers;
        let mut all = vec![[0.0; C]; slots.clusters.len() * n];
        let mut begin = 0;
        for &(_, end) in &slots.levels {
            let (above, here) = all.split_at_mut(begin * n);
            here[..(end - begin) * n].par_chunks_mut(n).enumerate().for_each(|(k, local)| {
                let slot = begin + k;
                for arrival in &self.arrivals[slot] {
                    let source = arrival.source as usize;
                    let values = if arrival.by_fit {
                        &fits[source][..]
                    } else {
                        &moments[source * n..][..n]
                    };
                    self.far[arrival.chunk as usize].add(arrival.column, values, local);
                }
                if let Some(parent) = slots.kin[slot] {
                    let parent = &above[parent as usize * n..][..n];
                    let child = slots.clusters[slot].index as usize % 4;
                    self.interpolation.add_parent(child, parent, local);
                }
            });
            begin = end;
        }
        all
    }
}
