//! What was typed, and nothing done with it yet.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use glam::DVec3;
use lumel::scene::Override;

use super::values::{self, MemorySize};

/// Help that follows the list of commands.
const AFTER_HELP: &str = "\
Examples, on scenes that come with the program:
  lumel inspect room.gltf
      What is in the file: faces, materials, lamps, cameras, and what was odd.
  lumel render room.gltf -o view.png
      What the file's first camera sees; irradiance is right to 1 % (root mean square).
  lumel bake room.gltf -o baked.glb
      The scene with its light in lightmaps, for any viewer of glTF.
  lumel probe cornell.obj --points desk.csv -o light.csv --emission 'li*=40,38,30'
      Irradiance at given points, with the radiance of the lamp set by hand.

More examples are in the help of each command, such as lumel render --help. The picture is black?
lumel inspect says what a scene lacks and where its camera stands.

Exit codes: 0 done, 1 failed at run time, 2 wrong usage, 3 bad scene or points,
4 tolerance or time limit not met, 130 interrupted.";

/// The program's command line.
#[derive(Debug, Parser)]
#[command(
    name = "lumel",
    version,
    about = "Exact diffuse light: solves the occluded radiosity equation for glTF and OBJ scenes",
    after_help = AFTER_HELP,
    max_term_width = 100
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show what was read: faces, materials, emitters, cameras, warnings
    Inspect(InspectArgs),
    /// Make a picture of a scene as a camera sees it
    Render(RenderArgs),
    /// Write a scene with its light in it: lightmaps, or colours of vertices
    Bake(BakeArgs),
    /// Measure irradiance and radiosity at points given in a table
    Probe(ProbeArgs),
    /// Repeat the experiments of Atkinson and Chien (2006), beside the printed tables
    Reference(ReferenceArgs),
    /// Print a script that lets a shell complete this command line
    Completions(CompletionsArgs),
    /// Print the page of the manual of a command, for man
    Manual(ManualArgs),
}

/// `lumel inspect`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  lumel inspect room.gltf
  lumel inspect room.gltf --json | jq .materials
  lumel inspect cornell.obj --eye 0.278,0.273,-0.8 --look-at 0.278,0.273,0
      Tells whether a view sees anything before it is drawn.
  lumel inspect cornell.gltf --reflectance 'white=0.9,0.9,0.9' --light-scale 2
      What changing materials would make of them.
  lumel inspect room.gltf --export room.json
      Triangles, sides, light and view as they were read, for other programs.
  lumel inspect room.gltf --audit
      Also what is wrong with it: leaks, flipped and buried faces, lamps that nothing sees.")]
pub struct InspectArgs {
    /// The scene and how to read it.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Print JSON instead of text
    #[arg(long, help_heading = None::<&str>)]
    pub json: bool,
    /// Also look for mistakes in the scene: leaks, faces that are flipped, buried or counted twice,
    /// lamps that nothing sees
    #[arg(long, help_heading = None::<&str>)]
    pub audit: bool,
    /// Also write the scene as it was read to this file as JSON: triangles in world space, their
    /// sides, reflectance and radiance (means where there are textures), and the view
    #[arg(long, value_name = "FILE", help_heading = None::<&str>)]
    pub export: Option<PathBuf>,
    /// The view to check.
    #[command(flatten)]
    pub view: ViewArgs,
    /// How to solve.
    #[command(flatten)]
    pub solve: SolveArgs,
    /// How to run.
    #[command(flatten)]
    pub run: RunArgs,
}

/// `lumel render`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  lumel render room.gltf -o view.exr --tolerance 0.5%
      Linear radiance, in W/(m^2 sr), from the file's first camera.
  lumel render room.gltf -o view.png --camera table --size 1280x720 --samples 3 --exposure 1.5
      One camera by its name, smooth edges, 1.5 stops brighter.
  lumel render cornell.obj -o view.png --eye 0.278,0.273,-0.8 --look-at 0.278,0.273,0 --fov 39
      A view of one's own, for a file without cameras.
  lumel render room.gltf -o view.png --error-map error.exr --report report.json
      With what is known of its errors.
  lumel render room.gltf -o quick.png --size 320x240 --tolerance 5% --time-limit 60
      A first look, in a minute at most.")]
pub struct RenderArgs {
    /// The scene and how to read it.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Picture to write; the extension decides: .exr (linear), .png (sRGB), .hdr (linear)
    #[arg(short, long, value_name = "FILE", help_heading = None::<&str>)]
    pub output: PathBuf,
    /// The view.
    #[command(flatten)]
    pub view: ViewArgs,
    /// How to make the picture.
    #[command(flatten)]
    pub picture: PictureArgs,
    /// How to solve.
    #[command(flatten)]
    pub solve: SolveArgs,
    /// How to run.
    #[command(flatten)]
    pub run: RunArgs,
}

/// `lumel bake`.
#[derive(Args, Debug)]
#[command(after_help = "\
Written beside OUT.glb are OUT-lightmap.exr (and OUT-lightmap-1.exr ... for further pages) and
OUT-bake.json, which says which texels belong to what, what they measure and how good they are.

Examples:
  lumel bake room.gltf -o baked.glb
      Shows its light in any viewer of glTF. Lightmap coordinates are TEXCOORD_1.
  lumel bake room.gltf -o baked.glb --target three --texels-per-metre 40 --tolerance 0.3%
      Keeps the materials; the lightmap holds irradiance, as three.js wants it.
  lumel bake room.gltf -o baked.glb --only 'wall*' --only floor --density floor=100
      Only some objects, lit by all; the floor finer than the rest.
  lumel bake room.gltf -o baked.glb --to vertices --max-triangles 20000
      Colours at vertices, on triangles as fine as the light asks for.")]
pub struct BakeArgs {
    /// The scene and how to read it.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Scene to write: .glb, or .gltf with its buffer and pictures beside it
    #[arg(short, long, value_name = "FILE", help_heading = None::<&str>)]
    pub output: PathBuf,
    /// What to bake and how.
    #[command(flatten)]
    pub bake: BakingArgs,
    /// How to solve.
    #[command(flatten)]
    pub solve: SolveArgs,
    /// How to run.
    #[command(flatten)]
    pub run: RunArgs,
}

/// `lumel probe`.
#[derive(Args, Debug)]
#[command(after_help = "\
The table of points is comma-separated text whose header names the columns x,y,z (metres) and
nx,ny,nz (normal); further columns are ignored. Written are these columns and
irradiance_r,irradiance_g,irradiance_b,radiosity_r,radiosity_g,radiosity_b in W/m^2; the
radiosity is empty where there is no surface.

Examples:
  lumel probe cornell.gltf --points desk.csv -o light.csv --tolerance 0.1%
  printf 'x,y,z,nx,ny,nz\\n0.3,0,0.2,0,1,0\\n' > p.csv && lumel probe furnace.gltf --points p.csv
      A table of one point, made by hand.")]
pub struct ProbeArgs {
    /// The scene and how to read it.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Table of points to measure at, with the header x,y,z,nx,ny,nz
    #[arg(long, value_name = "FILE", help_heading = None::<&str>)]
    pub points: PathBuf,
    /// Table to write [default: standard output]
    #[arg(short, long, value_name = "FILE", help_heading = None::<&str>)]
    pub output: Option<PathBuf>,
    /// How to solve.
    #[command(flatten)]
    pub solve: SolveArgs,
    /// How to run.
    #[command(flatten)]
    pub run: RunArgs,
}

/// `lumel reference`.
#[derive(Args, Debug)]
#[command(after_help = "\
The surface, the solutions and the tables are those of K. Atkinson and D. Chien, A study of the
fast solution of the occluded radiosity equation, 2006, sections 5 and 6. Times are CPU seconds.

Examples:
  lumel reference
      All tables up to n = 2560, in seconds.
  lumel reference --table 6.5 --table 6.10 --max-n 40960
  lumel reference --max-n 163840 --json > tables.jsonl
      All there is, in a quarter of an hour.")]
pub struct ReferenceArgs {
    /// Table to compute, 6.1 to 6.11; may be repeated [default: all]
    #[arg(long = "table", value_name = "NUMBER", help_heading = None::<&str>)]
    pub tables: Vec<String>,
    /// Largest number of elements: 10, 40, 160, ... 163840
    #[arg(long, value_name = "N", default_value = "2560", help_heading = None::<&str>)]
    pub max_n: usize,
    /// Print one JSON object a line instead of text
    #[arg(long, help_heading = None::<&str>)]
    pub json: bool,
    /// Use no more memory for an operator than this: 2GiB, 500MB, 75% (of what there is)
    #[arg(long, value_name = "SIZE", default_value = "75%", value_parser = values::memory_size, allow_negative_numbers = true, help_heading = None::<&str>)]
    pub max_memory: MemorySize,
    /// How to run.
    #[command(flatten)]
    pub run: RunArgs,
}

/// `lumel completions`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  lumel completions bash > ~/.local/share/bash-completion/completions/lumel
  lumel completions zsh > ~/.zfunc/_lumel
      With fpath+=~/.zfunc before compinit in .zshrc.
  lumel completions fish > ~/.config/fish/completions/lumel.fish")]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// `lumel manual`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  lumel manual | man -l -
  lumel manual bake > ~/.local/share/man/man1/lumel-bake.1")]
pub struct ManualArgs {
    /// The command [default: the program as a whole]
    pub command: Option<String>,
}

/// The scene and how to read it.
#[derive(Args, Debug)]
#[command(next_help_heading = "Scene")]
pub struct SceneArgs {
    /// Scene to read: .gltf, .glb or .obj
    #[arg(value_name = "SCENE", help_heading = None::<&str>)]
    pub scene: PathBuf,
    /// Let materials emit this radiance, W/(m^2 sr), e.g. 'Lamp*=40,38,30'; may be repeated
    #[arg(long, value_name = "NAME=R,G,B", value_parser = Override::parse)]
    pub emission: Vec<Override>,
    /// Give materials this diffuse reflectance, 0 to 1, e.g. 'Wall=0.8,0.8,0.7'; may be repeated
    #[arg(long, value_name = "NAME=R,G,B", value_parser = Override::parse)]
    pub reflectance: Vec<Override>,
    /// Let both sides of every surface reflect and emit; otherwise a back is black
    #[arg(long)]
    pub two_sided: bool,
    /// Multiply all emission by this number
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = values::not_negative, allow_negative_numbers = true)]
    pub light_scale: f64,
}

/// The view of a picture.
#[derive(Args, Debug)]
#[command(next_help_heading = "View")]
pub struct ViewArgs {
    /// Camera of the file, by name or number from 0 [default: the first, or one that suits the scene]
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Stand here instead of at a camera of the file, metres, e.g. 0,1.6,4
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, requires = "look_at", conflicts_with = "camera", allow_hyphen_values = true)]
    pub eye: Option<DVec3>,
    /// Look at this point from --eye
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, requires = "eye", allow_hyphen_values = true)]
    pub look_at: Option<DVec3>,
    /// Direction that is up in the picture seen from --eye [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::direction, requires = "eye", allow_hyphen_values = true)]
    pub up: Option<DVec3>,
    /// Vertical field of view from --eye, degrees [default: 45]
    #[arg(long, value_name = "DEGREES", value_parser = values::field_of_view, requires = "eye", allow_negative_numbers = true)]
    pub fov: Option<f64>,
    /// Size of the picture, pixels [default: 960 on its longer side, as wide as the camera says]
    #[arg(long, value_name = "WxH", value_parser = values::picture_size)]
    pub size: Option<(u32, u32)>,
}

/// How to make the picture.
#[derive(Args, Debug)]
#[command(next_help_heading = "Picture")]
pub struct PictureArgs {
    /// Brighten a PNG picture by 2^EV; .exr and .hdr keep the true values
    #[arg(long, value_name = "EV", default_value = "0", value_parser = values::exposure, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Bits a channel of a PNG picture
    #[arg(long, value_name = "8|16", default_value = "8")]
    pub bits: BitsArg,
    /// With elements of a given size: gather light at every pixel, with exact shadows whatever the
    /// mesh, but slower (done wherever needed with --tolerance)
    #[arg(long)]
    pub gather: bool,
    /// Also write a picture of the estimated error of the irradiance at each pixel, relative to its
    /// mean over the surface (not with elements of a given size)
    #[arg(long, value_name = "FILE")]
    pub error_map: Option<PathBuf>,
    /// Samples along each side of a pixel: N makes N x N a pixel
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub samples: u32,
}

/// What to bake and how.
#[derive(Args, Debug)]
#[command(next_help_heading = "Bake")]
pub struct BakingArgs {
    /// Where the light goes
    #[arg(long, value_enum, default_value = "lightmap")]
    pub to: ToArg,
    /// Who will show it, which decides the quantity and the materials
    #[arg(long, value_enum, default_value = "unlit")]
    pub target: TargetArg,
    /// Bake only objects and materials of this name, where * stands for anything; may be repeated
    #[arg(long, value_name = "NAME")]
    pub only: Vec<String>,
    /// Texels to a metre [default: as many as one page of --size holds]
    #[arg(long, value_name = "N", value_parser = values::positive, allow_negative_numbers = true)]
    pub texels_per_metre: Option<f64>,
    /// Texels to a metre for some objects or materials, e.g. 'Floor*=100'; may be repeated
    #[arg(long, value_name = "NAME=N", value_parser = values::density)]
    pub density: Vec<(String, f64)>,
    /// Texels along the sides of a page [default: 1024, or no more than needed with --texels-per-metre]
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(4..=16384))]
    pub size: Option<u32>,
    /// Texels along the sides of a page at most; what does not fit goes to a further page
    #[arg(long, value_name = "TEXELS", default_value = "4096", value_parser = clap::value_parser!(u32).range(4..=16384))]
    pub max_size: u32,
    /// Texels around each chart that take over its light
    #[arg(long, value_name = "TEXELS", default_value = "2", value_parser = clap::value_parser!(u32).range(0..=64))]
    pub padding: u32,
    /// Make new lightmap coordinates even where the file has good ones (its second set)
    #[arg(long)]
    pub new_coordinates: bool,
    /// Format of the lightmaps: linear .exr or .hdr, or .png of 16 bits in sRGB
    #[arg(long, value_enum, default_value = "exr")]
    pub format: FormatArg,
    /// Store 16-bit floats in .exr files instead of 32-bit ones
    #[arg(long)]
    pub half: bool,
    /// Also store direct and indirect light apart, as layers of the .exr files
    #[arg(long)]
    pub layers: bool,
    /// Brighten what has a limited range (.png, unlit materials, colours of vertices) by 2^EV
    /// [default: so that next to nothing is brighter than white]
    #[arg(long, value_name = "EV", value_parser = values::exposure, allow_negative_numbers = true)]
    pub exposure: Option<f64>,
    /// With --to vertices: refine up to so many triangles
    #[arg(long, value_name = "N", default_value = "200000", value_parser = clap::value_parser!(u32).range(1..=20_000_000))]
    pub max_triangles: u32,
}

/// Where baked light goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToArg {
    /// Pictures on the surface
    Lightmap,
    /// Colours of vertices, on refined triangles
    Vertices,
}

/// Who shows baked light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TargetArg {
    /// Any viewer: unlit materials with the light as their colour
    Unlit,
    /// three.js: irradiance, for lightMap of its materials
    Three,
    /// Bevy: irradiance/pi, for its component Lightmap
    Bevy,
    /// Blender: irradiance/pi, as from a bake of diffuse light without colour
    Blender,
}

/// Format of lightmaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FormatArg {
    /// OpenEXR
    Exr,
    /// Radiance HDR
    Hdr,
    /// PNG, 16 bits a channel, sRGB
    Png,
}

/// How to solve.
#[derive(Args, Debug)]
#[command(next_help_heading = "Solution")]
pub struct SolveArgs {
    /// Error of the irradiance that is wanted: root mean square over the surface, relative to its
    /// mean, such as 1% or 0.01. Mesh, operator and gathering follow from it [default: 1%, unless one
    /// of the following options says otherwise]
    #[arg(long, value_name = "E", value_parser = values::tolerance, allow_negative_numbers = true,
        conflicts_with_all = ["basis", "max_edge", "subdivide", "operator", "operator_tolerance", "eta", "order", "residual"])]
    pub tolerance: Option<f64>,
    /// How radiosity varies within an element [default: linear]
    #[arg(long, value_enum)]
    pub basis: Option<BasisArg>,
    /// Refine until no edge of an element is longer than this, metres
    #[arg(long, value_name = "LENGTH", value_parser = values::positive, conflicts_with = "subdivide", allow_negative_numbers = true)]
    pub max_edge: Option<f64>,
    /// Refine every face this many times, into 4 elements each time
    #[arg(long, value_name = "LEVELS", value_parser = values::levels, allow_negative_numbers = true)]
    pub subdivide: Option<u32>,
    /// How the operator of the equation is represented [default: fast]
    #[arg(long, value_enum)]
    pub operator: Option<OperatorArg>,
    /// With --operator fast: errors of the irradiance that it may make, relative to the largest
    /// [default: 1e-4]
    #[arg(long, value_name = "T", value_parser = values::residual, allow_negative_numbers = true)]
    pub operator_tolerance: Option<f64>,
    /// For experts: clusters of radius up to ETA times their distance are far (of both clusters
    /// together with --operator fast) [default: 0.5; 0.25 with --operator clustered]
    #[arg(long, value_name = "ETA", value_parser = values::positive, allow_negative_numbers = true)]
    pub eta: Option<f64>,
    /// For experts: polynomials of total degree below M represent what is far [default: by the
    /// tolerance; 6 with --operator clustered]
    #[arg(long, value_name = "M")]
    pub order: Option<usize>,
    /// Iterate until the relative residual is below this [default: 1e-8]
    #[arg(long, value_name = "R", value_parser = values::residual, allow_negative_numbers = true)]
    pub residual: Option<f64>,
    /// Use no more memory than this: 2GiB, 500MB, 75% (of what there is)
    #[arg(long, value_name = "SIZE", default_value = "75%", value_parser = values::memory_size, allow_negative_numbers = true)]
    pub max_memory: MemorySize,
}

/// How to run.
#[derive(Args, Debug)]
#[command(next_help_heading = "Run")]
pub struct RunArgs {
    /// Refine no further after this many seconds: the best light so far is written (exit code 4 if
    /// it is not what was asked for). Writing may take half as long again; pictures and lightmaps
    /// that would take longer are coarse
    #[arg(long, value_name = "SECONDS", value_parser = values::positive, allow_negative_numbers = true)]
    pub time_limit: Option<f64>,
    /// Threads to use [default: one for each processor]; results do not depend on it
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<NonZeroUsize>,
    /// Write neither warnings nor progress
    #[arg(short, long)]
    pub quiet: bool,
    /// Write times, counts, residuals and warnings to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

/// How radiosity varies within an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BasisArg {
    /// One value for an element
    Constant,
    /// A plane through three values, discontinuous across edges
    Linear,
}

/// How the operator is represented.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OperatorArg {
    /// Both sides clustered, exact visibility, to a tolerance; time and memory in proportion to
    /// the elements
    Fast,
    /// Every coefficient, exactly
    Exact,
    /// Exact near by and across shadows, Taylor polynomials far away: Hackbusch and Nowak's
    /// clustering as in Atkinson and Chien (2006)
    Clustered,
}

/// Bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BitsArg {
    /// 256 levels
    #[value(name = "8")]
    Eight,
    /// 65536 levels
    #[value(name = "16")]
    Sixteen,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn negative_numbers_are_values() {
        let typed = "lumel render s.gltf -o v.png --eye -1,-2,-3 --look-at 0,0,-1 --up 0,-1,0 \
                     --exposure -2";
        let Command::Render(args) = Cli::try_parse_from(typed.split_whitespace()).unwrap().command
        else {
            panic!("not a render");
        };
        assert_eq!(args.view.eye, Some(DVec3::new(-1.0, -2.0, -3.0)));
        assert_eq!(args.view.up, Some(DVec3::NEG_Y));
        assert_eq!(args.picture.exposure, -2.0);
        assert_eq!(args.solve.tolerance, None);
        assert_eq!(args.solve.max_memory, MemorySize::Share(0.75));
    }
}
