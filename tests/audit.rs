//! The linter for scenes: each made scene has one defect, which is found, named and placed; scenes
//! without defects have no findings.

mod command_support;
mod common;

use command_support::{json as read_json, shipped, stdout, succeeds};
use common::{box_quads, material, rotated, triangle};
use glam::{DMat3, DVec3, dvec3};
use lumel::Monitor;
use lumel::audit::{Audit, Enclosure, Finding, Kind, Severity, audit};
use lumel::scene::{Material, Object, ReadOptions, Scene, read, resolve_overlaps};

type Quads = Vec<[DVec3; 4]>;

const WALL: u32 = 0;
const LAMP: u32 = 1;
const BLACK: u32 = 2;
const BOTH: u32 = 3;

/// Objects of quads with a material each.
fn scene(objects: &[(&str, Quads, u32)]) -> Scene {
    let lamp = material("lamp", 0.0, 5.0);
    let materials = vec![
        material("wall", 0.5, 0.0),
        lamp.clone(),
        material("black", 0.0, 0.0),
        Material { two_sided: true, ..lamp },
    ];
    let mut triangles = vec![];
    for (object, (_, quads, m)) in objects.iter().enumerate() {
        for &[a, b, c, d] in quads {
            let own = [triangle([a, b, c], *m), triangle([a, c, d], *m)];
            triangles.extend(own.map(|t| lumel::scene::Triangle { object: object as u32, ..t }));
        }
    }
    let objects = objects.iter().map(|(name, ..)| Object { name: (*name).into() }).collect();
    Scene { triangles, materials, objects, ..Scene::default() }
}

fn audited(scene: &Scene) -> Audit {
    audit(scene, &scene.notices, &Monitor::silent()).unwrap()
}

fn findings(scene: &Scene) -> Vec<Finding> {
    audited(scene).findings
}

/// The only finding of a scene.
#[track_caller]
fn only(scene: &Scene) -> Finding {
    let found = findings(scene);
    let [one] = &found[..] else { panic!("{found:#?}") };
    one.clone()
}

#[track_caller]
fn is(finding: &Finding, severity: Severity, kind: Kind, about: &str) {
    assert_eq!((finding.severity, finding.kind), (severity, kind), "{finding:#?}");
    assert!(finding.about.contains(about), "{finding:#?}");
}

const SIZE: DVec3 = dvec3(4.0, 3.0, 5.0);

fn walls() -> Quads {
    box_quads(DVec3::ZERO, SIZE, false)
}

fn block(min: DVec3, max: DVec3) -> Quads {
    box_quads(min, max, true)
}

/// A quad of 1 m that faces down, or up, about a point.
fn panel(at: DVec3, down: bool) -> Quads {
    let p = |x: f64, z: f64| at + dvec3(x, 0.0, z);
    let q = [p(-0.5, -0.5), p(0.5, -0.5), p(0.5, 0.5), p(-0.5, 0.5)];
    vec![if down { q } else { [q[3], q[2], q[1], q[0]] }]
}

fn room(more: &[(&'static str, Quads, u32)]) -> Scene {
    let mut objects = vec![("Room", walls(), WALL)];
    objects.extend_from_slice(more);
    if !objects.iter().any(|(_, _, m)| *m == LAMP || *m == BOTH) {
        objects.push(("Lamp", panel(dvec3(2.0, 2.9, 2.5), true), LAMP));
    }
    scene(&objects)
}

/// A block in the room.
fn furniture() -> Quads {
    block(dvec3(0.5, 0.0, 0.5), dvec3(1.5, 1.0, 1.2))
}

fn inside_out(quads: Quads) -> Quads {
    quads.into_iter().map(|[a, b, c, d]| [d, c, b, a]).collect()
}

#[test]
fn sound_rooms_have_no_findings() {
    let pane = vec![[
        dvec3(1.0, 0.5, 2.0),
        dvec3(3.0, 0.5, 2.0),
        dvec3(3.0, 2.5, 2.0),
        dvec3(1.0, 2.5, 2.0),
    ]];
    let poster = [0.0, 1.0, 1.0, 0.0].iter().zip([1.0, 1.0, 2.0, 2.0]);
    let poster: Vec<DVec3> = poster.map(|(x, y)| dvec3(1.0 + x, y, 0.01)).collect();
    for (more, why) in [
        (vec![], "an empty room"),
        (vec![("Block", furniture(), WALL)], "a block on the floor"),
        (vec![("Pane", pane, WALL)], "a one-sided pane that stands free"),
        (vec![("Poster", vec![poster.try_into().unwrap()], WALL)], "a poster"),
        (
            vec![("Lamp", block(dvec3(1.0, 1.0, 1.0), dvec3(1.5, 1.5, 1.5)), LAMP)],
            "a lamp that is a box",
        ),
        (vec![("Sunk", block(dvec3(0.5, -0.2, 0.5), dvec3(1.5, 1.0, 1.2)), WALL)], "a sunk block"),
        (
            vec![(
                "Plate",
                [panel(dvec3(2.0, 1.0, 2.0), true), panel(dvec3(2.0, 1.0, 2.0), false)].concat(),
                WALL,
            )],
            "a plate of two sheets",
        ),
    ] {
        let room = room(&more);
        let turn = DMat3::from_axis_angle(dvec3(1.0, 2.0, 3.0).normalize(), 0.7);
        for scene in [room.clone(), rotated(&room, turn, 1e-3, dvec3(3e-3, 0.0, 1e-3))] {
            let found = audited(&scene);
            assert!(found.findings.is_empty(), "{why}: {:#?}", found.findings);
            assert_eq!(found.closure.enclosure, Enclosure::Closed, "{why}");
            assert_eq!(found.closure.mean, 1.0);
            assert!(found.row_sums.points >= 20 && found.row_sums.largest <= 1.0 + 1e-10);
        }
    }
    // All that an empty room's points see radiates.
    let empty = scene(&[("Room", walls(), WALL)]);
    assert!((audited(&empty).row_sums.least - 1.0).abs() < 1e-10);
}

#[test]
fn a_flipped_box_is_found() {
    for at in [dvec3(0.0, 0.2, 0.0), dvec3(1.0, 1.0, 2.0)] {
        let own = furniture().iter().map(|q| q.map(|p| p + at)).collect();
        let one = only(&room(&[
            ("Box", inside_out(own), WALL),
            ("Block", block(dvec3(3.0, 0.0, 4.0), dvec3(3.5, 1.0, 4.5)), WALL),
        ]));
        is(&one, Severity::Warning, Kind::Flipped, "\"Box\"");
        assert!(one.remedy.contains("--two-sided") && one.place.is_some());
    }
    // A part of an object: the other one is sound.
    let above_floor = furniture().iter().map(|q| q.map(|p| p + 0.1 * DVec3::Y)).collect();
    let wrong = inside_out(above_floor);
    let pair = [wrong.clone(), block(dvec3(3.0, 0.0, 4.0), dvec3(3.5, 1.0, 4.5))].concat();
    let one = only(&room(&[("Pair", pair, WALL)]));
    is(&one, Severity::Warning, Kind::Flipped, "\"Pair\"");
    assert!(one.text.contains("1 of its 2 connected parts (12 triangles)"), "{}", one.text);
    // As one object with its room.
    let all = [walls(), wrong].concat();
    let one =
        only(&scene(&[("All", all, WALL), ("Lamp", panel(dvec3(2.0, 2.9, 2.5), true), LAMP)]));
    is(&one, Severity::Warning, Kind::Flipped, "\"All\"");
    // On the floor its bottom faces the same way as that does.
    let mut on_floor = room(&[("Box", inside_out(furniture()), WALL)]);
    resolve_overlaps(&mut on_floor);
    let found = findings(&on_floor);
    is(&found[0], Severity::Warning, Kind::Flipped, "\"Box\"");
    assert!(found[1..].iter().all(|f| f.kind == Kind::Reading), "{found:#?}");
}

#[test]
fn a_panel_below_another_is_not_turned() {
    // A cabinet without a back stands at the wall; its door is two sheets, one right before the other.
    let (min, max) = (dvec3(1.0, 0.5, 0.0), dvec3(2.0, 1.5, 0.3));
    let front = |z: f64| {
        let p = |x, y| dvec3(x, y, z);
        vec![[p(min.x, min.y), p(max.x, min.y), p(max.x, max.y), p(min.x, max.y)]]
    };
    // The first two quads of a box are those at the ends of z.
    let sides = block(min, max).split_off(2);
    let cabinet =
        [("Sides", sides, WALL), ("Below", front(0.29), WALL), ("Door", front(0.3), WALL)];
    let one = only(&room(&cabinet));
    is(&one, Severity::Warning, Kind::Buried, "\"Below\"");
    // Without the door the sheet below it is seen, and may be turned.
    assert!(findings(&room(&cabinet[..2])).is_empty());
    let turned = ("Below", inside_out(front(0.29)), WALL);
    let one = only(&room(&[cabinet[0].clone(), turned]));
    is(&one, Severity::Warning, Kind::Flipped, "\"Below\"");
}

#[test]
fn a_room_that_is_inside_out_is_found() {
    let lamp = ("Lamp", panel(dvec3(2.0, 2.9, 2.5), true), LAMP);
    let found = findings(&scene(&[
        ("Room", inside_out(walls()), WALL),
        ("Block", furniture(), WALL),
        lamp,
    ]));
    is(&found[0], Severity::Warning, Kind::Flipped, "\"Room\"");
    assert_eq!(found.len(), 1, "{found:#?}");
}

#[test]
fn a_lamp_that_is_turned_to_the_ceiling_is_found() {
    let one = only(&room(&[("Lamp", panel(dvec3(2.0, 2.99, 2.5), false), LAMP)]));
    is(&one, Severity::Warning, Kind::Flipped, "\"Lamp\"");
    assert!(one.text.contains("its light"), "{}", one.text);
    // One that shines both ways loses half of its light.
    let one = only(&room(&[("Lamp", panel(dvec3(2.0, 2.99, 2.5), false), BOTH)]));
    is(&one, Severity::Note, Kind::Emitter, "\"Lamp\"");
    assert!(one.text.contains("50 %") && one.text.contains("\"Room\""), "{}", one.text);
}

#[test]
fn a_box_in_a_box_is_found() {
    let outer = block(dvec3(1.0, 0.0, 1.0), dvec3(2.0, 1.0, 2.0));
    let inner = block(dvec3(1.3, 0.3, 1.3), dvec3(1.6, 0.6, 1.6));
    let one = only(&room(&[("Outer", outer.clone(), WALL), ("Inner", inner.clone(), WALL)]));
    is(&one, Severity::Warning, Kind::Buried, "\"Inner\"");
    // Six squares of 0.3 m.
    assert!(one.text.contains("\"Outer\"") && one.text.contains("0.54 m^2"), "{}", one.text);
    assert!(one.place.unwrap().distance(dvec3(1.45, 0.45, 1.45)) < 0.3);
    let one = only(&room(&[("Both", [outer, inner].concat(), WALL)]));
    is(&one, Severity::Note, Kind::Buried, "\"Both\"");
    assert!(one.text.contains("1 of its 2 connected parts") && one.text.contains("itself"));
}

#[test]
fn a_lamp_that_nothing_sees_is_found() {
    let lamp = || ("Lamp", panel(dvec3(2.0, 1.5, 2.0), true), LAMP);
    let around = |m, out| ("Box", box_quads(dvec3(1.0, 1.0, 1.0), dvec3(3.0, 2.0, 3.0), out), m);
    let other = ("Other", panel(dvec3(2.0, 2.9, 2.5), true), LAMP);
    // Inside of a box whose backs are black; and of one that is black inside and out.
    for (around, cause) in [
        (vec![around(WALL, true)], "\"Box\""),
        (vec![around(BLACK, true), around(BLACK, false)], "nothing"),
    ] {
        let all = [vec![lamp()], around.clone()].concat();
        let found = findings(&room(&all));
        is(&found[0], Severity::Error, Kind::Darkness, "scene");
        is(&found[1], Severity::Warning, Kind::Emitter, "\"Lamp\"");
        assert!(
            found[1].text.contains("nothing sees") && found[1].text.contains(cause),
            "{found:#?}"
        );
        assert_eq!(found.len(), 2, "{found:#?}");
        // With another lamp it is not dark.
        let found = findings(&room(&[all, vec![other.clone()]].concat()));
        is(&found[0], Severity::Warning, Kind::Emitter, "\"Lamp\"");
        assert_eq!(found.len(), 1, "{found:#?}");
    }
    // Close below a shade that shows it its back: that is what is wrong.
    let lamp = ("Lamp", block(dvec3(1.9, 1.9, 1.9), dvec3(2.1, 2.1, 2.1)), LAMP);
    let mut shade = block(dvec3(1.7, 1.7, 1.7), dvec3(2.3, 2.3, 2.3));
    // Open below.
    shade.remove(2);
    let one = only(&room(&[lamp, ("Shade", shade, WALL)]));
    is(&one, Severity::Warning, Kind::Flipped, "\"Shade\"");
    assert!(one.remedy.contains("two-sided"), "{}", one.remedy);
}

#[test]
fn a_lamp_before_a_black_back_is_found() {
    // A sheet that is lit alike from both sides, so that it is not turned.
    let sheet = ("Sheet", panel(dvec3(2.0, 1.5, 2.0), true), WALL);
    let above = ("Above", panel(dvec3(2.0, 1.8, 2.0), true), LAMP);
    let below = ("Below", panel(dvec3(2.0, 1.2, 2.0), false), LAMP);
    let one = only(&room(&[sheet, above, below]));
    is(&one, Severity::Warning, Kind::Emitter, "\"Above\"");
    assert!(one.text.contains("black backs") && one.text.contains("\"Sheet\""), "{}", one.text);
}

#[test]
fn scenes_without_light_are_errors() {
    let nothing = findings(&Scene::default());
    is(&nothing[0], Severity::Error, Kind::Darkness, "scene");
    let dark = only(&scene(&[("Room", walls(), WALL)]));
    is(&dark, Severity::Error, Kind::Darkness, "scene");
    assert!(dark.text.contains("emits") && dark.remedy.contains("--emission"));
    let black = only(&scene(&[
        ("Room", walls(), BLACK),
        ("Lamp", panel(dvec3(2.0, 2.9, 2.5), true), LAMP),
    ]));
    is(&black, Severity::Error, Kind::Darkness, "scene");
    assert!(black.text.contains("reflects"));
    // A lamp that shines out of an open scene.
    let floor = panel(dvec3(0.0, 0.0, 0.0), false);
    let away = findings(&scene(&[
        ("Floor", floor, WALL),
        ("Lamp", panel(dvec3(3.0, 0.0, 0.0), true), LAMP),
    ]));
    is(&away[0], Severity::Error, Kind::Darkness, "scene");
    assert!(away.iter().any(|f| f.kind == Kind::Emitter && f.text.contains("leaves the scene")));
}

/// The room with a square hole of a given width in the wall z = 0.
fn with_hole(at: [f64; 2], width: f64) -> Scene {
    let mut quads = walls();
    // The first quad of a box is the one at the smallest z.
    quads.remove(0);
    let (x, y) = (
        [0.0, at[0] - width / 2.0, at[0] + width / 2.0, SIZE.x],
        [0.0, at[1] - width / 2.0, at[1] + width / 2.0, SIZE.y],
    );
    for i in 0..3 {
        for j in (0..3).filter(|j| (i, *j) != (1, 1)) {
            let p = |i: usize, j: usize| dvec3(x[i], y[j], 0.0);
            quads.push([p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1)]);
        }
    }
    scene(&[("Room", quads, WALL), ("Lamp", panel(dvec3(2.0, 2.9, 2.5), true), LAMP)])
}

#[test]
fn a_hole_is_found_where_it_is() {
    for (at, width) in [([1.3, 0.7], 0.1), ([3.5, 2.2], 0.3), ([2.0, 1.0], 0.03)] {
        let turn = DMat3::from_axis_angle(dvec3(1.0, 2.0, 3.0).normalize(), 0.7);
        for scale in [0.0, 1e-6, 1.0, 1e6] {
            let plain = with_hole(at, width);
            let (shift, hole) = (dvec3(3.0, 4.0, 5.0) * scale, dvec3(at[0], at[1], 0.0));
            let (scene, hole, scale) = match scale {
                0.0 => (plain, hole, 1.0),
                _ => (rotated(&plain, turn, scale, shift), scale * (turn * hole) + shift, scale),
            };
            let found = audited(&scene);
            assert_eq!(found.closure.enclosure, Enclosure::Leaking);
            // A point's rays leave by its share of the hemisphere; on average by the hole's area
            // over that of the walls (the mean free chord is the same for all openings).
            let share =
                width * width / (2.0 * (SIZE.x * SIZE.y + SIZE.y * SIZE.z + SIZE.z * SIZE.x));
            let ratio = (1.0 - found.closure.mean) / share;
            let rays = share * found.points as f64 * f64::from(found.rays);
            assert!((ratio - 1.0).abs() < 4.0 / rays.sqrt(), "{ratio} of {rays} rays");
            let [one] = &found.findings[..] else { panic!("{:#?}", found.findings) };
            is(one, Severity::Warning, Kind::Leak, "\"Room\"");
            let off = one.place.unwrap().distance(hole) / scale;
            assert!(off < 0.5 * width + 0.01, "{off} from a hole of {width}");
        }
    }
}

#[test]
fn an_open_scene_is_only_said_to_be_open() {
    let mut quads = walls();
    quads.remove(0);
    let one =
        only(&scene(&[("Room", quads, WALL), ("Lamp", panel(dvec3(2.0, 2.9, 2.5), true), LAMP)]));
    is(&one, Severity::Note, Kind::Open, "scene");
    // What stands outside does not open a scene.
    let outside = block(dvec3(4.1, 0.0, 1.0), dvec3(4.6, 0.5, 1.5));
    let found = audited(&room(&[("Bin", outside, WALL)]));
    assert_eq!(found.closure.enclosure, Enclosure::Closed);
    assert!(found.closure.outward > 0.0);
    let outside = |f: &Finding| f.kind == Kind::Outside && f.about.contains("\"Bin\"");
    assert!(found.findings.iter().all(outside), "{:#?}", found.findings);
}

#[test]
fn what_is_counted_twice_is_an_error() {
    // A wall that is there twice, cut along the other diagonal.
    let mut twice = room(&[]);
    let [a, b, c, d] = walls()[0];
    twice.triangles.extend([triangle([b, c, d], WALL), triangle([b, d, a], WALL)]);
    let found = audited(&twice);
    is(&found.findings[0], Severity::Error, Kind::RowSum, "\"Room\"");
    assert!(found.row_sums.largest > 1.01);
    // Reading resolves that, and says so.
    resolve_overlaps(&mut twice);
    let one = only(&twice);
    is(&one, Severity::Note, Kind::Reading, "\"Room\"");
    assert!(one.text.contains("in the same plane"), "{}", one.text);
}

#[test]
fn what_reading_finds_is_there_too() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("room.obj");
    let mut text = String::from("mtllib room.mtl\n");
    let materials = "newmtl wall\nKd 0.5 0.5 0.5\nnewmtl lamp\nKd 0 0 0\nKe 5 5 5\n";
    std::fs::write(directory.path().join("room.mtl"), materials).unwrap();
    let mut count = 0;
    let mut quads = |name: &str, material: &str, quads: &Quads, turn: usize| {
        text.push_str(&format!("o {name}\nusemtl {material}\n"));
        for (k, quad) in quads.iter().enumerate() {
            for p in quad {
                text.push_str(&format!("v {} {} {}\n", p.x, p.y, p.z));
            }
            let [a, b, c, d] = [1, 2, 3, 4].map(|i| count + i);
            let corners = if k < turn { [d, c, b, a] } else { [a, b, c, d] };
            text.push_str(&format!("f {} {} {}\n", corners[0], corners[1], corners[2]));
            text.push_str(&format!("f {} {} {}\n", corners[0], corners[2], corners[3]));
            count += 4;
        }
    };
    quads("Room", "wall", &walls(), 0);
    quads("Block", "wall", &furniture(), 1);
    quads("Lamp", "lamp", &panel(dvec3(2.0, 2.9, 2.5), true), 0);
    quads("Again", "lamp", &panel(dvec3(2.0, 2.9, 2.5), true), 0);
    std::fs::write(&path, text).unwrap();
    let scene = read(&path, &ReadOptions::default()).unwrap();
    assert!(scene.notices.iter().any(|n| n.about.contains("Block") && n.text.contains("fronts")));
    let found = findings(&scene);
    is(&found[0], Severity::Warning, Kind::Winding, "\"Block\"");
    // A quad that is turned disagrees along its four sides.
    assert!(found[0].text.contains("4 edges"), "{}", found[0].text);
    let twice = |f: &Finding| f.kind == Kind::Reading && f.text.contains("duplicate");
    assert!(found.iter().any(|f| twice(f) && f.about.contains("Again")), "{found:#?}");
    assert_eq!(found.len(), 2, "{found:#?}");
}

#[test]
fn shipped_scenes_are_sound() {
    for (name, enclosure) in [
        ("cornell.gltf", Enclosure::Open),
        ("cornell.obj", Enclosure::Open),
        ("paper.gltf", Enclosure::Open),
        ("room.gltf", Enclosure::Closed),
        ("furnace.gltf", Enclosure::Closed),
        ("arcade.gltf", Enclosure::Closed),
    ] {
        let scene = read(&shipped(name), &ReadOptions::default()).unwrap();
        let found = audited(&scene);
        assert_eq!(found.closure.enclosure, enclosure, "{name}");
        let wanted: &[Kind] = if enclosure == Enclosure::Open { &[Kind::Open] } else { &[] };
        let kinds: Vec<Kind> = found.findings.iter().map(|f| f.kind).collect();
        assert_eq!(kinds, wanted, "{name}: {:#?}", found.findings);
    }
}

#[test]
fn defects_made_on_purpose_are_found() {
    let scene = read(&shipped("arcade-defects.glb"), &ReadOptions::default()).unwrap();
    let found = findings(&scene);
    let (warnings, notes): (Vec<_>, Vec<_>) =
        found.iter().partition(|f| f.severity != Severity::Note);
    let [turned, winding, buried] = &warnings[..] else { panic!("{warnings:#?}") };
    is(turned, Severity::Warning, Kind::Flipped, "\"defect_crate_inside_out\"");
    is(winding, Severity::Warning, Kind::Winding, "\"defect_pot_some_flipped\"");
    is(buried, Severity::Warning, Kind::Buried, "\"defect_box_within\"");
    assert!(buried.text.contains("\"defect_crate_around\""), "{}", buried.text);
    for (about, text) in [
        ("defect_crate_twice", "duplicate triangles"),
        ("defect_crate_zero_area", "without area"),
        ("defect_rug_on_floor", "in the same plane cover them"),
    ] {
        let is_it = |f: &&Finding| f.about.contains(about) && f.text.contains(text);
        assert!(notes.iter().any(is_it), "{about}: {notes:#?}");
    }
}

#[test]
fn the_same_report_on_any_number_of_threads() {
    let hole = with_hole([1.3, 0.7], 0.2);
    let report = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| audited(&hole))
    };
    let one = report(1);
    assert!(one == report(2) && one == report(3));
}

#[test]
fn the_command_prints_findings_and_succeeds() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let text = stdout(&succeeds(path, "inspect scenes/cornell.gltf --audit"));
    assert!(text.contains("\naudit (0 errors, 0 warnings, 1 note)\n"), "{text}");
    assert!(text.contains("\n  note     scene: the scene is open: "), "{text}");
    let words = "inspect scenes/furnace.gltf --audit --json --light-scale 0 --report report.json";
    let json: serde_json::Value = serde_json::from_str(&stdout(&succeeds(path, words))).unwrap();
    let audit = &json["audit"];
    assert_eq!(audit["closure"]["enclosure"], "closed");
    assert_eq!((&audit["errors"], &audit["emitting_faces"]), (&1.into(), &0.into()));
    let findings = audit["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 1, "the advice of the command line is no second finding");
    assert_eq!(findings[0]["kind"], "darkness");
    assert_eq!(read_json(&path.join("report.json"))["counts"]["errors found by the audit"], 1);
    // Nothing changes for those who do not ask.
    let text = stdout(&succeeds(path, "inspect scenes/cornell.gltf"));
    assert!(!text.contains("\naudit ("), "{text}");
}
