//! `lumel render` as a user runs it: pictures, their values, and what happens to files.

mod command_support;

use std::f64::consts::PI;
use std::fs;

use command_support::*;

/// The size of most pictures here.
const SIZE: (usize, usize) = (64, 48);

/// Elements so large that each scene is solved in a second or two.
const COARSE: &str = "--size 64x48 --subdivide 1";

fn brightest(pixels: &[[f32; 3]]) -> f32 {
    pixels.iter().flatten().fold(0.0, |a, &b| a.max(b))
}

#[test]
fn every_shipped_scene_gives_a_picture_in_every_format() {
    let room = tempfile::tempdir().unwrap();
    for scene in SHIPPED {
        for extension in ["exr", "png", "hdr"] {
            let output = succeeds(
                room.path(),
                &format!("render scenes/{scene} -o {scene}.{extension} {COARSE}"),
            );
            assert_eq!(stderr(&output), "", "{scene}: a shipped scene is nothing to warn of");
            assert_eq!(stdout(&output), "", "{scene}: the result is the file");
        }
        let exr = Exr::read(&room.path().join(format!("{scene}.exr")));
        assert_eq!(exr.size(), SIZE, "{scene}");
        assert_eq!(exr.text("quantity").as_deref(), Some("radiance"), "{scene}");
        assert_eq!(exr.text("unit").as_deref(), Some("W/(m^2 sr)"), "{scene}");
        assert_eq!(exr.text("scene").as_deref(), Some(scene));
        assert_eq!(exr.text("subdivide").as_deref(), Some("1"), "{scene}");
        assert!(exr.text("view").is_some(), "{scene}");
        assert!(exr.attributes.world_to_camera.is_some(), "{scene}");
        assert!(exr.pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{scene}");
        assert!(brightest(&exr.pixels) > 1e-3, "{scene} is black");
        for extension in ["png", "hdr"] {
            let path = room.path().join(format!("{scene}.{extension}"));
            let picture = image::open(&path).unwrap();
            assert_eq!((picture.width() as usize, picture.height() as usize), SIZE, "{scene}");
            // Both hold what the EXR holds, but for their resolution (HDR: a 256th of the largest
            // channel; PNG: half of 255 levels, where 0.02 linear covers the steepest step).
            for (got, want) in picture.to_rgb32f().pixels().zip(&exr.pixels) {
                let largest = want.iter().fold(0f32, |a, &b| a.max(b));
                for (&got, &want) in got.0.iter().zip(want) {
                    if extension == "hdr" {
                        assert!((got - want).abs() <= largest / 256.0, "{scene}: {got} {want}");
                    } else {
                        let level = lumel::output::png_file::srgb_from_linear(f64::from(want));
                        let level = level.clamp(0.0, 1.0) as f32;
                        assert!((got - level).abs() <= 0.51 / 255.0, "{scene}: {got} {level}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let room = tempfile::tempdir().unwrap();
    for options in ["", "--gather --samples 2"] {
        for extension in ["exr", "png"] {
            let files = ["1", "2", "3"].map(|threads| {
                let name = format!("{threads}.{extension}");
                succeeds(
                    room.path(),
                    &format!(
                        "render scenes/cornell.gltf -o {name} {COARSE} --threads {threads} {options}"
                    ),
                );
                fs::read(room.path().join(name)).unwrap()
            });
            assert!(files[0] == files[1] && files[0] == files[2], "{extension} {options}");
        }
    }
}

#[test]
fn gathering_finds_what_interpolation_does() {
    let room = tempfile::tempdir().unwrap();
    let words = "render scenes/cornell.gltf --size 64x64 --subdivide 2";
    succeeds(room.path(), &format!("{words} -o plain.exr"));
    succeeds(room.path(), &format!("{words} -o gather.exr --gather"));
    let plain = Exr::read(&room.path().join("plain.exr"));
    let gather = Exr::read(&room.path().join("gather.exr"));
    assert_eq!(gather.text("gather").as_deref(), Some("true"));
    let mean = |f: &dyn Fn(f32, f32) -> f32| -> f32 {
        let pairs = plain.pixels.iter().flatten().zip(gather.pixels.iter().flatten());
        pairs.map(|(&a, &b)| f(a, b)).sum::<f32>()
    };
    let share = mean(&|a, b| (a - b).abs()) / mean(&|_, b| b);
    // They are two approximations of one picture: close, but not the same.
    assert!(share > 1e-6 && share < 0.1, "{share}");
}

#[test]
fn a_furnace_is_seen_exactly() {
    let room = tempfile::tempdir().unwrap();
    for options in ["", "--gather", "--samples 3", "--basis constant", "--subdivide 2"] {
        // The default operator is good to 1e-4.
        for (operator, tolerance) in [("exact", 1e-6), ("fast", 1e-4)] {
            let words = format!("--size 48x48 --operator {operator} {options}");
            succeeds(room.path(), &format!("render scenes/furnace.gltf -o view.exr {words}"));
            // E = 1 and rho = 1/2: u = E/(1 - rho) = 2, and radiance is u/pi.
            for value in Exr::read(&room.path().join("view.exr")).pixels.iter().flatten() {
                assert!((f64::from(*value) - 2.0 / PI).abs() < tolerance, "{words}: {value}");
            }
        }
    }
}

#[test]
fn the_report_says_what_was_done_and_how_well() {
    let room = tempfile::tempdir().unwrap();
    let words = format!("render scenes/room.gltf -o v.png {COARSE} --report r.json");
    succeeds(room.path(), &words);
    let fast = json(&room.path().join("r.json"));
    // The fast operator: what was left out, and what its parts took.
    for name in [
        "pairs behind each other",
        "pairs hidden",
        "pairs clear of occluders",
        "far pairs",
        "far field bytes",
        "links",
        "link bytes",
        "roots that reflect nothing",
        "roots that no light reaches",
        "channels solved",
    ] {
        assert!(fast["counts"][name].is_u64(), "{name}");
    }
    for name in ["far field seconds", "link seconds", "pair seconds"] {
        assert!(fast["values"][name].as_f64().unwrap() > 0.0, "{name}");
    }
    for sum in ["smallest row sum", "largest row sum"] {
        assert!((fast["values"][sum].as_f64().unwrap() - 1.0).abs() < 1e-4, "{sum}");
    }
    succeeds(room.path(), &format!("{words} --operator exact"));
    let report = json(&room.path().join("r.json"));
    assert_eq!(report["command"], "render");
    let stages: Vec<&str> =
        report["stages"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(stages, ["read", "solve", "render", "write"]);
    assert!(report["stages"][1]["wall_seconds"].as_f64().unwrap() > 0.0);
    assert_eq!(report["counts"]["faces"], 242);
    assert_eq!(report["counts"]["elements"], 4 * 242);
    assert_eq!(report["counts"]["nodes"], 3 * 4 * 242);
    assert!(report["counts"]["iterations"].as_u64().unwrap() > 1);
    for channel in ["r", "g", "b"] {
        let residual = report["values"][format!("residual_{channel}")].as_f64().unwrap();
        assert!(residual > 0.0 && residual <= 1e-8, "{residual}");
    }
    // The room is closed: what a node sees fills its hemisphere.
    for sum in ["smallest row sum", "largest row sum"] {
        let sum = report["values"][sum].as_f64().unwrap();
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }
    let (forecast, bytes) =
        (&report["values"]["operator bytes forecast"], &report["values"]["operator bytes"]);
    assert!(bytes.as_f64().unwrap() <= forecast.as_f64().unwrap(), "{bytes} {forecast}");
    assert_eq!(report["settings"]["size"], "64x48");
}

#[test]
fn work_that_does_not_fit_is_refused_before_it_begins() {
    let room = tempfile::tempdir().unwrap();
    fs::write(room.path().join("old.png"), "old").unwrap();
    fails(
        room.path(),
        "render scenes/cornell.gltf -o old.png --subdivide 4 --max-memory 1MB",
        1,
        &["would need about", "MiB of memory, but only 1.0 MiB", "--max-memory", "--max-edge"],
    );
    assert_eq!(fs::read(room.path().join("old.png")).unwrap(), b"old");
    assert_eq!(names_in(room.path()), ["old.png"]);
}

#[test]
fn a_tolerance_that_cannot_be_met_gives_the_best_and_says_so() {
    let room = tempfile::tempdir().unwrap();
    fails(
        room.path(),
        "render scenes/cornell.gltf -o best.exr --size 32x32 --tolerance 0.1% --max-memory 8MB --report r.json \
         --error-map map.exr",
        4,
        &["tolerance of 0.1 % was not met", "memory", "--max-memory", "estimated error of 0."],
    );
    let values = json(&room.path().join("r.json"));
    let estimate = values["values"]["estimated error rms"].as_f64().unwrap();
    assert!(estimate > 0.001 && estimate < 0.02, "{estimate}");
    assert!(brightest(&Exr::read(&room.path().join("best.exr")).pixels) > 1.0);
    assert_eq!(names_in(room.path()), ["best.exr", "map.exr", "r.json"]);
}

/// The picture of a tolerance against one of a tenth of it; and the estimates of its errors.
#[test]
fn a_tolerance_is_all_that_needs_to_be_said() {
    let room = tempfile::tempdir().unwrap();
    let words = "render scenes/cornell.gltf --size 96x96 --tolerance";
    succeeds(room.path(), &format!("{words} 1% -o a.exr --report a.json --error-map map.exr"));
    succeeds(room.path(), &format!("{words} 0.1% -o b.exr"));
    let [a, b, map] = ["a.exr", "b.exr", "map.exr"].map(|f| Exr::read(&room.path().join(f)));
    assert_eq!(a.text("tolerance").as_deref(), Some("0.01"));
    let mean = b.pixels.iter().flatten().map(|&x| f64::from(x)).sum::<f64>();
    let squares: f64 = a
        .pixels
        .iter()
        .flatten()
        .zip(b.pixels.iter().flatten())
        .map(|(a, b)| f64::from(a - b).powi(2))
        .sum();
    let n = (3 * a.pixels.len()) as f64;
    let error = (squares / n).sqrt() / (mean / n);
    assert!(error < 0.01, "{error}");
    // The map tells relative errors that are small nearly everywhere.
    let small = map.pixels.iter().filter(|p| p.iter().all(|e| (0.0..0.02).contains(e))).count();
    assert!(100 * small > 90 * map.pixels.len(), "{small}");
    let values = &json(&room.path().join("a.json"))["values"];
    let number = |name: &str| values[name].as_f64().unwrap();
    assert!(number("estimated error rms") <= 0.01);
    assert!(number("estimated error of the output rms") >= number("estimated error rms"));
    assert!(number("estimated error maximum") >= number("estimated error rms"));
}

#[test]
fn a_scene_without_light_is_black_and_said_to_be() {
    let room = tempfile::tempdir().unwrap();
    let words = format!("render scenes/cornell.gltf -o dark.exr {COARSE} --emission *=0");
    let output = succeeds(room.path(), &words);
    let message = stderr(&output);
    assert!(message.starts_with("Warning: scene: nothing emits light"), "{message}");
    assert!(message.contains("--emission NAME=R,G,B"), "{message}");
    assert!(message.contains("white, light, green, red"), "{message}");
    assert_eq!(brightest(&Exr::read(&room.path().join("dark.exr")).pixels), 0.0);
    assert_eq!(stderr(&succeeds(room.path(), &format!("{words} --quiet"))), "");
}

/// Starts long work, interrupts it after a while and checks that it ends soon, leaving nothing.
#[cfg(unix)]
fn interrupted(options: &str) {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let room = tempfile::tempdir().unwrap();
    fs::write(room.path().join("old.png"), "old").unwrap();
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("lumel"))
        .current_dir(room.path())
        .arg("render")
        .arg(shipped("cornell.gltf"))
        .args(["-o", "old.png", "--threads", "1"])
        .args(options.split_whitespace())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    assert!(child.try_wait().unwrap().is_none(), "{options}: the work is not long enough");
    let interruption = Instant::now();
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    // A second on an idle machine; tests run beside each other on busy ones.
    assert!(interruption.elapsed() < Duration::from_secs(8), "{:?}", interruption.elapsed());
    assert_eq!(code(&output), 130, "{options}");
    assert_eq!(stderr(&output), "Error: interrupted\n");
    assert_eq!(fs::read(room.path().join("old.png")).unwrap(), b"old");
    assert_eq!(names_in(room.path()), ["old.png"]);
}

#[cfg(unix)]
#[test]
fn an_interruption_ends_the_building_of_rows() {
    interrupted("--basis constant --max-edge 0.045");
}

#[cfg(unix)]
#[test]
fn an_interruption_ends_the_drawing() {
    interrupted("--subdivide 0 --size 20000x1000 --samples 8 --gather");
}
