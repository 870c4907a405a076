//! Bounds of what is accepted, in one place, each with its reason.

use glam::DVec3;

use super::Material;
use super::notices::Notices;

/// Largest reflectance of any channel, dimensionless. A reflectance of 1 makes the equation
/// singular in a closed scene: at this bound light is multiplied at most a thousandfold there.
/// Larger values in a file are lowered to it, with a notice that names the material.
pub const MAX_REFLECTANCE: f64 = 0.999;

/// Largest coordinate in size, metres. Squares of distances, and products of two of them, stay
/// finite in f64 below this.
pub(crate) const MAX_COORDINATE: f64 = 1e30;

/// Most triangles in a scene: about 4 GiB of them. A file of a few kilobytes can ask for more by
/// placing one mesh many times, which must not exhaust the memory.
pub(crate) const MAX_TRIANGLES: usize = 1 << 24;

/// Longest side of an image, texels.
pub(crate) const MAX_IMAGE_SIDE: u32 = 16_384;

/// Most texels in one image (8192 x 8192; 768 MiB when decoded).
pub(crate) const MAX_IMAGE_TEXELS: u64 = 1 << 26;

/// Most texels in all images of a scene (3 GiB when decoded).
pub(crate) const MAX_SCENE_TEXELS: u64 = 1 << 28;

/// Largest radiance of any channel, W/(m^2 sr). Exitances, and squares of them in norms, stay finite in
/// f64 below this, and pixels in f32: the sun has 2e7.
pub(crate) const MAX_RADIANCE: f64 = 1e30;

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
