//! The fast operator: both sides clustered, O(n) work and storage at a fixed tolerance.
//!
//! The product has two parts. Far pairs of clusters ([`super::pairs`]) interact through
//! interpolation nodes ([`crate::far::interpolation`]): moments go up the quadtrees, a matrix
//! takes them across, values go down (an H^2 matrix). Everything else are links of nodes to
//! clusters ([`super::links`]), integrated exactly over what is visible of a cluster, on which the
//! radiosity is taken for linear where its deviation from that allows it: gray pairs need not go
//! down to the elements, which is where the O(n sqrt n) of AC (3.12) comes from.

use std::mem::size_of;

use rayon::prelude::*;

use super::links::{Linker, Rows};
use super::pairs::{Cell, Descent, PairCounts, Pending, Receiver, Rules, sources_of};
use super::walk::Stage;
use crate::cluster::fit::fits;
use crate::error::Result;
use crate::far::Interpolation;
use crate::far::interpolation::DIRECT_LEVELS;
use crate::geometry::Frame;
use crate::monitor::Monitor;

/// Levels of the clusters whose rows one task builds: 256 elements.
const TASK_LEVEL: u32 = 4;

/// What the operator has to be good for.
#[derive(Clone, Copy)]
pub struct Demand<'a> {
    /// Far where R_P + R_Q <= eta times the distance of the centres.
    pub eta: f64,
    /// Deviation of the radiosity from linear on each cluster, W/m^2.
    pub deviation: &'a [f64],
    /// Largest product of deviation and form factor in a link, W/m^2.
    pub allowed: f64,
    /// Precision of the integrals of links, relative to the irradiance; 0 for exact ones.
    pub precision: f64,
    /// Which roots radiate.
    pub sends: &'a [bool],
    /// Which roots need to know their irradiance.
    pub receives: &'a [bool],
}

/// Far pairs and the matrices between their nodes: entry j * N + i is G(x_i, y_j).
#[derive(Default)]
struct FarPairs {
    /// Numbers of the receiving and the radiating cluster.
    pairs: Vec<(u32, u32)>,
    matrices: Vec<f64>,
}

/// Rows of the elements of one cluster.
struct Block {
    /// First node and number of nodes.
    nodes: (usize, usize),
    rows: Rows,
    /// Receiving clusters whose values go straight to nodes of this block: slot, levels, node.
    down: Vec<(u32, u32, u32)>,
}

/// Clusters with far pairs, or above or below such, in an order in which work can go by levels.
#[derive(Default)]
struct Slots {
    /// Number of the cluster, its level, area, first element, parent's slot (or none) and which
    /// child of it this is.
    clusters: Vec<SlotCluster>,
    /// Slot of the first of four children, where they are needed.
    children: Vec<Option<u32>>,
    /// Ends of the levels.
    levels: Vec<(u32, usize)>,
}

#[derive(Clone, Copy)]
struct SlotCluster {
    number: u32,
    level: u32,
    root: u32,
    depth: u32,
    index: u32,
}

/// See the module's text.
pub struct FastOperator<'a> {
    stage: Stage<'a>,
    interpolation: Interpolation,
    far: Vec<FarPairs>,
    blocks: Vec<Block>,
    /// Radiating clusters, elements' parents first; receiving ones, roots first.
    sources: Slots,
    receivers: Slots,
    /// For each receiving slot its pairs: chunk of `far`, number in it, source slot.
    arrivals: Vec<Vec<(u32, u32, u32)>>,
    /// How pairs were settled.
    pub counts: PairCounts,
}

/// Collects what a descent finds.
struct Collector<'a, 'b> {
    stage: Stage<'a>,
    interpolation: &'b Interpolation,
    far: FarPairs,
    linker: Linker,
    rows: Rows,
    tasks: Vec<(Cell, Pending)>,
}

impl<'a, 'b> Collector<'a, 'b> {
    fn new(stage: Stage<'a>, interpolation: &'b Interpolation, precision: f64) -> Self {
        Collector {
            stage,
            interpolation,
            far: FarPairs::default(),
            linker: Linker::new(precision),
            rows: Rows::default(),
            tasks: vec![],
        }
    }
}

impl Receiver for Collector<'_, '_> {
    fn far(&mut self, receiver: &Cell, source: &Cell) {
        self.far.pairs.push((receiver.number, source.number));
        let faces = &self.stage.mesh.faces;
        transfer(
            self.interpolation,
            (&faces[receiver.face as usize].frame, receiver),
            (&faces[source.face as usize].frame, source),
            &mut self.far.matrices,
        );
    }

    fn links(&mut self, element: &Cell, pending: &Pending, from: usize) {
        self.linker.link(self.stage, element, pending, from, &mut self.rows);
    }

    fn task(&mut self, receiver: &Cell, pending: &Pending, from: usize) {
        let mut own = Pending::default();
        for source in &pending.sources[from..] {
            let mut source = *source;
            let begin = own.occluders.len() as u32;
            let (first, last) = source.between;
            own.occluders.extend(&pending.occluders[first as usize..last as usize]);
            source.between = (begin, own.occluders.len() as u32);
            own.sources.push(source);
        }
        self.tasks.push((*receiver, own));
    }
}

/// Appends G at all pairs of nodes: (height of x over the source) (height of y over the receiver)
/// / |x - y|^4.
fn transfer(
    interpolation: &Interpolation,
    (own, receiver): (&Frame, &Cell),
    (other, source): (&Frame, &Cell),
    matrix: &mut Vec<f64>,
) {
    let n = interpolation.count();
    let place = |cell: &Cell| {
        let [a, b, c] = cell.space;
        interpolation.nodes.iter().map(move |w| w.x * a + w.y * b + w.z * c)
    };
    let (mut x, mut y, mut z, mut height) = (vec![], vec![], vec![], vec![]);
    for p in place(receiver) {
        x.push(p.x);
        y.push(p.y);
        z.push(p.z);
        height.push(other.height(p));
    }
    matrix.reserve(n * n);
    for q in place(source) {
        let rise = own.height(q);
        matrix.extend((0..n).map(|i| {
            let (dx, dy, dz) = (x[i] - q.x, y[i] - q.y, z[i] - q.z);
            let s = dx * dx + dy * dy + dz * dz;
            rise * height[i] / (s * s)
        }));
    }
}

impl<'a> FastOperator<'a> {
    /// Descends all pairs, links and expands.
    pub fn build(
        stage: Stage<'a>,
        order: usize,
        demand: &Demand,
        monitor: &Monitor,
    ) -> Result<FastOperator<'a>> {
        let Stage { mesh, .. } = stage;
        let interpolation = Interpolation::new(order, mesh.basis);
        // Links of three coefficients to a node against one matrix: about as many entries.
        let n = interpolation.count();
        let rules = Rules {
            eta: demand.eta,
            deviation: demand.deviation,
            allowed: demand.allowed,
            link_levels: if n * n > 400 { 1 } else { 0 },
            sends: demand.sends,
        };
        let roots: Vec<u32> =
            (0..mesh.roots.len() as u32).filter(|&r| demand.receives[r as usize]).collect();
        let progress = monitor.stage("pairs", roots.len() as u64);
        let descent = |pending, task_level| Descent {
            stage,
            rules,
            task_level,
            pending,
            counts: PairCounts::default(),
            out: Collector::new(stage, &interpolation, demand.precision),
        };
        let upper: Vec<_> = roots
            .par_iter()
            .map(|&root| {
                let receiver = Cell::root(stage, root);
                let mut counts = PairCounts::default();
                let pending = sources_of(stage, &receiver, demand.sends, &mut counts);
                progress.advance(1)?;
                if receiver.level <= TASK_LEVEL {
                    return Ok((FarPairs::default(), counts, vec![(receiver, pending)]));
                }
                let mut descent = descent(pending, Some(TASK_LEVEL));
                descent.visit(&receiver, 0);
                counts += descent.counts;
                Ok((descent.out.far, counts, descent.out.tasks))
            })
            .collect::<Result<_>>()?;
        let mut counts = PairCounts::default();
        let (mut far, mut tasks) = (vec![], vec![]);
        for (pairs, own, list) in upper {
            far.push(pairs);
            counts += own;
            tasks.extend(list);
        }
        let progress = monitor.stage("rows", tasks.len() as u64);
        let lower: Vec<_> = tasks
            .into_par_iter()
            .map(|(receiver, pending)| {
                let mut descent = descent(pending, None);
                descent.visit(&receiver, 0);
                progress.advance(1)?;
                let Collector { mut far, mut rows, .. } = descent.out;
                far.pairs.shrink_to_fit();
                far.matrices.shrink_to_fit();
                rows.shrink();
                let basis = mesh.basis.nodes();
                let first = receiver.first_element(stage) as usize * basis;
                let nodes = (first, basis << (2 * receiver.level));
                Ok((far, descent.counts, Block { nodes, rows, down: vec![] }))
            })
            .collect::<Result<_>>()?;
        let mut blocks = vec![];
        for (pairs, own, block) in lower {
            far.push(pairs);
            counts += own;
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
        };
        operator.arrange();
        Ok(operator)
    }

    /// Gives slots to the clusters of the far field.
    fn arrange(&mut self) {
        let Stage { mesh, clusters, .. } = self.stage;
        const NONE: u32 = u32::MAX;
        let (mut receives, mut sends) = (vec![NONE; clusters.len()], vec![NONE; clusters.len()]);
        for &(p, q) in self.far.iter().flat_map(|f| &f.pairs) {
            (receives[p as usize], sends[q as usize]) = (0, 0);
        }
        self.sources = Slots::new(self.stage, &mut sends, false);
        self.receivers = Slots::new(self.stage, &mut receives, true);
        self.arrivals = vec![vec![]; self.receivers.clusters.len()];
        for (chunk, far) in self.far.iter().enumerate() {
            for (k, &(p, q)) in far.pairs.iter().enumerate() {
                self.arrivals[receives[p as usize] as usize].push((
                    chunk as u32,
                    k as u32,
                    sends[q as usize],
                ));
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
        self.blocks.iter().map(|b| b.rows.clusters.len()).sum()
    }

    /// Far pairs stored.
    pub fn far_pairs(&self) -> usize {
        self.far.iter().map(|f| f.pairs.len()).sum()
    }

    /// Bytes stored.
    pub fn bytes(&self) -> usize {
        let far: usize = self
            .far
            .iter()
            .map(|f| size_of::<f64>() * f.matrices.len() + size_of::<(u32, u32)>() * f.pairs.len())
            .sum();
        far + self.blocks.iter().map(|b| b.rows.bytes()).sum::<usize>()
    }

    /// out = A u for C channels, one value a node.
    pub fn apply_channels<const C: usize>(&self, u: &[[f64; C]], out: &mut [[f64; C]]) {
        let Stage { mesh, clusters, .. } = self.stage;
        let fits = fits(mesh, clusters, u);
        let moments = self.moments(u);
        let locals = self.locals(&moments);
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
            let rows = &block.rows;
            let mut begin = 0;
            for (out, &end) in out.iter_mut().zip(&rows.ends) {
                let end = end as usize;
                let mut sum = [0.0; C];
                for (&cluster, c) in
                    rows.clusters[begin..end].iter().zip(&rows.coefficients[begin..end])
                {
                    for (value, c) in fits[cluster as usize].iter().zip(c) {
                        for (s, v) in sum.iter_mut().zip(value) {
                            *s += c * v;
                        }
                    }
                }
                out.iter_mut().zip(sum).for_each(|(o, s)| *o += s);
                begin = end;
            }
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
                    let [a, b, c] = root.corners;
                    let area = 0.5 * (b - a).perp_dot(c - a) * 0.25f64.powi(cluster.depth as i32);
                    let first = (root.first + (cluster.index << (2 * level))) as usize * basis;
                    let u = &u[first..][..basis << (2 * level)];
                    self.interpolation.add_moments(level, area, u, moments);
                } else if let Some(first) = slots.children[slot] {
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
    fn locals<const C: usize>(&self, moments: &[[f64; C]]) -> Vec<[f64; C]> {
        let n = self.interpolation.count();
        let slots = &self.receivers;
        let mut all = vec![[0.0; C]; slots.clusters.len() * n];
        let mut begin = 0;
        for &(_, end) in &slots.levels {
            let (above, here) = all.split_at_mut(begin * n);
            here[..(end - begin) * n].par_chunks_mut(n).enumerate().for_each(|(k, local)| {
                let slot = begin + k;
                for &(chunk, pair, source) in &self.arrivals[slot] {
                    let matrix =
                        &self.far[chunk as usize].matrices[pair as usize * n * n..][..n * n];
                    let moments = &moments[source as usize * n..][..n];
                    for (column, m) in matrix.chunks_exact(n).zip(moments) {
                        for (l, g) in local.iter_mut().zip(column) {
                            for (l, m) in l.iter_mut().zip(m) {
                                *l += g * m;
                            }
                        }
                    }
                }
                if let Some(parent) = slots.children[slot] {
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

impl Slots {
    /// Slots for the clusters that are marked (0) in `slot_of`, and for those that they need:
    /// children of clusters above [`DIRECT_LEVELS`]. Writes the slots to `slot_of`.
    ///
    /// Sources come by ascending level, with the slots of their children in `children`; receivers
    /// by descending level, with the slots of their parents there.
    fn new(stage: Stage, slot_of: &mut [u32], receivers: bool) -> Slots {
        const NONE: u32 = u32::MAX;
        let Stage { mesh, clusters, .. } = stage;
        let mut list = vec![];
        for (root, r) in mesh.roots.iter().enumerate() {
            for depth in 0..=r.level {
                let level = r.level - depth;
                for index in 0..1u32 << (2 * depth) {
                    let number = clusters.number(root, depth, index);
                    if slot_of[number as usize] == NONE {
                        continue;
                    }
                    list.push(SlotCluster { number, level, root: root as u32, depth, index });
                    if level > DIRECT_LEVELS {
                        for k in 0..4 {
                            slot_of[clusters.number(root, depth + 1, 4 * index + k) as usize] = 0;
                        }
                    }
                }
            }
        }
        if receivers {
            list.sort_by_key(|c| std::cmp::Reverse(c.level));
        } else {
            list.sort_by_key(|c| c.level);
        }
        let mut levels: Vec<(u32, usize)> = vec![];
        for (slot, c) in list.iter().enumerate() {
            slot_of[c.number as usize] = slot as u32;
            match levels.last_mut() {
                Some(last) if last.0 == c.level => last.1 = slot + 1,
                _ => levels.push((c.level, slot + 1)),
            }
        }
        let children = list
            .iter()
            .map(|c| {
                if receivers {
                    let parent = (c.depth > 0 && c.level + 1 > DIRECT_LEVELS)
                        .then(|| clusters.number(c.root as usize, c.depth - 1, c.index / 4));
                    parent.map(|p| slot_of[p as usize]).filter(|&slot| slot != NONE)
                } else {
                    (c.level > DIRECT_LEVELS).then(|| {
                        slot_of[clusters.number(c.root as usize, c.depth + 1, 4 * c.index) as usize]
                    })
                }
            })
            .collect();
        Slots { clusters: list, children, levels }
    }
}
