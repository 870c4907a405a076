//! Numbers of a glTF file that the `gltf` crate cuts to 32 bits in silence.
//!
//! It reads mesh 4294967296 as mesh 0. So the text is looked through once for whole numbers of 2^32
//! and more where an index or a code of the format stands; other numbers (lengths, extras,
//! coordinates) are not cut and may be as large as they like.

use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Members that hold an index, a code, or a list of those.
const INDICES: [&str; 27] = [
    "attributes",
    "buffer",
    "bufferView",
    "camera",
    "children",
    "componentType",
    "index",
    "indices",
    "input",
    "inverseBindMatrices",
    "joints",
    "magFilter",
    "material",
    "mesh",
    "minFilter",
    "mode",
    "node",
    "nodes",
    "output",
    "sampler",
    "scene",
    "skeleton",
    "skin",
    "source",
    "target",
    "targets",
    "texCoord",
];

/// Members whose own members are indices under any name.
const MAPS: [&str; 2] = ["attributes", "targets"];

/// Members that are not part of the format.
const FOREIGN: [&str; 2] = ["extras", "extensions"];

/// The first number that is too large for an index, and the member that holds it.
pub(crate) fn too_large(json: &[u8]) -> Result<Option<(String, u64)>, serde_json::Error> {
    let mut found = None;
    let mut reader = serde_json::Deserializer::from_slice(json);
    Look { member: "", is_index: false, found: &mut found }.deserialize(&mut reader)?;
    Ok(found)
}

/// Looks through one value.
struct Look<'a> {
    /// The member that holds it.
    member: &'a str,
    is_index: bool,
    found: &'a mut Option<(String, u64)>,
}

impl<'de> DeserializeSeed<'de> for Look<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<(), D::Error> {
        reader.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Look<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_u64<E>(self, number: u64) -> Result<(), E> {
        if self.is_index && number > u64::from(u32::MAX) && self.found.is_none() {
            *self.found = Some((self.member.to_string(), number));
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Look { member, is_index, found } = self;
        while list.next_element_seed(Look { member, is_index, found: &mut *found })?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let all = MAPS.contains(&self.member);
        while let Some(name) = map.next_key::<String>()? {
            if FOREIGN.contains(&name.as_str()) {
                map.next_value::<IgnoredAny>()?;
                continue;
            }
            let is_index = all || INDICES.contains(&name.as_str());
            map.next_value_seed(Look { member: &name, is_index, found: &mut *self.found })?;
        }
        Ok(())
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_numbers_are_found_where_indices_are() {
        let look = |json: &str| too_large(json.as_bytes()).unwrap();
        let big = 1u64 << 32;
        for (json, member) in [
            (r#"{"scene": 4294967296}"#, "scene"),
            (r#"{"scenes": [{"nodes": [0, 4294967296]}]}"#, "nodes"),
            (r#"{"nodes": [{"mesh": 4294967296}]}"#, "mesh"),
            (
                r#"{"meshes": [{"primitives": [{"attributes": {"POSITION": 4294967296}}]}]}"#,
                "POSITION",
            ),
            (r#"{"meshes": [{"primitives": [{"targets": [{"X": 4294967296}]}]}]}"#, "X"),
            (
                r#"{"accessors": [{"sparse": {"indices": {"bufferView": 4294967296}}}]}"#,
                "bufferView",
            ),
        ] {
            assert_eq!(look(json), Some((member.into(), big)), "{json}");
            assert_eq!(look(&json.replace("4294967296", "4294967295")), None, "{json}");
        }
        for json in [
            r#"{"extras": {"mesh": 4294967296}, "a": [true, null, -1, 0.5, "b"]}"#,
            r#"{"nodes": [{"translation": [4294967296, 0, 0], "extensions": {"mesh": 4294967296}}]}"#,
            r#"{"buffers": [{"byteLength": 4294967296}]}"#,
        ] {
            assert_eq!(look(json), None, "{json}");
        }
        assert!(too_large(b"{").is_err());
    }
}
