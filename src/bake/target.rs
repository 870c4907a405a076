//! What baked light is for: which quantity, in which material.
//!
//! Programs differ by a factor of pi, and in what they can show:
//!
//! | target | texels hold | materials of the file |
//! |---|---|---|
//! | `unlit` | radiance (E + rho H)/pi | `KHR_materials_unlit`, the light as base colour: shows as it is in any viewer |
//! | `three` | irradiance H | as read; `MeshStandardMaterial.lightMap` adds rho/pi times the texel |
//! | `bevy` | H/pi | as read; `Lightmap` adds rho times the texel times `lightmap_exposure` |
//! | `blender` | H/pi | as read; base colour times the texel is what to emit (as of a Cycles bake of diffuse light without colour) |
//!
//! In every one of them the coordinates are `TEXCOORD_1` with the origin at the top left, as glTF has
//! it, and the first row of each picture is the top one. three.js reads EXR pictures upside down
//! (their first row comes last), see [`Target::note`]; Blender's importer of glTF turns the coordinates
//! itself.

use crate::output::picture::Quantity;

/// Who shows the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Any viewer of glTF.
    Unlit,
    /// three.js, by the lightmap of its standard material.
    Three,
    /// Bevy, by its component `Lightmap`.
    Bevy,
    /// Blender, by a material that emits base colour times light.
    Blender,
}

impl Target {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Target::Unlit => "unlit",
            Target::Three => "three",
            Target::Bevy => "bevy",
            Target::Blender => "blender",
        }
    }

    /// What the texels of its lightmap measure.
    pub fn quantity(self) -> Quantity {
        match self {
            Target::Unlit => Quantity::Radiance,
            Target::Three => Quantity::Irradiance,
            Target::Bevy | Target::Blender => Quantity::IrradianceOverPi,
        }
    }

    /// The factor from irradiance to what its texels measure; none where that depends on the material.
    pub fn of_irradiance(self) -> Option<f64> {
        match self {
            Target::Unlit => None,
            Target::Three => Some(1.0),
            Target::Bevy | Target::Blender => Some(std::f64::consts::FRAC_1_PI),
        }
    }

    /// What to do with the files, in one sentence.
    pub fn note(self) -> &'static str {
        match self {
            Target::Unlit => {
                "open the file as it is: its colours are radiance times 2^exposure_ev, in sRGB"
            }
            Target::Three => {
                "material.lightMap = texture of userData.lightmap.image with channel = 1 and flipY = \
                 true for .exr (which three.js reads from its last row), false for .hdr and .png; \
                 material.lightMapIntensity = userData.lightmap.scale; for .png also colorSpace = \
                 SRGBColorSpace"
            }
            Target::Bevy => {
                "insert Lightmap { image } (loaded as linear data, .png as sRGB) beside each mesh whose \
                 material names it in its extras; StandardMaterial::lightmap_exposure = scale over the \
                 exposure of the camera"
            }
            Target::Blender => {
                "in each material: image (color space Linear for .exr and .hdr) with the UV map of \
                 TEXCOORD_1 (the second one), times scale, times base color, to Emission"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Each program's own rule, applied to what it gets, gives radiance rho H / pi.
    #[test]
    fn no_factor_of_pi_is_lost() {
        let (rho, irradiance) = (0.6, 2.5);
        for target in [Target::Three, Target::Bevy, Target::Blender] {
            let texel = target.of_irradiance().unwrap() * irradiance;
            let shown = match target {
                Target::Three => texel * rho / PI,
                _ => texel * rho,
            };
            assert!((shown - rho * irradiance / PI).abs() < 1e-15, "{target:?}");
        }
    }
}
