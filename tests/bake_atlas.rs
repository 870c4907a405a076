//! Atlases: every triangle has texels of its own, as many as asked for, apart from all others.

mod common;

use std::path::Path;

use common::{box_quads, material, scene};
use glam::{DVec2, DVec3, dvec3};
use lumel::Error;
use lumel::bake::{Atlas, AtlasOptions, Density, make_atlas, second_sets};
use lumel::scene::{Object, ReadOptions, Scene, read};

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    read(&path, &ReadOptions::default()).unwrap()
}

fn texels_a_metre(density: f64) -> AtlasOptions {
    AtlasOptions { texels_per_metre: Some(density), ..AtlasOptions::default() }
}

fn of_size(size: u32) -> AtlasOptions {
    AtlasOptions { size: Some(size), ..AtlasOptions::default() }
}

/// Corners of a triangle in texels of its page.
fn in_texels(atlas: &Atlas, i: usize) -> Option<[DVec2; 3]> {
    let page = atlas.pages[atlas.page[i]? as usize];
    let size = DVec2::new(f64::from(page.width), f64::from(page.height));
    Some(atlas.uv[i].map(|x| x * size))
}

fn area(t: &[DVec2; 3]) -> f64 {
    0.5 * (t[1] - t[0]).perp_dot(t[2] - t[0])
}

/// Rectangles keep their distance, triangles lie in those of their charts, and no point of a fine
/// grid is in two triangles.
fn assert_sound(scene: &Scene, atlas: &Atlas, padding: u32) {
    assert_eq!((atlas.page.len(), atlas.uv.len()), (scene.triangles.len(), scene.triangles.len()));
    let mut owner: Vec<Vec<usize>> = atlas
        .pages
        .iter()
        .map(|p| vec![usize::MAX; p.width as usize * p.height as usize])
        .collect();
    for (index, chart) in atlas.charts.iter().enumerate() {
        let page = atlas.pages[chart.page as usize];
        let [x, y, w, h] = chart.rectangle;
        assert!(w > 0 && h > 0 && x >= padding && y >= padding);
        assert!(x + w + padding <= page.width && y + h + padding <= page.height);
        for row in y - padding..y + h + padding {
            for column in x - padding..x + w + padding {
                let cell = &mut owner[chart.page as usize][(row * page.width + column) as usize];
                assert_eq!(*cell, usize::MAX, "charts {cell} and {index} overlap");
                *cell = index;
            }
        }
        for &i in &chart.triangles {
            assert_eq!(atlas.page[i as usize], Some(chart.page));
            assert_eq!(scene.triangles[i as usize].object, chart.object);
            for c in in_texels(atlas, i as usize).unwrap() {
                let (low, high) = (DVec2::new(x.into(), y.into()), DVec2::new(w.into(), h.into()));
                let c = c - low;
                assert!(c.min_element() > -1e-9 && (high - c).min_element() > -1e-9, "{c}");
            }
        }
    }
    // A point inside of each triangle is inside of no other.
    for chart in &atlas.charts {
        let all: Vec<[DVec2; 3]> =
            chart.triangles.iter().map(|&i| in_texels(atlas, i as usize).unwrap()).collect();
        for (i, t) in all.iter().enumerate() {
            // Spread evenly by irrational steps.
            let step = |s: f64| (0.5 + s * i as f64).fract();
            let (a, b) = (0.5 * step(0.754_877_666_2), 0.5 * step(0.569_840_290_9));
            let x = t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]);
            let inside = |t: &[DVec2; 3]| {
                let s = area(t).signum();
                (0..3).all(|k| s * (t[(k + 1) % 3] - t[k]).perp_dot(x - t[k]) > 1e-9)
            };
            let hit = all.iter().enumerate().filter(|(j, t)| *j != i && inside(t)).count();
            assert_eq!(hit, 0, "triangle {} overlaps", chart.triangles[i]);
        }
    }
}

#[test]
fn walls_get_whole_texels_of_the_density_asked_for() {
    let cornell = shipped("cornell.gltf");
    for density in [3.0, 20.0, 200.0] {
        let atlas = make_atlas(&cornell, &texels_a_metre(density)).unwrap();
        assert_eq!(atlas.pages.len(), 1);
        assert!(atlas.page.iter().all(Option::is_some));
        assert_sound(&cornell, &atlas, 2);
        for (i, triangle) in cornell.triangles.iter().enumerate() {
            let (laid, real) =
                (area(&in_texels(&atlas, i).unwrap()).abs(), triangle.normal_and_area().1);
            // Each side is rounded to whole texels.
            let shortest = density * real.sqrt() * 0.5;
            let ratio = laid / (real * density * density);
            assert!((ratio - 1.0).abs() < 2.0 / shortest, "{i}: {ratio} of {shortest}");
        }
        // Rectangles lie along the texels.
        let mut rectangles = 0;
        for chart in &atlas.charts {
            let square_corner = |t: &[DVec3; 3], k: usize| {
                let (u, v) = (t[(k + 1) % 3] - t[k], t[(k + 2) % 3] - t[k]);
                u.dot(v).abs() < 1e-12
            };
            let is_rectangle = chart.triangles.len() == 2
                && chart.triangles.iter().all(|&i| {
                    let t = &cornell.triangles[i as usize].vertices;
                    (0..3).any(|k| square_corner(t, k))
                });
            if is_rectangle {
                rectangles += 1;
                let [x, y, w, h] = chart.rectangle.map(f64::from);
                for c in
                    chart.triangles.iter().flat_map(|&i| in_texels(&atlas, i as usize).unwrap())
                {
                    let off = DVec2::new((c.x - x).min(x + w - c.x), (c.y - y).min(y + h - c.y));
                    assert!(off.abs().max_element() < 1e-9, "{c} in {:?}", chart.rectangle);
                }
            }
        }
        assert!(rectangles > 3, "{rectangles}");
    }
}

#[test]
fn a_page_of_a_given_size_is_filled() {
    for (name, least) in [("cornell.gltf", 0.68), ("room.gltf", 0.7), ("paper.gltf", 0.6)] {
        let scene = shipped(name);
        for size in [128, 1024] {
            let atlas = make_atlas(&scene, &of_size(size)).unwrap();
            assert_eq!(atlas.pages.len(), 1);
            assert_eq!((atlas.pages[0].width, atlas.pages[0].height), (size, size));
            assert_sound(&scene, &atlas, 2);
            let used: f64 = (0..scene.triangles.len())
                .map(|i| area(&in_texels(&atlas, i).unwrap()).abs())
                .sum();
            let share = used / f64::from(size).powi(2);
            assert!(share > least * if size < 500 { 0.6 } else { 1.0 }, "{name} {size}: {share}");
            let densities = atlas.charts.iter().map(|c| c.density);
            let (low, high) = densities.fold((f64::MAX, 0.0f64), |(a, b), d| (a.min(d), b.max(d)));
            assert!(size < 500 || high < 1.3 * low, "{name} {size}: {low} {high}");
        }
    }
}

#[test]
fn several_pages_where_one_is_too_small() {
    let room = shipped("room.gltf");
    let options = AtlasOptions { size: Some(64), padding: 1, ..texels_a_metre(12.0) };
    let atlas = make_atlas(&room, &options).unwrap();
    assert!(atlas.pages.len() > 2, "{}", atlas.pages.len());
    assert!(atlas.pages.iter().all(|p| (p.width, p.height) == (64, 64)));
    assert_sound(&room, &atlas, 1);
    // Charts larger than a page are made as large as one, with a notice.
    let options = AtlasOptions { size: None, max_size: 64, ..options };
    let smaller =
        make_atlas(&room, &AtlasOptions { texels_per_metre: Some(100.0), ..options.clone() });
    let smaller = smaller.unwrap();
    assert_sound(&room, &smaller, 1);
    assert!(smaller.notices.iter().any(|n| n.text.contains("--max-size")), "{:?}", smaller.notices);
}

/// A room whose inner box is its own object, with texture coordinates made by `uv`.
fn two_objects(uv: impl Fn(usize, DVec3) -> DVec2) -> Scene {
    let mut quads: Vec<_> =
        box_quads(DVec3::ZERO, DVec3::ONE, false).into_iter().map(|q| (q, 0)).collect();
    quads.extend(box_quads(DVec3::splat(0.3), DVec3::splat(0.6), true).into_iter().map(|q| (q, 1)));
    let mut made = scene(&quads, vec![material("walls", 0.5, 1.0), material("block", 0.5, 0.0)]);
    made.objects = vec![Object { name: "room".into() }, Object { name: "box".into() }];
    for (i, triangle) in made.triangles.iter_mut().enumerate() {
        triangle.object = u32::from(i >= 12);
        triangle.uv[1] = triangle.vertices.map(|x| uv(i, x));
    }
    made
}

/// Each quad in a cell of a 4 x 4 grid, with the last ones of the second object after the first's.
fn cells(i: usize, x: DVec3) -> DVec2 {
    let quad = i / 2;
    let (low, size) = if quad < 6 { (0.0, 1.0) } else { (0.3, 0.3) };
    let inner = (x - low) / size;
    // Of the three coordinates two vary.
    let flat = match quad % 6 {
        0 | 1 => DVec2::new(inner.x, inner.y),
        2 | 3 => DVec2::new(inner.x, inner.z),
        _ => DVec2::new(inner.y, inner.z),
    };
    let cell = DVec2::new((quad % 4) as f64, (quad / 4) as f64);
    (cell + 0.1 + 0.8 * flat) / 4.0
}

#[test]
fn a_valid_second_set_is_kept() {
    let both = two_objects(cells);
    assert!(second_sets(&both).iter().all(|s| s.is_valid()), "{:?}", second_sets(&both));
    let atlas = make_atlas(&both, &of_size(256)).unwrap();
    assert_eq!(atlas.charts.len(), 2);
    for (triangle, uv) in both.triangles.iter().zip(&atlas.uv) {
        assert_eq!(*uv, triangle.uv[1]);
    }
    // An instance shares the coordinates of the first: each gets a region, neither is distorted.
    let shared = two_objects(|i, x| {
        let i = i % 12;
        cells(i, if x.min_element() >= 0.3 && x.max_element() <= 0.6 { (x - 0.3) / 0.3 } else { x })
    });
    assert!(second_sets(&shared).iter().all(|s| s.is_valid()));
    for options in [of_size(256), texels_a_metre(50.0)] {
        let atlas = make_atlas(&shared, &options).unwrap();
        assert!(atlas.charts.iter().all(|c| c.kept) && atlas.charts.len() == 2);
        assert_sound(&shared, &atlas, 2);
        let ratio = atlas.charts[0].density / atlas.charts[1].density;
        assert!(ratio.is_finite() && ratio > 0.0);
        for (i, triangle) in shared.triangles.iter().enumerate() {
            let (t, own) = (in_texels(&atlas, i).unwrap(), triangle.uv[1]);
            // A whole number of texels, and one scale.
            let scale = (t[1] - t[0]).length() / (own[1] - own[0]).length();
            let moved = t[0] - scale * own[0];
            assert!(
                (moved - moved.round()).abs().max_element() < 1e-6,
                "{i}: {moved} {t:?} {own:?} {:?}",
                atlas.charts
            );
        }
    }
    // Without being asked to keep them, or overlapping, all are charted.
    let charted = make_atlas(&both, &AtlasOptions { keep: false, ..of_size(256) }).unwrap();
    assert!(charted.charts.iter().all(|c| !c.kept) && charted.charts.len() == 12);
}

#[test]
fn sets_that_cannot_hold_a_lightmap_are_found_and_replaced() {
    let count = |uv: &dyn Fn(usize, DVec3) -> DVec2| {
        let scene = two_objects(uv);
        let sets = second_sets(&scene);
        let atlas = make_atlas(&scene, &of_size(256)).unwrap();
        assert_sound(&scene, &atlas, 2);
        for chart in &atlas.charts {
            assert_eq!(chart.kept, sets[chart.object as usize].is_valid());
        }
        sets
    };
    let none = count(&|_, _| DVec2::ZERO);
    assert_eq!((none[0].missing, none[1].missing, none[0].flat), (12, 12, 0));
    let outside = count(&|i, x| if i < 2 { 2.0 + cells(i, x) } else { cells(i, x) });
    assert_eq!((outside[0].outside, outside[1].is_valid()), (2, true));
    let overlapping =
        count(&|i, x| if i < 4 { 0.1 + 0.5 * DVec2::new(x.x, x.y) } else { cells(i, x) });
    assert!(overlapping[0].overlapping >= 4, "{overlapping:?}");
    let flat = count(&|i, x| if i == 12 { DVec2::splat(0.5 + 0.1 * x.x) } else { cells(i, x) });
    assert_eq!((flat[1].flat, flat[0].is_valid()), (1, true));
}

#[test]
fn only_what_is_named_is_baked_as_dense_as_it_is_named() {
    let both = two_objects(|_, _| DVec2::ZERO);
    let only = AtlasOptions { only: vec!["b*x".into()], ..texels_a_metre(40.0) };
    let atlas = make_atlas(&both, &only).unwrap();
    for (i, page) in atlas.page.iter().enumerate() {
        assert_eq!(page.is_some(), i >= 12);
    }
    let denser = |pattern: &str, d: f64| Density { pattern: pattern.into(), texels_per_metre: d };
    let options = AtlasOptions {
        densities: vec![denser("walls", 10.0), denser("box", 80.0)],
        ..of_size(512)
    };
    let atlas = make_atlas(&both, &options).unwrap();
    assert_sound(&both, &atlas, 2);
    for chart in &atlas.charts {
        let first = atlas.charts.iter().find(|c| c.object == 0).unwrap().density;
        let expected = if chart.object == 0 { 1.0 } else { 8.0 };
        assert!((chart.density / first - expected).abs() < 0.1 * expected, "{chart:?}");
    }
    let nobody = AtlasOptions { only: vec!["nobody".into()], ..AtlasOptions::default() };
    let message = make_atlas(&both, &nobody).unwrap_err().to_string();
    assert!(message.contains("nobody") && message.contains("walls"), "{message}");
}

#[test]
fn degenerate_tiny_and_huge_things_get_texels_or_a_message() {
    // A needle, a plate thinner than a texel, a face smaller than a texel, far from the origin.
    let quad = |o: DVec3, u: DVec3, v: DVec3| [o, o + u, o + u + v, o + v];
    for size in [1e-6, 1.0, 1e6] {
        let at = |x: f64, y: f64, z: f64| size * dvec3(x, y, z);
        let quads = [
            (quad(at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0)), 0),
            (quad(at(0.0, 0.0, 1.0), at(1.0, 0.0, 0.0), at(0.0, 1e-7, 0.0)), 0),
            (quad(at(9.0, 0.0, 1.0), at(1e-5, 0.0, 0.0), at(0.0, 1e-5, 0.0)), 0),
        ];
        let scene = scene(&quads, vec![material("grey", 0.5, 1.0)]);
        for options in [of_size(64), texels_a_metre(30.0 / size)] {
            let atlas = make_atlas(&scene, &options).unwrap();
            assert_sound(&scene, &atlas, 2);
            assert_eq!(atlas.charts.len(), 3);
            for i in 0..scene.triangles.len() {
                let t = in_texels(&atlas, i).unwrap();
                assert!(area(&t).abs() > 0.49, "{i}: {}", area(&t));
            }
        }
        let many = make_atlas(&scene, &AtlasOptions { max_memory: 1 << 20, ..texels_a_metre(1e9) });
        if size >= 1.0 {
            // A page of the largest size still takes more than is allowed.
            assert!(matches!(many, Err(Error::Memory { .. })), "{:?}", many.map(|a| a.pages));
        }
    }
    let cornell = shipped("cornell.gltf");
    for (options, word) in [
        (of_size(8), "--size"),
        (AtlasOptions { padding: 32, ..of_size(64) }, "padding"),
        (texels_a_metre(0.0), "texels"),
        (texels_a_metre(f64::NAN), "texels"),
        (of_size(0), "--size"),
        (of_size(1 << 20), "--size"),
    ] {
        let error = make_atlas(&cornell, &options).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(word), "{error}");
    }
}
