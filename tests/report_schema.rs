//! Reports of real runs fit `tools/report.schema.json`, which names and explains everything in them.

mod command_support;

use std::path::Path;

use command_support::*;
use serde_json::{Value, json};

fn schema() -> Value {
    json(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/report.schema.json"))
}

/// Everything about `value` that does not fit, by its place. Knows the keywords of JSON Schema that
/// our schema uses; others are an error, so that none is passed over.
fn misfits(root: &Value, schema: &Value, value: &Value, place: &str, found: &mut Vec<String>) {
    let mut wrong = |what: String| found.push(format!("{place}: {what}"));
    let number = value.as_f64();
    for (keyword, rule) in schema.as_object().unwrap() {
        match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "properties" | "items" => {}
            "type" => {
                let kinds: Vec<&str> = match rule {
                    Value::Array(list) => list.iter().map(|k| k.as_str().unwrap()).collect(),
                    one => vec![one.as_str().unwrap()],
                };
                let is = |kind: &str| match kind {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "null" => value.is_null(),
                    "number" => value.is_number(),
                    "integer" => number.is_some_and(|x| x.fract() == 0.0),
                    other => panic!("unknown type {other}"),
                };
                if !kinds.iter().any(|kind| is(kind)) {
                    wrong(format!("{value} is not of type {rule}"));
                }
            }
            "const" if value != rule => wrong(format!("{value} is not {rule}")),
            "enum" if !rule.as_array().unwrap().contains(value) => {
                wrong(format!("{value} is not one of {rule}"));
            }
            "minimum" if number.is_some_and(|x| x < rule.as_f64().unwrap()) => {
                wrong(format!("{value} is less than {rule}"));
            }
            "minLength" if value.as_str().is_some_and(|s| s.len() < size(rule)) => {
                wrong(format!("{value} is too short"));
            }
            "minItems" if value.as_array().is_some_and(|a| a.len() < size(rule)) => {
                wrong("too few items".into());
            }
            "required" => {
                for name in rule.as_array().unwrap() {
                    if value.is_object() && value.get(name.as_str().unwrap()).is_none() {
                        wrong(format!("{name} is missing"));
                    }
                }
            }
            "const" | "enum" | "minimum" | "minLength" | "minItems" => {}
            "$ref" | "additionalProperties" => {}
            other => panic!("unknown keyword {other}"),
        }
    }
    if let Some(path) = schema.get("$ref") {
        let target = root.pointer(path.as_str().unwrap().trim_start_matches('#')).unwrap();
        misfits(root, target, value, place, found);
    }
    for (name, inner) in value.as_object().into_iter().flatten() {
        let place = format!("{place}/{name}");
        match (
            schema.get("properties").and_then(|p| p.get(name)),
            schema.get("additionalProperties"),
        ) {
            (Some(known), _) => misfits(root, known, inner, &place, found),
            (None, Some(Value::Bool(false))) => {
                found.push(format!("{place}: unknown; explain it in tools/report.schema.json"));
            }
            (None, Some(any)) => misfits(root, any, inner, &place, found),
            (None, None) => {}
        }
    }
    if let (Some(list), Some(rule)) = (value.as_array(), schema.get("items")) {
        for (i, inner) in list.iter().enumerate() {
            misfits(root, rule, inner, &format!("{place}/{i}"), found);
        }
    }
}

fn size(rule: &Value) -> usize {
    rule.as_u64().unwrap() as usize
}

fn all_misfits(report: &Value) -> Vec<String> {
    let schema = schema();
    let mut found = vec![];
    misfits(&schema, &schema, report, "", &mut found);
    found
}

/// A room cut into so many triangles that it counts as a scene of many small faces.
fn many_faces() -> String {
    let mut obj = String::from("mtllib m.mtl\n");
    let n = 32;
    for (y, material, flip) in [(0.0, "w", true), (1.0, "w", false)] {
        let begin = obj.matches("\nv ").count() + 1;
        for i in 0..=n {
            for j in 0..=n {
                obj += &format!("v {} {y} {}\n", f64::from(i) / 32.0, f64::from(j) / 32.0);
            }
        }
        for i in 0..n {
            for j in 0..n {
                let at = |i: i32, j: i32| begin as i32 + i * (n + 1) + j;
                let lamp = !flip && i == 16 && j == 16;
                obj += &format!("usemtl {}\n", if lamp { "l" } else { material });
                let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let order = if flip { [3, 2, 1, 0] } else { [0, 1, 2, 3] };
                let words = order.map(|k| corners[k].to_string()).join(" ");
                obj += &format!("f {words}\n");
            }
        }
    }
    obj
}

#[test]
fn every_report_fits_the_schema() {
    let room = tempfile::tempdir().unwrap();
    let at = |name: &str| room.path().join(name);
    std::fs::write(at("many.obj"), many_faces()).unwrap();
    std::fs::write(at("m.mtl"), "newmtl w\nKd 0.5 0.5 0.5\nnewmtl l\nKe 9 9 9\n").unwrap();
    std::fs::write(at("p.csv"), "x,y,z,nx,ny,nz\n0.3,0,0.1,0,1,0\n").unwrap();
    let mut seen = vec![];
    for words in [
        "inspect scenes/room.gltf --two-sided --time-limit 60 --threads 1",
        "inspect scenes/cornell.gltf --emission *=0 --subdivide 1 --audit",
        "render scenes/cornell.gltf -o v.png --size 16x16 --error-map e.exr",
        "render scenes/paper.gltf -o v.exr --size 16x16 --max-edge 2 --camera low",
        "render scenes/paper.gltf -o v.exr --size 16x16 --subdivide 1 --operator exact",
        "render scenes/paper.gltf -o v.exr --size 16x16 --subdivide 1 --operator clustered --gather",
        "render many.obj -o v.png --size 16x16 --tolerance 5%",
        "bake scenes/cornell.gltf -o o.glb --size 64 --tolerance 5% --only floor",
        "bake scenes/cornell.gltf -o o.gltf --to vertices --max-triangles 2000 --tolerance 5%",
        "probe scenes/cornell.gltf --points p.csv --tolerance 3%",
        "probe scenes/furnace.gltf --points p.csv --emission *=0",
        "reference --table 6.4 --max-n 40 --json",
    ] {
        succeeds(room.path(), &format!("{words} --report r.json"));
        let report = json(&at("r.json"));
        assert_eq!(all_misfits(&report), [""; 0], "{words}");
        seen.push(report);
    }
    // Nothing is explained that is nowhere.
    for list in ["counts", "values"] {
        let explained = schema()["properties"][list]["properties"].clone();
        for name in explained.as_object().unwrap().keys() {
            let is_there = seen.iter().any(|report| report[list].get(name).is_some());
            assert!(is_there, "{list}: \"{name}\" is in no report");
        }
    }
}

#[test]
fn reports_with_mistakes_do_not_fit() {
    let room = tempfile::tempdir().unwrap();
    succeeds(room.path(), "inspect scenes/paper.gltf --reflectance *=2 --report r.json");
    let good = json(&room.path().join("r.json"));
    assert_eq!(all_misfits(&good), [""; 0]);
    assert!(!good["notices"].as_array().unwrap().is_empty());
    for (place, mistake) in [
        ("", json!([])),
        ("/program", json!("other")),
        ("/command", json!("paint")),
        ("/version", json!(1)),
        ("/settings/scene", json!(7)),
        ("/stages", json!([])),
        ("/stages/0/name", json!("rest")),
        ("/stages/0/wall_seconds", json!(-1)),
        ("/stages/0/cpu_seconds", json!("1")),
        ("/counts/faces", json!(1.5)),
        ("/counts/faces", json!(-1)),
        ("/values", json!({"other": 1})),
        ("/values", json!({"residual_r": "small"})),
        ("/notices/0", json!({"about": "a", "text": "b"})),
        ("/notices/0/count", json!(0)),
        ("/notices/0/text", json!("")),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(place).unwrap() = mistake.clone();
        assert!(!all_misfits(&bad).is_empty(), "{place}: {mistake}");
    }
    for name in good.as_object().unwrap().keys() {
        let mut bad = good.clone();
        bad.as_object_mut().unwrap().remove(name);
        assert!(!all_misfits(&bad).is_empty(), "{name}");
    }
}
