//! Bounds of what is accepted, in one place, each with its reason.

use std::path::Path;

use glam::DVec3;

use super::Material;
use super::notices::Notices;
use crate::error::{Error, Result};

/// Largest reflectance of any channel, dimensionless. A reflectance of 1 makes the equation
/// singular in a closed scene: at this bound light is multiplied at most a thousandfold there.
/// Larger values in a file are lowered to it, with a notice that names the material.
pub const MAX_REFLECTANCE: f64 = 0.999;

/// Largest coordinate in size, metres. Squares of distances, and products of two of them, stay
/// finite in f64 below this.
pub(crate) const MAX_COORDINATE: f64 = 1e30;

/// Most triangles in a scene, where memory suffices for them (see [`Budget`]).
const MAX_TRIANGLES: usize = 1 << 24;

/// Bytes that a triangle takes at most until the scene is meshed: 1,460 were measured on a mesh that is
/// placed many times, of which nothing is left out.
const BYTES_PER_TRIANGLE: u64 = 1500;

/// Bytes that a texel takes at most while it is decoded, from 16 bits a channel; then it is sixteen, a
/// quarter of them for the pyramid.
const BYTES_PER_TEXEL: u64 = 24;

/// What a scene may take in any case, bytes: so little is not worth refusing.
const ANYWAY: u64 = 64 << 20;

/// Longest side of an image, texels.
pub(crate) const MAX_IMAGE_SIDE: u32 = 16_384;

/// Most texels in one image (8192 x 8192; 768 MiB when decoded).
pub(crate) const MAX_IMAGE_TEXELS: u64 = 1 << 26;

/// Most texels in all images of a scene (3 GiB when decoded).
const MAX_SCENE_TEXELS: u64 = 1 << 28;

/// Largest radiance of any channel, W/(m^2 sr). Exitances, and squares of them in norms, stay finite in
/// f64 below this, and pixels in f32: the sun has 2e7.
pub(crate) const MAX_RADIANCE: f64 = 1e30;

/// What a scene may take while it is read. A file of a few kilobytes can ask for thousands of times its
/// size, by placing one mesh many times or by pictures of one colour: that must not exhaust the memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    allowed: u64,
}

impl Budget {
    /// Of a limit in bytes.
    pub(crate) fn new(max_memory: u64) -> Budget {
        Budget { allowed: max_memory.max(ANYWAY) }
    }

    /// Refuses more triangles than there may be; `what` asks for them.
    pub(crate) fn triangles(self, path: &Path, what: &str, count: usize) -> Result<()> {
        if count > MAX_TRIANGLES {
            return Err(Error::unsupported(
                path,
                what,
                format!("more than {MAX_TRIANGLES} triangles in all; simplify the scene"),
            ));
        }
        let needed = (count as u64).saturating_mul(BYTES_PER_TRIANGLE);
        if needed <= self.allowed {
            return Ok(());
        }
        Err(Error::Memory {
            what: format!("{}: {what}: a scene of {count} triangles or more", path.display()),
            needed,
            allowed: self.allowed,
            remedy: "simplify the scene, or raise --max-memory".into(),
        })
    }
}

/// The texels of all images of a scene, as they are added up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Texels {
    count: u64,
    budget: Budget,
}

impl Texels {
    /// None so far.
    pub(crate) fn new(budget: Budget) -> Texels {
        Texels { count: 0, budget }
    }

    /// Adds an image of `what` in a file, or refuses it.
    pub(crate) fn add(&mut self, path: &Path, what: &str, width: u32, height: u32) -> Result<()> {
        self.count = self.count.saturating_add(u64::from(width) * u64::from(height));
        let allowed = self.budget.allowed.min(MAX_SCENE_TEXELS * BYTES_PER_TEXEL);
        let needed = self.count.saturating_mul(BYTES_PER_TEXEL);
        if needed <= allowed {
            return Ok(());
        }
        Err(Error::Memory {
            what: format!("{}: {what}: decoding the images", path.display()),
            needed,
            allowed,
            remedy: "scale the images down, or raise --max-memory".into(),
        })
    }
}

/// Whether a point may be used as a position.
pub(crate) fn is_position(p: DVec3) -> bool {
    p.is_finite() && p.abs().max_element() < MAX_COORDINATE
}

/// Brings the reflectance of a material into [0, [`MAX_REFLECTANCE`]], with a notice where it was
/// outside. NaN counts as zero.
pub(crate) fn clamp_reflectance(material: &mut Material, notices: &mut Notices) {
    let old = material.reflectance;
    let clamp = |x: f64| if x > 0.0 { x.min(MAX_REFLECTANCE) } else { 0.0 };
    let new = DVec3::new(clamp(old.x), clamp(old.y), clamp(old.z));
    // Metal leaves (1 - metallic) of it: only what is left is reflected diffusely.
    let reflects = material.metallic < 1.0 || material.metallic_texture.is_some();
    if new != old && (reflects || old.min_element() < 0.0) {
        let text = format!(
            "reflectance {} is outside [0, {MAX_REFLECTANCE}]; {} is used",
            triple(old),
            triple(new)
        );
        notices.add(format!("material \"{}\"", material.name), text);
    }
    material.reflectance = new;
}

/// A colour in words.
pub(crate) fn triple(c: DVec3) -> String {
    format!("({}, {}, {})", c.x, c.y, c.z)
}
