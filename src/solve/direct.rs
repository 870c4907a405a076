//! Direct light apart from indirect light.
//!
//! With u = E + r the radiosity splits into what is emitted and what is reflected, r = rho H, and
//! H = H_d + w into direct and indirect irradiance. H_d = 1/pi int E G V has all the shadow lines,
//! and is known exactly at any point without solving anything; w is smooth, and all that is
//! unknown:
//!
//! ```text
//! w(P) = 1/pi int (rho H_d + rho w)(Q) G V dS_Q
//! ```
//!
//! So w is sought on a coarse mesh, and rho H_d is represented on a tree of its own
//! ([`DirectField`]), refined where it is far from linear. What the mesh sees of it are its best
//! linear fits: moments are kept, and what they miss matters close by only, where the tree is
//! looked at again ([`DirectField::reflected`]) when light is gathered.

use glam::{DVec2, DVec3};

use crate::cluster::adaptive::{AdaptiveTree, Field};
use crate::cluster::fit::{Fit, join, mismatch, split};
use crate::error::{Error, Result};
use crate::geometry::triangle_area;
use crate::mesh::{Basis, Face, Mesh, child};
use crate::monitor::Monitor;
use crate::operator::gather::Radiant;
use crate::operator::walk::{Stage, Walker};
use crate::scene::{self, Scene};

/// How fine the representation of emitted and of directly reflected light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// A cell is refined while its deviation from linear, rms over the whole surface with zero
    /// elsewhere, is above this, W/m^2.
    pub deviation: f64,
    /// Irradiance that is added where that of direct light is multiplied by textures: about that
    /// of indirect light, W/m^2.
    pub ambient: f64,
    /// Error that a cell of an emitter may make in direct irradiance, W/m^2.
    pub allowed: f64,
    /// Bytes that it may take.
    pub max_memory: u64,
}

/// Direct irradiance on a tree at least as fine as a mesh.
pub struct DirectField {
    tree: AdaptiveTree,
    cells: Vec<DirectCell>,
}

#[derive(Clone, Copy)]
struct DirectCell {
    /// H_d at the nodes, and rho: averages over what they stand for.
    irradiance: Fit<3>,
    reflectance: Fit<3>,
    /// Known to be as good as linear.
    settled: bool,
}

const DARK: DirectCell =
    DirectCell { irradiance: [[0.0; 3]; 3], reflectance: [[0.0; 3]; 3], settled: false };

/// Area of all roots, square metres.
pub fn surface_area(mesh: &Mesh) -> f64 {
    mesh.roots.iter().map(|r| triangle_area(&r.corners)).sum()
}

/// What the nodes of a cell stand for: the child triangles around them, as weights of the corners of
/// the input triangle.
fn footprints(face: &Face, corners: &[DVec2; 3]) -> [[DVec3; 3]; 3] {
    [2, 1, 0].map(|k| child(corners, k).map(|x| face.triangle_weights(x)))
}

/// Emitted exitance E, W/m^2, on trees as fine as its textures ask for.
///
/// A cell is refined while its deviation from linear, rms over the whole surface with zero elsewhere,
/// is above `fineness` (W/m^2).
pub fn emission(
    scene: &Scene,
    stage: Stage,
    fineness: f64,
    max_memory: u64,
    monitor: &Monitor,
) -> Result<Radiant> {
    let mesh = stage.mesh;
    let area = surface_area(mesh);
    let grown = AdaptiveTree::grow(
        mesh,
        most_cells(max_memory),
        ([[0.0; 3]; 3], false),
        || (),
        |_, place, &(_, settled): &(Fit<3>, bool)| {
            let face = &mesh.faces[mesh.roots[place.root as usize].face as usize];
            let material =
                &scene.materials[scene.triangles[face.triangle as usize].material as usize];
            if settled || material.radiance == DVec3::ZERO || material.radiance_texture.is_none() {
                return Ok(None);
            }
            monitor.check()?;
            let four = [0, 1, 2, 3].map(|k| {
                footprints(face, &child(&place.corners, k))
                    .map(|f| scene::exitance(scene, face.triangle as usize, &f).to_array())
            });
            let settled = small(&join(&four), &four, &place.corners, area, fineness);
            Ok(Some(four.map(|fit| (fit, settled))))
        },
    );
    let (tree, carried) = grown?.ok_or_else(|| too_fine("emitted", max_memory))?;
    let mut values: Vec<Fit<3>> = carried.into_iter().map(|(fit, _)| fit).collect();
    tree.for_leaves(mesh, |place| {
        if place.depth == 0 {
            let face = &mesh.faces[mesh.roots[place.root as usize].face as usize];
            let whole = place.corners.map(|x| face.triangle_weights(x));
            let e = scene::exitance(scene, face.triangle as usize, &whole).to_array();
            values[place.cell as usize] = [e; 3];
        }
    });
    Ok(Radiant::new(stage, Field::new(tree, values)))
}

/// Bytes that a cell takes at most while fields are made of it: its own values, and those of fields.
const CELL_BYTES: u64 = 3 * size_of::<DirectCell>() as u64;

fn most_cells(max_memory: u64) -> usize {
    // Numbers of cells are u32.
    (max_memory / CELL_BYTES).min(1 << 31) as usize
}

fn too_fine(what: &str, max_memory: u64) -> Error {
    Error::Memory {
        what: format!("the representation of {what} light"),
        needed: max_memory.saturating_mul(2),
        allowed: max_memory,
        remedy: "choose a larger --tolerance, or raise --max-memory".into(),
    }
}

/// Whether the difference of four children from their parent's fit is small for the whole surface.
fn small(
    fit: &Fit<3>,
    four: &[Fit<3>; 4],
    corners: &[DVec2; 3],
    surface: f64,
    allowed: f64,
) -> bool {
    let square = mismatch(fit, four).into_iter().fold(0.0, f64::max);
    square * triangle_area(corners) <= allowed * allowed * surface
}

fn times(a: &Fit<3>, b: &Fit<3>) -> Fit<3> {
    std::array::from_fn(|j| std::array::from_fn(|c| a[j][c] * b[j][c]))
}

impl DirectField {
    /// Direct irradiance from `emitters` on all that reflects.
    pub fn new(
        scene: &Scene,
        stage: Stage,
        emitters: &Radiant,
        fineness: &Fineness,
        monitor: &Monitor,
    ) -> Result<DirectField> {
        let mesh = stage.mesh;
        let area = surface_area(mesh);
        let dark = emitters.is_dark();
        let most = most_cells(fineness.max_memory);
        let grown = AdaptiveTree::grow(
            mesh,
            most,
            DARK,
            Walker::default,
            |walker, place, cell: &DirectCell| {
                let root = &mesh.roots[place.root as usize];
                if cell.settled || dark {
                    return Ok(None);
                }
                if place.depth < root.level {
                    return Ok(Some([DARK; 4]));
                }
                monitor.check()?;
                let face = &mesh.faces[root.face as usize];
                let triangle = face.triangle as usize;
                let four = [0, 1, 2, 3].map(|k| {
                    let corners = child(&place.corners, k);
                    let reflectance = footprints(face, &corners)
                        .map(|f| scene::reflectance(scene, triangle, &f).to_array());
                    if reflectance == [[0.0; 3]; 3] {
                        return DARK;
                    }
                    let irradiance = std::array::from_fn(|j| {
                        let w = Basis::Linear.node(j);
                        let x = w.x * corners[0] + w.y * corners[1] + w.z * corners[2];
                        let point = face.frame.lift(x);
                        emitters
                            .gather(walker, stage, point, face.frame.n, fineness.allowed)
                            .to_array()
                    });
                    DirectCell { irradiance, reflectance, settled: false }
                });
                let products = four.map(|cell| {
                    let lit = cell.irradiance.map(|h| h.map(|h| h + fineness.ambient));
                    times(&lit, &cell.reflectance)
                });
                let settled =
                    small(&join(&products), &products, &place.corners, area, fineness.deviation);
                Ok(Some(four.map(|cell| DirectCell { settled, ..cell })))
            },
        );
        let (tree, cells) =
            grown?.ok_or_else(|| too_fine("directly reflected", fineness.max_memory))?;
        Ok(DirectField { tree, cells })
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.tree.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty()
    }

    /// H_d on the tree.
    pub fn irradiance(&self) -> Field {
        self.field(|cell| cell.irradiance)
    }

    /// rho H_d on the tree.
    pub fn reflected_once(&self) -> Field {
        self.field(|cell| times(&cell.irradiance, &cell.reflectance))
    }

    fn field(&self, of_leaf: impl Fn(&DirectCell) -> Fit<3>) -> Field {
        Field::new(self.tree.clone(), self.cells.iter().map(of_leaf).collect())
    }

    /// A field on this tree at the nodes of a mesh of the same roots that is no finer than the one this
    /// was made for: best linear fits on the elements.
    pub fn at_nodes(&self, field: &Field, mesh: &Mesh) -> Vec<DVec3> {
        let mut nodes = vec![DVec3::ZERO; mesh.nodes()];
        self.for_elements(mesh, |element, cell| {
            for (j, value) in field.fits[cell as usize].iter().enumerate() {
                nodes[3 * element + j] = DVec3::from_array(*value);
            }
        });
        nodes
    }

    /// The reflected radiosity rho (H_d + w), with indirect irradiance `w` at the nodes of a mesh as
    /// in [`DirectField::at_nodes`].
    pub fn reflected(&self, mesh: &Mesh, w: &[DVec3]) -> Field {
        let mut values = vec![[[0.0; 3]; 3]; self.tree.len()];
        let mut stack: Vec<(u32, Fit<3>)> = vec![];
        self.for_elements(mesh, |element, cell| {
            stack.push((cell, [0, 1, 2].map(|j| w[3 * element + j].to_array())));
            while let Some((cell, indirect)) = stack.pop() {
                match self.tree.children(cell) {
                    Some(first) => {
                        let four = split(&indirect);
                        stack.extend((first..).zip(four));
                    }
                    None => {
                        let own = &self.cells[cell as usize];
                        let all: Fit<3> = std::array::from_fn(|j| {
                            std::array::from_fn(|c| own.irradiance[j][c] + indirect[j][c])
                        });
                        values[cell as usize] = times(&all, &own.reflectance);
                    }
                }
            }
        });
        Field::new(self.tree.clone(), values)
    }

    /// Calls `see` with each element of a mesh and its cell.
    pub fn for_elements(&self, mesh: &Mesh, mut see: impl FnMut(usize, u32)) {
        for (number, root) in mesh.roots.iter().enumerate() {
            for index in 0..1u32 << (2 * root.level) {
                let mut cell = Some(number as u32);
                for depth in 1..=root.level {
                    let k = (index >> (2 * (root.level - depth))) & 3;
                    cell = cell.and_then(|c| self.tree.children(c)).map(|first| first + k);
                }
                if let Some(cell) = cell {
                    see((root.first + index) as usize, cell);
                }
            }
        }
    }
}
