//! Materials of OBJ files.
//!
//! The text is checked and made plain first: `tobj` panics on colours of fewer than three numbers
//! and names no line in its errors. `Kd` (times `map_Kd`) is the reflectance, `Ke` (times
//! `map_Ke`) the radiance; images are sRGB. Numbers are taken as linear.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::limits::{Budget, Texels, clamp_reflectance};
use super::notices::Notices;
use super::obj_text::{keyword, statements, words};
use super::texture::{self, DecodeError, Encoding, Texture, TextureUse, Wrap};
use super::{Material, uri};
use crate::error::{Error, Result};

/// Reflectance where a file gives none.
const GREY: f64 = 0.5;

/// The materials of an OBJ file and the images that they use, each decoded once.
pub(crate) struct Library<'a> {
    /// The OBJ file.
    path: &'a Path,
    pub(crate) list: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    /// Files read: libraries and images.
    pub(crate) files: Vec<PathBuf>,
    numbers: HashMap<String, usize>,
    /// Libraries by the names that asked for them.
    asked: HashSet<String>,
    /// Images by the library and the name that asked for them, and by their files.
    named: HashMap<(PathBuf, String), usize>,
    decoded: BTreeMap<PathBuf, usize>,
    texels: Texels,
}

impl<'a> Library<'a> {
    /// No materials, for an OBJ file at `path`.
    pub(crate) fn new(path: &'a Path, budget: Budget) -> Self {
        Library {
            path,
            list: Vec::new(),
            textures: Vec::new(),
            files: Vec::new(),
            numbers: HashMap::new(),
            asked: HashSet::new(),
            named: HashMap::new(),
            decoded: BTreeMap::new(),
            texels: Texels::new(budget),
        }
    }

    /// Reads the files of a `mtllib` statement: one name, which may contain spaces, or several, each
    /// once however often it is asked for. A missing file is a notice.
    pub(crate) fn load(&mut self, argument: &str, notices: &mut Notices) -> Result<()> {
        if !self.asked.insert(argument.to_string()) {
            return Ok(());
        }
        if let Some((file, bytes)) = find(self.path, unquoted(argument)) {
            return self.read(&file, &bytes, notices);
        }
        for name in argument.split_ascii_whitespace().map(unquoted) {
            if !self.asked.insert(name.to_string()) {
                continue;
            }
            match find(self.path, name) {
                Some((file, bytes)) => self.read(&file, &bytes, notices)?,
                None => notices.add(
                    format!("material file \"{name}\""),
                    "it is missing; materials that it would define are grey",
                ),
            }
        }
        Ok(())
    }

    /// The number of a material; an unknown one is made grey, with a notice.
    pub(crate) fn number(&mut self, name: &str, notices: &mut Notices) -> u32 {
        let next = self.list.len();
        let number = *self.numbers.entry(name.to_string()).or_insert(next);
        if number == next {
            notices.add(
                format!("material \"{name}\""),
                format!("it is not defined; reflectance {GREY} is used"),
            );
            self.list.push(Material::plain(name, DVec3::splat(GREY)));
        }
        // A file of 4 GiB could not name 2^32 materials.
        number as u32
    }

    /// The number of the material of faces that have none: grey.
    pub(crate) fn number_of_none(&mut self, notices: &mut Notices) -> u32 {
        self.number("default", notices)
    }

    fn read(&mut self, file: &Path, bytes: &[u8], notices: &mut Notices) -> Result<()> {
        self.files.push(file.to_path_buf());
        let text = plain(file, bytes, notices)?;
        let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes())
            .map_err(|e| Error::invalid(file, "materials", e))?;
        for read in &materials {
            let material = self.material(file, read, notices)?;
            if let Some(&number) = self.numbers.get(&material.name) {
                notices.add(
                    format!("material \"{}\"", material.name),
                    "it is defined more than once; the last definition is used",
                );
                self.list[number] = material;
            } else {
                self.numbers.insert(material.name.clone(), self.list.len());
                self.list.push(material);
            }
        }
        Ok(())
    }

    fn material(
        &mut self,
        file: &Path,
        read: &tobj::Material,
        notices: &mut Notices,
    ) -> Result<Material> {
        let about = format!("material \"{}\"", read.name);
        let radiance_map = read.unknown_param.get("map_Ke");
        // A colour that only a map gives is the map's.
        let colour = |given: Option<[f64; 3]>, map: bool, none: f64| {
            given.map_or(DVec3::splat(if map { 1.0 } else { none }), DVec3::from)
        };
        let has_map = read.diffuse_texture.is_some();
        let mut material = Material::plain(&read.name, colour(read.diffuse, has_map, GREY));
        material.radiance = colour(read.emissive, radiance_map.is_some(), 0.0);
        if material.radiance.min_element() < 0.0 {
            return Err(Error::invalid(file, about, "its emission Ke is negative; correct it"));
        }
        if read.diffuse.is_none() && !has_map {
            notices.add(&about, format!("it has no Kd; reflectance {GREY} is used"));
        }
        clamp_reflectance(&mut material, notices);
        if let Some(map) = &read.diffuse_texture {
            if material.reflectance == DVec3::ZERO {
                notices.add(&about, "map_Kd has no effect, since it is multiplied by a Kd of zero");
            } else {
                material.reflectance_texture = Some(self.texture(file, &about, map, notices)?);
            }
        }
        if let Some(map) = radiance_map {
            if material.radiance == DVec3::ZERO {
                notices.add(&about, "map_Ke has no effect, since it is multiplied by a Ke of zero");
            } else {
                material.radiance_texture = Some(self.texture(file, &about, map, notices)?);
            }
        }
        say_what_is_lost(&about, read, notices);
        Ok(material)
    }

    /// How a material uses the image of a `map_` statement.
    fn texture(
        &mut self,
        file: &Path,
        about: &str,
        map: &str,
        notices: &mut Notices,
    ) -> Result<TextureUse> {
        let map = Map::parse(map);
        for option in &map.ignored {
            notices.add(about, format!("option {option} of its texture is left out"));
        }
        let missing = |reason: &str| {
            Error::unreadable(
                file,
                format!("{about}: texture \"{}\": {reason}; put it beside the scene", map.name),
            )
        };
        if map.name.is_empty() {
            return Err(missing("it has no file name"));
        }
        let key = (file.to_path_buf(), map.name.to_string());
        let index = match self.named.get(&key) {
            Some(&index) => index,
            None => {
                let (found, bytes) =
                    find(file, map.name).ok_or_else(|| missing("the file is not there"))?;
                let index = match self.decoded.get(&found) {
                    Some(&index) => index,
                    None => self.decode(found, &bytes, about, map.name)?,
                };
                *self.named.entry(key).or_insert(index)
            }
        };
        let [su, sv] = map.scale;
        let [ou, ov] = map.offset;
        Ok(TextureUse {
            // OBJ counts from the bottom of the image, textures from the top.
            transform: [[su, 0.0, ou], [0.0, -sv, 1.0 - ov]],
            wrap: [if map.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2],
            ..TextureUse::plain(index)
        })
    }
}

impl Library<'_> {
    /// Decodes an image that was not there before; its number.
    fn decode(&mut self, file: PathBuf, bytes: &[u8], about: &str, name: &str) -> Result<usize> {
        let fail = |error| match error {
            DecodeError::Invalid(reason) => Error::invalid(&file, about, reason),
            DecodeError::Unsupported(reason) => Error::unsupported(&file, about, reason),
        };
        let (width, height) = texture::dimensions(bytes).map_err(fail)?;
        self.texels.add(&file, about, width, height)?;
        let texture = texture::decode(bytes, name, Encoding::Srgb).map_err(fail)?;
        self.textures.push(texture);
        self.decoded.insert(file.clone(), self.textures.len() - 1);
        self.files.push(file);
        Ok(self.textures.len() - 1)
    }
}

/// Notices for everything of a material that diffuse reflection and emission cannot hold.
fn say_what_is_lost(about: &str, read: &tobj::Material, notices: &mut Notices) {
    let specular = read.specular.is_some_and(|s| s.iter().any(|&s| s > 0.0));
    // Models 0 and 1 have no highlights, whatever Ks is.
    if (specular && read.illumination_model.is_none_or(|i| i >= 2))
        || read.specular_texture.is_some()
    {
        notices.add(about, "gloss (Ks) is left out");
    }
    if read.dissolve.is_some_and(|d| d < 1.0) || read.dissolve_texture.is_some() {
        notices.add(about, "transparency (d, Tr) is left out: it is opaque");
    }
    if read.normal_texture.is_some() {
        notices.add(about, "its bump map is left out");
    }
    let metal = read.unknown_param.get("Pm").and_then(|m| m.parse::<f64>().ok());
    if metal.is_some_and(|m| m > 0.0) {
        notices.add(about, "metal (Pm) is left out: Kd is its reflectance");
    }
}

/// A `map_` statement taken apart.
#[derive(Debug, PartialEq)]
struct Map<'a> {
    name: &'a str,
    scale: [f64; 2],
    offset: [f64; 2],
    clamp: bool,
    /// Options that would change the image but are not followed.
    ignored: Vec<&'a str>,
}

impl<'a> Map<'a> {
    /// Takes options from the front; the rest is the name, which may contain spaces.
    fn parse(text: &'a str) -> Self {
        let mut map =
            Map { name: "", scale: [1.0; 2], offset: [0.0; 2], clamp: false, ignored: Vec::new() };
        let mut rest = text.trim();
        while rest.starts_with('-') {
            let (option, after) = keyword(rest);
            match option {
                "-s" | "-o" | "-t" => {
                    let (numbers, after) = leading_numbers(after);
                    match option {
                        "-s" => fill(&mut map.scale, &numbers),
                        "-o" => fill(&mut map.offset, &numbers),
                        _ => map.ignored.push(option),
                    }
                    rest = after;
                }
                "-mm" => {
                    let (base, after) = keyword(after);
                    let (gain, after) = keyword(after);
                    if (base.parse(), gain.parse()) != (Ok(0.0), Ok(1.0)) {
                        map.ignored.push(option);
                    }
                    rest = after;
                }
                "-clamp" => {
                    let (value, after) = keyword(after);
                    map.clamp = value == "on";
                    rest = after;
                }
                "-blendu" | "-blendv" | "-bm" | "-boost" | "-texres" | "-type" => {
                    rest = keyword(after).1;
                }
                "-cc" | "-imfchan" => {
                    map.ignored.push(option);
                    rest = keyword(after).1;
                }
                // A name may begin with a dash.
                _ => break,
            }
        }
        map.name = unquoted(rest);
        map
    }
}

/// Replaces as many values as there are numbers.
fn fill(values: &mut [f64; 2], numbers: &[f64]) {
    for (value, &number) in values.iter_mut().zip(numbers) {
        *value = number;
    }
}

/// Up to three finite numbers at the front, and the rest. The last word is never taken: it is
/// (part of) the file name.
fn leading_numbers(text: &str) -> (Vec<f64>, &str) {
    let mut numbers = Vec::new();
    let mut rest = text;
    while numbers.len() < 3 {
        let (word, after) = keyword(rest);
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() && !after.is_empty() => numbers.push(x),
            _ => break,
        }
        rest = after;
    }
    (numbers, rest)
}

fn unquoted(name: &str) -> &str {
    let name = name.trim();
    name.strip_prefix('"').and_then(|n| n.strip_suffix('"')).unwrap_or(name).trim()
}

/// Finds and reads a file named in an OBJ or MTL file, from the folder of `beside`. Names made on
/// another machine are common: backslashes divide folders, and where the path does not lead
/// anywhere (or is absolute) the file is looked for in the folder itself.
fn find(beside: &Path, name: &str) -> Option<(PathBuf, Vec<u8>)> {
    let folder = beside.parent().unwrap_or(Path::new(""));
    let slashes = name.replace('\\', "/");
    let is_absolute = slashes.starts_with('/') || slashes.get(1..2) == Some(":");
    let last = slashes.rsplit('/').next().unwrap_or("").to_string();
    let mut candidates = vec![name.to_string(), slashes];
    if is_absolute {
        candidates.clear();
    }
    candidates.push(last);
    candidates.iter().filter(|name| !name.is_empty()).find_map(|name| {
        let path = folder.join(name);
        uri::read_regular(&path).ok().map(|bytes| (path, bytes))
    })
}

/// The statements of an MTL file that matter, in the form that `tobj` reads right.
fn plain(file: &Path, bytes: &[u8], notices: &mut Notices) -> Result<String> {
    let mut text = String::new();
    let mut material = String::new();
    for (line, statement) in statements(bytes) {
        let (word, rest) = keyword(&statement);
        let wrong = |reason: String| {
            let what = format!("line {line}, material \"{material}\"");
            Error::invalid(file, what, reason)
        };
        match word.to_ascii_lowercase().as_str() {
            "newmtl" => {
                if rest.is_empty() {
                    return Err(wrong("newmtl without a name; give it one".into()));
                }
                material = rest.to_string();
                let _ = writeln!(text, "newmtl {rest}");
            }
            // What stands before the first material belongs to none.
            _ if material.is_empty() => {}
            "kd" | "ke" | "ks" => {
                let first = words(rest).next().unwrap_or("");
                if first == "spectral" || first == "xyz" {
                    notices.add(
                        format!("material \"{material}\""),
                        format!("{word} given as \"{first}\" is left out; write it as R G B"),
                    );
                    continue;
                }
                let [r, g, b] = colour(rest).map_err(|e| wrong(format!("{word}: {e}")))?;
                let word = format!("K{}", &word[1..].to_ascii_lowercase());
                let _ = writeln!(text, "{word} {r} {g} {b}");
            }
            "d" | "tr" => {
                // "d -halo 0.5" too.
                let value = words(rest).last().and_then(|v| v.parse::<f64>().ok());
                let Some(value) = value.filter(|v| v.is_finite()) else {
                    return Err(wrong(format!("{word}: \"{rest}\" is no number; correct it")));
                };
                let opacity = if word.eq_ignore_ascii_case("d") { value } else { 1.0 - value };
                let _ = writeln!(text, "d {opacity}");
            }
            "illum" => {
                if let Some(model) = words(rest).next().and_then(|m| m.parse::<u8>().ok()) {
                    let _ = writeln!(text, "illum {model}");
                }
            }
            "pm" => {
                let _ = writeln!(text, "Pm {}", words(rest).next().unwrap_or("0"));
            }
            "map_kd" | "map_ke" | "map_ks" | "map_d" | "map_bump" | "bump" | "norm" => {
                let word = match word.to_ascii_lowercase().as_str() {
                    "map_kd" => "map_Kd",
                    "map_ke" => "map_Ke",
                    "map_ks" => "map_Ks",
                    "map_d" => "map_d",
                    _ => "bump",
                };
                if rest.is_empty() {
                    return Err(wrong(format!("{word} without a file; name one or remove it")));
                }
                let _ = writeln!(text, "{word} {rest}");
            }
            _ => {}
        }
    }
    Ok(text)
}

/// One number is grey, three are red, green, blue.
fn colour(rest: &str) -> std::result::Result<[f64; 3], String> {
    let numbers = words(rest)
        .take(3)
        .map(|w| match w.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Err(format!("\"{w}\" is no finite number; correct it")),
        })
        .collect::<std::result::Result<Vec<f64>, String>>()?;
    match numbers[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err("one or three numbers are needed; the line may be cut off".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn map_options_are_taken_apart() {
        let map = Map::parse("-s 2 3 1 -o .5 -clamp on -bm 1 -mm 0 1 wood panel.png");
        assert_eq!((map.scale, map.offset), ([2.0, 3.0], [0.5, 0.0]));
        assert!(map.clamp && map.ignored.is_empty());
        assert_eq!(map.name, "wood panel.png");
        assert_eq!(Map::parse("-mm 0.1 2 \"a b.png\"").ignored, ["-mm"]);
        assert_eq!(Map::parse("-mm 0.1 2 \"a b.png\"").name, "a b.png");
        assert_eq!(Map::parse("-s 1 2 3 4.png").name, "4.png");
        assert_eq!(Map::parse("-odd.png").name, "-odd.png");
        assert_eq!(Map::parse("-s").name, "");
    }

    #[test]
    fn colours_may_be_grey() {
        assert_eq!(colour("0.5 # half"), Ok([0.5; 3]));
        assert_eq!(colour("1 2 3 4"), Ok([1.0, 2.0, 3.0]));
        assert!(colour("1 2").is_err());
        assert!(colour("").is_err());
        assert!(colour("nan").is_err());
    }
}
