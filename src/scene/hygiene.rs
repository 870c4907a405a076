//! Leaves out triangles that cannot be lit: those without area and those that are there twice.
//!
//! *Without area*: the height over the longest edge is below [`MIN_RELATIVE_HEIGHT`] times that
//! edge, so that no digit of the normal could be trusted.
//!
//! *Twice*: the same three corners, bit for bit, and a side that another triangle already has.
//! Sides are what counts: two one-sided triangles back to back are two opposed faces and both
//! stay; a two-sided triangle has both sides, so nothing else may lie on its corners. The first
//! in the file stays, except that a two-sided one is preferred.
//!
//! Nothing else is dropped, and objects and materials stay. Cost: O(n log n).

use std::collections::BTreeMap;

use glam::DVec3;

use super::limits::{MAX_RADIANCE, is_position, triple};
use super::notices::Notices;
use super::{Scene, Triangle};
use crate::error::{Error, Result};

/// Height over the longest edge, relative to it, below which a triangle has no area. The rounding
/// error of a cross product is about 2e-16 relative to the product of the edges: below 1e-12 fewer
/// than four digits of the normal are left.
const MIN_RELATIVE_HEIGHT: f64 = 1e-12;

/// Drops degenerate and duplicate triangles, counted in notices by object.
///
/// # Errors
///
/// [`Error::Invalid`] for a corner that is not a usable position, for emission beyond reason, or when
/// no triangle is left.
pub(crate) fn clean(scene: &mut Scene) -> Result<()> {
    for triangle in &scene.triangles {
        if !triangle.vertices.iter().all(|&p| is_position(p)) {
            return Err(Error::invalid(
                &scene.path,
                about(scene, triangle.object),
                "a corner is not finite or beyond 1e30 m; check the transforms above it",
            ));
        }
    }
    for material in &scene.materials {
        // What is not a number is not below it either.
        if !material.radiance.to_array().iter().all(|x| *x <= MAX_RADIANCE) {
            return Err(Error::invalid(
                &scene.path,
                format!("material \"{}\"", material.name),
                format!(
                    "its emission {} is beyond {MAX_RADIANCE:e} W/(m^2 sr); correct it in the file, or \
                     set it with --emission or --light-scale",
                    triple(material.radiance)
                ),
            ));
        }
    }
    let mut drop = vec![None; scene.triangles.len()];
    for (triangle, drop) in scene.triangles.iter().zip(&mut drop) {
        if is_degenerate(triangle) {
            *drop = Some("triangles without area left out");
        }
    }
    mark_duplicates(scene, &mut drop);

    let mut counts: BTreeMap<(u32, &str), usize> = BTreeMap::new();
    for (triangle, drop) in scene.triangles.iter().zip(&drop) {
        if let Some(text) = *drop {
            *counts.entry((triangle.object, text)).or_default() += 1;
        }
    }
    let mut notices = Notices::default();
    for ((object, text), count) in counts {
        notices.add_many(about(scene, object), text, count);
    }
    scene.notices.extend(notices.into_list());
    let mut drop = drop.into_iter();
    scene.triangles.retain(|_| drop.next().flatten().is_none());
    if scene.triangles.is_empty() {
        return Err(Error::invalid(
            &scene.path,
            "scene",
            "it has no triangles with area; nothing can be lit",
        ));
    }
    Ok(())
}

/// An object in words.
pub(super) fn about(scene: &Scene, object: u32) -> String {
    format!("object \"{}\"", scene.objects.get(object as usize).map_or("", |o| &o.name))
}

/// Whether a triangle has no area, see [`MIN_RELATIVE_HEIGHT`].
fn is_degenerate(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.vertices;
    let edges = [b - a, c - b, a - c];
    let longest = edges.iter().map(|e| e.abs().max_element()).fold(0.0, f64::max);
    if longest == 0.0 {
        return true;
    }
    // In units of the longest edge nothing over- or underflows.
    let [e0, e1, e2] = edges.map(|e| e / longest);
    let longest_squared = e0.length_squared().max(e1.length_squared()).max(e2.length_squared());
    let double_area = e0.cross(e1).length();
    double_area <= MIN_RELATIVE_HEIGHT * longest_squared
}

/// Corners in an order that does not depend on the winding, and whether that order runs forward.
fn key(triangle: &Triangle) -> ([[u64; 3]; 3], bool) {
    // Adding zero makes -0 and 0 the same bits.
    let bits = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    let corners = triangle.vertices.map(bits);
    let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
    let [a, b, c] = [0, 1, 2].map(|k| corners[(first + k) % 3]);
    if b <= c { ([a, b, c], true) } else { ([a, c, b], false) }
}

/// Marks every triangle all of whose sides another one has.
fn mark_duplicates(scene: &Scene, drop: &mut [Option<&'static str>]) {
    let text = "duplicate triangles left out: others with the same corners are there";
    let mut order: Vec<_> = (0..scene.triangles.len())
        .filter(|&i| drop[i].is_none())
        .map(|i| (key(&scene.triangles[i]), i))
        .collect();
    order.sort_unstable_by_key(|&((corners, _), i)| (corners, i));
    for group in order.chunk_by(|a, b| a.0.0 == b.0.0) {
        if group.len() == 1 {
            continue;
        }
        let two_sided = |i: usize| {
            let material = scene.triangles[i].material as usize;
            scene.materials.get(material).is_some_and(|m| m.two_sided)
        };
        let whole = group.iter().find(|&&(_, i)| two_sided(i)).map(|&(_, i)| i);
        let mut taken = [false; 2];
        for &((_, forward), i) in group {
            let side = usize::from(forward);
            let keep = match whole {
                Some(kept) => i == kept,
                None => !taken[side],
            };
            taken[side] = true;
            if !keep {
                drop[i] = Some(text);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Material, Object};
    use super::*;
    use glam::DVec2;

    fn scene(corners: &[[[f64; 3]; 3]], materials: &[(u32, bool)]) -> Scene {
        let triangle = |(c, material): (&[[f64; 3]; 3], u32)| Triangle {
            vertices: c.map(DVec3::from),
            uv: [[DVec2::ZERO; 3]; 2],
            colour: [DVec3::ONE; 3],
            material,
            object: 0,
        };
        let plain = |two_sided| Material { two_sided, ..Material::plain("m", DVec3::splat(0.5)) };
        Scene {
            objects: vec![Object { name: "box".into() }],
            materials: vec![plain(false), plain(true)],
            triangles: corners.iter().zip(materials.iter().map(|m| m.0)).map(triangle).collect(),
            ..Scene::default()
        }
    }

    const A: [f64; 3] = [0.0, 0.0, 0.0];
    const B: [f64; 3] = [1.0, 0.0, 0.0];
    const C: [f64; 3] = [0.0, 1.0, 0.0];

    #[test]
    fn rotated_corners_are_duplicates_and_reversed_ones_are_not() {
        let mut s = scene(&[[A, B, C], [B, C, A], [A, C, B], [C, B, A]], &[(0, false); 4]);
        clean(&mut s).unwrap();
        assert_eq!(s.triangles.len(), 2);
        assert_eq!(s.notices.len(), 1);
        assert_eq!((s.notices[0].count, s.notices[0].about.as_str()), (2, "object \"box\""));
    }

    #[test]
    fn a_two_sided_triangle_covers_both_sides() {
        let mut s = scene(&[[A, B, C], [A, C, B], [A, C, B]], &[(0, false), (1, true), (0, false)]);
        clean(&mut s).unwrap();
        assert_eq!(s.triangles.len(), 1);
        assert_eq!(s.triangles[0].material, 1);
    }

    #[test]
    fn minus_zero_is_zero() {
        let mut s = scene(&[[A, B, C], [[-0.0, 0.0, -0.0], B, C]], &[(0, false); 2]);
        clean(&mut s).unwrap();
        assert_eq!(s.triangles.len(), 1);
    }

    #[test]
    fn slivers_stay_and_lines_go() {
        let thin = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-9, 0.0]];
        let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [3.0, 3.0, 3.0]];
        let tiny = [[0.0, 0.0, 0.0], [1e-200, 0.0, 0.0], [0.0, 1e-200, 0.0]];
        let mut s = scene(&[thin, line, [A, A, B], tiny], &[(0, false); 4]);
        clean(&mut s).unwrap();
        assert_eq!(s.triangles.len(), 2);
        assert_eq!(s.notices[0].count, 2);
    }

    #[test]
    fn nothing_left_is_an_error() {
        let mut s = scene(&[[A, A, A]], &[(0, false)]);
        assert!(matches!(clean(&mut s), Err(Error::Invalid { .. })));
        assert!(matches!(clean(&mut Scene::default()), Err(Error::Invalid { .. })));
        let mut far = scene(&[[A, B, [0.0, 1e31, 0.0]]], &[(0, false)]);
        let error = clean(&mut far).unwrap_err().to_string();
        assert!(error.contains("box"), "{error}");
    }
}
