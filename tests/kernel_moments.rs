//! Integrals of G against adaptive quadrature that shares no formula with them.

use glam::{DVec2, DVec3};
use lumel::geometry::Frame;
use lumel::kernel::{Precision, View, gauss, moments, quadrature};

/// Small deterministic generator (SplitMix64).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
            );
            if v.length() > 0.1 && v.length() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// Integrals of G, G x, G y (about `about`) over a triangle by adaptive tensor Gauss rules, with
/// G written with 3D vectors as in AC (1.2).
struct Adaptive {
    rule: (Vec<f64>, Vec<f64>),
    receiver: DVec3,
    normal: DVec3,
    about: DVec2,
}

impl Adaptive {
    fn rule_on(&self, t: [DVec2; 3]) -> DVec3 {
        let (nodes, weights) = &self.rule;
        let (e1, e2) = (t[1] - t[0], t[2] - t[1]);
        let jacobian = e1.perp_dot(e2);
        let mut sum = DVec3::ZERO;
        for (s, ws) in nodes.iter().zip(weights) {
            for (q, wq) in nodes.iter().zip(weights) {
                let x = t[0] + *s * (e1 + *q * e2);
                let r = DVec3::new(x.x, x.y, 0.0) - self.receiver;
                let g = r.dot(self.normal) * -r.z / r.length_squared().powi(2);
                let o = x - self.about;
                sum += ws * wq * s * jacobian * g * DVec3::new(1.0, o.x, o.y);
            }
        }
        sum
    }

    fn integrate(&self, t: [DVec2; 3], whole: DVec3, tolerance: DVec3, depth: usize) -> DVec3 {
        let m = [0.5 * (t[0] + t[1]), 0.5 * (t[1] + t[2]), 0.5 * (t[2] + t[0])];
        let children = [[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m];
        let parts = children.map(|c| self.rule_on(c));
        let sum = parts[0] + parts[1] + parts[2] + parts[3];
        // A peak narrower than the triangle could be missed by every node: cut down to it first.
        let nearest = DVec2::ZERO.clamp(t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let distance = nearest.length().hypot(self.receiver.z);
        let size = t[0].distance(t[1]).max(t[1].distance(t[2])).max(t[2].distance(t[0]));
        let wide = size > 3.0 * distance;
        if depth == 0 || !wide && (sum - whole).abs().cmple(tolerance).all() {
            return sum;
        }
        (0..4).map(|i| self.integrate(children[i], parts[i], tolerance, depth - 1)).sum()
    }
}

/// Largest error of the moments of one triangle, relative as the documentation of `moments` says.
fn error(triangle: [DVec2; 3], receiver: DVec3, normal: DVec3) -> f64 {
    // Quadrature works relative to the receiver's foot: a peak there is as narrow as its height.
    let foot = DVec2::new(receiver.x, receiver.y);
    let centre = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
    let (corners, about) = (triangle.map(|x| x - foot), centre - foot);
    let above = DVec3::new(0.0, 0.0, receiver.z);
    let adaptive = Adaptive { rule: gauss::legendre(16), receiver: above, normal, about };
    let first = adaptive.rule_on(corners);
    let size = (corners[0] - about).length();
    let scaled = |relative: f64| relative * DVec3::new(1.0, size, size);
    let rough = adaptive.integrate(corners, first, scaled(1e-9), 60);
    let want = adaptive.integrate(corners, first, scaled(2e-14 * rough.x.abs()), 60);
    let frame = Frame::new(DVec3::ZERO, DVec3::Z);
    assert_eq!((frame.u, frame.v), (DVec3::X, DVec3::Y));
    let got = moments(&View::new(&frame, receiver, normal), &triangle, centre, &Precision::EXACT);
    // Relative, but for one rounding of a full hemisphere (pi), which grazing views lose.
    let scale = want.x.abs() + 1e-15 / 1e-12;
    let e0 = (got.zeroth - want.x).abs() / scale;
    let e1 = (got.first - DVec2::new(want.y, want.z)).length() / (scale * size);
    e0.max(e1)
}

#[test]
fn general_positions() {
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    let mut tried = 0;
    while tried < 400 {
        let corner = |r: &mut Random| DVec2::new(r.between(-1.0, 1.0), r.between(-1.0, 1.0));
        let mut t = [corner(&mut random), corner(&mut random), corner(&mut random)];
        let twice: f64 = (t[1] - t[0]).perp_dot(t[2] - t[0]);
        if twice.abs() < 0.05 {
            continue;
        }
        if twice < 0.0 {
            t.swap(1, 2);
        }
        let distance = 10f64.powf(random.between(-1.5, 2.0));
        let mut receiver = distance * random.direction();
        receiver.z = receiver.z.abs() + 0.02;
        let normal = random.direction();
        let above = |x: &DVec2| (DVec3::new(x.x, x.y, 0.0) - receiver).dot(normal) > 0.0;
        if !t.iter().all(above) {
            continue;
        }
        tried += 1;
        let e = error(t, receiver, normal);
        assert!(e < 1e-12, "{e:e} for {t:?} from {receiver} with {normal}");
        worst = worst.max(e);
    }
    println!("worst error {worst:.1e}");
}

#[test]
fn near_edges_and_parallel_planes() {
    let t = [DVec2::ZERO, DVec2::X, DVec2::Y];
    // On the perpendicular plane y = 0, at 1e-1 .. 1e-8 of the size from the common edge.
    for k in 1..=8 {
        let height = 10f64.powi(-k);
        let e = error(t, DVec3::new(0.3, 0.0, height), DVec3::Y);
        assert!(e < 1e-12, "perpendicular, {height:e}: {e:e}");
        let e = error(t, DVec3::new(0.3, -0.8 * height, 0.6 * height), DVec3::new(0.0, 0.6, 0.8));
        assert!(e < 1e-12, "obtuse fold, {height:e}: {e:e}");
        // Opposite parallel plane, at 1e-1 .. 1e-8 of the size, above an edge and the inside.
        for foot in [DVec2::new(0.3, 0.0), DVec2::new(0.2, 0.3), DVec2::ZERO] {
            let e = error(t, DVec3::new(foot.x, foot.y, height), -DVec3::Z);
            assert!(e < 1e-12, "parallel, {foot} {height:e}: {e:e}");
        }
    }
}

#[test]
fn quadrature_and_closed_form_agree_where_they_meet() {
    let mut random = Random(7);
    let frame = Frame::new(DVec3::ZERO, DVec3::Z);
    let t = [DVec2::ZERO, DVec2::X, DVec2::new(0.2, 0.9)];
    for ratio in [0.25, 0.125, 0.0625, 0.03125, 0.015, 0.004, 0.001] {
        let mut worst: f64 = 0.0;
        for _ in 0..200 {
            let centre = (t[0] + t[1] + t[2]) / 3.0;
            let radius = t.iter().map(|x| x.distance(centre)).fold(0.0, f64::max);
            let mut out = random.direction();
            out.z = out.z.abs();
            let receiver = centre.extend(0.0) + radius / ratio * out;
            let normal = random.direction();
            let view = View::new(&frame, receiver, normal);
            if view.d < 1e-3 * radius / ratio {
                continue;
            }
            let above = |x: &DVec2| (x.extend(0.0) - receiver).dot(normal) > 0.0;
            if !t.iter().all(above) {
                continue;
            }
            let fine = quadrature::moments(&view, &t, centre, 16);
            let used = quadrature::moments(&view, &t, centre, quadrature::points_for(ratio));
            let scale = fine.zeroth.abs();
            worst = worst.max((fine.zeroth - used.zeroth).abs() / scale);
            worst = worst.max((fine.first - used.first).length() / (scale * radius));
        }
        println!("ratio {ratio}: {worst:.1e} with {}", quadrature::points_for(ratio));
        assert!(worst < 1e-12, "ratio {ratio}: {worst:e}");
    }
}

/// Integrals of a lower precision are as good as that: within precision times area/distance^2, and
/// times the radius in the first moment. Distance and radius are those of `moments`.
#[test]
fn lower_precisions_are_met() {
    let mut random = Random(11);
    let frame = Frame::new(DVec3::ZERO, DVec3::Z);
    for precision in [0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9] {
        let lower = Precision::within(precision);
        let (mut tried, mut worst, mut at) = (0, 0.0f64, 0.0);
        while tried < 20_000 {
            let corner = |r: &mut Random| DVec2::new(r.between(-1.0, 1.0), r.between(-1.0, 1.0));
            let mut t = [corner(&mut random), corner(&mut random), corner(&mut random)];
            // One in four is thin.
            if random.unit() < 0.25 {
                let along = t[0].lerp(t[1], random.between(-0.2, 1.2));
                t[2] = along + (t[2] - along) * 10f64.powf(random.between(-4.0, 0.0));
            }
            let twice: f64 = (t[1] - t[0]).perp_dot(t[2] - t[0]);
            if twice < 0.0 {
                t.swap(1, 2);
            }
            let area = 0.5 * twice.abs();
            let centre = (t[0] + t[1] + t[2]) / 3.0;
            let radius = t.iter().map(|x| x.distance(centre)).fold(0.0, f64::max);
            let ratio = 10f64.powf(random.between(-3.0, 3f64.log10()));
            let distance = radius / ratio;
            let mut out = random.direction();
            out.z = out.z.abs();
            let receiver = centre.extend(0.0) + distance * out;
            // Every other one looks at the triangle, where G is largest.
            let at_it = -out;
            let normal = if tried % 2 == 0 { at_it } else { random.direction() };
            let above = |x: &DVec2| (x.extend(0.0) - receiver).dot(normal) > 0.0;
            if !(area > 1e-6 && receiver.z > 1e-3 * distance && t.iter().all(above)) {
                continue;
            }
            tried += 1;
            let view = View::new(&frame, receiver, normal);
            let want = moments(&view, &t, centre, &Precision::EXACT);
            let got = moments(&view, &t, centre, &lower);
            // And a few roundings of a full hemisphere, which thin triangles lose in the closed form.
            let scale = precision * area / (distance * distance) + 4e-15;
            let zeroth = (got.zeroth - want.zeroth).abs() / scale;
            let first = (got.first - want.first).length() / (scale * radius);
            if zeroth.max(first) > worst {
                (worst, at) = (zeroth.max(first), ratio);
            }
        }
        println!("{precision:e}: {worst:.2} of it, at ratio {at:.3}");
        assert!(worst <= 1.0, "{precision:e}: {worst} times it, at ratio {at}");
        assert!(worst > 0.01, "{precision:e}: {worst} of it: rules are too long");
    }
}
