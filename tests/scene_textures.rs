//! Textures: decoding, averaging, placing.

mod scene_support;

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use lumel::scene::{
    Material, Object, Scene, Texture, TextureUse, Triangle, Wrap, exitance, reflectance,
};
use scene_support::*;
use serde_json::{Value, json};

const WHOLE: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

/// Half of the unit square of texture coordinates, times `scale`, with a white material.
fn scene(texture: Texture, scale: f64) -> Scene {
    let uv = [[0.0, 0.0], [scale, 0.0], [0.0, scale]].map(DVec2::from);
    let mut material = Material::plain("m", DVec3::splat(0.999));
    material.reflectance_texture = Some(TextureUse::plain(0));
    Scene {
        objects: vec![Object { name: "o".into() }],
        materials: vec![material],
        textures: vec![texture],
        triangles: vec![Triangle {
            vertices: [DVec3::ZERO, DVec3::X, DVec3::Y],
            uv: [uv; 2],
            colour: [DVec3::ONE; 3],
            material: 0,
            object: 0,
        }],
        ..Scene::default()
    }
}

fn checkerboard(cells: u32, texels: u32) -> Texture {
    let side = cells * texels;
    let texel = |i: u32| {
        let (x, y) = (i % side / texels, i / side / texels);
        [((x + y) % 2) as f32; 3]
    };
    Texture::new("checker", side, side, (0..side * side).map(texel).collect())
}

#[test]
fn minified_checkerboards_are_grey() {
    for (cells, texels, scale) in
        [(100, 1, 1.0), (100, 4, 1.0), (2, 1, 50.0), (2, 8, 50.0), (2, 1, 1e4), (64, 3, 7.3)]
    {
        let scene = scene(checkerboard(cells, texels), scale);
        let mean = reflectance(&scene, 0, &WHOLE).x / 0.999;
        assert!((mean - 0.5).abs() < 0.005, "{cells} x {texels} at {scale}: {mean}");
        // A part of it, about a tenth in size.
        let part = [[0.2, 0.3, 0.5], [0.3, 0.3, 0.4], [0.2, 0.4, 0.4]].map(DVec3::from);
        if f64::from(cells) * scale >= 100.0 {
            let mean = reflectance(&scene, 0, &part).x / 0.999;
            assert!((mean - 0.5).abs() < 0.05, "part, {cells} x {texels} at {scale}: {mean}");
        }
    }
}

#[test]
fn footprints_smaller_than_a_texel_interpolate() {
    let texture = Texture::new("t", 2, 2, vec![[0.0; 3], [0.4; 3], [0.2; 3], [0.8; 3]]);
    let scene = scene(texture, 1.0);
    // u = b.y, v = b.z; texel centres at 1/4 and 3/4.
    for (u, v) in [(0.25, 0.25), (0.4, 0.3), (0.5, 0.5), (0.6, 0.35)] {
        let b = DVec3::new(1.0 - u - v, u, v);
        let e = 1e-6 * DVec3::new(-1.0, 1.0, 0.0);
        let f = 1e-6 * DVec3::new(-1.0, 0.0, 1.0);
        let mean = reflectance(&scene, 0, &[b, b + e, b + f]).x / 0.999;
        let (x, y) = (2.0 * u - 0.5, 2.0 * v - 0.5);
        let want = (1.0 - y) * 0.4 * x + y * (0.2 * (1.0 - x) + 0.8 * x);
        assert!((mean - want).abs() < 1e-5, "({u}, {v}): {mean} {want}");
    }
}

/// The mean by many points.
fn sampled(n: usize, value: impl Fn(f64, f64) -> f64) -> f64 {
    let mut sum = 0.0;
    let mut count = 0.0;
    for i in 0..n {
        for j in 0..n - i {
            let (u, v) = ((i as f64 + 1.0 / 3.0) / n as f64, (j as f64 + 1.0 / 3.0) / n as f64);
            sum += value(u, v);
            count += 1.0;
        }
    }
    sum / count
}

#[test]
fn averages_agree_with_sampling() {
    // A texture that goes with the vertex colours and the metal: products must not be split.
    let side = 16;
    let noise = |i: u32| ((i * 7919 + i * i * 31) % 101) as f32 / 101.0;
    let texels = (0..side * side).map(|i| [noise(i); 3]).collect();
    let metal = (0..side * side).map(|i| [0.0, 0.0, noise(i)]).collect();
    let mut s = scene(Texture::new("t", side, side, texels), 1.0);
    s.textures.push(Texture::new("m", side, side, metal));
    s.materials[0].metallic = 0.9;
    s.materials[0].metallic_texture = Some(TextureUse { set: 1, ..TextureUse::plain(1) });
    s.triangles[0].colour = [DVec3::ZERO, DVec3::ONE, DVec3::ZERO];
    let bilinear = |u: f64, v: f64| {
        let n = f64::from(side);
        let (x, y) = (u * n - 0.5, v * n - 0.5);
        let at = |x: f64, y: f64| {
            let (x, y) = (x.rem_euclid(n) as u32, y.rem_euclid(n) as u32);
            f64::from(noise(y * side + x))
        };
        let (i, j, fx, fy) = (x.floor(), y.floor(), x - x.floor(), y - y.floor());
        (at(i, j) * (1.0 - fx) + at(i + 1.0, j) * fx) * (1.0 - fy)
            + (at(i, j + 1.0) * (1.0 - fx) + at(i + 1.0, j + 1.0) * fx) * fy
    };
    let want = 0.999
        * sampled(1000, |u, v| {
            let t = bilinear(u, v);
            t * u * (1.0 - 0.9 * t)
        });
    let mean = reflectance(&s, 0, &WHOLE).x;
    assert!((mean - want).abs() < 2e-3 * want, "{mean} {want}");
    // Parts weighted by area make the whole.
    let middle = |i: usize, j: usize| 0.5 * (WHOLE[i] + WHOLE[j]);
    let (ab, bc, ca) = (middle(0, 1), middle(1, 2), middle(2, 0));
    let parts = [[WHOLE[0], ab, ca], [ab, WHOLE[1], bc], [ca, bc, WHOLE[2]], [ab, bc, ca]];
    let sum: f64 = parts.iter().map(|p| reflectance(&s, 0, p).x / 4.0).sum();
    assert!((sum - mean).abs() < 2e-3 * mean, "{sum} {mean}");
    assert_eq!(reflectance(&s, 0, &WHOLE), reflectance(&s, 0, &WHOLE));
}

#[test]
fn slender_footprints_and_sharp_texels() {
    let mut s = scene(checkerboard(2, 1), 1.0);
    s.materials[0].reflectance_texture = Some(TextureUse { nearest: true, ..TextureUse::plain(0) });
    // Inside one texel everything is that texel, up to its edge.
    let at = |u: f64, v: f64| DVec3::new(1.0 - u - v, u, v);
    let inside = [at(0.01, 0.01), at(0.49, 0.01), at(0.01, 0.49)];
    assert_eq!(reflectance(&s, 0, &inside).x, 0.0);
    // Across the edge u = 1/2, by exact areas: a triangle of which a quarter lies beyond.
    let across = [at(0.0, 0.0), at(0.75, 0.0), at(0.0, 0.25)];
    let mean = reflectance(&s, 0, &across).x / 0.999;
    assert!((mean - 1.0 / 9.0).abs() < 0.01, "{mean}");
    // A line along a row sees that row's mean and ends.
    let s = scene(checkerboard(1000, 1), 1.0);
    let thin = [at(0.0, 1e-5), at(0.99, 1e-5), at(0.0, 2e-5)];
    let mean = reflectance(&s, 0, &thin).x / 0.999;
    assert!((mean - 0.5).abs() < 0.02, "{mean}");
}

#[test]
fn coordinates_beyond_reason_end() {
    let mut s = scene(checkerboard(4, 1), 1e300);
    assert!(reflectance(&s, 0, &WHOLE).is_finite());
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let used = TextureUse { wrap: [wrap; 2], ..TextureUse::plain(0) };
        s.materials[0].reflectance_texture = Some(used);
        for scale in [1e3, 1e15, f64::MAX] {
            s.triangles[0].uv[0] = [DVec2::ZERO, DVec2::splat(scale), DVec2::new(-scale, scale)];
            assert!(reflectance(&s, 0, &WHOLE).is_finite(), "{wrap:?} {scale}");
        }
    }
}

/// A textured triangle in a GLB; coordinates (0,0), (1,0), (0,1).
/// Coordinates that are far off, with differences that drown in their rounding, end too: found by a
/// broken file whose texture is moved by 1e39.
#[test]
fn coordinates_far_from_the_image_end() {
    let texture = || checkerboard(64, 2);
    for offset in [1e9, 1e12, 1e20, 1e39, -1e300, f64::INFINITY] {
        let mut s = scene(texture(), 1.0);
        for uv in &mut s.triangles[0].uv[0] {
            *uv += offset;
        }
        for size in [1.0, 1e-3, 1e6, 1e9] {
            let part = [[0.2, 0.3, 0.5], [0.3, 0.3, 0.4], [0.2, 0.4, 0.4]].map(DVec3::from);
            let middle = DVec3::splat(1.0 / 3.0);
            let part = part.map(|b| middle + size * (b - middle));
            let mean = reflectance(&s, 0, &part);
            assert!(mean.min_element() >= 0.0 && mean.max_element() <= 0.999, "{offset}: {mean}");
        }
    }
    // Where the texels can still be told apart, nothing changes.
    let mut s = scene(texture(), 1.0);
    let near = reflectance(&s, 0, &WHOLE).x;
    for uv in &mut s.triangles[0].uv[0] {
        *uv += 1e9;
    }
    assert!((reflectance(&s, 0, &WHOLE).x - near).abs() < 1e-3);
}

fn textured(image: &[u8], material: Value) -> Gltf {
    let mut g = Gltf::triangle();
    let uv = g.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    let uv = g.floats("VEC2", &[0.25, 0.25, 0.25, 0.25, 0.25, 0.25]);
    g.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(uv);
    let view = g.view(image);
    g.push("images", json!({"bufferView": view, "mimeType": "image/png", "name": "Pic"}));
    g.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    g.push("textures", json!({"source": 0}));
    g.push("textures", json!({"source": 0, "sampler": 0}));
    g.json["materials"][0] = material;
    g
}

#[test]
fn base_colour_is_srgb_and_metal_is_linear_blue() {
    let image = png(1, 1, |_, _| [188, 64, 51]);
    let g = textured(
        &image,
        json!({"pbrMetallicRoughness": {"metallicFactor": 0.5,
            "baseColorFactor": [0.5, 1.0, 1.0, 1.0],
            "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}},
            "emissiveFactor": [0.5, 0.5, 0.5], "emissiveTexture": {"index": 0}}),
    );
    let s = g.read().unwrap();
    let linear = |v: f64| ((v / 255.0 + 0.055) / 1.055).powf(2.4);
    let base = DVec3::new(linear(188.0), linear(64.0), linear(51.0));
    let want = base * DVec3::new(0.5, 0.999, 0.999) * (1.0 - 0.5 * 51.0 / 255.0);
    assert!((reflectance(&s, 0, &WHOLE) - want).length() < 1e-6);
    assert!((exitance(&s, 0, &WHOLE) - base * (0.5 * PI)).length() < 1e-6);
    // Two encodings of one image, and no more.
    assert_eq!(s.textures.len(), 2);
    assert!(s.textures[0].name.contains("Pic"));
}

#[test]
fn samplers_and_transforms_are_followed() {
    let image = png(2, 2, |x, y| [255 * (x ^ y) as u8; 3]);
    let with = |info: Value| {
        let g = textured(
            &image,
            json!({"pbrMetallicRoughness":
            {"metallicFactor": 0, "baseColorTexture": info}}),
        );
        g.read().unwrap()
    };
    let s = with(json!({"index": 1, "texCoord": 1}));
    let used = s.materials[0].reflectance_texture.clone().unwrap();
    assert_eq!((used.set, used.wrap, used.nearest), (1, [Wrap::Clamp, Wrap::Mirror], true));
    let s = with(json!({"index": 0, "extensions": {"KHR_texture_transform": {
        "offset": [0.0, 1.0], "rotation": PI / 2.0, "scale": [0.5, 0.5], "texCoord": 1}}}));
    let used = s.materials[0].reflectance_texture.clone().unwrap();
    assert_eq!((used.set, used.wrap, used.nearest), (1, [Wrap::Repeat; 2], false));
    // The extension's own example: the lower left quadrant, turned.
    let close = |a: DVec2, b: [f64; 2]| (a - DVec2::from(b)).length() < 1e-6;
    assert!(close(used.apply(DVec2::ZERO), [0.0, 1.0]));
    assert!(close(used.apply(DVec2::X), [0.0, 0.5]));
    assert!(close(used.apply(DVec2::Y), [0.5, 1.0]));
}

#[test]
fn kinds_of_images() {
    use image::{DynamicImage, ImageFormat};
    let grey16 = image::ImageBuffer::from_pixel(3, 1, image::Luma([0x8000u16]));
    let rgba = image::RgbaImage::from_pixel(2, 2, image::Rgba([188, 188, 188, 0]));
    let cases = [
        (DynamicImage::ImageLuma16(grey16), ImageFormat::Png, 0x8000 as f64 / 65535.0),
        (DynamicImage::ImageRgba8(rgba.clone()), ImageFormat::Png, 188.0 / 255.0),
        (
            DynamicImage::ImageRgb8(DynamicImage::ImageRgba8(rgba).into_rgb8()),
            ImageFormat::Jpeg,
            188.0 / 255.0,
        ),
    ];
    for (image, format, value) in cases {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        let g = textured(
            &bytes.into_inner(),
            json!({"pbrMetallicRoughness": {"metallicFactor": 0,
                "baseColorTexture": {"index": 0}}}),
        );
        let mean = reflectance(&g.read().unwrap(), 0, &WHOLE).x;
        let want = 0.999 * ((value + 0.055) / 1.055f64).powf(2.4);
        assert!((mean - want).abs() < 1e-2, "{format:?}: {mean} {want}");
    }
}

#[test]
fn external_and_embedded_images() {
    let folder = Folder::new();
    let image = png(1, 1, |_, _| [255, 0, 0]);
    folder.write("im ages/a.png", &image);
    let mut g = textured(
        &image,
        json!({"pbrMetallicRoughness": {"metallicFactor": 0,
            "baseColorTexture": {"index": 0}}}),
    );
    use base64::Engine;
    let data = base64::engine::general_purpose::STANDARD_NO_PAD.encode(&image);
    for uri in ["im%20ages/a.png".to_string(), format!("data:image/png;base64,{data}")] {
        g.json["images"][0] = json!({"uri": uri});
        let s = folder.read("s.gltf", g.embedded()).unwrap();
        assert!((reflectance(&s, 0, &WHOLE) - DVec3::X * 0.999).length() < 1e-9);
    }
}
