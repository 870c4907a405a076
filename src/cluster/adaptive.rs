//! Quadtrees that are as deep as what they carry asks for.
//!
//! Where a mesh has elements of one size on each root, light has shadow lines here and none there.
//! An [`AdaptiveTree`] refines each root where its field needs it, by the field's values at the
//! interior nodes of the cells; a [`Field`] is such a tree with the linear fits of its cells, and
//! how far each fit is from what lies below.

use glam::DVec2;
use rayon::prelude::*;

use super::fit::{Fit, join, mismatch};
use crate::error::Result;
use crate::mesh::{Mesh, child};

/// No children.
const LEAF: u32 = u32::MAX;

/// Deepest level below a root.
pub const DEEPEST_CELL: u32 = 14;

/// Cells: the roots of a mesh and their descendants.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AdaptiveTree {
    /// The first of the four children of each cell; children come after their parents. The first
    /// cells are the roots of the mesh.
    children: Vec<u32>,
    /// How many roots there are.
    roots: usize,
}

/// A cell that is about to be refined.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Its number, and its root's.
    pub cell: u32,
    /// The root.
    pub root: u32,
    /// Levels above it.
    pub depth: u32,
    /// Corners in the plane of the root's face.
    pub corners: [DVec2; 3],
}

impl AdaptiveTree {
    /// Grows trees: of each cell, `refine` says what its four children carry, or nothing where it
    /// stays a leaf. Returns the tree and what each cell carries (roots: `of_root`).
    ///
    /// None where there would be more than `most` cells; errors are those of `refine`. `state` makes memory for a thread. A cell's children depend on nothing but the cell, so that the
    /// result is the same on any number of threads.
    pub fn grow<T: Copy + Send + Sync, S>(
        mesh: &Mesh,
        most: usize,
        of_root: T,
        state: impl Fn() -> S + Sync,
        refine: impl Fn(&mut S, &Place, &T) -> Result<Option<[T; 4]>> + Sync,
    ) -> Result<Option<(AdaptiveTree, Vec<T>)>> {
        let roots = mesh.roots.len();
        let mut tree = AdaptiveTree { children: vec![LEAF; roots], roots };
        let mut carried = vec![of_root; roots];
        let mut front: Vec<Place> = mesh
            .roots
            .iter()
            .enumerate()
            .map(|(i, r)| Place { cell: i as u32, root: i as u32, depth: 0, corners: r.corners })
            .collect();
        while !front.is_empty() {
            if tree.len() + 4 * front.len() > most {
                return Ok(None);
            }
            let found: Vec<Option<[T; 4]>> = front
                .par_iter()
                .with_min_len(16)
                .map_init(&state, |state, place| {
                    let deep = place.depth >= DEEPEST_CELL;
                    if deep {
                        Ok(None)
                    } else {
                        refine(state, place, &carried[place.cell as usize])
                    }
                })
                .collect::<Result<_>>()?;
            let mut next = vec![];
            for (place, four) in front.iter().zip(found) {
                let Some(four) = four else { continue };
                let first = tree.children.len() as u32;
                tree.children[place.cell as usize] = first;
                tree.children.extend([LEAF; 4]);
                carried.extend(four);
                next.extend((0..4).map(|k| Place {
                    cell: first + k,
                    root: place.root,
                    depth: place.depth + 1,
                    corners: child(&place.corners, k as usize),
                }));
            }
            front = next;
        }
        Ok(Some((tree, carried)))
    }

    /// The first of a cell's four children.
    pub fn children(&self, cell: u32) -> Option<u32> {
        let first = self.children[cell as usize];
        (first != LEAF).then_some(first)
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.children.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.children.is_empty()
    }

    /// Calls `see` with each leaf and the place of its root.
    pub fn for_leaves(&self, mesh: &Mesh, mut see: impl FnMut(&Place)) {
        let mut stack = vec![];
        for root in 0..self.roots as u32 {
            let corners = mesh.roots[root as usize].corners;
            stack.push(Place { cell: root, root, depth: 0, corners });
            while let Some(place) = stack.pop() {
                let Some(first) = self.children(place.cell) else {
                    see(&place);
                    continue;
                };
                stack.extend((0..4).rev().map(|k| Place {
                    cell: first + k,
                    depth: place.depth + 1,
                    corners: child(&place.corners, k as usize),
                    ..place
                }));
            }
        }
    }
}

/// A field on a tree: three channels, linear on each leaf.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// The cells.
    pub tree: AdaptiveTree,
    /// Best linear approximation on each cell, by its values at the interior nodes.
    pub fits: Vec<Fit<3>>,
    /// Root mean square of the field minus its fit on each cell; of the channels the largest.
    pub deviation: Vec<f64>,
}

impl Field {
    /// From the values on the leaves; what `values` has for other cells does not count.
    pub fn new(tree: AdaptiveTree, mut values: Vec<Fit<3>>) -> Field {
        let mut squares = vec![[0.0; 3]; tree.len()];
        for cell in (0..tree.len()).rev() {
            let Some(first) = tree.children(cell as u32) else { continue };
            let first = first as usize;
            let four: [Fit<3>; 4] = std::array::from_fn(|k| values[first + k]);
            let fit = join(&four);
            let own = mismatch(&fit, &four);
            squares[cell] = std::array::from_fn(|c| {
                own[c] + 0.25 * (0..4).map(|k| squares[first + k][c]).sum::<f64>()
            });
            values[cell] = fit;
        }
        let deviation =
            squares.iter().map(|s| s.iter().copied().fold(0.0, f64::max).sqrt()).collect();
        Field { tree, fits: values, deviation }
    }

    /// Whether a cell is dark all over.
    pub fn is_dark(&self, cell: u32) -> bool {
        self.deviation[cell as usize] == 0.0 && self.fits[cell as usize] == [[0.0; 3]; 3]
    }
}
