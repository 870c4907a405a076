//! PNG pictures: 8 or 16 bits a channel in sRGB, with the settings as text.
//!
//! A linear value c is multiplied by 2^EV, limited to [0, 1] (NaN becomes 0), encoded by the
//! transfer function of IEC 61966-2-1
//!
//! ```text
//!     12.92 c                      c <= 0.0031308
//!     1.055 c^(1/2.4) - 0.055      otherwise
//! ```
//!
//! and rounded to the nearest of the 256 or 65536 levels. No dithering and no tone mapping: a
//! level can be turned back into light. The chunks `sRGB` (with its `gAMA` and `cHRM` stand-ins)
//! and `tEXt` (`iTXt` for text outside Latin-1) say so to other programs.

use crate::error::{Error, Result};
use crate::output::SOFTWARE;
use crate::output::picture::{Picture, PictureOptions};

/// Longest keyword of a text chunk, bytes (PNG specification, 11.3.3.2).
const LONGEST_KEYWORD: usize = 79;

/// The sRGB transfer function: linear [0, 1] to encoded [0, 1].
pub fn srgb_from_linear(c: f64) -> f64 {
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// Encodes a picture whose pixel count fits its size.
pub fn encode(picture: &Picture, options: &PictureOptions) -> Result<Vec<u8>> {
    let levels = match options.png_bits {
        8 => 255.0,
        16 => 65535.0,
        other => {
            return Err(Error::Usage(format!(
                "a PNG picture has 8 or 16 bits a channel, not {other}"
            )));
        }
    };
    let factor = options.exposure_ev.exp2();
    let level = |linear: f32| {
        let c = f64::from(linear) * factor;
        let limited = if c > 0.0 { c.min(1.0) } else { 0.0 };
        (srgb_from_linear(limited) * levels).round() as u16
    };
    let values = picture.pixels.iter().flatten().map(|&c| level(c));
    let (depth, data): (_, Vec<u8>) = if options.png_bits == 8 {
        (png::BitDepth::Eight, values.map(|v| v as u8).collect())
    } else {
        (png::BitDepth::Sixteen, values.flat_map(u16::to_be_bytes).collect())
    };
    write(picture, options, depth, &data).map_err(|e| Error::Runtime(format!("PNG: {e}")))
}

fn write(
    picture: &Picture,
    options: &PictureOptions,
    depth: png::BitDepth,
    data: &[u8],
) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(depth);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let exposure = format!("{} EV", options.exposure_ev);
    let fixed =
        [("Software", SOFTWARE), ("Quantity", picture.quantity.name()), ("Exposure", &exposure)];
    let settings = picture.metadata.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    for (name, value) in fixed.into_iter().chain(settings) {
        let value = value.replace('\0', "");
        let is_latin = value.chars().all(|c| u32::from(c) < 256);
        if is_latin {
            encoder.add_text_chunk(keyword(name), value)?;
        } else {
            encoder.add_itxt_chunk(keyword(name), value)?;
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(data)?;
    writer.finish()?;
    Ok(bytes)
}

/// A keyword that PNG allows: 1 to 79 printable ASCII characters, no spaces at the ends.
fn keyword(name: &str) -> String {
    let printable = name.chars().map(|c| if c == ' ' || c.is_ascii_graphic() { c } else { '_' });
    let word: String = printable.take(LONGEST_KEYWORD).collect();
    match word.trim() {
        "" => "Comment".into(),
        trimmed => trimmed.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transfer_function_has_its_known_values() {
        // The two pieces meet at the knee, and middle grey is where it is known to be.
        assert_eq!(srgb_from_linear(0.0), 0.0);
        assert!((srgb_from_linear(1.0) - 1.0).abs() < 1e-15);
        assert!((srgb_from_linear(0.18) - 0.461_356_129_5).abs() < 1e-9);
        assert!((srgb_from_linear(0.5) - 0.735_356_983_1).abs() < 1e-9);
        assert!((srgb_from_linear(0.003_130_8) - 0.040_449_936).abs() < 1e-12);
        assert!((srgb_from_linear(0.003_130_800_1) - 0.040_449_936).abs() < 1e-6);
    }

    #[test]
    fn keywords_are_made_valid() {
        assert_eq!(keyword("max edge"), "max edge");
        assert_eq!(keyword(" a\tb\u{e9} "), "a_b_");
        assert_eq!(keyword(""), "Comment");
        assert_eq!(keyword(&"x".repeat(200)).len(), 79);
    }
}
