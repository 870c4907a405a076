//! Small cases that were wrong once.

use glam::{DMat3, DVec3};
use lumel::geometry::Frame;

use super::look::look;
use super::scenes::Sight;

/// A square with a corner cut by 1e-11 of its side: the plane through the observer and so short an
/// edge is uncertain by 2e-4 radians. That must not lose the shadow of the whole square where a
/// source lies within the uncertainty of this one plane.
#[test]
fn an_occluder_with_a_very_short_edge_still_hides() {
    let p = |x: f64, y: f64| DVec3::new(x, y, 0.5);
    let (short, turn) = (1e-11, 1e-3);
    let cut = p(1.0 + turn * short, short);
    let blockers = vec![
        [p(0.0, 0.0), p(1.0, 0.0), cut],
        [p(0.0, 0.0), cut, p(1.0, 1.0)],
        [p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)],
    ];
    let q = |x: f64, y: f64| DVec3::new(1.4998 + 1e-4 * x, -0.4 + 1e-4 * y, 0.0);
    let source = [q(0.0, 0.0), q(1.0, 0.0), q(0.0, 1.0)];
    let point = DVec3::new(0.5, 0.5, 1.0);
    let sight = Sight { source, point, normal: DVec3::NEG_Z, blockers };
    assert_eq!(look(&sight, 0).visible, 0.0);
}

/// A thin triangle and another in its plane: neither may hide the other by its rounded normal.
#[test]
fn a_thin_triangle_is_not_hidden_by_a_triangle_in_its_plane() {
    let a = DVec3::new(-0.697844425941577, -0.9523240634735091, -0.6460662785220019);
    let b = DVec3::new(0.18435542978971564, -0.1727486447706268, -0.024992601767055644);
    let c = DVec3::new(0.515509388021351, 0.10912662626954028, 0.25006048645563617);
    let d = DVec3::new(0.18435543015332803, -0.17274864446112317, -0.024992601465042907);
    let point = DVec3::new(0.6778418969809463, -0.6560767252453091, -0.0005159822405791381);
    let normal = ((a + b + c) / 3.0 - point).normalize();
    let sight = Sight { source: [a, b, c], point, normal, blockers: vec![[a, d, c]] };
    let whole = 0.5 * (b - a).cross(c - a).length();
    assert!((look(&sight, 0).visible - whole).abs() <= 1e-12 * whole);
}

/// The corners of thin triangles lie in their planes, and the corners of a strip cut into them too.
#[test]
fn normals_of_thin_triangles_are_right() {
    let turn = DMat3::from_axis_angle(DVec3::new(0.4, -0.7, 0.2).normalize(), 1.3);
    for width in [1e-2, 1e-4, 1e-6, 1e-8] {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, width), (0.0, width)]
            .map(|(x, y)| turn * DVec3::new(x, y, 0.0));
        for [i, j, k] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 3], [1, 3, 0], [3, 1, 2]] {
            let frame = Frame::of_triangle(&[corners[i], corners[j], corners[k]]).unwrap();
            for x in corners {
                assert!(frame.height(x).abs() <= 4.0 * f64::EPSILON, "{width}: {i} {j} {k}");
            }
        }
    }
}
