//! What was typed, made into what the commands work with: checked, resolved, plain.
//!
//! Each group can be listed in two ways: `metadata`, which holds all that a result depends on and
//! is written into pictures (so nothing that differs between runs with the same result), and
//! `described`, which also holds limits and is written into the report.

use std::path::PathBuf;

use glam::DVec3;
use lumel::mesh::{self, Basis, MeshOptions};
use lumel::operator::{ClusteredOptions, FastOptions, OperatorKind};
use lumel::output::machine;
use lumel::output::picture::{PictureFormat, PictureOptions};
use lumel::reference::ReferenceOptions;
use lumel::scene::{Override, ReadOptions};
use lumel::solve::{LightOptions, SolveOptions};
use lumel::{Error, Result};

use super::args::{
    BasisArg, BitsArg, InspectArgs, OperatorArg, PictureArgs, ProbeArgs, ReferenceArgs, RenderArgs,
    RunArgs, SceneArgs, SolveArgs, ViewArgs,
};
use super::values::MemorySize;

/// Elements where the user does not say how fine the mesh is.
const USUAL_ELEMENTS: usize = 2000;

/// The error where the user does not say how good the light must be.
const USUAL_TOLERANCE: f64 = 0.01;

/// Names and values, as written into pictures and reports.
pub type Described = Vec<(String, String)>;

/// Vertical field of view where none is given, degrees.
const USUAL_FOV: f64 = 45.0;

/// The scene and how to read it.
#[derive(Clone, Debug)]
pub struct SceneSettings {
    /// The file.
    pub path: PathBuf,
    /// What is changed in it.
    pub options: ReadOptions,
}

/// Which view a picture shows.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewChoice {
    /// The file's first camera, or a view made for the scene where there is none.
    First,
    /// The file's camera of this name or number.
    Named(String),
    /// A view of the user's own.
    Eye(EyeSettings),
}

/// A view of the user's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeSettings {
    /// Where the eye is, metres.
    pub eye: DVec3,
    /// The point in the middle of the picture, metres.
    pub look_at: DVec3,
    /// The direction that is up in the picture.
    pub up: DVec3,
    /// Full vertical field of view, radians.
    pub vertical_fov: f64,
}

/// The view of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSettings {
    /// Which view.
    pub choice: ViewChoice,
    /// Width and height in pixels, where they are fixed.
    pub size: Option<(u32, u32)>,
}

/// How the mesh is refined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refinement {
    /// Until there are about this many elements: enough for a good picture in seconds.
    Usual,
    /// Until no edge is longer than this, metres.
    MaxEdge(f64),
    /// Each face this many times.
    Levels(u32),
}

/// How to solve.
#[derive(Clone, Copy, Debug)]
pub struct SolveSettings {
    /// The error that is wanted, from which all else follows; where there is none, the fields below
    /// say how to solve.
    pub tolerance: Option<f64>,
    /// How radiosity varies within an element.
    pub basis: BasisArg,
    /// How the mesh is refined.
    pub refinement: Refinement,
    /// How the operator is represented.
    pub operator: OperatorKind,
    /// Relative residual to reach.
    pub residual: f64,
    /// Bytes of memory that may be used; none where it is not known how many there are.
    pub max_memory: Option<u64>,
}

/// How to run.
#[derive(Clone, Debug)]
pub struct RunSettings {
    /// Seconds until the work is given up.
    pub time_limit: Option<f64>,
    /// Threads to use; none for one a processor.
    pub threads: Option<usize>,
    /// Whether warnings and progress are left out.
    pub quiet: bool,
    /// Where the report goes.
    pub report: Option<PathBuf>,
}

/// `lumel inspect`.
#[derive(Clone, Debug)]
pub struct InspectSettings {
    /// The scene.
    pub scene: SceneSettings,
    /// The view to check.
    pub view: ViewSettings,
    /// How it would be solved.
    pub solve: SolveSettings,
    /// How to run.
    pub run: RunSettings,
    /// Whether to print JSON.
    pub json: bool,
    /// Whether to look for mistakes in the scene.
    pub audit: bool,
    /// Where to write the scene as it was read.
    pub export: Option<PathBuf>,
}

/// `lumel render`.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// The scene.
    pub scene: SceneSettings,
    /// The picture to write.
    pub output: PathBuf,
    /// The view.
    pub view: ViewSettings,
    /// How values become pixels of a PNG file.
    pub picture: PictureOptions,
    /// Whether light is gathered at every pixel.
    pub gather: bool,
    /// Samples along each side of a pixel.
    pub samples: u32,
    /// Where a picture of the estimated errors goes.
    pub error_map: Option<PathBuf>,
    /// How to solve.
    pub solve: SolveSettings,
    /// How to run.
    pub run: RunSettings,
}

/// `lumel probe`.
#[derive(Clone, Debug)]
pub struct ProbeSettings {
    /// The scene.
    pub scene: SceneSettings,
    /// The table of points.
    pub points: PathBuf,
    /// The table to write; none for standard output.
    pub output: Option<PathBuf>,
    /// How to solve.
    pub solve: SolveSettings,
    /// How to run.
    pub run: RunSettings,
}

impl InspectSettings {
    /// Checks what was typed.
    pub fn new(args: InspectArgs) -> Result<Self> {
        let solve = solve(&args.solve)?;
        Ok(InspectSettings {
            scene: scene(args.scene, &solve),
            view: view(args.view)?,
            solve,
            run: run(args.run),
            json: args.json,
            audit: args.audit,
            export: args.export,
        })
    }

    /// For the report.
    pub fn described(&self) -> Described {
        let mut list = self.scene.metadata();
        list.extend(self.view.metadata());
        list.extend(self.solve.described());
        list.extend(self.run.described());
        list
    }
}

impl RenderSettings {
    /// Checks what was typed.
    pub fn new(args: RenderArgs) -> Result<Self> {
        PictureFormat::of(&args.output)?;
        let PictureArgs { exposure, bits, gather, samples, error_map } = args.picture;
        let png_bits = match bits {
            BitsArg::Eight => 8,
            BitsArg::Sixteen => 16,
        };
        let solve = solve(&args.solve)?;
        if let Some(path) = &error_map {
            PictureFormat::of(path)?;
            if solve.tolerance.is_none() {
                return Err(Error::Usage(
                    "--error-map needs an estimate of the error: use --tolerance, and leave out \
                     options that set elements and operator by hand"
                        .into(),
                ));
            }
        }
        Ok(RenderSettings {
            scene: scene(args.scene, &solve),
            output: args.output,
            view: view(args.view)?,
            picture: PictureOptions { exposure_ev: exposure, png_bits },
            gather,
            samples,
            error_map,
            solve,
            run: run(args.run),
        })
    }

    /// For the picture.
    pub fn metadata(&self) -> Described {
        let mut list = self.scene.metadata();
        list.extend(self.view.metadata());
        list.extend(self.solve.metadata());
        if self.solve.tolerance.is_none() {
            list.push(pair("gather", self.gather));
        }
        list.push(pair("samples", self.samples));
        list
    }

    /// For the report.
    pub fn described(&self) -> Described {
        let mut list = self.metadata();
        list.push(pair("output", self.output.display()));
        list.extend(self.error_map.iter().map(|path| pair("error-map", path.display())));
        list.push(pair("exposure", self.picture.exposure_ev));
        list.push(pair("bits", self.picture.png_bits));
        list.extend(self.solve.described());
        list.extend(self.run.described());
        list
    }
}

impl ProbeSettings {
    /// Checks what was typed.
    pub fn new(args: ProbeArgs) -> Result<Self> {
        let solve = solve(&args.solve)?;
        Ok(ProbeSettings {
            scene: scene(args.scene, &solve),
            points: args.points,
            output: args.output,
            solve,
            run: run(args.run),
        })
    }

    /// For the report.
    pub fn described(&self) -> Described {
        let mut list = self.scene.metadata();
        list.push(pair("points", self.points.display()));
        list.extend(self.output.iter().map(|path| pair("output", path.display())));
        list.extend(self.solve.described());
        list.extend(self.run.described());
        list
    }
}

/// `lumel reference`.
#[derive(Clone, Debug)]
pub struct ReferenceSettings {
    /// What is computed.
    pub options: ReferenceOptions,
    /// Whether to print JSON.
    pub json: bool,
    /// How to run.
    pub run: RunSettings,
}

impl ReferenceSettings {
    /// Checks what was typed.
    pub fn new(args: ReferenceArgs) -> Self {
        let limit = max_memory(args.max_memory, machine::usable_memory());
        ReferenceSettings {
            options: ReferenceOptions {
                tables: args.tables,
                max_n: args.max_n,
                max_memory: limit.unwrap_or(u64::MAX),
            },
            json: args.json,
            run: run(args.run),
        }
    }

    /// For the report.
    pub fn described(&self) -> Described {
        let mut list = vec![
            pair("max-n", self.options.max_n),
            pair("max-memory", format!("{} B", self.options.max_memory)),
        ];
        if !self.options.tables.is_empty() {
            list.push(pair("tables", self.options.tables.join(" ")));
        }
        list.extend(self.run.described());
        list
    }
}

impl SceneSettings {
    /// The scene by the name of its file alone, so that a picture does not depend on where the
    /// file lies, and what was changed in it.
    pub fn metadata(&self) -> Described {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let mut list = vec![
            pair("scene", name),
            pair("two-sided", self.options.two_sided),
            pair("light-scale", self.options.light_scale),
        ];
        for (name, overrides) in
            [("emission", &self.options.emission), ("reflectance", &self.options.reflectance)]
        {
            let texts: Vec<String> = overrides.iter().map(described_override).collect();
            if !texts.is_empty() {
                list.push(pair(name, texts.join(" ")));
            }
        }
        list
    }
}

impl ViewSettings {
    /// The view as it was asked for.
    pub fn metadata(&self) -> Described {
        let mut list = match &self.choice {
            ViewChoice::First => vec![],
            ViewChoice::Named(name) => vec![pair("camera", name)],
            ViewChoice::Eye(own) => vec![
                pair("eye", vector(own.eye)),
                pair("look-at", vector(own.look_at)),
                pair("up", vector(own.up)),
                pair("fov", own.vertical_fov.to_degrees()),
            ],
        };
        list.extend(self.size.map(|(width, height)| pair("size", format!("{width}x{height}"))));
        list
    }
}

impl SolveSettings {
    /// As the library wants it.
    pub fn light_options(&self) -> LightOptions {
        let basis = match self.basis {
            BasisArg::Constant => Basis::Constant,
            BasisArg::Linear => Basis::Linear,
        };
        let refinement = match self.refinement {
            Refinement::Usual => mesh::Refinement::Elements(USUAL_ELEMENTS),
            Refinement::MaxEdge(length) => mesh::Refinement::MaxEdge(length),
            Refinement::Levels(levels) => mesh::Refinement::Levels(levels),
        };
        LightOptions {
            mesh: MeshOptions { basis, refinement },
            operator: self.operator,
            solve: SolveOptions { residual: self.residual, ..SolveOptions::default() },
            max_memory: self.max_memory.unwrap_or(u64::MAX),
        }
    }

    /// What the solution depends on.
    pub fn metadata(&self) -> Described {
        let basis = match self.basis {
            BasisArg::Constant => "constant",
            BasisArg::Linear => "linear",
        };
        if let Some(tolerance) = self.tolerance {
            return vec![pair("tolerance", tolerance)];
        }
        let mut list = vec![pair("basis", basis), pair("residual", self.residual)];
        match self.refinement {
            Refinement::Usual => {}
            Refinement::MaxEdge(length) => list.push(pair("max-edge", length)),
            Refinement::Levels(levels) => list.push(pair("subdivide", levels)),
        }
        match self.operator {
            OperatorKind::Fast(fast) => {
                list.push(pair("operator", "fast"));
                list.push(pair("operator-tolerance", fast.tolerance));
                list.push(pair("eta", fast.eta()));
                list.push(pair("order", fast.order()));
            }
            OperatorKind::Exact => list.push(pair("operator", "exact")),
            OperatorKind::Clustered(ClusteredOptions { eta, order }) => {
                list.push(pair("operator", "clustered"));
                list.push(pair("eta", eta));
                list.push(pair("order", order));
            }
        }
        list
    }

    /// All of it.
    pub fn described(&self) -> Described {
        let mut list = self.metadata();
        list.extend(self.max_memory.map(|bytes| pair("max-memory", format!("{bytes} B"))));
        list
    }
}

impl RunSettings {
    /// All of it.
    pub fn described(&self) -> Described {
        let limit = self.time_limit.map(|seconds| pair("time-limit", format!("{seconds} s")));
        limit.into_iter().chain(self.threads.map(|n| pair("threads", n))).collect()
    }
}

pub(super) fn scene(args: SceneArgs, solve: &SolveSettings) -> SceneSettings {
    let options = ReadOptions {
        max_memory: solve.max_memory.unwrap_or(u64::MAX),
        two_sided: args.two_sided,
        light_scale: args.light_scale,
        emission: args.emission,
        reflectance: args.reflectance,
    };
    SceneSettings { path: args.scene, options }
}

fn view(args: ViewArgs) -> Result<ViewSettings> {
    let choice = match (args.eye, args.look_at, args.camera) {
        (Some(eye), Some(look_at), _) => ViewChoice::Eye(EyeSettings {
            eye,
            look_at,
            up: up(eye, look_at, args.up)?,
            vertical_fov: args.fov.unwrap_or(USUAL_FOV).to_radians(),
        }),
        (_, _, Some(name)) => ViewChoice::Named(name),
        _ => ViewChoice::First,
    };
    Ok(ViewSettings { choice, size: args.size })
}

/// The direction that is up: what was typed, or +y, or -z for a view straight down or up (where
/// +y has no place in the picture; the nearest sine to count as straight is 1e-6).
fn up(eye: DVec3, look_at: DVec3, typed: Option<DVec3>) -> Result<DVec3> {
    let forward = (look_at - eye).try_normalize().ok_or_else(|| {
        Error::Usage("--eye and --look-at are the same point: look at another one".into())
    })?;
    let is_straight = |up: DVec3| forward.cross(up.normalize_or_zero()).length() < 1e-6;
    match typed {
        Some(up) if is_straight(up) => Err(Error::Usage(
            "--up points along the view: give the direction that is up in the picture".into(),
        )),
        Some(up) => Ok(up),
        None if is_straight(DVec3::Y) => Ok(DVec3::NEG_Z),
        None => Ok(DVec3::Y),
    }
}

pub(super) fn solve(args: &SolveArgs) -> Result<SolveSettings> {
    let refinement = match (args.max_edge, args.subdivide) {
        (Some(length), _) => Refinement::MaxEdge(length),
        (None, Some(levels)) => Refinement::Levels(levels),
        (None, None) => Refinement::Usual,
    };
    let given = args.basis.is_some()
        || args.max_edge.is_some()
        || args.subdivide.is_some()
        || args.operator.is_some()
        || args.operator_tolerance.is_some()
        || args.eta.is_some()
        || args.order.is_some()
        || args.residual.is_some();
    let operator = match args.operator.unwrap_or(OperatorArg::Fast) {
        OperatorArg::Fast => {
            let tolerance = args.operator_tolerance.unwrap_or(FastOptions::default().tolerance);
            OperatorKind::Fast(FastOptions::new(tolerance, args.order, args.eta)?)
        }
        OperatorArg::Exact => OperatorKind::Exact,
        OperatorArg::Clustered => OperatorKind::Clustered(ClusteredOptions::new(
            args.eta.unwrap_or(0.25),
            args.order.unwrap_or(6),
        )?),
    };
    Ok(SolveSettings {
        tolerance: if given { None } else { Some(args.tolerance.unwrap_or(USUAL_TOLERANCE)) },
        basis: args.basis.unwrap_or(BasisArg::Linear),
        refinement,
        operator,
        residual: args.residual.unwrap_or(SolveOptions::default().residual),
        max_memory: max_memory(args.max_memory, machine::usable_memory()),
    })
}

/// A limit in bytes. A share of a memory whose size the system does not tell is no limit.
fn max_memory(typed: MemorySize, usable: Option<u64>) -> Option<u64> {
    match typed {
        MemorySize::Bytes(bytes) => Some(bytes),
        MemorySize::Share(share) => usable.map(|bytes| (bytes as f64 * share) as u64),
    }
}

pub(super) fn run(args: RunArgs) -> RunSettings {
    RunSettings {
        time_limit: args.time_limit,
        threads: args.threads.map(usize::from),
        quiet: args.quiet,
        report: args.report,
    }
}

pub(super) fn pair(name: &str, value: impl ToString) -> (String, String) {
    (name.into(), value.to_string())
}

fn vector(v: DVec3) -> String {
    format!("{},{},{}", v.x, v.y, v.z)
}

fn described_override(wanted: &Override) -> String {
    format!("{}={}", wanted.pattern, vector(wanted.value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{Cli, Command};
    use clap::Parser;

    fn render(typed: &str) -> Result<RenderSettings> {
        let words = "lumel render dir/s.gltf".split(' ').chain(typed.split_whitespace());
        match Cli::try_parse_from(words).unwrap().command {
            Command::Render(args) => RenderSettings::new(args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_a_picture_depends_on_is_its_metadata_and_no_more() {
        let one = "-o a.png --max-edge 0.1 --emission L*=1,2,3 --size 8x4";
        let other = "-o b.exr --max-edge 0.1 --emission L*=1,2,3 --size 8x4 --threads 3 \
                     --time-limit 9 --max-memory 1GiB --report r.json --quiet --exposure 2";
        let (one, other) = (render(one).unwrap(), render(other).unwrap());
        assert_eq!(one.metadata(), other.metadata());
        let has = |list: &Described, name: &str, value: &str| {
            assert!(list.contains(&pair(name, value)), "{name} {value} in {list:?}");
        };
        for (name, value) in [
            ("scene", "s.gltf"),
            ("emission", "L*=1,2,3"),
            ("size", "8x4"),
            ("max-edge", "0.1"),
            ("basis", "linear"),
            ("residual", "0.00000001"),
        ] {
            has(&one.metadata(), name, value);
        }
        has(&other.described(), "threads", "3");
        has(&other.described(), "max-memory", "1073741824 B");
    }

    #[test]
    fn a_tolerance_is_what_counts_unless_elements_are_given() {
        let solve = |typed: &str| render(&format!("-o a.png {typed}")).unwrap().solve;
        assert_eq!(solve("").tolerance, Some(0.01));
        assert_eq!(solve("--tolerance 0.3%").tolerance, Some(0.003));
        assert_eq!(solve("--tolerance 0.02 --max-memory 1GiB").tolerance, Some(0.02));
        for typed in ["--max-edge 0.1", "--subdivide 2", "--basis constant", "--residual 1e-5"] {
            assert_eq!(solve(typed).tolerance, None, "{typed}");
        }
        let typed = "lumel render s.gltf -o a.png --tolerance 1% --subdivide 2";
        assert!(Cli::try_parse_from(typed.split(' ')).is_err());
        assert!(render("-o a.png --subdivide 2 --error-map e.exr").is_err());
    }

    #[test]
    fn a_view_straight_down_has_another_up() {
        let eye = |typed: &str| match render(&format!("-o a.png {typed}")).unwrap().view.choice {
            ViewChoice::Eye(own) => own,
            other => panic!("{other:?}"),
        };
        assert_eq!(eye("--eye 0,1,4 --look-at 0,1,0").up, DVec3::Y);
        let down = eye("--eye 0,3,0 --look-at 0,0,0 --fov 60");
        assert_eq!(down.up, DVec3::NEG_Z);
        assert!((down.vertical_fov - std::f64::consts::FRAC_PI_3).abs() < 1e-15);
    }

    #[test]
    fn views_that_cannot_be_are_usage_errors() {
        for typed in [
            "-o a.png --eye 1,1,1 --look-at 1,1,1",
            "-o a.png --eye 0,0,1 --look-at 0,0,0 --up 0,0,-2",
            "-o a.jpg",
        ] {
            assert_eq!(render(typed).unwrap_err().exit_code(), 2, "{typed}");
        }
    }

    #[test]
    fn a_share_of_unknown_memory_is_no_limit() {
        assert_eq!(max_memory(MemorySize::Share(0.5), Some(100)), Some(50));
        assert_eq!(max_memory(MemorySize::Share(0.5), None), None);
        assert_eq!(max_memory(MemorySize::Bytes(7), None), Some(7));
    }
}
