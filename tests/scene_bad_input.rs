//! Bad files: each kind is refused with an error that names file, object and remedy; nothing
//! panics, hangs or exhausts the memory.

mod scene_support;

use std::fs;
use std::time::{Duration, Instant};

use lumel::Error;
use lumel::scene::{ReadOptions, read};
use scene_support::*;
use serde_json::{Value, json};

/// The kind of an error.
#[derive(Debug, PartialEq, Clone, Copy)]
enum Kind {
    Unreadable,
    Invalid,
    Unsupported,
    Other,
}
use Kind::{Invalid, Unreadable, Unsupported};

fn kind(error: &Error) -> Kind {
    match error {
        Error::Unreadable { .. } => Unreadable,
        Error::Invalid { .. } => Invalid,
        Error::Unsupported { .. } => Unsupported,
        _ => Kind::Other,
    }
}

/// Reads a file that must be refused: kind and all parts of the message must be as wanted.
#[track_caller]
fn refused(name: &str, bytes: impl AsRef<[u8]>, want: Kind, parts: &[&str]) {
    let error = match Folder::new().read(name, bytes) {
        Err(error) => error,
        Ok(scene) => panic!("accepted: {:?}", scene.notices),
    };
    let text = error.to_string();
    assert_eq!(kind(&error), want, "{text}");
    assert_eq!(error.exit_code(), 3);
    assert!(text.contains(name), "the file is not named: {text}");
    for part in parts {
        assert!(text.contains(part), "no \"{part}\" in: {text}");
    }
}

#[track_caller]
fn refused_gltf(g: &Gltf, want: Kind, parts: &[&str]) {
    refused("bad.glb", g.glb(), want, parts);
}

/// The usual triangle with some member changed.
fn changed(change: impl FnOnce(&mut Value)) -> Gltf {
    let mut g = Gltf::triangle();
    change(&mut g.json);
    g
}

#[test]
fn coordinates_that_are_no_numbers() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut g = Gltf::triangle();
        g.bin[12..16].copy_from_slice(&bad.to_le_bytes());
        refused_gltf(&g, Invalid, &["mesh 0 \"Tri\", primitive 0", "vertex 1", "repair"]);
    }
    let mut g = Gltf::triangle();
    let colour = g.floats("VEC3", &[f32::NAN; 9]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colour);
    refused_gltf(&g, Invalid, &["Tri", "COLOR_0", "vertex 0"]);
    for (text, what) in [("v 0 nan 0\n", "nan"), ("o A\nv 0 0 1e999\n", "1e999")] {
        refused("bad.obj", text, Invalid, &["line", "object", what, "not finite"]);
    }
    refused("bad.obj", "v 1e200 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3", Invalid, &["object", "1e30"]);
}

/// The crate that reads glTF cuts indices to 32 bits.
#[test]
fn indices_beyond_32_bits() {
    let huge = 1u64 << 32;
    let g = changed(|j| j["nodes"][0]["mesh"] = json!(huge));
    refused_gltf(&g, Invalid, &["mesh", "4294967296", "export it again"]);
    let g = changed(|j| j["accessors"][0]["componentType"] = json!(huge + 5126));
    refused_gltf(&g, Invalid, &["componentType", "4294972422"]);
    let g = changed(|j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(huge));
    refused_gltf(&g, Invalid, &["POSITION", "4294967296"]);
}

/// Found by a broken file: pi times the largest number is none.
#[test]
fn emission_beyond_reason() {
    let face = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Sun\nf 1 2 3\n";
    for (emission, fits) in [("1e308", false), ("1e31", false), ("1e29", true)] {
        let folder = Folder::new();
        folder.write("m.mtl", format!("newmtl Sun\nKe {emission} 1 1\n"));
        match folder.read("sun.obj", face) {
            Ok(_) => assert!(fits, "{emission}"),
            Err(error) => {
                assert!(!fits && kind(&error) == Invalid, "{error}");
                for part in ["sun.obj", "Sun", "1e30", "--emission"] {
                    assert!(error.to_string().contains(part), "no \"{part}\" in: {error}");
                }
            }
        }
    }
}

#[test]
fn transforms_that_are_no_transforms() {
    let huge = 1e300;
    let matrix = |i: usize, x: f64| {
        let mut m = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
        m[i] = x;
        changed(|j| j["nodes"][0]["matrix"] = json!(m))
    };
    refused_gltf(&matrix(3, 0.5), Invalid, &["node 0 \"Tri\"", "last row"]);
    refused_gltf(&matrix(15, 2.0), Invalid, &["node 0 \"Tri\"", "last row"]);
    refused_gltf(&matrix(0, huge), Invalid, &["Tri", "1e30"]);
    let g = changed(|j| {
        j["nodes"][0]["scale"] = json!([huge, 1, 1]);
        j["scenes"][0]["nodes"] = json!([1]);
        j["nodes"].as_array_mut().unwrap().push(json!({"children": [0], "scale": [huge, 1, 1]}));
    });
    refused_gltf(&g, Invalid, &["node 0 \"Tri\"", "not finite"]);
    let g = changed(|j| {
        j["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
        j["nodes"][0]["translation"] = json!([1, 2, 3]);
    });
    refused_gltf(&g, Invalid, &["node 0 \"Tri\"", "matrix and also"]);
    let g = changed(|j| j["nodes"][0]["rotation"] = json!([0, 0, 0, 0]));
    refused_gltf(&g, Invalid, &["node 0 \"Tri\"", "quaternion"]);
    // A number that JSON can hold and f64 cannot.
    let text =
        Gltf::triangle().embedded().replace("\"mesh\":0", "\"mesh\":0,\"scale\":[1e999,1,1]");
    refused("bad.gltf", text, Unreadable, &["JSON"]);
}

#[test]
fn indices_past_the_end() {
    let mut g = Gltf::triangle();
    let indices = g.shorts(&[0, 1, 3]);
    g.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    refused_gltf(&g, Invalid, &["mesh 0 \"Tri\", primitive 0, indices", "index 3", "3 vertices"]);

    /// What is past the end, how it comes about, and where.
    type Case = (&'static str, fn(&mut Value), &'static str);
    let past: [Case; 12] = [
        ("default scene", |j| j["scene"] = json!(5), "file"),
        ("node 7", |j| j["scenes"][0]["nodes"] = json!([7]), "scene 0"),
        ("child node 9", |j| j["nodes"][0]["children"] = json!([9]), "node 0 \"Tri\""),
        ("mesh 3", |j| j["nodes"][0]["mesh"] = json!(3), "node 0 \"Tri\""),
        ("camera 0", |j| j["nodes"][0]["camera"] = json!(0), "node 0 \"Tri\""),
        ("skin 0", |j| j["nodes"][0]["skin"] = json!(0), "node 0 \"Tri\""),
        (
            "Positions accessor 8",
            |j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(8),
            "mesh 0 \"Tri\", primitive 0",
        ),
        (
            "index accessor 8",
            |j| j["meshes"][0]["primitives"][0]["indices"] = json!(8),
            "mesh 0 \"Tri\", primitive 0",
        ),
        (
            "material 4",
            |j| j["meshes"][0]["primitives"][0]["material"] = json!(4),
            "mesh 0 \"Tri\", primitive 0",
        ),
        ("buffer view 3", |j| j["accessors"][0]["bufferView"] = json!(3), "accessor 0"),
        ("buffer 1", |j| j["bufferViews"][0]["buffer"] = json!(1), "buffer view 0"),
        (
            "texture 0",
            |j| j["materials"][0]["emissiveTexture"] = json!({"index": 0}),
            "material 0 \"Grey\"",
        ),
    ];
    for (index, change, object) in past {
        refused_gltf(&changed(change), Invalid, &[index, object, "does not exist", "export"]);
    }
    // What nothing here follows, but the format forbids.
    let g = changed(|j| j["skins"] = json!([{"joints": [99]}]));
    refused_gltf(&g, Invalid, &["skins[0]", "out of bounds"]);
    for text in ["f 1 2 3", "v 0 0 0\nf 1 1 2", "v 0 0 0\nf -1 -1 -2", "v 0 0 0\nf 0 1 1"] {
        refused(
            "bad.obj",
            format!("o Wall\n{text}"),
            Invalid,
            &["line", "object \"Wall\"", "vertex"],
        );
    }
    let far = "v 0 0 0\nvt 0 0\nf 1/-9223372036854775808 1 1";
    refused("bad.obj", far, Invalid, &["line 3", "texture coordinate"]);
    refused("bad.obj", "v 0 0 0\nvt 0 0\nf 1/2 1 1", Invalid, &["line 3", "texture coordinate 2"]);
}

#[test]
fn accessors_that_do_not_fit_their_buffers() {
    let accessor = |change: fn(&mut Value)| changed(|j| change(&mut j["accessors"][0]));
    let parts = ["mesh 0 \"Tri\", primitive 0, POSITION, accessor 0", "export"];
    refused_gltf(&accessor(|a| a["count"] = json!(4)), Invalid, &parts);
    refused_gltf(&accessor(|a| a["count"] = json!(4_000_000_000u64)), Invalid, &parts);
    refused_gltf(&accessor(|a| a["count"] = json!(u64::MAX)), Invalid, &parts);
    refused_gltf(&accessor(|a| a["byteOffset"] = json!(4)), Invalid, &parts);
    refused_gltf(&accessor(|a| a["byteOffset"] = json!(u64::MAX)), Invalid, &parts);
    let view = |change: fn(&mut Value)| changed(|j| change(&mut j["bufferViews"][0]));
    let parts = ["POSITION", "buffer view 0", "past the end", "export"];
    refused_gltf(&view(|v| v["byteLength"] = json!(40)), Invalid, &parts);
    refused_gltf(&view(|v| v["byteOffset"] = json!(u64::MAX)), Invalid, &parts);
    refused_gltf(&view(|v| v["byteStride"] = json!(8)), Invalid, &["POSITION", "overlap"]);
    refused_gltf(&view(|v| v["byteStride"] = json!(1000)), Invalid, &["byteStride"]);

    // Huge counts without data behind them.
    let sparse = |count: u64, replaced: u64, place: u8| {
        let mut g = Gltf::empty();
        g.push("materials", grey());
        let indices = g.view(&[place]);
        let values = g.view(&[0; 12]);
        let positions = g.push(
            "accessors",
            json!({"type": "VEC3", "componentType": 5126, "count": count,
            "sparse": {"count": replaced, "values": {"bufferView": values},
            "indices": {"bufferView": indices, "componentType": 5121}}}),
        );
        g.mesh("Tri", json!({"attributes": {"POSITION": positions}, "material": 0}));
        g
    };
    refused_gltf(&sparse(4_000_000_000, 1, 0), Invalid, &["Tri", "4000000000", "without data"]);
    refused_gltf(&sparse(u64::MAX, 1, 0), Invalid, &["Tri", "without data"]);
    refused_gltf(&sparse(3, 4_000_000_000, 0), Invalid, &["Tri", "replaces 4000000000"]);
    refused_gltf(&sparse(3, 2, 0), Invalid, &["Tri", "2 elements need"]);
    refused_gltf(&sparse(3, 1, 3), Invalid, &["Tri", "element 3 of 3"]);
    let g = changed(|j| drop(j["accessors"][0].as_object_mut().unwrap().remove("bufferView")));
    refused_gltf(&g, Invalid, &["accessors[0]"]);
}

#[test]
fn accessors_of_wrong_types() {
    let mut g = Gltf::triangle();
    let other = g.floats("VEC2", &[0.0; 6]);
    let bytes = g.accessor(&[0; 12], "VEC4", 5121, 3);
    let long = g.floats("VEC2", &[0.0; 8]);
    let float_indices = g.floats("SCALAR", &[0.0, 1.0, 2.0]);
    let signed = g.accessor(&[0, 0, 1, 0, 2, 0], "SCALAR", 5122, 3);
    let set = |attribute: &str, accessor: usize| {
        let mut g = g.clone();
        g.json["meshes"][0]["primitives"][0]["attributes"][attribute] = json!(accessor);
        g
    };
    let parts = |semantic: &'static str| ["mesh 0 \"Tri\"", semantic, "must hold"];
    refused_gltf(&set("POSITION", other), Invalid, &parts("POSITION"));
    refused_gltf(&set("POSITION", bytes), Invalid, &parts("POSITION"));
    refused_gltf(&set("TEXCOORD_0", 0), Invalid, &parts("TEXCOORD_0"));
    refused_gltf(&set("COLOR_0", bytes), Invalid, &parts("COLOR_0"));
    refused_gltf(&set("TEXCOORD_1", long), Invalid, &["TEXCOORD_1", "4 elements for 3 vertices"]);
    for accessor in [float_indices, signed, 0] {
        let mut g = g.clone();
        g.json["meshes"][0]["primitives"][0]["indices"] = json!(accessor);
        refused_gltf(&g, Invalid, &parts("indices"));
    }
    let unknown = changed(|j| j["accessors"][0]["componentType"] = json!(5124));
    refused_gltf(&unknown, Invalid, &["accessors[0]"]);
}

#[test]
fn nodes_that_are_no_trees() {
    let cycle = changed(|j| {
        j["nodes"] = json!([{"name": "A", "mesh": 0}, {"name": "B", "children": [2]},
            {"name": "C", "children": [1]}]);
    });
    refused_gltf(&cycle, Invalid, &["node 1 \"B\"", "cycle"]);
    let own = changed(|j| j["nodes"][0]["children"] = json!([0]));
    refused_gltf(&own, Invalid, &["node 0 \"Tri\"", "cycle"]);
    let two = changed(|j| {
        j["nodes"] = json!([{"name": "A", "mesh": 0}, {"name": "B", "children": [0]},
            {"name": "C", "children": [0]}]);
        j["scenes"][0]["nodes"] = json!([1, 2]);
    });
    refused_gltf(&two, Invalid, &["node 0 \"A\"", "node 1 \"B\" and node 2 \"C\""]);
    let twice = changed(|j| j["scenes"][0]["nodes"] = json!([0, 0]));
    refused_gltf(&twice, Invalid, &["node 0 \"Tri\"", "twice"]);
    let child = changed(|j| {
        j["nodes"] = json!([{"name": "A", "mesh": 0}, {"name": "B", "children": [0]}]);
        j["scenes"][0]["nodes"] = json!([1, 0]);
    });
    refused_gltf(&child, Invalid, &["node 0 \"A\"", "as a root"]);
}

#[test]
fn deep_nodes_do_not_overflow_the_stack() {
    let n = 100_000;
    let mut g = Gltf::triangle();
    let mut nodes: Vec<Value> = (1..n).map(|i| json!({"children": [i]})).collect();
    nodes.push(json!({"name": "Deep", "mesh": 0, "translation": [1, 0, 0]}));
    g.json["nodes"] = json!(nodes);
    let scene = g.read().unwrap();
    assert_eq!(scene.objects[0].name, "Deep");
    // Deep JSON itself.
    let deep = format!("{}{}", "[".repeat(200_000), "]".repeat(200_000));
    let with = |member: &str| {
        Gltf::triangle().embedded().replacen('{', &format!("{{\"{member}\":{deep},"), 1)
    };
    refused(
        "bad.gltf",
        with("extensions\":{\"X").replacen(",\"accessors", "},\"accessors", 1),
        Unreadable,
        &["JSON"],
    );
    refused("bad.gltf", with("nodes"), Unreadable, &["JSON"]);
    // What is skipped may be as deep as it likes.
    Folder::new().read("good.gltf", with("extras")).unwrap();
}

#[test]
fn small_files_cannot_ask_for_much_memory() {
    // 2^12 nodes share a mesh of 2^13 triangles.
    let mut g = Gltf::empty();
    g.push("materials", grey());
    let n = 1 << 13;
    let positions = g.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let indices = g.accessor(&[0, 1, 2].repeat(n), "SCALAR", 5121, 3 * n);
    g.mesh("M", json!({"attributes": {"POSITION": positions}, "indices": indices, "material": 0}));
    for i in 0..1 << 12 {
        g.root(json!({"name": format!("copy {i}"), "mesh": 0}));
    }
    let start = Instant::now();
    refused_gltf(&g, Unsupported, &["copy", "triangles", "simplify"]);
    assert!(start.elapsed() < Duration::from_secs(60));
    // An image that says it is huge.
    let mut image = png(1, 1, |_, _| [0; 3]);
    image[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let crc = crc32(&image[12..29]);
    image[29..33].copy_from_slice(&crc.to_be_bytes());
    refused_gltf(&with_image(&image), Unsupported, &["image 0", "16384 x 16384", "scale it down"]);
    let corners: String = (0..20_000).map(|_| " 1").collect();
    refused("bad.obj", format!("v 0 0 0\nf{corners}"), Unsupported, &["line 2", "20000 corners"]);
}

/// The check sum of PNG chunks.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &b| {
        (0..8).fold(crc ^ u32::from(b), |c, _| (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg()))
    })
}

/// The usual triangle, textured with an embedded image.
fn with_image(bytes: &[u8]) -> Gltf {
    let mut g = Gltf::triangle();
    let view = g.view(bytes);
    g.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    g.push("textures", json!({"source": 0}));
    g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    g
}

#[test]
fn images_that_are_none() {
    let image = png(40, 40, |x, y| [(x * y) as u8, x as u8, y as u8]);
    with_image(&image).read().unwrap();
    refused_gltf(
        &with_image(&image[..image.len() / 2]),
        Invalid,
        &["image 0", "cannot be decoded"],
    );
    refused_gltf(&with_image(b"GIF89a"), Unsupported, &["image 0", "PNG, JPEG", "convert"]);
    let picture = image::load_from_memory(&image).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    let jpeg = bytes.into_inner();
    with_image(&jpeg).read().unwrap();
    refused_gltf(&with_image(&jpeg[..jpeg.len() - 20]), Invalid, &["image 0", "cut off"]);
    let neither = |j: &mut Value| j["images"][0] = json!({"name": "Pic"});
    let mut g = with_image(&image);
    neither(&mut g.json);
    refused_gltf(&g, Invalid, &["image 0 \"Pic\"", "either a URI or a buffer view"]);
    let mut g = with_image(&image);
    g.json["bufferViews"][1]["byteLength"] = json!(1_000_000);
    refused_gltf(&g, Invalid, &["image 0", "past the end"]);
    let mut g = with_image(&image);
    g.json["textures"][0] = json!({"extensions": {"EXT_texture_webp": {"source": 0}}});
    refused_gltf(&g, Unsupported, &["texture 0", "PNG or JPEG"]);
    let mut g = with_image(&image);
    g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(2);
    refused_gltf(&g, Unsupported, &["material 0 \"Grey\"", "TEXCOORD_2"]);
}

#[test]
fn files_that_are_missing() {
    let g = Gltf::triangle();
    refused("bad.gltf", g.external("no.bin"), Unreadable, &["buffer 0", "no.bin", "beside"]);
    let mut textured = with_image(&png(1, 1, |_, _| [0; 3]));
    textured.json["images"][0] = json!({"uri": "no.png"});
    refused("bad.gltf", textured.embedded(), Unreadable, &["image 0 \"no.png\"", "beside"]);
    for uri in ["https://example.org/b.bin", "file:///b.bin", "C:/b.bin", "/etc/hostname"] {
        refused("bad.gltf", g.external(uri), Unsupported, &["buffer 0", uri, "relative"]);
    }
    // A folder and a device are no files.
    refused("bad.gltf", g.external("."), Unreadable, &["buffer 0"]);
    refused("bad.gltf", g.external("../../../../../dev/zero"), Unreadable, &["buffer 0"]);
    for uri in ["data:;base64,%%%", "data:nothing", "data:text/plain,abc"] {
        let error = Folder::new().read("bad.gltf", g.external(uri)).unwrap_err();
        assert!(error.to_string().contains("buffer 0"), "{error}");
    }
    let short = Folder::new();
    short.write("short.bin", &g.bin[..20]);
    let error = short.read("bad.gltf", g.external("short.bin")).unwrap_err();
    assert_eq!(kind(&error), Invalid);
    assert!(error.to_string().contains("buffer 0") && error.to_string().contains("cut off"));
    let folder = Folder::new();
    folder.write("m.mtl", "newmtl Oak\nmap_Kd oak.png\n");
    let error = folder.read("bad.obj", "mtllib m.mtl\nv 0 0 0\n").unwrap_err();
    assert_eq!(kind(&error), Unreadable);
    for part in ["m.mtl", "\"Oak\"", "oak.png", "beside"] {
        assert!(error.to_string().contains(part), "{error}");
    }
}

#[test]
fn files_that_are_cut_off() {
    let glb = Gltf::triangle().glb();
    for length in 0..glb.len() {
        let error = Folder::new().read("cut.glb", &glb[..length]).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{length}");
    }
    refused("cut.glb", &glb[..glb.len() - 8], Unreadable, &["cut off"]);
    let mut short = glb.clone();
    short[8..12].copy_from_slice(&8u32.to_le_bytes());
    refused("cut.glb", &short, Unreadable, &["cut off"]);
    let text = Gltf::triangle().embedded();
    refused("cut.gltf", &text[..text.len() / 2], Unreadable, &["JSON"]);
    refused("cut.gltf", "", Unreadable, &["JSON"]);
    // A buffer without its binary chunk.
    let mut json = Gltf::triangle().json;
    json["buffers"][0]["byteLength"] = json!(36);
    refused("cut.gltf", json.to_string(), Invalid, &["buffer 0", "binary chunk"]);
    for text in ["v 0 0", "v 0 0 0\nf 1 1/ 2", "vt", "o X\nv 0 0 0\nf 1 1 2\n", "f 1 x 2"] {
        refused("cut.obj", text, Invalid, &["object"]);
    }
}

#[test]
fn versions_and_extensions() {
    for version in ["1.0", "3.0", "", "x"] {
        let g = changed(|j| j["asset"]["version"] = json!(version));
        refused_gltf(&g, Unsupported, &["version", version, "2.0"]);
    }
    let g = changed(|j| j["asset"]["minVersion"] = json!("2.1"));
    refused_gltf(&g, Unsupported, &["2.1"]);
    let mut glb = Gltf::triangle().glb();
    glb[4] = 1;
    refused("bad.glb", glb, Unsupported, &["version 1"]);
    for (name, remedy) in [
        ("KHR_draco_mesh_compression", "without compression"),
        ("EXT_meshopt_compression", "without compression"),
        ("KHR_mesh_quantization", "32-bit"),
        ("KHR_texture_basisu", "PNG"),
        ("EXT_mine", "without it"),
    ] {
        let g = changed(|j| j["extensionsRequired"] = json!([name]));
        refused_gltf(&g, Unsupported, &[name, remedy]);
    }
}

#[test]
fn materials_and_cameras_out_of_range() {
    let g = changed(|j| j["materials"][0]["emissiveFactor"] = json!([-1, 0, 0]));
    refused_gltf(&g, Invalid, &["material 0 \"Grey\"", "emission"]);
    let camera = |camera: Value| {
        changed(|j| {
            j["cameras"] = json!([camera]);
            j["nodes"][0]["camera"] = json!(0);
        })
    };
    for yfov in [0.0, -1.0, 3.2] {
        let lens = json!({"yfov": yfov, "znear": 0.1});
        let g = camera(json!({"name": "Eye", "type": "perspective", "perspective": lens}));
        refused_gltf(&g, Invalid, &["camera 0 \"Eye\"", "field of view"]);
    }
    let lens = json!({"yfov": 1.0, "znear": 0.1, "aspectRatio": 0.0});
    let g = camera(json!({"type": "perspective", "perspective": lens}));
    refused_gltf(&g, Invalid, &["camera 0", "aspect"]);
    let lens = json!({"xmag": 0.0, "ymag": 1.0, "znear": 0.1, "zfar": 1.0});
    let g = camera(json!({"type": "orthographic", "orthographic": lens}));
    refused_gltf(&g, Invalid, &["camera 0", "magnification"]);
    let g = camera(json!({"type": "perspective", "orthographic":
        {"xmag": 1.0, "ymag": 1.0, "znear": 0.1, "zfar": 1.0}}));
    refused_gltf(&g, Invalid, &["camera 0", "lens"]);
    for (line, what) in [
        ("Kd 1 2", "Kd"),
        ("Kd x", "\"x\""),
        ("Ke 1 nan 1", "nan"),
        ("Ke -1", "negative"),
        ("d", "no number"),
        ("map_Kd", "without a file"),
    ] {
        let folder = Folder::new();
        folder.write("m.mtl", format!("newmtl Oak\n{line}\n"));
        let error = folder.read("bad.obj", "mtllib m.mtl\nv 0 0 0\n").unwrap_err();
        assert_eq!(kind(&error), Invalid, "{error}");
        for part in ["m.mtl", "Oak", what] {
            assert!(error.to_string().contains(part), "no \"{part}\" in: {error}");
        }
    }
}

#[test]
fn scenes_without_surface() {
    let g = changed(|j| j["scenes"][0]["nodes"] = json!([]));
    refused_gltf(&g, Invalid, &["scene", "no triangles"]);
    refused_gltf(&Gltf::empty(), Invalid, &["scene", "no triangles"]);
    refused("bad.obj", "v 0 0 0\nf 1 1 1", Invalid, &["scene", "no triangles"]);
    refused("bad.obj", [0u8, 159, 146, 150].repeat(50), Invalid, &["no triangles"]);
    refused("bad.obj", b"\xff\xfev\0 \0", Unsupported, &["UTF-16"]);
    let flat = changed(|j| j["nodes"][0]["scale"] = json!([0, 1, 1]));
    refused_gltf(&flat, Invalid, &["no triangles"]);
}

/// Small deterministic random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// Reads 2000 damaged variants; whatever the outcome, it must be one.
fn mutate(name: &str, bytes: &[u8], others: &[(&str, &[u8])], which: Option<&str>) {
    let folder = Folder::new();
    for (name, bytes) in others {
        folder.write(name, bytes);
    }
    let start = Instant::now();
    let mut random = Random(7);
    let damaged_name = which.unwrap_or(name);
    let scene = folder.write(name, bytes);
    let original = fs::read(folder.0.path().join(damaged_name)).unwrap();
    let (mut good, mut bad) = (0, 0);
    for _ in 0..2000 {
        let mut damaged = original.clone();
        for _ in 0..=random.below(4) {
            if damaged.is_empty() {
                break;
            }
            let at = random.below(damaged.len());
            match random.below(6) {
                0 => damaged.truncate(at),
                1 => damaged[at] ^= 1 << random.below(8),
                2 => damaged[at] = random.below(256) as u8,
                3 => drop(damaged.remove(at)),
                4 => damaged.insert(at, b"0123456789-.e,/\\ \n[]{}\"\xff"[random.below(24)]),
                // Digits make numbers that are plausible and wrong.
                _ => {
                    let digit = (at..damaged.len()).find(|&i| damaged[i].is_ascii_digit());
                    if let Some(i) = digit {
                        damaged[i] = b'0' + random.below(10) as u8;
                    }
                }
            }
        }
        folder.write(damaged_name, &damaged);
        match read(&scene, &ReadOptions::default()) {
            Ok(scene) => {
                good += 1;
                let whole = [glam::DVec3::X, glam::DVec3::Y, glam::DVec3::Z];
                for (i, t) in scene.triangles.iter().enumerate() {
                    assert!(t.vertices.iter().all(|p| p.is_finite()));
                    let r = lumel::scene::reflectance(&scene, i, &whole);
                    assert!(r.min_element() >= 0.0 && r.max_element() < 1.0, "{r}");
                    let e = lumel::scene::exitance(&scene, i, &whole);
                    assert!(e.is_finite() && e.min_element() >= 0.0, "{e}");
                }
                lumel::scene::default_camera(&scene);
            }
            Err(error) => {
                bad += 1;
                assert_eq!(error.exit_code(), 3, "{error}");
            }
        }
    }
    assert!(good > 0 && bad > 0, "{name}: {good} read, {bad} refused");
    assert!(start.elapsed() < Duration::from_secs(120), "{name}: {:?}", start.elapsed());
}

/// A document with a bit of everything.
fn rich() -> Gltf {
    let mut g = with_image(&png(4, 4, |x, y| [(60 * x) as u8, (60 * y) as u8, 200]));
    let uv = g.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    let colour = g.floats("VEC3", &[0.5; 9]);
    let indices = g.shorts(&[0, 1, 2]);
    let primitive = &mut g.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = json!(uv);
    primitive["attributes"]["COLOR_0"] = json!(colour);
    primitive["indices"] = json!(indices);
    g.json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    let places = g.view(&[1]);
    let values = g.view(&[0, 0, 0, 64, 0, 0, 0, 0, 0, 0, 0, 0]);
    g.json["accessors"][0]["sparse"] = json!({"count": 1, "values": {"bufferView": values},
        "indices": {"bufferView": places, "componentType": 5121}});
    g.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}));
    g.root(json!({"camera": 0, "rotation": [0, 0, 0, 1]}));
    g.root(json!({"children": [3], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 0, 0, 1]}));
    g.push("nodes", json!({"mesh": 0, "scale": [-1, 1, 1]}));
    g
}

const RICH_OBJ: &str = "mtllib m.mtl\no One\nv 0 0 0\nv 1 0 0\nv 1 1 0.0\nv 0 1 0\nv 0.5 0.5 0\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3 4/4 5\ng Two\nusemtl b\n\
    f -5 -4 \\\n-1\nl 1 2 3\n# end\n";

const RICH_MTL: &str =
    "newmtl a\nKd .5 .5 .5\nmap_Kd -s 2 2 1 -o .5 a.png\nKe 1\nnewmtl b\nKd 0.25\nd 0.5\nillum 2\n";

#[test]
fn damaged_glb_files_do_not_panic() {
    mutate("s.glb", &rich().glb(), &[], None);
}

#[test]
fn damaged_gltf_files_do_not_panic() {
    mutate("s.gltf", rich().embedded().as_bytes(), &[], None);
}

#[test]
fn damaged_obj_and_mtl_files_do_not_panic() {
    let image = png(3, 2, |x, y| [(80 * x) as u8, (80 * y) as u8, 9]);
    let others: [(&str, &[u8]); 2] = [("m.mtl", RICH_MTL.as_bytes()), ("a.png", &image)];
    mutate("s.obj", RICH_OBJ.as_bytes(), &others, None);
    mutate("s.obj", RICH_OBJ.as_bytes(), &others, Some("m.mtl"));
    mutate("s.obj", RICH_OBJ.as_bytes(), &others, Some("a.png"));
}
