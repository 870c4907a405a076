//! Light that the elements miss.
//!
//! Elements see directly reflected light b_d = rho H_d by its best linear fits, which keep its power and
//! first moments: enough, unless a part of an element holds much of it and something stands close by. A
//! small lamp in front of a wall makes a spot of light smaller than an element, and is in the way of
//! just that light. What the fits miss of b_d is therefore gathered at the nodes, from the elements
//! where it is much:
//!
//! ```text
//! w = A (b_d + rho w) + 1/pi int (b_d - fit of b_d) G V
//! ```

use glam::DVec3;
use rayon::prelude::*;

use super::direct::{DirectField, surface_area};
use crate::cluster::adaptive::Field;
use crate::cluster::fit::{Fit, split};
use crate::error::Result;
use crate::geometry::triangle_area;
use crate::mesh::Mesh;
use crate::monitor::Monitor;
use crate::operator::gather::Radiant;
use crate::operator::walk::{Stage, Walker};

/// What elements miss.
pub struct Missed {
    /// Indirect irradiance that they miss at the nodes, W/m^2.
    pub irradiance: Vec<DVec3>,
    /// Elements that miss much, in ascending order.
    pub elements: Vec<usize>,
}

/// What the elements of the stage's mesh miss of directly reflected light (`once`, rho H_d on the tree of
/// `direct`); nothing where they miss little, and at nodes without `reflectance`.
///
/// An element misses much if what it misses (root mean square times area) is more than `least` times the
/// whole surface, in W/m^2. A cell of those may make an error of `least` at a node.
pub fn missed(
    (direct, once): (&DirectField, &Field),
    stage: Stage,
    reflectance: &[DVec3],
    least: f64,
    monitor: &Monitor,
) -> Result<Option<Missed>> {
    let Some((field, elements)) = rough(direct, once, stage.mesh, least) else { return Ok(None) };
    let radiant = Radiant::new(stage, field);
    let nodes = reflectance.par_iter().enumerate();
    let found = nodes.map_init(Walker::default, |walker, (node, rho)| {
        if *rho == DVec3::ZERO {
            return Ok(DVec3::ZERO);
        }
        monitor.check()?;
        let (point, normal) = stage.mesh.node(node);
        Ok(radiant.gather(walker, stage, point, normal, least))
    });
    Ok(Some(Missed { irradiance: found.collect::<Result<_>>()?, elements }))
}

/// Directly reflected light minus its fits on the elements that miss much, and zero elsewhere; with
/// those elements.
fn rough(
    direct: &DirectField,
    whole: &Field,
    mesh: &Mesh,
    least: f64,
) -> Option<(Field, Vec<usize>)> {
    let most = least * surface_area(mesh);
    let mut values = vec![[[0.0; 3]; 3]; direct.len()];
    let (mut cells, mut elements): (Vec<u32>, Vec<usize>) = (vec![], vec![]);
    let mut stack: Vec<(u32, Fit<3>)> = vec![];
    direct.for_elements(mesh, |element, cell| {
        let area = triangle_area(&mesh.element_corners[element]);
        if whole.deviation[cell as usize] * area <= most {
            return;
        }
        cells.push(cell);
        elements.push(element);
        stack.push((cell, whole.fits[cell as usize]));
        while let Some((cell, fit)) = stack.pop() {
            match whole.tree.children(cell) {
                Some(first) => stack.extend((first..).zip(split(&fit))),
                None => {
                    let own = &whole.fits[cell as usize];
                    values[cell as usize] =
                        std::array::from_fn(|j| std::array::from_fn(|c| own[j][c] - fit[j][c]));
                }
            }
        }
    });
    if cells.is_empty() {
        return None;
    }
    let mut field = Field::new(whole.tree.clone(), values);
    // But for rounding they are zero, and need not be looked at.
    for cell in cells {
        field.fits[cell as usize] = [[0.0; 3]; 3];
    }
    Some((field, elements))
}
