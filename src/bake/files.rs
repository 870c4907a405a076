//! What a bake leaves on disk: the scene, its lightmaps, and a JSON file that says what they are.
//!
//! For `room.glb` these are `room-lightmap.exr` (`room-lightmap-1.exr` and on for further pages) and
//! `room-bake.json`; for `room.gltf` also `room-bake.bin` and its pictures `room-unlit.png`,
//! `room-texture-0.png`. Nothing here is written yet: [`Files::list`] goes to
//! [`crate::output::atomic::write_together`].

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::atlas::{Atlas, Lightmap};
use super::model;
use super::surface_map::{SurfaceMap, surface_map};
use super::target::Target;
use super::vertices::LitSurface;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::output::exr_file::{self, ExrOptions};
use crate::output::gltf_file::{Document, Image};
use crate::output::gltf_scene::plain_png;
use crate::output::picture::{Picture, PictureOptions, Quantity};
use crate::output::png_file::srgb_from_linear;
use crate::output::{SOFTWARE, hdr_file, png_file};
use crate::scene::{Notice, Scene};

/// Where the exposure follows from the light, this share of the surface may be brighter than white.
const BRIGHTER: f64 = 0.001;

/// How lightmaps are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// OpenEXR, f16 or f32.
    Exr {
        /// Whether f16.
        half: bool,
    },
    /// Radiance HDR.
    Hdr,
    /// PNG of 16 bits a channel in sRGB.
    Png,
}

impl Format {
    /// Extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Exr { .. } => "exr",
            Format::Hdr => "hdr",
            Format::Png => "png",
        }
    }

    fn encoding(self) -> &'static str {
        match self {
            Format::Exr { half: true } => "linear f16",
            Format::Exr { half: false } => "linear f32",
            Format::Hdr => "linear RGBE",
            Format::Png => "sRGB 16 bit",
        }
    }
}

/// How files are made.
#[derive(Clone, Debug, PartialEq)]
pub struct FileOptions {
    /// Who shows the light.
    pub target: Target,
    /// How lightmaps are stored.
    pub format: Format,
    /// Stops by which pictures of limited range and colours of vertices are brightened; none: so
    /// that next to nothing is brighter than white.
    pub exposure_ev: Option<f64>,
    /// Whether direct and indirect light are written too, as layers of EXR files.
    pub layers: bool,
    /// Settings, by name.
    pub metadata: Vec<(String, String)>,
    /// Estimated error of the irradiance, relative to its mean; none where it is not known.
    pub error: Option<f64>,
}

/// Files that belong together.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// Names and contents; the scene, which refers to the others, is the last.
    pub list: Vec<(PathBuf, Vec<u8>)>,
    /// Stops of the colours that the scene shows by itself, where it shows light.
    pub exposure_ev: Option<f64>,
    /// What is lost in them.
    pub notices: Vec<Notice>,
}

/// Names of the files that a bake to `output` will write, as far as they are known before: for the
/// first `pages` lightmaps (none with light at vertices).
pub fn names(output: &Path, pages: usize, format: Format) -> Result<Vec<PathBuf>> {
    let stem = stem(output)?;
    let mut names = vec![output.to_path_buf(), output.with_file_name(sidecar(&stem))];
    names.extend((0..pages).map(|k| output.with_file_name(lightmap(&stem, k, format))));
    if !is_binary(output)? {
        names.push(output.with_file_name(format!("{stem}-bake.bin")));
    }
    Ok(names)
}

/// Whether a name asks for binary glTF.
pub fn is_binary(output: &Path) -> Result<bool> {
    let extension = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("glb") => Ok(true),
        Some("gltf") => Ok(false),
        _ => Err(Error::Usage(format!(
            "{}: the name of a baked scene must end in .glb (one file) or .gltf (with a buffer and \
             pictures beside it)",
            output.display()
        ))),
    }
}

fn stem(output: &Path) -> Result<String> {
    // The name goes into the files: it has to be text.
    output.file_stem().and_then(|s| s.to_str()).map(str::to_string).ok_or_else(|| {
        Error::Usage(format!("{}: the name must be valid UTF-8 text", output.display()))
    })
}

fn sidecar(stem: &str) -> String {
    format!("{stem}-bake.json")
}

fn numbered(stem: &str, what: &str, page: usize, extension: &str) -> String {
    match page {
        0 => format!("{stem}-{what}.{extension}"),
        n => format!("{stem}-{what}-{n}.{extension}"),
    }
}

fn lightmap(stem: &str, page: usize, format: Format) -> String {
    numbered(stem, "lightmap", page, format.extension())
}

/// Files of a scene with its light in pictures.
pub fn lightmap_files(
    scene: &Scene,
    atlas: &Atlas,
    maps: &[Lightmap],
    output: &Path,
    options: &FileOptions,
    monitor: &Monitor,
) -> Result<Files> {
    let stem = stem(output)?;
    let mut files = Files::default();
    let stored = maps
        .iter()
        .enumerate()
        .map(|(k, map)| {
            let surface = match options.target {
                Target::Unlit => Some(surface_map(scene, atlas, k as u32, monitor)?),
                _ => None,
            };
            Ok(Stored::new(map, surface, options.target))
        })
        .collect::<Result<Vec<_>>>()?;
    let mut names = vec![];
    let png_ev = options.exposure_ev.unwrap_or_else(|| fitting(&stored, 0.0));
    for (k, page) in stored.iter().enumerate() {
        monitor.check()?;
        let name = lightmap(&stem, k, options.format);
        let bytes = page.encode(options, png_ev)?;
        files.list.push((output.with_file_name(&name), bytes));
        names.push(name);
    }
    // A stored value of 1 is this much.
    let scale = if options.format == Format::Png { (-png_ev).exp2() } else { 1.0 };
    let mut pages = vec![];
    if options.target == Target::Unlit {
        let ev = options.exposure_ev.unwrap_or_else(|| fitting(&stored, BRIGHTER));
        files.exposure_ev = Some(ev);
        for (k, page) in stored.iter().enumerate() {
            monitor.check()?;
            let file = numbered(&stem, "unlit", k, "png");
            pages.push(Image { file, png: page.shown(ev)? });
        }
    }
    files.notices = notices(scene, atlas, options.target);
    let extras: Vec<(String, f64)> = match options.target {
        Target::Unlit => vec![],
        _ => names.iter().map(|n| (n.clone(), scale)).collect(),
    };
    let mut document = model::with_lightmaps(scene, atlas, options.target, pages, &extras, &stem)?;
    let head = head(scene, output, "lightmap", options, files.exposure_ev);
    document.extras = head.clone();
    let mut json = head;
    json["lightmap"] = json!({
        "quantity": options.target.quantity().name(), "unit": options.target.quantity().unit(),
        "texCoord": 1, "origin": "top left", "encoding": options.format.encoding(), "scale": scale,
        "layers": if options.layers { layers(options.target) } else { &[] },
    });
    if options.format == Format::Png {
        json["lightmap"]["exposure_ev"] = json!(png_ev);
    }
    json["pages"] = maps
        .iter()
        .zip(&names)
        .map(|(map, name)| json!({ "image": name, "width": map.width, "height": map.height }))
        .collect();
    json["nodes"] = nodes(scene, atlas);
    add_scene(&mut files, document, json, output, &stem)?;
    Ok(files)
}

/// Files of a scene with its light in the colours of vertices.
pub fn vertex_files(
    scene: &Scene,
    surface: &LitSurface,
    wanted: &[bool],
    output: &Path,
    options: &FileOptions,
) -> Result<Files> {
    let stem = stem(output)?;
    let ev = options.exposure_ev.unwrap_or_else(|| fitting_vertices(scene, surface, wanted));
    let (mut document, limited) =
        model::with_colours(scene, &surface.triangles, wanted, ev.exp2(), &stem)?;
    let mut files = Files { exposure_ev: Some(ev), ..Files::default() };
    if limited > 0.0 {
        files.notices.push(Notice {
            about: "colours of vertices".into(),
            text: format!(
                "{:.2} % are brighter than white at {ev:.2} EV and are limited to it (glTF allows no \
                 more): choose a lower --exposure",
                100.0 * limited
            ),
            count: 1,
        });
    }
    let mut json = head(scene, output, "vertices", options, files.exposure_ev);
    json["vertices"] = json!({
        "quantity": Quantity::Radiance.name(), "unit": Quantity::Radiance.unit(),
        "attribute": "COLOR_0", "encoding": "linear f32", "scale": (-ev).exp2(),
        "triangles": surface.triangles.len(), "error": surface.error,
    });
    document.extras = json.clone();
    add_scene(&mut files, document, json, output, &stem)?;
    Ok(files)
}

/// What both kinds of files say first.
fn head(
    scene: &Scene,
    output: &Path,
    to: &str,
    options: &FileOptions,
    exposure_ev: Option<f64>,
) -> Value {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut head = json!({
        "program": SOFTWARE, "scene": name(&scene.path), "output": name(output), "to": to,
        "target": options.target.name(), "use": options.target.note(),
        "settings": options.metadata.iter().cloned().collect::<std::collections::BTreeMap<_, _>>(),
        // JSON has no infinity: an error that is not known is null.
        "estimated_error": options.error.filter(|e| e.is_finite()),
    });
    if let Some(ev) = exposure_ev {
        head["shown"] = json!({
            "quantity": Quantity::Radiance.name(), "exposure_ev": ev, "scale": (-ev).exp2(),
        });
    }
    head
}

/// Nodes that have texels, with their places.
fn nodes(scene: &Scene, atlas: &Atlas) -> Value {
    let mut nodes: Vec<Vec<Value>> = vec![vec![]; scene.objects.len()];
    for chart in &atlas.charts {
        let [x, y, width, height] = chart.rectangle;
        nodes[chart.object as usize].push(json!({
            "page": chart.page, "x": x, "y": y, "width": width, "height": height,
            "texels_per_metre": chart.density, "kept": chart.kept,
        }));
    }
    let named = nodes.into_iter().zip(&scene.objects).filter(|(charts, _)| !charts.is_empty());
    named.map(|(charts, object)| json!({ "node": object.name, "rectangles": charts })).collect()
}

fn add_scene(
    files: &mut Files,
    document: Document,
    sidecar_json: Value,
    output: &Path,
    stem: &str,
) -> Result<()> {
    let mut text = serde_json::to_vec_pretty(&sidecar_json)
        .map_err(|e| Error::Runtime(format!("no JSON can be made: {e}")))?;
    text.push(b'\n');
    files.list.push((output.with_file_name(sidecar(stem)), text));
    let scene = if is_binary(output)? {
        document.to_glb()?
    } else {
        let (text, beside) = document.to_gltf(&format!("{stem}-bake.bin"))?;
        let beside = beside.into_iter().map(|(name, bytes)| (output.with_file_name(name), bytes));
        files.list.extend(beside);
        text
    };
    files.list.push((output.to_path_buf(), scene));
    Ok(())
}

/// What the pictures cannot hold.
fn notices(scene: &Scene, atlas: &Atlas, target: Target) -> Vec<Notice> {
    let mut used = vec![0; scene.materials.len()];
    for (triangle, _) in scene.triangles.iter().zip(&atlas.page).filter(|(_, p)| p.is_some()) {
        used[triangle.material as usize] += 1;
    }
    let mut notices = vec![];
    for (material, count) in scene.materials.iter().zip(used).filter(|(_, count)| *count > 0) {
        let mut say = |text: &str| {
            let about = format!("material \"{}\"", material.name);
            notices.push(Notice { about, text: text.into(), count });
        };
        if material.two_sided {
            say(
                "its faces are two-sided: their backs show the light of their fronts (--to vertices \
                 keeps both)",
            );
        }
        if target == Target::Unlit && material.reflectance_texture.is_some() {
            say(
                "its texture is mixed with the light, at the resolution of the lightmap: choose more \
                 texels a metre, or another --target, which keeps them apart",
            );
        }
    }
    notices
}

fn layers(target: Target) -> &'static [&'static str] {
    match target {
        Target::Unlit => &["direct", "indirect", "emission"],
        _ => &["direct", "indirect"],
    }
}

/// A page as it is stored.
struct Stored {
    width: u32,
    height: u32,
    quantity: Quantity,
    total: Vec<[f32; 3]>,
    /// As [`layers`] has them.
    parts: Vec<Vec<[f32; 3]>>,
    /// Of each texel the share that surface covers, and none where that emits.
    weights: Vec<f64>,
}

impl Stored {
    fn new(map: &Lightmap, surface: Option<SurfaceMap>, target: Target) -> Stored {
        let texels = 0..map.direct.len();
        let stored = |v: DVec3| v.max(DVec3::ZERO).as_vec3().to_array();
        let pi = std::f64::consts::PI;
        // The factor from irradiance, texel by texel.
        let of = |i: usize| match (&surface, target.of_irradiance()) {
            (Some(surface), _) => surface.reflectance[i].as_dvec3() / pi,
            (None, factor) => DVec3::splat(factor.unwrap_or(1.0)),
        };
        let part = |light: &[Vec3]| -> Vec<[f32; 3]> {
            texels.clone().map(|i| stored(of(i) * light[i].as_dvec3())).collect()
        };
        let mut parts = vec![part(&map.direct), part(&map.indirect)];
        if let Some(surface) = &surface {
            parts.push(surface.exitance.iter().map(|e| stored(e.as_dvec3() / pi)).collect());
        }
        // The sum of what the layers hold: none of it is negative.
        let sum = |i: usize| parts.iter().fold(Vec3::ZERO, |sum, part| sum + Vec3::from(part[i]));
        let total = texels.clone().map(|i| sum(i).to_array()).collect();
        let emits = |i: usize| surface.as_ref().is_some_and(|s| s.exitance[i] != Vec3::ZERO);
        let weight = |i: usize| if emits(i) { 0.0 } else { f64::from(map.covered[i]) };
        let weights = texels.map(weight).collect();
        let (width, height, quantity) = (map.width, map.height, target.quantity());
        Stored { width, height, quantity, total, parts, weights }
    }

    /// As a file of its own.
    fn encode(&self, options: &FileOptions, png_ev: f64) -> Result<Vec<u8>> {
        let mut metadata = options.metadata.clone();
        metadata.push(("target".into(), options.target.name().into()));
        metadata.push(("coordinates".into(), "TEXCOORD_1, origin top left".into()));
        if let Some(error) = options.error {
            metadata.push(("estimated error".into(), format!("{error:.2e}")));
        }
        let (width, height, quantity) = (self.width, self.height, self.quantity);
        let pixels = self.total.clone();
        let picture = Picture { width, height, pixels, quantity, metadata, camera: None };
        match options.format {
            Format::Exr { half } => {
                let names = layers(options.target).iter().copied();
                let parts = self.parts.iter().map(|p| p.as_slice());
                let mut list: Vec<(&str, &[[f32; 3]])> = names.zip(parts).collect();
                if !options.layers {
                    list.clear();
                }
                exr_file::encode_with(&picture, &ExrOptions { half, layers: &list })
            }
            Format::Hdr => hdr_file::encode(&picture),
            Format::Png => {
                let png = PictureOptions { exposure_ev: png_ev, png_bits: 16 };
                png_file::encode(&picture, &png)
            }
        }
    }

    /// As an unlit material shows it: 8 bits a channel, sRGB.
    fn shown(&self, ev: f64) -> Result<Vec<u8>> {
        let factor = ev.exp2();
        let level = |v: f32| {
            let v = (f64::from(v) * factor).clamp(0.0, 1.0);
            (255.0 * srgb_from_linear(v)).round() as u8
        };
        let levels: Vec<u8> = self.total.iter().flatten().map(|&v| level(v)).collect();
        plain_png(self.width, self.height, &levels)
    }
}

/// Stops with which the given share of what does not emit is brighter than white.
fn fitting(pages: &[Stored], brighter: f64) -> f64 {
    let of_page = |page: &Stored| -> Vec<(f64, f64)> {
        let values = page.total.iter().zip(&page.weights);
        values.map(|(v, &w)| (v.iter().fold(0.0, |a, &b| f64::max(a, f64::from(b))), w)).collect()
    };
    white_at(pages.iter().flat_map(of_page).collect(), brighter)
}

fn fitting_vertices(scene: &Scene, surface: &LitSurface, wanted: &[bool]) -> f64 {
    let shown = surface.triangles.iter().filter(|t| wanted[t.triangle as usize]);
    let values = shown.flat_map(|t| {
        let material = scene.triangles[t.triangle as usize].material as usize;
        let [a, b, c] = t.corners;
        let area = if scene.emits(material) { 0.0 } else { (b - a).cross(c - a).length() };
        (0..3).map(move |k| (model::radiance(scene, t, k).max_element(), area))
    });
    white_at(values.collect(), BRIGHTER)
}

/// Stops that make a value white, such that values of the given share of the weight are greater.
fn white_at(mut values: Vec<(f64, f64)>, brighter: f64) -> f64 {
    // Where all of it emits, that is what counts.
    if values.iter().all(|(_, w)| *w == 0.0) {
        values.iter_mut().for_each(|(_, w)| *w = 1.0);
    }
    values.retain(|(v, w)| *w > 0.0 && *v > 0.0 && v.is_finite());
    values.sort_by(|a, b| b.0.total_cmp(&a.0));
    let limit = brighter * values.iter().map(|(_, w)| w).sum::<f64>();
    let mut seen = 0.0;
    let white = values.iter().find(|(_, w)| {
        seen += w;
        seen > limit
    });
    white.map_or(0.0, |(v, _)| -v.log2())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_leaves_the_asked_share_above_it() {
        let values: Vec<(f64, f64)> = (1..=1000).map(|k| (f64::from(k), 1.0)).collect();
        assert_eq!(white_at(values.clone(), 0.0), -(1000f64.log2()));
        assert_eq!(white_at(values, 0.01), -(990f64.log2()));
        assert_eq!(white_at(vec![], 0.5), 0.0);
        assert_eq!(white_at(vec![(8.0, 0.0)], 0.0), -3.0);
        // What emits does not count where something else is there.
        assert_eq!(white_at(vec![(8.0, 0.0), (0.5, 1.0)], 0.0), 1.0);
    }

    #[test]
    fn names_follow_the_output() {
        let exr = Format::Exr { half: true };
        let list = names(Path::new("a/b.glb"), 2, exr).unwrap();
        let want = ["a/b.glb", "a/b-bake.json", "a/b-lightmap.exr", "a/b-lightmap-1.exr"];
        assert_eq!(list, want.map(PathBuf::from));
        assert_eq!(names(Path::new("b.gltf"), 0, exr).unwrap().len(), 3);
        assert_eq!(names(Path::new("b.obj"), 0, exr).unwrap_err().exit_code(), 2);
    }
}
