//! Changes that break files: of bytes, of numbers, of lines, of members of JSON.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::random::Random;

/// What stands in for numbers and words.
const WORDS: [&str; 26] = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e400",
    "1e39",
    "-0",
    "0",
    "-1",
    "1",
    "2",
    "0.5",
    "1e-320",
    "255",
    "65535",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "999999999",
    "\"text\"",
    "null",
    "[]",
    "{}",
    "true",
];

/// Bit patterns of f32 and indices that hurt.
const BITS: [u32; 9] = [
    0x7fc0_0000,
    0x7f80_0000,
    0xff80_0000,
    0x7f7f_ffff,
    0x0000_0001,
    0x8000_0000,
    0xffff_ffff,
    0,
    0x7149_f2ca,
];

/// Changes a few things at random; which ones follow from the random numbers alone.
pub fn changed(file: &[u8], is_json: bool, random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..1 + random.below(3) {
        bytes = match random.below(if is_json { 12 } else { 8 }) {
            0 => flipped(bytes, random),
            1 => cut(bytes, random),
            2..=4 => number_replaced(bytes, random),
            5 | 6 => lines(bytes, random),
            7 => spliced(bytes, random),
            8 => with_numbers_in_buffer(bytes, random),
            _ => member(bytes, random),
        };
    }
    bytes
}

/// Bytes with some bits turned over.
fn flipped(mut bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    if !bytes.is_empty() {
        for _ in 0..1 + random.below(8) {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
    }
    bytes
}

/// The beginning of a file, or what is left without a part of it.
fn cut(mut bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let from = random.below(bytes.len() + 1);
    if random.below(2) == 0 {
        bytes.truncate(from);
    } else {
        let to = (from + random.below(200)).min(bytes.len());
        bytes.drain(from..to);
    }
    bytes
}

/// A number of the text is another one, or a word.
fn number_replaced(bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let is_part = |b: u8| b.is_ascii_digit() || b"+-.eE".contains(&b);
    let begins: Vec<usize> = (0..bytes.len())
        .filter(|&i| bytes[i].is_ascii_digit() && (i == 0 || !bytes[i - 1].is_ascii_alphanumeric()))
        .filter(|&i| i == 0 || !is_part(bytes[i - 1]) || bytes[i - 1] == b'-')
        .collect();
    if begins.is_empty() {
        return bytes;
    }
    let begin = begins[random.below(begins.len())];
    let length = bytes[begin..].iter().take_while(|&&b| is_part(b)).count();
    let mut changed = bytes[..begin].to_vec();
    changed.extend(WORDS[random.below(WORDS.len())].bytes());
    changed.extend(&bytes[begin + length..]);
    changed
}

/// A line is missing, is there twice or a thousand times, stands elsewhere, or is very long.
fn lines(bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = bytes.split(|&b| b == b'\n').map(<[u8]>::to_vec).collect();
    let at = random.below(lines.len());
    match random.below(5) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[at].clone()),
        2 => drop(lines.splice(at..at, vec![lines[at].clone(); 1000])),
        3 => {
            let line = lines.remove(at);
            lines.insert(random.below(lines.len() + 1), line);
        }
        _ => {
            let line = lines[at].clone();
            lines[at] = (0..1 + random.below(50)).flat_map(|_| line.iter().copied()).collect();
        }
    }
    lines.join(&b'\n')
}

/// Some bytes of one place stand in another as well.
fn spliced(mut bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let from = random.below(bytes.len() + 1);
    let to = (from + random.below(300)).min(bytes.len());
    let part = bytes[from..to].to_vec();
    let at = random.below(bytes.len() + 1);
    bytes.splice(at..at, part);
    bytes
}

/// Some words of a buffer that the JSON holds are other numbers.
fn with_numbers_in_buffer(bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let Ok(mut json) = serde_json::from_slice::<Value>(&bytes) else { return bytes };
    let Some(uri) = json.pointer_mut("/buffers/0/uri") else { return bytes };
    let text = uri.as_str().unwrap_or("").to_string();
    let Some((head, data)) = text.split_once(',') else { return bytes };
    let Ok(mut data) = STANDARD.decode(data) else { return bytes };
    if data.len() < 4 {
        return bytes;
    }
    for _ in 0..1 + random.below(4) {
        let at = random.below(data.len() / 4) * 4;
        data[at..at + 4].copy_from_slice(&BITS[random.below(BITS.len())].to_le_bytes());
    }
    *uri = format!("{head},{}", STANDARD.encode(data)).into();
    json.to_string().into_bytes()
}

/// A member of the JSON is missing, is something else, or is there more than once.
fn member(bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let Ok(mut json) = serde_json::from_slice::<Value>(&bytes) else { return bytes };
    let mut places = vec![];
    collect(&json, String::new(), &mut places);
    let place = places[random.below(places.len())].clone();
    let other = places[random.below(places.len())].clone();
    let other = json.pointer(&other).cloned().unwrap_or(Value::Null);
    let (parent, name) = place.rsplit_once('/').unwrap_or(("", ""));
    let what = random.below(6);
    if let Some(Value::Array(list)) = json.pointer_mut(&place)
        && what < 2
        && !list.is_empty()
    {
        let item = list[random.below(list.len())].clone();
        list.extend(vec![item; if what == 0 { 1 } else { 1000 }]);
        return json.to_string().into_bytes();
    }
    let value = match what {
        0 | 1 => other,
        2 => serde_json::from_str(WORDS[random.below(WORDS.len())]).unwrap_or(Value::Null),
        // Deep, but not so that the reader of JSON refuses it.
        3 => (0..100).fold(Value::Null, |inner, _| json!([inner])),
        4 => json!(-1),
        _ => {
            if let Some(Value::Object(map)) = json.pointer_mut(parent) {
                map.remove(name);
            }
            return json.to_string().into_bytes();
        }
    };
    if let Some(slot) = json.pointer_mut(&place) {
        *slot = value;
    }
    json.to_string().into_bytes()
}

/// The places of all values below one, but for the number of those in long lists.
fn collect(value: &Value, at: String, places: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            for (name, inner) in map {
                let name = name.replace('~', "~0").replace('/', "~1");
                collect(inner, format!("{at}/{name}"), places);
            }
        }
        Value::Array(list) => {
            for (i, inner) in list.iter().enumerate().take(40) {
                collect(inner, format!("{at}/{i}"), places);
            }
        }
        _ => {}
    }
    places.push(at);
}

/// A GLB with words of its header, of its JSON or of its binary chunk changed.
pub fn glb_changed(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    match random.below(4) {
        0 => {
            let at = 4 * random.below(5.min(bytes.len() / 4));
            bytes[at..at + 4].copy_from_slice(&BITS[random.below(BITS.len())].to_le_bytes());
            bytes
        }
        1 => {
            let at = 4 * random.below(bytes.len() / 4);
            bytes[at..at + 4].copy_from_slice(&BITS[random.below(BITS.len())].to_le_bytes());
            bytes
        }
        _ => changed(&bytes, false, random),
    }
}
