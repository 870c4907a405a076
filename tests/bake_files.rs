//! Baked files as others read them: the rules of glTF, and the scene that was baked.

mod scene_support;

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

use glam::{DVec2, DVec3, Vec3};
use lumel::Monitor;
use lumel::bake::atlas::{Atlas, Lightmap, Page};
use lumel::bake::files::{FileOptions, Files, Format, lightmap_files, vertex_files};
use lumel::bake::target::Target;
use lumel::bake::vertices::{VertexOptions, vertex_light};
use lumel::scene::{self, Projection, ReadOptions, Scene};
use lumel::solve::{WithinOptions, light_within};
use scene_support::*;
use serde_json::{Value, json};

/// A room of two walls: one with a texture that is turned and mirrored, one two-sided, one that
/// emits; with colours, both sets of coordinates, an empty node and two cameras.
fn gltf() -> Gltf {
    let mut g = Gltf::empty();
    let checks = png(4, 4, |x, y| if (x + y) % 2 == 0 { [250, 120, 30] } else { [20, 90, 200] });
    let view = g.view(&checks);
    g.push("images", json!({"bufferView": view, "mimeType": "image/png", "name": "checks"}));
    g.push("samplers", json!({"wrapS": 33648, "wrapT": 33071, "magFilter": 9728}));
    g.push("textures", json!({"source": 0, "sampler": 0}));
    g.push("textures", json!({"source": 0}));
    g.push(
        "materials",
        json!({"name": "checked", "pbrMetallicRoughness": {
            "baseColorFactor": [0.9, 0.8, 0.7, 1.0], "metallicFactor": 0.25,
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {
                "offset": [0.2, -0.3], "rotation": 0.7, "scale": [1.5, -2.0]}}}
        }}),
    );
    g.push(
        "materials",
        json!({"name": "both", "doubleSided": true, "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.6, 0.7, 1.0], "metallicFactor": 0.0
        }}),
    );
    g.push(
        "materials",
        json!({"name": "lamp", "emissiveFactor": [1.0, 0.5, 0.25],
            "emissiveTexture": {"index": 1, "texCoord": 1},
            "pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorFactor": [0.1, 0.1, 0.1, 1.0]},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 7.0}}}),
    );
    g.json["extensionsUsed"] = json!(["KHR_texture_transform", "KHR_materials_emissive_strength"]);
    let quad = |g: &mut Gltf, name: &str, corners: [[f32; 3]; 4], material: usize| {
        let positions = g.floats("VEC3", &corners.concat());
        let uv = g.floats("VEC2", &[0., 0., 1., 0., 1., 1., 0., 1.]);
        let second = g.floats("VEC2", &[0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.1, 0.9]);
        let colours = [0.2, 0.4, 0.6, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.9, 0.1, 0.3];
        let colours = g.floats("VEC3", &colours);
        let indices = g.shorts(&[0, 1, 2, 0, 2, 3]);
        let mut primitive = json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uv,
            "TEXCOORD_1": second}, "indices": indices, "material": material});
        if material == 0 {
            primitive["attributes"]["COLOR_0"] = json!(colours);
        }
        g.mesh(name, primitive);
    };
    quad(&mut g, "floor", [[0., 0., 0.], [0., 0., 2.], [3., 0., 2.], [3., 0., 0.]], 0);
    quad(&mut g, "wall", [[0., 0., 0.], [3., 0., 0.], [3., 1., 0.], [0., 1., 0.]], 1);
    quad(&mut g, "lamp", [[1., 2., 0.5], [2., 2., 0.5], [2., 2., 1.5], [1., 2., 1.5]], 2);
    g.push(
        "cameras",
        json!({"type": "perspective", "name": "eye",
        "perspective": {"yfov": 0.8, "aspectRatio": 1.5, "znear": 0.01}}),
    );
    g.push(
        "cameras",
        json!({"type": "orthographic", "name": "plan",
        "orthographic": {"xmag": 2.0, "ymag": 1.0, "znear": 0.0, "zfar": 9.0}}),
    );
    g.root(json!({"name": "eye", "camera": 0, "translation": [1.5, 1.0, 5.0],
        "rotation": [0.0, 0.259, 0.0, 0.966]}));
    g.root(json!({"name": "plan", "camera": 1, "translation": [1.5, 4.0, 1.0],
        "rotation": [-0.6, 0.0, 0.0, 0.8]}));
    g
}

fn options(target: Target) -> FileOptions {
    FileOptions {
        target,
        format: Format::Exr { half: false },
        exposure_ev: None,
        layers: false,
        metadata: vec![("scene".into(), "s".into())],
        error: Some(0.01),
    }
}

/// Each object on its own row of one page, and a light of `value` everywhere.
fn lightmaps(scene: &Scene, value: f32) -> (Atlas, Vec<Lightmap>) {
    let rows = scene.objects.len() as f64;
    let (width, height) = (32, 16 * scene.objects.len() as u32);
    let uv = scene.triangles.iter().map(|t| {
        let [a, b, c] = t.uv[1].map(|uv| DVec2::new(uv.x, (f64::from(t.object) + uv.y) / rows));
        [a, b, c]
    });
    let atlas = Atlas {
        pages: vec![Page { width, height }],
        page: vec![Some(0); scene.triangles.len()],
        uv: uv.collect(),
        ..Atlas::default()
    };
    let texels = (width * height) as usize;
    let map = Lightmap {
        width,
        height,
        direct: vec![Vec3::splat(0.75 * value); texels],
        indirect: vec![Vec3::splat(0.25 * value); texels],
        covered: vec![1.0; texels],
    };
    (atlas, vec![map])
}

fn baked(scene: &Scene, output: &str, options: &FileOptions) -> Files {
    let (atlas, maps) = lightmaps(scene, 2.0);
    let monitor = Monitor::silent();
    lightmap_files(scene, &atlas, &maps, Path::new(output), options, &monitor).unwrap()
}

/// Writes files into a folder and reads the scene among them.
fn read_back(files: &Files) -> Scene {
    let room = tempfile::tempdir().unwrap();
    for (name, bytes) in &files.list {
        std::fs::write(room.path().join(name), bytes).unwrap();
    }
    let (last, _) = files.list.last().unwrap();
    scene::read(&room.path().join(last), &ReadOptions::default()).unwrap()
}

/// The JSON and the buffer of a GLB file, with the rules of its container.
fn glb(file: &[u8]) -> (Value, &[u8]) {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&file[..4], word(4), word(8)), (&b"glTF"[..], 2, file.len()));
    let json = word(12);
    assert_eq!((&file[16..20], json % 4), (&b"JSON"[..], 0));
    let bin = 20 + json;
    assert_eq!((&file[bin + 4..bin + 8], word(bin) % 4), (&b"BIN\0"[..], 0));
    assert_eq!(bin + 8 + word(bin), file.len());
    (serde_json::from_slice(&file[20..bin]).unwrap(), &file[bin + 8..])
}

/// The numbers of a float accessor, by element.
fn floats(json: &Value, bin: &[u8], accessor: &Value) -> Vec<Vec<f32>> {
    let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let number = |v: &Value| v.as_u64().unwrap() as usize;
    let width = match accessor["type"].as_str().unwrap() {
        "VEC2" => 2,
        "VEC3" => 3,
        _ => 1,
    };
    let (offset, count) = (number(&view["byteOffset"]), number(&accessor["count"]));
    assert_eq!((offset % 4, number(&view["byteLength"])), (0, 4 * width * count));
    let values = bin[offset..][..4 * width * count].chunks(4);
    let values: Vec<f32> = values.map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    values.chunks(width).map(|v| v.to_vec()).collect()
}

/// What Khronos' validator would call an error in meshes, and more.
fn follows_the_rules(json: &Value, bin: &[u8]) {
    for view in json["bufferViews"].as_array().unwrap() {
        let end = view["byteOffset"].as_u64().unwrap() + view["byteLength"].as_u64().unwrap();
        assert!(end as usize <= bin.len());
    }
    for mesh in json["meshes"].as_array().unwrap() {
        for primitive in mesh["primitives"].as_array().unwrap() {
            let attributes = primitive["attributes"].as_object().unwrap();
            let positions = floats(json, bin, &attributes["POSITION"]);
            let bounds = &json["accessors"][attributes["POSITION"].as_u64().unwrap() as usize];
            for (k, fold) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
                for axis in 0..3 {
                    let want = positions.iter().map(|p| p[axis]).reduce(fold).unwrap();
                    assert_eq!(bounds[k][axis].as_f64(), Some(f64::from(want)));
                }
            }
            for (name, accessor) in attributes {
                let values = floats(json, bin, accessor);
                assert_eq!(values.len(), positions.len(), "{name}");
                assert!(values.iter().flatten().all(|v| v.is_finite()), "{name}");
                match name.as_str() {
                    "NORMAL" => assert!(
                        values
                            .iter()
                            .all(|n| { (n.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5 })
                    ),
                    "COLOR_0" | "TEXCOORD_1" => {
                        assert!(values.iter().flatten().all(|v| (0.0..=1.0).contains(v)), "{name}");
                    }
                    _ => {}
                }
            }
            // Sets are numbered without gaps.
            let sets = (0..4).filter(|k| attributes.contains_key(&format!("TEXCOORD_{k}"))).count();
            assert!((0..sets).all(|k| attributes.contains_key(&format!("TEXCOORD_{k}"))));
            let indices = floats(json, bin, &primitive["indices"]);
            let most = indices.iter().map(|v| v[0].to_bits()).max().unwrap();
            assert_eq!(most as usize + 1, positions.len(), "every vertex is used");
        }
    }
}

/// Corners of all triangles with their objects and materials by name, in one order.
fn corners(scene: &Scene) -> BTreeMap<(String, String), Vec<[[f32; 3]; 3]>> {
    let mut all: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for t in &scene.triangles {
        let object = scene.objects[t.object as usize].name.clone();
        let material = scene.materials[t.material as usize].name.clone();
        let list = all.entry((object, material)).or_default();
        list.push(t.vertices.map(|p| p.as_vec3().to_array()));
    }
    all
}

fn mean_of(scene: &Scene, of: fn(&Scene, usize, &[DVec3; 3]) -> DVec3) -> Vec<DVec3> {
    let part = [[0.6, 0.2, 0.2], [0.5, 0.3, 0.2], [0.4, 0.2, 0.4]].map(DVec3::from);
    (0..scene.triangles.len()).map(|i| of(scene, i, &part)).collect()
}

#[test]
fn lit_targets_keep_the_whole_scene() {
    let before = gltf().read().unwrap();
    for (target, output) in
        [(Target::Three, "a.glb"), (Target::Bevy, "b.gltf"), (Target::Blender, "c.glb")]
    {
        let files = baked(&before, output, &options(target));
        let after = read_back(&files);
        assert_eq!(corners(&before), corners(&after), "{target:?}");
        let names = |s: &Scene| s.objects.iter().map(|o| o.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&before), names(&after));
        for (of, close) in [
            (scene::reflectance as fn(&Scene, usize, &[DVec3; 3]) -> DVec3, 1e-6),
            (scene::exitance, 1e-5),
        ] {
            for (a, b) in mean_of(&before, of).into_iter().zip(mean_of(&after, of)) {
                assert!((a - b).abs().max_element() <= close, "{target:?}: {a} {b}");
            }
        }
        let sides = |s: &Scene| s.materials.iter().map(|m| m.two_sided).collect::<Vec<_>>();
        assert_eq!(sides(&before), sides(&after));
        // The light's own coordinates are the second set.
        let (atlas, _) = lightmaps(&before, 1.0);
        for (uv, t) in atlas.uv.iter().zip(&after.triangles) {
            assert!((0..3).all(|k| uv[k].distance(t.uv[1][k]) < 1e-6));
        }
    }
}

#[test]
fn cameras_see_the_same() {
    let before = gltf().read().unwrap();
    let after = read_back(&baked(&before, "a.glb", &options(Target::Unlit)));
    assert_eq!(before.cameras.len(), 2);
    for (a, b) in before.cameras.iter().zip(&after.cameras) {
        assert_eq!(a.name, b.name);
        for (x, y) in [(a.eye, b.eye), (a.right, b.right), (a.up, b.up), (a.forward, b.forward)] {
            assert!((x - y).length() < 1e-12);
        }
        match (a.projection, b.projection) {
            (
                Projection::Perspective { vertical_fov: f, aspect: r },
                Projection::Perspective { vertical_fov: g, aspect: s },
            ) => assert!((f - g).abs() < 1e-6 && (r.unwrap() - s.unwrap()).abs() < 1e-6),
            (a, b) => assert_eq!(a, b),
        }
    }
}

#[test]
fn an_unlit_scene_shows_radiance_and_lamps_their_own() {
    let scene = gltf().read().unwrap();
    let files =
        baked(&scene, "a.glb", &FileOptions { exposure_ev: Some(-3.0), ..options(Target::Unlit) });
    let (json, bin) = glb(&files.list.last().unwrap().1);
    follows_the_rules(&json, bin);
    assert_eq!(json["extensionsUsed"], json!(["KHR_materials_unlit"]));
    for material in json["materials"].as_array().unwrap() {
        assert_eq!(material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], 1);
        assert!(material["extensions"]["KHR_materials_unlit"].is_object());
    }
    // The picture: H = 2 everywhere, so the wall shows 2 rho/pi, and the lamp (E + rho H)/pi.
    let view = &json["bufferViews"][json["images"][0]["bufferView"].as_u64().unwrap() as usize];
    let png = &bin[view["byteOffset"].as_u64().unwrap() as usize..];
    let picture = image::load_from_memory_with_format(png, image::ImageFormat::Png).unwrap();
    let picture = picture.to_rgb8();
    let level = |x: f64| (255.0 * lumel::output::png_file::srgb_from_linear(x.min(1.0))).round();
    for (y, material, emitted) in [(24, 1, DVec3::ZERO), (40, 2, scene.materials[2].radiance)] {
        let rho = scene.materials[material].reflectance;
        let got = picture.get_pixel(16, y).0;
        let plain = (emitted + 2.0 * rho / PI) / 8.0;
        if material == 1 {
            assert_eq!(got.map(f64::from), plain.to_array().map(level));
        } else {
            // Its texture is between 20 and 250 of 255 levels.
            assert!(got[0] > 20 && f64::from(got[0]) <= level(plain.x), "{got:?}");
        }
    }
    assert!(files.notices.iter().any(|n| n.about.contains("both") && n.text.contains("backs")));
    assert!(files.notices.iter().any(|n| n.about.contains("checked")));
}

#[test]
fn colours_of_vertices_follow_the_rules_and_show_both_sides() {
    let scene = gltf().read().unwrap();
    let monitor = Monitor::silent();
    let light = light_within(&scene, &WithinOptions::new(0.02, u64::MAX), &monitor).unwrap();
    let wanted: Vec<bool> = scene.triangles.iter().map(|t| t.object != 2).collect();
    let how = VertexOptions { tolerance: 0.01, most: 5000 };
    let surface = vertex_light(&scene, &light, &wanted, &how, &monitor).unwrap();
    assert!(surface.error <= 0.01 && surface.triangles.len() > 50, "{}", surface.error);
    // Both sides of the wall, one of everything else.
    let area = |back: bool| -> f64 {
        let of = surface.triangles.iter().filter(|t| t.back == back);
        of.map(|t| {
            let [a, b, c] = t.corners;
            0.5 * (b - a).cross(c - a).length()
        })
        .sum()
    };
    assert!((area(false) - (6.0 + 3.0 + 1.0)).abs() < 1e-9);
    assert!((area(true) - 3.0).abs() < 1e-9);
    let output = Path::new("v.glb");
    let files = vertex_files(&scene, &surface, &wanted, output, &options(Target::Unlit)).unwrap();
    let (json, bin) = glb(&files.list.last().unwrap().1);
    follows_the_rules(&json, bin);
    let scale = json["asset"]["extras"]["vertices"]["scale"].as_f64().unwrap();
    assert!((scale.log2() + files.exposure_ev.unwrap()).abs() < 1e-12);
    // What is shown is radiance: colour times scale (times the texture of the floor).
    for (name, rho) in [("wall", scene.materials[1].reflectance)] {
        let meshes = json["meshes"].as_array().unwrap();
        let mesh = meshes.iter().find(|m| m["name"] == name).unwrap();
        let attributes = &mesh["primitives"][0]["attributes"];
        let colours = floats(&json, bin, &attributes["COLOR_0"]);
        let positions = floats(&json, bin, &attributes["POSITION"]);
        for t in surface.triangles.iter().filter(|t| t.triangle == 2 || t.triangle == 3) {
            let want = rho * t.irradiance[0] / PI / scale;
            let p = t.corners[0].as_vec3().to_array();
            let near = positions.iter().zip(&colours).filter(|(q, _)| q[..] == p);
            let off = near.map(|(_, c)| (c[0] as f64 - want.x.min(1.0)).abs());
            assert!(off.fold(f64::INFINITY, f64::min) < 1e-6);
        }
    }
    // What was not asked for keeps its material.
    let lamp = json["materials"].as_array().unwrap().iter().find(|m| m["name"] == "lamp").unwrap();
    assert!(lamp["extensions"]["KHR_materials_emissive_strength"].is_object());
    let lit = json["materials"].as_array().unwrap().iter().find(|m| m["name"] == "checked");
    assert!(lit.unwrap()["pbrMetallicRoughness"]["baseColorTexture"].is_object());
}

#[test]
fn quantities_differ_by_pi_as_they_are_said_to() {
    let scene = gltf().read().unwrap();
    for (target, want) in
        [(Target::Three, 2.0), (Target::Bevy, 2.0 / PI), (Target::Blender, 2.0 / PI)]
    {
        for format in
            [Format::Exr { half: false }, Format::Exr { half: true }, Format::Hdr, Format::Png]
        {
            let files = baked(&scene, "a.glb", &FileOptions { format, ..options(target) });
            let sidecar: Value = serde_json::from_slice(&files.list[1].1).unwrap();
            let scale = sidecar["lightmap"]["scale"].as_f64().unwrap();
            let bytes = &files.list[0].1;
            let stored = match format {
                Format::Exr { .. } => {
                    use exr::prelude::*;
                    let image = read()
                        .no_deep_data()
                        .largest_resolution_level()
                        .rgb_channels(|_, _| 0f32, |v, _, (r, _, _): (f32, f32, f32)| *v = r)
                        .first_valid_layer()
                        .all_attributes()
                        .from_buffered(std::io::Cursor::new(bytes))
                        .unwrap();
                    f64::from(image.layer_data.channel_data.pixels)
                }
                Format::Hdr => {
                    let format = image::ImageFormat::Hdr;
                    let picture = image::load_from_memory_with_format(bytes, format).unwrap();
                    f64::from(picture.to_rgb32f().get_pixel(0, 0).0[0])
                }
                Format::Png => {
                    let picture = image::load_from_memory(bytes).unwrap();
                    let v = f64::from(picture.to_rgb16().get_pixel(0, 0).0[0]) / 65535.0;
                    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
                }
            };
            let close = if format == Format::Hdr { want / 256.0 } else { 1e-3 };
            assert!(
                (stored * scale - want).abs() < close,
                "{target:?} {format:?}: {stored} {scale}"
            );
            assert_eq!(sidecar["lightmap"]["quantity"], target.quantity().name());
        }
    }
}

#[test]
fn a_scene_far_from_the_origin_keeps_its_shape() {
    let mut g = gltf();
    for k in 0..3 {
        g.json["nodes"][k]["translation"] = json!([1e7, -2e7, 3e7]);
    }
    let before = g.read().unwrap();
    let after = read_back(&baked(&before, "a.glb", &options(Target::Three)));
    for (a, b) in before.triangles.iter().zip(&after.triangles) {
        for k in 0..3 {
            let (x, y) = (a.vertices[k] - before.bounds().0, b.vertices[k] - after.bounds().0);
            assert!((x - y).length() < 1e-6, "{x} {y}");
        }
    }
}
