//! Radiance pictures (`.hdr`, RGBE): three 8-bit mantissas that share one exponent.
//!
//! A pixel is c = m 2^(e-136) with m in 0..=255 and the largest m at least 128, so an error of at
//! most 1/256 of the pixel's *largest* channel. The encoder of the `image` crate truncates the
//! mantissa, which darkens every picture by half a level on average (0.2 to 0.4 %); values are
//! therefore rounded to representable ones first, which truncation then leaves as they are.
//! (Readers that follow Radiance itself add half a level: for these the error is that half.)
//!
//! NaN and negative values become 0; values too large or too small for the exponent become the
//! largest one and 0.

use image::Rgb;
use image::codecs::hdr::HdrEncoder;

use crate::error::{Error, Result};
use crate::output::SOFTWARE;
use crate::output::picture::Picture;

/// Largest representable value: mantissa 255 and exponent byte 255.
const LARGEST: f64 = 255.0 * (1u128 << 119) as f64;
/// Smallest exponent of two of the largest channel, +1, that has a positive exponent byte.
const LEAST_EXPONENT: i32 = -127;

/// Encodes a picture whose pixel count fits its size.
pub fn encode(picture: &Picture) -> Result<Vec<u8>> {
    let failed = |what: &str| Error::Runtime(format!("HDR: {what}"));
    let pixels: Vec<Rgb<f32>> = picture.pixels.iter().map(|&p| Rgb(representable(p))).collect();
    let mut encoded = Vec::new();
    HdrEncoder::new(&mut encoded)
        .encode(&pixels, picture.width as usize, picture.height as usize)
        .map_err(|e| failed(&e.to_string()))?;
    drop(pixels);

    // The encoder writes no variables of ours: put them behind its first line.
    let first = encoded.iter().position(|&b| b == b'\n').ok_or_else(|| failed("no header"))? + 1;
    let mut bytes = Vec::with_capacity(encoded.len() + 1024);
    bytes.extend_from_slice(&encoded[..first]);
    bytes.extend_from_slice(format!("SOFTWARE={SOFTWARE}\n").as_bytes());
    let fixed = [("quantity", picture.quantity.name()), ("unit", picture.quantity.unit())];
    let settings = picture.metadata.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    for (name, value) in fixed.into_iter().chain(settings) {
        let line = format!("{name}: {value}").replace(|c: char| c.is_control(), " ");
        bytes.extend_from_slice(format!("# {line}\n").as_bytes());
    }
    bytes.extend_from_slice(&encoded[first..]);
    Ok(bytes)
}

/// The nearest colour that RGBE holds exactly.
fn representable(pixel: [f32; 3]) -> [f32; 3] {
    let limited = |c: f64| if c > 0.0 { c.min(LARGEST) } else { 0.0 };
    let pixel = pixel.map(|c| limited(f64::from(c)));
    let largest = pixel[0].max(pixel[1]).max(pixel[2]);
    if largest < f64::MIN_POSITIVE {
        return [0.0; 3];
    }
    // largest = fraction 2^exponent with fraction in [1/2, 1); the bits of a normal f64 hold it.
    let exponent = ((largest.to_bits() >> 52) & 0x7ff) as i32 - 1022;
    if exponent < LEAST_EXPONENT {
        return [0.0; 3];
    }
    let mut level = f64::from(exponent - 8).exp2();
    // A mantissa rounded up to 256 is 128 with the next exponent, whose levels hold for all three.
    if (largest / level).round() == 256.0 {
        level *= 2.0;
    }
    pixel.map(|c| ((c / level).round() * level) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_to_the_nearest_level_of_the_largest_channel() {
        assert_eq!(representable([1.0, 0.5, 0.25]), [1.0, 0.5, 0.25]);
        // Largest in [1/2, 1): levels of 1/256.
        assert_eq!(representable([0.75, 0.6 / 256.0, 0.4 / 256.0]), [0.75, 1.0 / 256.0, 0.0]);
        // Rounding up to the next power of two.
        assert_eq!(representable([0.999, 0.0, 0.0]), [1.0, 0.0, 0.0]);
        // The other channels then have the coarser levels as well, here of 1/128.
        assert_eq!(representable([0.999, 3.2 / 256.0, 0.9 / 256.0]), [1.0, 2.0 / 128.0, 0.0]);
    }

    #[test]
    fn values_that_the_format_cannot_hold_are_limited() {
        assert_eq!(representable([f32::NAN, -1.0, 0.0]), [0.0; 3]);
        assert_eq!(representable([1e-45, 0.0, 0.0]), [0.0; 3]);
        let top = representable([f32::INFINITY, f32::MAX, 1.0]);
        assert_eq!(top, [LARGEST as f32, LARGEST as f32, 0.0]);
    }
}
