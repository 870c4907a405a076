//! glTF and GLB files: everything that is read, in its smallest form.

mod scene_support;

use glam::{DVec2, DVec3};
use lumel::Error;
use lumel::scene::{
    MAX_REFLECTANCE, Override, Projection, ReadOptions, default_camera, exitance, read, reflectance,
};
use scene_support::*;
use serde_json::json;

const WHOLE: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

#[test]
fn containers_and_buffers_give_the_same_scene() {
    let g = Gltf::triangle();
    let folder = Folder::new();
    folder.write("my data/b 1.bin", &g.bin);
    let scenes = [
        folder.read("a.glb", g.glb()),
        folder.read("a.gltf", g.embedded()),
        folder.read("a.gltf", g.external("my%20data/b%201.bin")),
        folder.read("b.gltf", g.external("my data/b 1.bin")),
        folder.read("named-wrongly.obj", g.glb()),
        folder.read("UPPER.GLTF", [b"\xef\xbb\xbf", g.embedded().as_bytes()].concat()),
    ];
    for scene in scenes {
        let scene = scene.unwrap();
        assert_eq!(scene.triangles.len(), 1);
        assert_eq!(scene.triangles[0].vertices, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(scene.objects[0].name, "Tri");
        assert_eq!(scene.materials[0].name, "Grey");
        assert_eq!(scene.bounds(), (DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)));
        assert_eq!(scene.extent(), 1.0);
        assert_eq!(scene.triangle_normal_and_area(0), (DVec3::Z, 0.5));
        assert_eq!(scene.notices, []);
    }
}

#[test]
fn a_file_not_named_as_a_scene_is_unsupported() {
    let error = Folder::new().read("scene.fbx", "x").unwrap_err();
    assert!(matches!(error, Error::Unsupported { .. }));
    assert!(error.to_string().contains(".glb"), "{error}");
    let error = read("no such file.glb".as_ref(), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Unreadable { .. }));
}

#[test]
fn nodes_compose_in_f64() {
    let mut g = Gltf::triangle();
    g.json["nodes"][0]["translation"] = json!([0.1, 0.0, 0.0]);
    g.json["scenes"][0]["nodes"] = json!([1]);
    // Down: move, then turn x to y, then double.
    g.push("nodes", json!({"children": [2], "translation": [0.0, 0.0, 0.3]}));
    g.push("nodes", json!({"children": [3], "rotation": [0.0, 0.0, 0.5f64.sqrt(), 0.5f64.sqrt()]}));
    g.push(
        "nodes",
        json!({"children": [0], "matrix":
        [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]}),
    );
    let scene = g.read().unwrap();
    let [a, b, c] = scene.triangles[0].vertices;
    assert!(close(a, DVec3::new(0.0, 0.2, 0.3)), "{a}");
    assert!(close(b, DVec3::new(0.0, 2.2, 0.3)), "{b}");
    assert!(close(c, DVec3::new(-2.0, 0.2, 0.3)), "{c}");
}

#[test]
fn one_mesh_at_many_nodes_is_many_objects() {
    let mut g = Gltf::triangle();
    g.root(json!({"name": "Second", "mesh": 0, "translation": [5, 0, 0]}));
    g.root(json!({"mesh": 0, "translation": [9, 0, 0]}));
    let scene = g.read().unwrap();
    let names: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["Tri", "Second", "Tri"]);
    assert_eq!(scene.triangles.iter().map(|t| t.object).collect::<Vec<_>>(), [0, 1, 2]);
}

#[test]
fn mirroring_keeps_the_front_in_front() {
    let mut g = Gltf::triangle();
    let uv = g.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    g.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let scene = g.read().unwrap();
    let triangle = &scene.triangles[0];
    assert_eq!(scene.triangle_normal_and_area(0).0, DVec3::Z);
    // Each corner keeps its own coordinates.
    for (p, uv) in triangle.vertices.iter().zip(triangle.uv[0]) {
        assert_eq!(uv, DVec2::new(-p.x, p.y));
    }
}

#[test]
fn strips_and_fans_are_wound_alike() {
    for (mode, positions) in [
        (5, [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0., 0., 2., 0.]),
        (6, [0., 0., 0., 1., 0., 0., 1., 1., 0., 1., 2., 0., 0., 2., 0.]),
    ] {
        let mut g = Gltf::empty();
        let positions = g.floats("VEC3", &positions);
        let indices = g.shorts(&[0, 1, 2, 3, 4]);
        g.push("materials", grey());
        g.mesh(
            "S",
            json!({"attributes": {"POSITION": positions}, "indices": indices,
            "material": 0, "mode": mode}),
        );
        let scene = g.read().unwrap();
        assert_eq!(scene.triangles.len(), 3, "mode {mode}");
        for i in 0..3 {
            assert_eq!(scene.triangle_normal_and_area(i).0, DVec3::Z, "mode {mode}");
        }
    }
}

#[test]
fn points_and_lines_are_noticed_and_skipped() {
    for mode in [0, 1, 2, 3] {
        let mut g = Gltf::triangle();
        let primitive = json!({"attributes": {"POSITION": 0}, "mode": mode});
        g.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
        let scene = g.read().unwrap();
        assert_eq!(scene.triangles.len(), 1);
        assert!(noticed(&scene, "primitive 1", "points and lines"));
    }
}

#[test]
fn indices_of_all_widths_and_strided_views() {
    for (component, width) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut g = Gltf::empty();
        g.push("materials", grey());
        // Positions interleaved with four bytes of something else.
        let mut bytes = Vec::new();
        for p in [[9f32, 9., 9.], [0., 0., 0.], [1., 0., 0.], [0., 1., 0.]] {
            bytes.extend(p.iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([7; 4]);
        }
        let positions = g.accessor(&bytes, "VEC3", 5126, 4);
        g.json["bufferViews"][0]["byteStride"] = json!(16);
        let bytes: Vec<u8> =
            [1u32, 2, 3].iter().flat_map(|i| i.to_le_bytes()[..width].to_vec()).collect();
        let indices = g.accessor(&bytes, "SCALAR", component, 3);
        g.mesh(
            "M",
            json!({"attributes": {"POSITION": positions}, "indices": indices,
            "material": 0}),
        );
        let scene = g.read().unwrap();
        assert_eq!(scene.triangles[0].vertices, [DVec3::ZERO, DVec3::X, DVec3::Y]);
    }
}

#[test]
fn sparse_values_replace_others_or_zeros() {
    for with_base in [true, false] {
        let mut g = Gltf::empty();
        g.push("materials", grey());
        let indices = g.view(&[1, 2]);
        let values: Vec<u8> =
            [3f32, 0., 0., 0., 3., 0.].iter().flat_map(|v| v.to_le_bytes()).collect();
        let values = g.view(&values);
        let mut accessor = json!({"type": "VEC3", "componentType": 5126, "count": 3, "sparse":
            {"count": 2, "indices": {"bufferView": indices, "componentType": 5121},
             "values": {"bufferView": values}}});
        if with_base {
            accessor["bufferView"] = json!(g.view(&[0; 36]));
        }
        let positions = g.push("accessors", accessor);
        g.mesh("M", json!({"attributes": {"POSITION": positions}, "material": 0}));
        let scene = g.read().unwrap();
        assert_eq!(scene.triangles[0].vertices, [DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 3.0]);
    }
}

#[test]
fn scenes_are_chosen() {
    let mut g = Gltf::triangle();
    g.push("nodes", json!({"name": "Other", "mesh": 0, "translation": [0, 0, 7]}));
    g.json["scenes"] = json!([{"nodes": [0]}, {"name": "B", "nodes": [1]}]);
    g.json["scene"] = json!(1);
    let scene = g.read().unwrap();
    assert_eq!(scene.objects[0].name, "Other");
    assert!(noticed(&scene, "file", "scene 1 \"B\""));
    g.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(g.read().unwrap().objects[0].name, "Tri");
    g.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(g.read().unwrap().objects.len(), 2);
}

#[test]
fn cameras_look_down_minus_z() {
    let mut g = Gltf::triangle();
    g.push(
        "cameras",
        json!({"type": "perspective", "perspective":
        {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}}),
    );
    g.push(
        "cameras",
        json!({"name": "Plan", "type": "orthographic", "orthographic":
        {"xmag": 3.0, "ymag": 2.0, "znear": 0.1, "zfar": 10.0}}),
    );
    g.root(json!({"name": "Eye", "camera": 0, "translation": [1, 2, 3]}));
    // Looking down: -z becomes -y.
    let half = 0.5f64.sqrt();
    g.root(json!({"camera": 1, "rotation": [-half, 0.0, 0.0, half], "scale": [2, 2, 2]}));
    let scene = g.read().unwrap();
    let [eye, plan] = &scene.cameras[..] else { panic!("{:?}", scene.cameras) };
    assert_eq!((eye.name.as_str(), plan.name.as_str()), ("Eye", "Plan"));
    assert_eq!(eye.eye, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!((eye.forward, eye.up), (DVec3::NEG_Z, DVec3::Y));
    assert_eq!(eye.projection, Projection::Perspective { vertical_fov: 0.7, aspect: Some(1.5) });
    assert!(close(plan.forward, DVec3::NEG_Y) && close(plan.up, DVec3::NEG_Z));
    assert!(close(plan.right, DVec3::X));
    assert_eq!(plan.projection, Projection::Orthographic { half_width: 3.0, half_height: 2.0 });
}

#[test]
fn material_factors_are_exact() {
    let mut g = Gltf::triangle();
    g.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
    g.json["extensionsRequired"] = json!(["KHR_materials_emissive_strength"]);
    g.json["materials"][0] = json!({"doubleSided": true, "emissiveFactor": [0.1, 0.2, 0.3],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 7.0}},
        "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.6, 0.1, 1.0], "metallicFactor": 0.25}});
    let scene = g.read().unwrap();
    let material = &scene.materials[0];
    assert_eq!(material.name, "material 0");
    assert!(material.two_sided && scene.emits(0) && !scene.emits(9));
    assert_eq!(material.reflectance, DVec3::new(0.7, 0.6, 0.1));
    assert_eq!(material.radiance, DVec3::new(0.1, 0.2, 0.3) * 7.0);
    assert!(close(reflectance(&scene, 0, &WHOLE), DVec3::new(0.7, 0.6, 0.1) * 0.75));
    let pi = std::f64::consts::PI;
    assert!(close(exitance(&scene, 0, &WHOLE), DVec3::new(0.1, 0.2, 0.3) * (7.0 * pi)));
    assert!(noticed(&scene, "material 0", "partly metal"));
}

#[test]
fn defaults_are_the_specifications() {
    // Without a material: white metal.
    let mut g = Gltf::triangle();
    g.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    let scene = g.read().unwrap();
    let material = &scene.materials[scene.triangles[0].material as usize];
    assert_eq!((material.name.as_str(), material.metallic), ("default", 1.0));
    assert_eq!(reflectance(&scene, 0, &WHOLE), DVec3::ZERO);
    assert!(noticed(&scene, "default", "perfect metal"));
    // A white dielectric is lowered below 1, and that is said.
    let mut g = Gltf::triangle();
    g.json["materials"][0] = json!({"name": "W", "pbrMetallicRoughness": {"metallicFactor": 0}});
    let scene = g.read().unwrap();
    assert_eq!(reflectance(&scene, 0, &WHOLE), DVec3::splat(MAX_REFLECTANCE));
    assert!(noticed(&scene, "\"W\"", "outside"));
}

#[test]
fn vertex_colours_of_all_types_multiply() {
    let bytes = |v: &[u16]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    for case in 0..4 {
        let mut g = Gltf::triangle();
        let colour = match case {
            0 => g.floats("VEC3", &[1., 0., 0.5, 1., 0., 0.5, 1., 3., 0.5]),
            1 => g.floats("VEC4", &[1., 0., 0.5, 0., 1., 0., 0.5, 0., 1., 1., 0.5, 0.]),
            2 => {
                let b = [255, 0, 128, 0, 255, 0, 128, 0, 255, 255, 127, 0];
                g.accessor(&b, "VEC4", 5121, 3)
            }
            _ => {
                let b = bytes(&[65535, 0, 32768, 0, 65535, 0, 32768, 0, 65535, 65535, 32767, 0]);
                g.accessor(&b, "VEC4", 5123, 3)
            }
        };
        if case >= 2 {
            g.json["accessors"][colour]["normalized"] = json!(true);
        }
        g.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colour);
        let scene = g.read().unwrap();
        let mean = reflectance(&scene, 0, &WHOLE);
        let want = DVec3::new(0.5, 0.5 / 3.0, 0.25);
        assert!((mean - want).length() < 1e-3, "case {case}: {mean}");
        // The footprint at the last corner sees that corner's colour.
        let corner = reflectance(&scene, 0, &[DVec3::Z; 3]);
        assert!((corner.y - 0.5).abs() < 1e-12, "case {case}: {corner}");
    }
}

#[test]
fn what_the_model_cannot_hold_is_said_once_a_material() {
    let mut g = Gltf::triangle();
    let png = png(1, 1, |_, _| [255; 3]);
    let view = g.view(&png);
    g.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    g.push("textures", json!({"source": 0}));
    g.json["extensionsUsed"] =
        json!(["KHR_materials_unlit", "KHR_materials_transmission", "EXT_other"]);
    g.json["materials"][0] = json!({"name": "M", "alphaMode": "BLEND",
        "normalTexture": {"index": 0}, "occlusionTexture": {"index": 0},
        "pbrMetallicRoughness": {"metallicFactor": 1.0},
        "extensions": {"KHR_materials_unlit": {}, "KHR_materials_transmission": {}}});
    let primitive = json!({"attributes": {"POSITION": 0}, "material": 0,
        "targets": [{"POSITION": 0}]});
    g.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    g.push("skins", json!({"joints": [0]}));
    g.json["nodes"][0]["skin"] = json!(0);
    g.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    g.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    let scene = g.read().unwrap();
    for text in ["alpha", "normal map", "occlusion", "perfect metal", "unlit", "transmission"] {
        assert!(noticed(&scene, "\"M\"", text), "{text}: {:?}", scene.notices);
    }
    assert!(noticed(&scene, "primitive 1", "morph"));
    assert!(noticed(&scene, "Tri", "skin"));
    assert!(noticed(&scene, "Tri", "punctual light"));
    assert!(noticed(&scene, "EXT_other", "not read"));
    assert!(scene.notices.iter().all(|n| n.count == 1));
}

#[test]
fn options_change_materials() {
    let folder = Folder::new();
    let mut g = Gltf::triangle();
    g.json["materials"][0]["emissiveFactor"] = json!([1, 0, 0]);
    let colour = g.floats("VEC3", &[0.5; 9]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colour);
    let path = folder.write("s.glb", g.glb());
    let options = ReadOptions {
        two_sided: true,
        light_scale: 2.0,
        emission: vec![Override::parse("Gr*=1,2,3").unwrap()],
        reflectance: vec![Override::parse("*=0.25").unwrap()],
        ..ReadOptions::default()
    };
    let scene = read(&path, &options).unwrap();
    assert!(scene.materials[0].two_sided);
    assert_eq!(scene.materials[0].radiance, DVec3::new(2.0, 4.0, 6.0));
    assert_eq!(reflectance(&scene, 0, &WHOLE), DVec3::splat(0.25));

    let with = |name: &str, value: f64| ReadOptions {
        emission: vec![Override { pattern: name.into(), value: DVec3::splat(value) }],
        ..ReadOptions::default()
    };
    let error = read(&path, &with("grey", 1.0)).unwrap_err();
    assert!(matches!(error, Error::Usage(_)) && error.to_string().contains("\"Grey\""), "{error}");
    for (name, value) in [("Grey", -1.0), ("Grey", f64::NAN)] {
        assert!(matches!(read(&path, &with(name, value)), Err(Error::Usage(_))));
    }
    let scale = ReadOptions { light_scale: f64::INFINITY, ..ReadOptions::default() };
    assert!(matches!(read(&path, &scale), Err(Error::Usage(_))));
    let white = ReadOptions {
        reflectance: vec![Override::parse("Grey=1").unwrap()],
        ..ReadOptions::default()
    };
    let scene = read(&path, &white).unwrap();
    assert_eq!(scene.materials[0].reflectance, DVec3::splat(MAX_REFLECTANCE));
    assert!(noticed(&scene, "Grey", "outside"));
}

#[test]
fn long_material_lists_are_cut_in_usage_errors() {
    let mut g = Gltf::triangle();
    for i in 1..100 {
        g.push("materials", json!({"name": format!("m{i}")}));
    }
    let path = Folder::new();
    let path_file = path.write("s.glb", g.glb());
    let options = ReadOptions {
        emission: vec![Override::parse("none=1").unwrap()],
        ..ReadOptions::default()
    };
    let text = read(&path_file, &options).unwrap_err().to_string();
    assert!(text.contains("\"m29\"") && !text.contains("\"m30\""), "{text}");
    assert!(text.contains("and 70 more"), "{text}");
}

/// A box whose faces look inward (or outward), without its face at z = 1 if open.
fn room(inward: bool, open: bool, two_sided: bool) -> Gltf {
    let mut g = Gltf::empty();
    let mut material = grey();
    material["doubleSided"] = json!(two_sided);
    g.push("materials", material);
    let corner = |i: u16| [f32::from(i & 1), f32::from(i >> 1 & 1), f32::from(i >> 2 & 1)];
    let positions: Vec<f32> = (0..8).flat_map(corner).collect();
    let positions = g.floats("VEC3", &positions);
    // Outward faces.
    let mut quads =
        vec![[0, 2, 3, 1], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5], [4, 5, 7, 6]];
    if open {
        quads.pop();
    }
    let mut indices = Vec::new();
    for mut q in quads {
        if inward {
            q.reverse();
        }
        indices.extend([q[0], q[1], q[2], q[0], q[2], q[3]]);
    }
    let indices = g.shorts(&indices);
    g.mesh(
        "Room",
        json!({"attributes": {"POSITION": positions}, "indices": indices,
        "material": 0}),
    );
    g
}

#[test]
fn default_cameras_see_fronts() {
    let inside = |p: DVec3| p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::ONE).all();
    let eye = |g: Gltf| default_camera(&g.read().unwrap()).eye;
    assert!(inside(eye(room(true, false, false))), "a closed room is seen from inside");
    assert!(!inside(eye(room(false, false, false))), "a block is seen from outside");
    let open = eye(room(true, true, true));
    assert!(open.z > 1.0, "an open box is seen through its opening, not from {open}");
    let mut lit = room(true, false, true);
    let positions = lit.floats("VEC3", &[0.4, 0.99, 0.4, 0.6, 0.99, 0.4, 0.5, 0.99, 0.6]);
    lit.push("materials", json!({"emissiveFactor": [1, 1, 1]}));
    lit.mesh("Lamp", json!({"attributes": {"POSITION": positions}, "material": 1}));
    assert!(inside(eye(lit)), "a lamp tells the inside of a two-sided room");
}

#[test]
fn hygiene_counts_what_it_drops() {
    let mut g = Gltf::empty();
    g.push("materials", grey());
    let positions = g.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., 2., 0., 0.]);
    let indices = g.shorts(&[0, 1, 2, 1, 2, 0, 0, 2, 1, 0, 1, 3, 0, 0, 1]);
    g.mesh("M", json!({"attributes": {"POSITION": positions}, "indices": indices, "material": 0}));
    let scene = g.read().unwrap();
    assert_eq!(scene.triangles.len(), 2);
    assert_eq!(area_vector(&scene), DVec3::ZERO);
    let count = |text: &str| {
        scene.notices.iter().filter(|n| n.text.contains(text)).map(|n| n.count).sum::<usize>()
    };
    assert_eq!((count("without area"), count("duplicate")), (2, 1));
}
