//! Where each triangle of a scene lies on the pages of a lightmap.
//!
//! Texel (i, j) of a page of w x h texels covers [i, i+1]/w x [j, j+1]/h of the unit square, i to
//! the right and j downward from the top left: glTF's texture coordinates. Only the front of a
//! triangle (the side from which its corners run counter-clockwise) has texels.

use glam::{DVec2, Vec3};

use crate::reconstruct::irradiance::IrradianceCounts;
use crate::scene::Notice;

/// Size of a lightmap in texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Page {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A part of a page that belongs to one chart, or to all of an object whose own second set of
/// texture coordinates is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Index into [`crate::scene::Scene::objects`].
    pub object: u32,
    /// Index into [`Atlas::pages`].
    pub page: u32,
    /// Left, top, width, height in texels, without the gutter.
    pub rectangle: [u32; 4],
    /// Texels a metre, the root of texels a square metre.
    pub density: f64,
    /// Whether the texture coordinates of the file were kept in it.
    pub kept: bool,
    /// Its triangles, in ascending order.
    pub triangles: Vec<u32>,
}

/// Places of triangles on pages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Atlas {
    /// Sizes of the pages.
    pub pages: Vec<Page>,
    /// Of every triangle of the scene its page; none where it is not baked.
    pub page: Vec<Option<u32>>,
    /// Of every triangle its corners on the page, in the unit square, origin top left; zero where it
    /// is not baked.
    pub uv: Vec<[DVec2; 3]>,
    /// Rectangles of the pages, in order of the objects.
    pub charts: Vec<Chart>,
    /// What was odd and what was made of it.
    pub notices: Vec<Notice>,
}

/// Texels a metre for what fits a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Density {
    /// The name of an object or a material; `*` stands for any run of characters.
    pub pattern: String,
    /// Texels a metre, greater than zero.
    pub texels_per_metre: f64,
}

/// How an atlas is made.
#[derive(Clone, Debug, PartialEq)]
pub struct AtlasOptions {
    /// Texels a metre; none: as many as fit one page of `size`.
    pub texels_per_metre: Option<f64>,
    /// Texels along each side of a page; none: no more than needed, or [`DEFAULT_SIZE`] where
    /// texels a metre are not given either.
    pub size: Option<u32>,
    /// The longest side of a page, where `size` does not say.
    pub max_size: u32,
    /// Texels of gutter around each chart: two charts are at least twice as far apart.
    pub padding: u32,
    /// Names of objects (or materials) to bake, with `*`; all where empty.
    pub only: Vec<String>,
    /// Texels a metre of objects (or materials); later ones win. Where the scale follows from
    /// `size` they count in proportion to 1 texel a metre elsewhere.
    pub densities: Vec<Density>,
    /// Whether a valid second set of texture coordinates is kept.
    pub keep: bool,
    /// Bytes that all pages may take while they are baked.
    pub max_memory: u64,
}

/// The side of a page where nothing else is said.
pub const DEFAULT_SIZE: u32 = 1024;

/// The longest side of a page that is accepted: what graphics hardware takes.
pub const LARGEST_SIZE: u32 = 16384;

impl Default for AtlasOptions {
    fn default() -> Self {
        AtlasOptions {
            texels_per_metre: None,
            size: None,
            max_size: 4096,
            padding: 2,
            only: vec![],
            densities: vec![],
            keep: true,
            max_memory: u64::MAX,
        }
    }
}

/// Irradiance on the fronts of the triangles of one page, W/m^2, row by row from the top.
///
/// The value of a texel is the mean over the part of it that the surface covers; texels that no
/// surface covers have values continued from those around them.
#[derive(Clone, Debug, PartialEq)]
pub struct Lightmap {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// From emitters straight away.
    pub direct: Vec<Vec3>,
    /// From surfaces that reflect; direct + indirect is the irradiance.
    pub indirect: Vec<Vec3>,
    /// The share of each texel that surface covers, [0, 1].
    pub covered: Vec<f32>,
}

/// What baking did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakeCounts {
    /// Points gathered and filled in, with their errors.
    pub irradiance: IrradianceCounts,
    /// Texels that surface covers.
    pub covered: u64,
    /// Those of them that were sampled more than once.
    pub refined: u64,
    /// Parts of faces inside of solid things or below them, which have no texels.
    pub buried: u64,
    /// What was odd and what was made of it.
    pub notices: Vec<Notice>,
}
