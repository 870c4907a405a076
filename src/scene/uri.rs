//! Files that a scene file refers to: relative references only, resolved against its folder.

use std::fs;
use std::path::{Path, PathBuf};

/// Why a reference cannot be followed.
#[derive(Debug, PartialEq)]
pub(crate) enum Refused {
    /// It asks for something that this program does not do: an address on a network, an absolute
    /// path.
    Unsupported(String),
    /// The file cannot be read.
    Unreadable(PathBuf, String),
}

/// Reads a whole regular file. Devices and pipes are refused: they may have no end.
pub(crate) fn read_regular(path: &Path) -> Result<Vec<u8>, String> {
    let kind = fs::metadata(path).map_err(|e| e.to_string())?;
    if !kind.is_file() {
        return Err("it is not a regular file".into());
    }
    fs::read(path).map_err(|e| e.to_string())
}

/// Reads the file that a glTF URI refers to, from the folder of the scene file.
pub(crate) fn read_relative(scene: &Path, uri: &str) -> Result<Vec<u8>, Refused> {
    if let Some(scheme) = scheme(uri) {
        return Err(Refused::Unsupported(format!(
            "\"{uri}\" has the scheme \"{scheme}\"; only files beside the scene are read: \
             download it and refer to it by a relative path"
        )));
    }
    if uri.starts_with(['/', '\\']) {
        return Err(Refused::Unsupported(format!(
            "\"{uri}\" is an absolute path; refer to the file by a path relative to the scene"
        )));
    }
    let [path, as_it_is] = places(scene, uri);
    match read_regular(&path) {
        Ok(bytes) => Ok(bytes),
        Err(reason) => read_regular(&as_it_is).map_err(|_| {
            Refused::Unreadable(path, format!("{reason}; put the file there, beside the scene"))
        }),
    }
}

/// Where the file may be that a glTF URI refers to, the likelier place first: some exporters write
/// file names as they are, percent signs and all.
fn places(scene: &Path, uri: &str) -> [PathBuf; 2] {
    let folder = scene.parent().unwrap_or(Path::new(""));
    [folder.join(percent_decode(uri)), folder.join(uri)]
}

/// The file that [`read_relative`] would read; none for a URI that holds its data itself.
pub(crate) fn file_of(scene: &Path, uri: &str) -> Option<PathBuf> {
    if uri.starts_with("data:") {
        return None;
    }
    places(scene, uri).into_iter().find(|place| place.is_file())
}

/// The scheme of a URI such as `https:` or `C:`, if it has one (RFC 3986, section 3.1).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut letters = scheme.chars();
    let fits = letters.next().is_some_and(|c| c.is_ascii_alphabetic())
        && letters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    fits.then_some(scheme)
}

/// Undoes percent encoding; what is not a valid escape, or would not be UTF-8, stays as it is.
fn percent_decode(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let digit = |k: usize| bytes.get(k).and_then(|&b| (b as char).to_digit(16));
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                // Two hexadecimal digits fit a byte.
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (other, _, _) => {
                out.push(other);
                i += 1;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| uri.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_escapes_are_undone_and_strays_kept() {
        assert_eq!(percent_decode("a%20b%2fc"), "a b/c");
        assert_eq!(percent_decode("100%"), "100%");
        assert_eq!(percent_decode("%zz%4"), "%zz%4");
        assert_eq!(percent_decode("%ff"), "%ff");
        assert_eq!(percent_decode("%E2%82%AC"), "\u{20ac}");
    }

    #[test]
    fn schemes_are_seen() {
        assert_eq!(scheme("https://a/b"), Some("https"));
        assert_eq!(scheme("C:/a"), Some("C"));
        assert_eq!(scheme("a/b.bin"), None);
        assert_eq!(scheme("./1:2.bin"), None);
    }
}
