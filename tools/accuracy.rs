//! Run time against error for a given tolerance: `cargo bench --bench accuracy`, or `cargo bench
//! --bench accuracy -- NAME` for the scenes whose name contains NAME.
//!
//! The result is irradiance on a grid of texels over every flat surface of a scene (64 x 64 on
//! those longer than 0.6 of the scene, 32 x 32 and 8 x 8 on smaller ones), each texel the mean of
//! those of 4 x 4 points that lie on the surface: what a lightmap holds. Every case is a process of its
//! own; its CPU seconds are user and system time of all threads, from reading the file to the last
//! texel, the estimate included. The error is the difference from a reference of a tolerance below the
//! smallest of the cases, root mean square over the texels and largest, relative to the mean; and root mean
//! square over single points, every so many of them, which is what the estimate is of.
//!
//! For other programs (`tools/mitsuba/time_error.py`), `--texels SCENE FILE` writes the points of all
//! texels, and `--case SCENE WAY TOLERANCE FILE` runs one case and writes its texels where there is
//! no such file yet: numbers of 8 bytes, little end first, see [`Texels::write_points`] and [`run_here`].

use std::path::{Path, PathBuf};
use std::process::Command;

use glam::{DVec2, DVec3};
use lumel::mesh::{self, Face, Mesh, barycentric};
use lumel::output::machine;
use lumel::reconstruct::fill::RootPoints;
use lumel::reconstruct::irradiance::irradiances;
use lumel::scene::{ReadOptions, Scene, read};
use lumel::solve::within::COARSEST;
use lumel::solve::{Way, WithinOptions, light_within};
use lumel::{Error, Monitor, Result};
use serde_json::{Value, json};

/// Scenes, tolerances from large to small, that of the reference, and how meshes follow from each
/// other.
const CASES: [(&str, &[f64], f64, &[&str]); 3] = [
    ("cornell", &[3e-2, 1e-2, 3e-3, 1e-3, 3e-4], 5e-5, &WAYS),
    ("paper", &[1e-2, 1e-3, 1e-4], 5e-6, &WAYS),
    ("room", &[3e-2, 1e-2, 3e-3, 1e-3], 2.5e-4, &["uniform"]),
];

/// How meshes follow from each other.
const WAYS: [&str; 3] = ["uniform", "adaptive", "iterated"];

fn way_of(name: &str) -> Way {
    match name {
        "adaptive" => Way::Adaptive,
        "iterated" => Way::Iterated,
        _ => Way::Uniform,
    }
}

/// Points along each side of a texel.
const ACROSS: usize = 4;

/// Every so many of them are compared one by one.
const POINTS: usize = 37;

/// Texels over all flat surfaces of a mesh.
struct Texels {
    /// Points, root by root, and the texel of each.
    asked: Vec<RootPoints>,
    texel: Vec<Vec<usize>>,
    /// Their numbers, which are the same for all meshes of a scene.
    number: Vec<Vec<usize>>,
    numbers: usize,
    /// Points of each texel.
    count: Vec<f64>,
}

impl Texels {
    fn new(mesh: &Mesh) -> Texels {
        let root = |r| RootPoints { root: r, points: vec![] };
        let roots = mesh.roots.len();
        let asked = (0..roots as u32).map(root).collect();
        let mut texels = Texels {
            asked,
            texel: vec![vec![]; roots],
            number: vec![vec![]; roots],
            numbers: 0,
            count: vec![],
        };
        let surfaces = mesh.faces.iter().map(|f| f.surface + 1).max().unwrap_or(0);
        for surface in 0..surfaces {
            let faces: Vec<&Face> = mesh.faces.iter().filter(|f| f.surface == surface).collect();
            texels.add(mesh, &faces);
        }
        texels
    }

    fn add(&mut self, mesh: &Mesh, faces: &[&Face]) {
        let Some(first) = faces.first() else { return };
        let [a, b, c] = first.corners.map(|x| first.frame.lift(x));
        // A short side of the first triangle: a side of the rectangle that it is half of.
        let sides = [b - a, c - b, a - c];
        let side = sides.into_iter().min_by(|x, y| x.length().total_cmp(&y.length()));
        let right = side.unwrap_or(DVec3::X).normalize();
        let up = first.frame.n.cross(right);
        let flat = |p: DVec3| DVec2::new((p - a).dot(right), (p - a).dot(up));
        let corners = faces.iter().flat_map(|f| f.corners.map(|x| flat(f.frame.lift(x))));
        let (low, high) = corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let extent = (high - low).max_element() / mesh.bounds.extent();
        let across = if extent > 0.6 {
            64
        } else if extent > 0.12 {
            32
        } else {
            8
        };
        let points = across * ACROSS;
        let mut texel_of = vec![None; across * across];
        for k in 0..points * points {
            let (i, j) = (k % points, k / points);
            let share = (DVec2::new(i as f64, j as f64) + 0.5) / points as f64;
            let x = low + share * (high - low);
            let point = a + x.x * right + x.y * up;
            let on = faces.iter().find_map(|f| {
                let x = f.frame.project(point);
                let inside =
                    |r: &u32| barycentric(&mesh.roots[*r as usize].corners, x).min_element() >= 0.0;
                (f.roots.0..f.roots.1).find(inside).map(|r| (r as usize, x))
            });
            if let Some((root, x)) = on {
                let place = j / ACROSS * across + i / ACROSS;
                let texel = *texel_of[place].get_or_insert_with(|| {
                    self.count.push(0.0);
                    self.count.len() - 1
                });
                self.count[texel] += 1.0;
                self.asked[root].points.push(x);
                self.number[root].push(self.numbers);
                self.numbers += 1;
                self.texel[root].push(texel);
            }
        }
    }

    /// Writes all points, texel by texel: number of the texel, position, normal, input triangle.
    fn write_points(&self, mesh: &Mesh, path: &Path) -> Result<()> {
        let mut rows = vec![vec![]; self.count.len()];
        for (asked, texels) in self.asked.iter().zip(&self.texel) {
            let face = &mesh.faces[mesh.roots[asked.root as usize].face as usize];
            for (&texel, &x) in texels.iter().zip(&asked.points) {
                let (p, n) = (face.frame.lift(x), face.frame.n);
                let triangle = f64::from(face.triangle);
                rows[texel].extend([texel as f64, p.x, p.y, p.z, n.x, n.y, n.z, triangle]);
            }
        }
        write_numbers(path, rows.into_iter().flatten())
    }

    /// Single ones of the values at points.
    fn some(&self, values: &[Vec<DVec3>]) -> Vec<DVec3> {
        let mut some = vec![DVec3::ZERO; self.numbers.div_ceil(POINTS)];
        for (number, value) in self.number.iter().flatten().zip(values.iter().flatten()) {
            if number % POINTS == 0 {
                some[number / POINTS] = *value;
            }
        }
        some
    }

    fn means(&self, values: &[Vec<DVec3>]) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.count.len()];
        for (texels, values) in self.texel.iter().zip(values) {
            for (&texel, value) in texels.iter().zip(values) {
                sums[texel] += *value;
            }
        }
        sums.iter().zip(&self.count).map(|(sum, count)| *sum / *count).collect()
    }
}

fn failed(e: impl ToString) -> Error {
    Error::Runtime(e.to_string())
}

fn write_numbers(path: &Path, numbers: impl Iterator<Item = f64>) -> Result<()> {
    let bytes: Vec<u8> = numbers.flat_map(f64::to_le_bytes).collect();
    std::fs::write(path, bytes).map_err(failed)
}

/// A shipped scene.
fn shipped(name: &str) -> Result<Scene> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    read(&path.with_extension("gltf"), &ReadOptions::default())
}

fn file_of(scene: &str) -> PathBuf {
    std::env::temp_dir().join(format!("lumel-accuracy-{}-{scene}", std::process::id()))
}

/// Runs a case in this process; one line of JSON. Texels are compared with those in `reference`, or
/// written there where that does not exist yet.
fn run_here(scene: &str, way: &str, tolerance: f64, reference: &Path) -> Result<Value> {
    let monitor = Monitor::silent();
    let scene = shipped(scene)?;
    let options = WithinOptions { way: way_of(way), ..WithinOptions::new(tolerance, u64::MAX) };
    let light = light_within(&scene, &options, &monitor)?;
    let source = light.apart().ok_or_else(|| failed("no tolerance"))?;
    let solved = machine::cpu_seconds().unwrap_or(f64::NAN);
    let texels = Texels::new(&light.mesh);
    let (values, counts) = irradiances(&light, &texels.asked, &monitor)?;
    let means = texels.means(&values);
    let cpu = machine::cpu_seconds().unwrap_or(f64::NAN);
    let estimate = source.estimate;
    let mut result = json!({
        "elements": light.mesh.elements(),
        "texels": means.len(),
        "solve": solved,
        "cpu": cpu,
        "memory": machine::peak_memory(),
        "gathers": counts.indirect.gathered,
        "estimate": estimate.rms.hypot(counts.error(estimate.mean)),
        "maximum estimate": estimate.maximum + counts.largest_error(estimate.mean),
    });
    let single = texels.some(&values);
    let of_points = reference.with_added_extension("points");
    if !reference.exists() {
        write_numbers(reference, means.iter().flat_map(|h| h.to_array()))?;
        write_numbers(&of_points, single.iter().flat_map(|h| h.to_array()))?;
        return Ok(result);
    }
    let (error, maximum) = difference(&means, reference)?;
    (result["error"], result["maximum"]) = (json!(error), json!(maximum));
    if of_points.exists() {
        result["error of points"] = json!(difference(&single, &of_points)?.0);
    }
    Ok(result)
}

/// How far values are from those in a file, relative to the mean of these: root mean square, of the
/// channels the largest, and largest.
fn difference(values: &[DVec3], path: &Path) -> Result<(f64, f64)> {
    let numbers = std::fs::read(path).map_err(failed)?;
    let numbers: Vec<f64> =
        numbers.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let wanted: Vec<DVec3> =
        numbers.as_chunks::<3>().0.iter().map(|c| DVec3::from_array(*c)).collect();
    let mean = wanted.iter().sum::<DVec3>() / wanted.len() as f64;
    let off: Vec<DVec3> = values.iter().zip(&wanted).map(|(a, b)| (*a - *b).abs() / mean).collect();
    let squares = off.iter().map(|x| *x * *x).sum::<DVec3>() / off.len() as f64;
    let largest = off.iter().map(|x| x.max_element()).fold(0.0, f64::max);
    Ok((squares.max_element().sqrt(), largest))
}

/// Runs a case in a process of its own.
fn run_apart(scene: &str, way: &str, tolerance: f64, reference: &Path) -> Result<Value> {
    let own = std::env::current_exe().map_err(failed)?;
    let output = Command::new(own)
        .args(["--case", scene, way, &tolerance.to_string()])
        .arg(reference)
        .output()
        .map_err(failed)?;
    serde_json::from_slice(&output.stdout)
        .map_err(|e| failed(format!("{e}: {}", String::from_utf8_lossy(&output.stderr))))
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
    if let [flag, scene, way, tolerance, reference] = &words[..]
        && flag == "--case"
    {
        let tolerance = tolerance.parse().unwrap_or(0.01);
        println!("{}", run_here(scene, way, tolerance, Path::new(reference))?);
        return Ok(());
    }
    if let [flag, scene, path] = &words[..]
        && flag == "--texels"
    {
        // The faces and roots of every mesh of a scene are those of the coarsest one.
        let mesh = mesh::build(&shipped(scene)?, &COARSEST)?;
        return Texels::new(&mesh).write_points(&mesh, Path::new(path));
    }
    println!(
        "| scene | texels | way | tolerance | error rms | at points | estimate | estimate / error at points | \
         largest error | estimate of it | elements | gathers | CPU s | of it solving | memory MB |"
    );
    println!("|---{}|", "|---".repeat(14));
    for (scene, tolerances, finest, ways) in CASES {
        if !words.iter().all(|w| scene.contains(w.as_str())) {
            continue;
        }
        let reference = file_of(scene);
        let print = |way: &str, tolerance: f64, value: &Value| {
            let number = |name: &str| value[name].as_f64().unwrap_or(f64::NAN);
            println!(
                "| {scene} | {} | {way} | {} % | {:.2e} | {:.2e} | {:.2e} | {:.1} | {:.1e} | {:.1e} | {} | {} | {:.2} | {:.2} | {:.0} |",
                value["texels"],
                100.0 * tolerance,
                number("error"),
                number("error of points"),
                number("estimate"),
                number("estimate") / number("error of points"),
                number("maximum"),
                number("maximum estimate"),
                value["elements"],
                value["gathers"],
                number("cpu"),
                number("solve"),
                number("memory") / 1e6,
            );
        };
        print("reference", finest, &run_apart(scene, "uniform", finest, &reference)?);
        for (way, &tolerance) in
            ways.iter().flat_map(|way| tolerances.iter().map(move |t| (way, t)))
        {
            print(way, tolerance, &run_apart(scene, way, tolerance, &reference)?);
        }
        for file in [reference.with_added_extension("points"), reference] {
            std::fs::remove_file(&file).map_err(failed)?;
        }
    }
    Ok(())
}
