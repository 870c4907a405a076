//! OBJ text made plain, so that its reader cannot misread it.
//!
//! `tobj` refuses some legitimate files (continued lines, bytes that are not UTF-8, comments after
//! numbers, colours with alpha) and silently misreads others: a polyline of three points becomes a
//! triangle, a corner without texture coordinates gets its neighbour's, colours of some vertices
//! shift to others, a weight divides the position, far negative indices wrap around. Its errors
//! name no line. So every statement is checked here, with its line, and written anew in the form
//! that it reads right: all vertices first, absolute indices, objects and materials by number.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use super::notices::Notices;
use crate::error::{Error, Result};

/// Most corners of one polygon: triangulating takes up to the square of it, some seconds here.
pub(crate) const MAX_CORNERS: usize = 1 << 12;

/// A plain OBJ text and the names that its numbers stand for.
#[derive(Debug, Default)]
pub(crate) struct Plain {
    /// Lines `v`, `vt`, `o NUMBER`, `usemtl NUMBER`, `f`.
    pub(crate) text: String,
    /// Object names (`o`, else `g`), each once.
    pub(crate) objects: Vec<String>,
    /// Names of used materials, each once.
    pub(crate) materials: Vec<String>,
    /// Arguments of `mtllib`.
    pub(crate) libraries: Vec<String>,
}

/// Text of a line, and those that it continues on, without the comment lines and blank ones.
pub(crate) fn statements(bytes: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines = bytes.split(|&b| b == b'\n').enumerate();
    std::iter::from_fn(move || {
        let (number, line) = lines.next()?;
        let text = trimmed(line);
        if text.starts_with('#') || !text.ends_with('\\') {
            return Some((number + 1, text));
        }
        // One string that grows: a file may continue one line to its end.
        let mut whole = text.into_owned();
        while whole.ends_with('\\') {
            whole.pop();
            whole.push(' ');
            whole.push_str(&lines.next().map_or(Cow::Borrowed(""), |(_, line)| trimmed(line)));
        }
        Some((number + 1, Cow::Owned(whole)))
    })
    .filter(|(_, text)| !text.is_empty() && !text.starts_with('#'))
}

/// A line as text. What is not UTF-8 is taken for Latin-1, which maps distinct bytes to distinct
/// characters, so that different names stay different.
fn trimmed(line: &[u8]) -> Cow<'_, str> {
    let line = line.trim_ascii();
    match std::str::from_utf8(line) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(line.iter().map(|&b| char::from(b)).collect()),
    }
}

/// The first word of a statement and the rest.
pub(crate) fn keyword(text: &str) -> (&str, &str) {
    match text.split_once(|c: char| c.is_ascii_whitespace()) {
        Some((word, rest)) => (word, rest.trim()),
        None => (text, ""),
    }
}

/// The words of an argument that holds no names; a comment may follow.
pub(crate) fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_ascii_whitespace().take_while(|word| !word.starts_with('#'))
}

/// Names by number, each once.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    numbers: HashMap<String, usize>,
}

impl Names {
    fn number(&mut self, name: &str) -> usize {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        self.numbers.insert(name.to_string(), self.list.len());
        self.list.push(name.to_string());
        self.list.len() - 1
    }
}

/// The statement that is being read, for messages.
struct Place<'a> {
    path: &'a Path,
    line: usize,
    object: &'a str,
}

impl Place<'_> {
    fn wrong(&self, reason: impl ToString) -> Error {
        let what = format!("line {}, object \"{}\"", self.line, self.object);
        Error::invalid(self.path, what, reason)
    }
}

/// The greatest index asked for and where, checked when the number of vertices is known.
#[derive(Default)]
struct Greatest {
    index: usize,
    line: usize,
    object: String,
}

/// Writes an OBJ file anew. `name` is the object's name until the file gives one.
pub(crate) fn plain(path: &Path, bytes: &[u8], name: &str, notices: &mut Notices) -> Result<Plain> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Error::unsupported(path, "file", "UTF-16 text; save it as UTF-8"));
    }
    let mut vertices = String::new();
    let mut faces = String::new();
    let (mut v_count, mut vt_count) = (0, 0);
    let (mut v_greatest, mut vt_greatest) = (Greatest::default(), Greatest::default());
    let (mut objects, mut materials) = (Names::default(), Names::default());
    let mut libraries = Vec::new();
    let mut object = name.to_string();
    let mut has_objects = false;
    let mut corners: Vec<(usize, usize)> = Vec::new();
    let mut oddities = Oddities::default();
    let _ = writeln!(faces, "o {}", objects.number(name));

    for (line, text) in statements(bytes) {
        let place = Place { path, line, object: &object };
        let (word, rest) = keyword(&text);
        match word {
            "v" => {
                let numbers = position(&place, rest, &mut oddities)?;
                let _ = writeln!(vertices, "v {} {} {}", numbers[0], numbers[1], numbers[2]);
                v_count += 1;
            }
            "vt" => {
                let [u, v] = texture_coordinate(&place, rest, &mut oddities)?;
                let _ = writeln!(vertices, "vt {u} {v}");
                vt_count += 1;
            }
            "f" | "fo" => {
                corners.clear();
                for word in words(rest) {
                    corners.push(corner(&place, word, v_count, vt_count)?);
                }
                if corners.len() < 3 {
                    oddities.small_faces += 1;
                    continue;
                }
                if corners.len() > MAX_CORNERS {
                    return Err(Error::unsupported(
                        path,
                        format!("line {line}, object \"{object}\""),
                        format!("a polygon of {} corners; cut it into smaller ones", corners.len()),
                    ));
                }
                faces.push('f');
                for &(v, vt) in &corners {
                    v_greatest.see(v, &place);
                    vt_greatest.see(vt, &place);
                    // Texture coordinate 1 is the one of corners that have none.
                    let _ = write!(faces, " {v}/{}", vt + 1);
                }
                faces.push('\n');
            }
            "o" | "g" => {
                has_objects |= word == "o";
                if word == "o" || !has_objects {
                    object = if rest.is_empty() { name.to_string() } else { rest.to_string() };
                    let _ = writeln!(faces, "o {}", objects.number(&object));
                }
            }
            "usemtl" => {
                let _ = writeln!(faces, "usemtl {}", materials.number(rest));
            }
            "mtllib" => libraries.push(rest.to_string()),
            "l" | "p" => oddities.lines += 1,
            "vn" | "s" | "mg" | "lod" | "bevel" | "c_interp" | "d_interp" => {}
            _ => oddities.unknown += 1,
        }
    }
    v_greatest.check(path, v_count, "vertex")?;
    vt_greatest.check(path, vt_count, "texture coordinate")?;
    oddities.say(notices);
    let text = format!("vt 0 0\n{vertices}{faces}");
    Ok(Plain { text, objects: objects.list, materials: materials.list, libraries })
}

/// Counts of what is left out.
#[derive(Default)]
struct Oddities {
    weights: usize,
    colours: usize,
    coordinates: usize,
    small_faces: usize,
    lines: usize,
    unknown: usize,
}

impl Oddities {
    fn say(&self, notices: &mut Notices) {
        let mut add = |text: &str, count| notices.add_many("file", text, count);
        add("vertex weights are left out: they are for curved surfaces", self.weights);
        add("vertex colours are left out: OBJ does not define them", self.colours);
        add("texture coordinates that are not finite are set to zero", self.coordinates);
        add("faces of fewer than three corners are left out", self.small_faces);
        add("points and lines have no surface and are left out", self.lines);
        add("statements that describe no polygons are left out", self.unknown);
    }
}

/// The three words of a position, which are finite numbers.
fn position<'a>(place: &Place, rest: &'a str, oddities: &mut Oddities) -> Result<[&'a str; 3]> {
    let mut numbers = [""; 3];
    let mut count = 0;
    for word in words(rest) {
        if count < 3 {
            match word.parse::<f64>() {
                Ok(x) if x.is_finite() => numbers[count] = word,
                Ok(_) => {
                    return Err(place.wrong(format!(
                        "coordinate \"{word}\" is not finite; repair the mesh and export it again"
                    )));
                }
                Err(_) => {
                    return Err(
                        place.wrong(format!("coordinate \"{word}\" is no number; correct it"))
                    );
                }
            }
        }
        if count == 3 && word.parse() != Ok(1.0) {
            oddities.weights += 1;
        }
        count += 1;
    }
    match count {
        0..3 => Err(place.wrong("a vertex needs three coordinates; the line may be cut off")),
        3 | 4 => Ok(numbers),
        _ => {
            // Six or more are a position and a colour; then the fourth was no weight.
            oddities.weights -= usize::from(words(rest).nth(3).map(str::parse) != Some(Ok(1.0)));
            oddities.colours += 1;
            Ok(numbers)
        }
    }
}

fn texture_coordinate(place: &Place, rest: &str, oddities: &mut Oddities) -> Result<[f64; 2]> {
    let mut uv = [0.0f64; 2];
    let mut count = 0;
    for (uv, word) in uv.iter_mut().zip(words(rest)) {
        *uv = word.parse().map_err(|_| {
            place.wrong(format!("texture coordinate \"{word}\" is no number; correct it"))
        })?;
        count += 1;
    }
    if count == 0 {
        return Err(place.wrong("a texture coordinate needs a number; the line may be cut off"));
    }
    if !uv.iter().all(|x| x.is_finite()) {
        oddities.coordinates += 1;
        return Ok([0.0; 2]);
    }
    Ok(uv)
}

/// A corner `v`, `v/vt`, `v//vn` or `v/vt/vn`: absolute numbers of its vertex (from 1) and of its
/// texture coordinate (0 where it has none). Normals do not matter here.
fn corner(place: &Place, word: &str, v_count: usize, vt_count: usize) -> Result<(usize, usize)> {
    let mut parts = word.split('/');
    let mut absolute = |what: &str, count: usize| {
        let part = parts.next().unwrap_or("");
        if part.is_empty() {
            return Ok(0);
        }
        let index: i64 = part.parse().map_err(|_| {
            place.wrong(format!("face corner \"{word}\" holds no {what} index; correct it"))
        })?;
        // Negative indices count back from the latest.
        let index = if index < 0 { index.checked_add(count as i64 + 1) } else { Some(index) };
        match index.and_then(|i| usize::try_from(i).ok()) {
            Some(index) if index > 0 => Ok(index),
            _ => Err(place.wrong(format!(
                "face corner \"{word}\": there is no such {what} (there are {count} so far); \
                 the file is damaged, export it again"
            ))),
        }
    };
    let v = absolute("vertex", v_count)?;
    let vt = absolute("texture coordinate", vt_count)?;
    if v == 0 {
        return Err(place.wrong(format!("face corner \"{word}\" has no vertex; correct it")));
    }
    Ok((v, vt))
}

impl Greatest {
    fn see(&mut self, index: usize, place: &Place) {
        if index > self.index {
            self.index = index;
            self.line = place.line;
            place.object.clone_into(&mut self.object);
        }
    }

    fn check(&self, path: &Path, count: usize, what: &str) -> Result<()> {
        if self.index <= count {
            return Ok(());
        }
        let place = Place { path, line: self.line, object: &self.object };
        Err(place.wrong(format!(
            "{what} {} does not exist (there are {count}); the file may be cut off, export it again",
            self.index
        )))
    }
}
