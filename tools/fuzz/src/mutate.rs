//! Mutations that know the formats, beside the engine's own: members of JSON, numbers and lines of
//! text, words of buffers.

use crate::change::{changed, glb_changed};
use crate::random::Random;

/// What is mutated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Text in lines, with numbers.
    Text,
    /// JSON with buffers in base64.
    Json,
    /// JSON and a binary chunk.
    Glb,
}

/// A mutated copy; none where it would be longer than `longest`.
pub fn mutated(kind: Kind, data: &[u8], longest: usize, seed: u32) -> Option<Vec<u8>> {
    let mut random = Random::new(u64::from(seed));
    let new = match kind {
        Kind::Text => changed(data, false, &mut random),
        Kind::Json => changed(data, true, &mut random),
        Kind::Glb => match parts(data) {
            Some((json, rest)) if random.below(2) == 0 => {
                let json = changed(json, true, &mut random);
                whole(json, rest)
            }
            _ if data.len() >= 20 => glb_changed(data, &mut random),
            _ => return None,
        },
    };
    (new.len() <= longest).then_some(new)
}

/// The JSON of a GLB and the chunks after it.
fn parts(data: &[u8]) -> Option<(&[u8], &[u8])> {
    let length = u32::from_le_bytes(data.get(12..16)?.try_into().ok()?) as usize;
    data.get(20..)?.split_at_checked(length)
}

/// A GLB of such JSON and further chunks, with lengths that are right.
fn whole(mut json: Vec<u8>, rest: &[u8]) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = 20 + json.len() + rest.len();
    let mut glb = b"glTF".to_vec();
    glb.extend(2u32.to_le_bytes());
    glb.extend((length as u32).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(json);
    glb.extend(rest);
    glb
}
