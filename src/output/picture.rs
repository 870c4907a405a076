//! A picture, and the choice of its file format by the name of the file.

use std::path::Path;

use crate::error::{Error, Result};
use crate::output::camera_matrices::CameraMatrices;
use crate::output::{atomic, exr_file, hdr_file, png_file};

/// What the pixels measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Radiance towards the eye, W/(m^2 sr): radiosity / pi.
    Radiance,
    /// Irradiance, W/m^2.
    Irradiance,
    /// Irradiance / pi: the radiance of a white surface, W/(m^2 sr).
    IrradianceOverPi,
    /// Radiosity, W/m^2.
    Radiosity,
    /// Error of the irradiance relative to its mean over the surface.
    RelativeError,
}

impl Quantity {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Radiance => "radiance",
            Quantity::Irradiance => "irradiance",
            Quantity::IrradianceOverPi => "irradiance/pi",
            Quantity::Radiosity => "radiosity",
            Quantity::RelativeError => "relative error of irradiance",
        }
    }

    /// Its unit in files.
    pub fn unit(self) -> &'static str {
        match self {
            Quantity::Radiance | Quantity::IrradianceOverPi => "W/(m^2 sr)",
            Quantity::Irradiance | Quantity::Radiosity => "W/m^2",
            Quantity::RelativeError => "1",
        }
    }
}

/// A picture in linear colours of the sRGB primaries.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear R, G, B, row by row from the top left.
    pub pixels: Vec<[f32; 3]>,
    /// What the pixels measure.
    pub quantity: Quantity,
    /// What the picture was made from and with: names and values, written into the file.
    pub metadata: Vec<(String, String)>,
    /// Where the picture was seen from, where that makes sense.
    pub camera: Option<CameraMatrices>,
}

/// How a picture is turned into values for a screen. Only PNG files are: EXR and HDR files keep
/// the linear values as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureOptions {
    /// Values are multiplied by 2 to this power.
    pub exposure_ev: f64,
    /// Bits a channel: 8 or 16.
    pub png_bits: u8,
}

impl Default for PictureOptions {
    fn default() -> Self {
        PictureOptions { exposure_ev: 0.0, png_bits: 8 }
    }
}

/// A file format for pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// OpenEXR, linear f32.
    Exr,
    /// PNG, sRGB.
    Png,
    /// Radiance RGBE, linear with 8 bits of mantissa.
    Hdr,
}

impl PictureFormat {
    /// The format that a file name asks for by its extension, in any case.
    pub fn of(path: &Path) -> Result<PictureFormat> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(PictureFormat::Exr),
            Some("png") => Ok(PictureFormat::Png),
            Some("hdr") => Ok(PictureFormat::Hdr),
            _ => Err(Error::Usage(format!(
                "{}: the name of a picture must end in .exr (linear, f32), .png (sRGB) or .hdr \
                 (linear, 8-bit mantissa)",
                path.display()
            ))),
        }
    }
}

/// Encodes a picture as a file of `format`.
pub fn encode(
    picture: &Picture,
    format: PictureFormat,
    options: &PictureOptions,
) -> Result<Vec<u8>> {
    let Picture { width, height, ref pixels, .. } = *picture;
    if width == 0 || height == 0 || pixels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(Error::Runtime(format!(
            "a picture of {width} x {height} cannot be made of {} pixels",
            pixels.len()
        )));
    }
    match format {
        PictureFormat::Exr => exr_file::encode(picture),
        PictureFormat::Png => png_file::encode(picture, options),
        PictureFormat::Hdr => hdr_file::encode(picture),
    }
}

/// Writes a picture, whole or not at all, in the format that the name asks for.
pub fn write_picture(path: &Path, picture: &Picture, options: &PictureOptions) -> Result<()> {
    let format = PictureFormat::of(path)?;
    atomic::write_whole(path, &encode(picture, format, options)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_decides_in_any_case() {
        assert_eq!(PictureFormat::of(Path::new("a.EXR")).unwrap(), PictureFormat::Exr);
        assert_eq!(PictureFormat::of(Path::new("b.c/a.png")).unwrap(), PictureFormat::Png);
        assert_eq!(PictureFormat::of(Path::new("a.exr.hdr")).unwrap(), PictureFormat::Hdr);
        for name in ["a.jpg", "a", "exr", ".png"] {
            let failure = PictureFormat::of(Path::new(name)).unwrap_err();
            assert_eq!(failure.exit_code(), 2);
            let message = failure.to_string();
            assert!([".exr", ".png", ".hdr"].iter().all(|e| message.contains(e)), "{message}");
        }
    }

    #[test]
    fn a_picture_with_too_few_pixels_is_an_error_not_a_panic() {
        let picture = Picture {
            width: 4,
            height: 4,
            pixels: vec![[0.0; 3]; 15],
            quantity: Quantity::Radiance,
            metadata: vec![],
            camera: None,
        };
        for format in [PictureFormat::Exr, PictureFormat::Png, PictureFormat::Hdr] {
            assert!(encode(&picture, format, &PictureOptions::default()).is_err());
        }
    }
}
