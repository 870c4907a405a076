//! Values on the command line: text to numbers, sizes and vectors.
//!
//! Each message says what is expected, with an example; clap adds what was typed and where.

use std::num::NonZeroUsize;

use glam::DVec3;

/// Largest width or height of a picture, pixels: what every format holds and most viewers show.
const LARGEST_SIDE: u32 = 32_768;

/// Most levels of uniform refinement: 4^15 is a thousand million elements for each face.
const MOST_LEVELS: u32 = 15;

/// Most threads: more than the processors of any machine, and few enough that a mistyped number
/// does not stop it.
const MOST_THREADS: usize = 1024;

/// A limit of memory, as typed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MemorySize {
    /// This many bytes.
    Bytes(u64),
    /// This share of the memory that the process may use, in (0, 1].
    Share(f64),
}

/// A finite number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    match number(text)? {
        v if v > 0.0 => Ok(v),
        _ => Err("expected a number above 0, such as 0.25".into()),
    }
}

/// A finite number, zero or above.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match number(text)? {
        v if v >= 0.0 => Ok(v),
        _ => Err("expected a number of at least 0, such as 2.5".into()),
    }
}

/// A relative error: a number, or a percentage.
pub fn tolerance(text: &str) -> Result<f64, String> {
    let expected = "expected an error between 0 and 100 %, such as 1% or 0.01";
    let (digits, unit) = match text.trim_end().strip_suffix('%') {
        Some(digits) => (digits.trim_end(), 0.01),
        None => (text, 1.0),
    };
    match number(digits).map_err(|_| expected)? * unit {
        v if v > 0.0 && v < 1.0 => Ok(v),
        _ => Err(expected.into()),
    }
}

/// A relative residual.
pub fn residual(text: &str) -> Result<f64, String> {
    match number(text)? {
        v if v > 0.0 && v < 1.0 => Ok(v),
        _ => Err("expected a relative residual between 0 and 1, such as 1e-8".into()),
    }
}

/// A field of view in degrees.
pub fn field_of_view(text: &str) -> Result<f64, String> {
    match number(text)? {
        v if v > 0.0 && v < 180.0 => Ok(v),
        _ => Err("expected an angle between 0 and 180 degrees, such as 45".into()),
    }
}

/// An exposure in stops.
pub fn exposure(text: &str) -> Result<f64, String> {
    match number(text)? {
        v if v.abs() <= 100.0 => Ok(v),
        _ => Err("expected stops between -100 and 100, such as 1.5 or -2".into()),
    }
}

/// A number of threads.
pub fn threads(text: &str) -> Result<NonZeroUsize, String> {
    match text.trim().parse::<NonZeroUsize>() {
        Ok(v) if v.get() <= MOST_THREADS => Ok(v),
        _ => Err(format!("expected a number of threads from 1 to {MOST_THREADS}, such as 4")),
    }
}

/// Levels of uniform refinement.
pub fn levels(text: &str) -> Result<u32, String> {
    match text.trim().parse() {
        Ok(v) if v <= MOST_LEVELS => Ok(v),
        _ => Err(format!(
            "expected a whole number from 0 to {MOST_LEVELS}, such as 3: each level makes four \
             elements of one"
        )),
    }
}

/// A picture's width and height.
pub fn picture_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| match text.trim().parse() {
        Ok(v) if (1..=LARGEST_SIDE).contains(&v) => Some(v),
        _ => None,
    };
    text.split_once(['x', 'X', '×'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| {
            format!("expected WIDTHxHEIGHT, each from 1 to {LARGEST_SIDE} pixels, such as 960x540")
        })
}

/// Three numbers.
pub fn vector(text: &str) -> Result<DVec3, String> {
    let values: Option<Vec<f64>> = text.split(',').map(|part| number(part).ok()).collect();
    match values.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three numbers with commas and no spaces, such as 1.5,-2,0".into()),
    }
}

/// Three numbers that are not all zero.
pub fn direction(text: &str) -> Result<DVec3, String> {
    match vector(text)? {
        DVec3::ZERO => Err("expected a direction, such as 0,1,0; this one has no length".into()),
        v => Ok(v),
    }
}

/// A name and texels to a metre.
pub fn density(text: &str) -> Result<(String, f64), String> {
    let expected = "expected NAME=N with N texels to a metre, such as 'Floor*=100'";
    match text.rsplit_once('=') {
        Some((name, number)) if !name.is_empty() => {
            positive(number).map(|n| (name.to_string(), n)).map_err(|_| expected.into())
        }
        _ => Err(expected.into()),
    }
}

/// A limit of memory: bytes with a unit, or per cent of what there is.
pub fn memory_size(text: &str) -> Result<MemorySize, String> {
    let teach = || {
        "expected a size with its unit, such as 2GiB, 500MB or 75% (of the memory of this machine)"
            .to_string()
    };
    let text = text.trim();
    let split = text.find(|c: char| c != '.' && !c.is_ascii_digit()).ok_or_else(teach)?;
    let (digits, unit) = text.split_at(split);
    let amount: f64 = digits.parse().map_err(|_| teach())?;
    let bytes = match unit.trim_start().to_ascii_lowercase().as_str() {
        "%" if amount > 0.0 && amount <= 100.0 => return Ok(MemorySize::Share(amount / 100.0)),
        "b" => amount,
        "kb" => amount * 1e3,
        "mb" => amount * 1e6,
        "gb" => amount * 1e9,
        "tb" => amount * 1e12,
        "k" | "kib" => amount * 1024.0,
        "m" | "mib" => amount * 1024f64.powi(2),
        "g" | "gib" => amount * 1024f64.powi(3),
        "t" | "tib" => amount * 1024f64.powi(4),
        _ => return Err(teach()),
    };
    if bytes >= 1.0 { Ok(MemorySize::Bytes(bytes as u64)) } else { Err(teach()) }
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err("expected a number, such as 0.5 or 1e-3".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_has_decimal_and_binary_units_and_per_cent() {
        assert_eq!(memory_size("2GiB"), Ok(MemorySize::Bytes(2 << 30)));
        assert_eq!(memory_size("500 MB"), Ok(MemorySize::Bytes(500_000_000)));
        assert_eq!(memory_size("1.5k"), Ok(MemorySize::Bytes(1536)));
        assert_eq!(memory_size("75%"), Ok(MemorySize::Share(0.75)));
        for wrong in ["", "2", "GiB", "-1GB", "0MB", "0%", "101%", "2 gigs", "1.2.3MB", "nan%"] {
            assert!(memory_size(wrong).unwrap_err().contains("2GiB"), "{wrong}");
        }
    }

    #[test]
    fn densities_have_a_name_and_a_number() {
        assert_eq!(density("a=b=2.5"), Ok(("a=b".into(), 2.5)));
        for wrong in ["a", "=2", "a=0", "a=x", ""] {
            assert!(density(wrong).unwrap_err().contains("Floor"), "{wrong}");
        }
    }

    #[test]
    fn sizes_of_pictures() {
        assert_eq!(picture_size("960x540"), Ok((960, 540)));
        assert_eq!(picture_size("1X32768"), Ok((1, 32768)));
        for wrong in ["960", "0x5", "5x0", "-1x5", "1x2x3", "32769x1", "axb", ""] {
            assert!(picture_size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn vectors_and_directions() {
        assert_eq!(vector("1,-2.5, 3e1"), Ok(DVec3::new(1.0, -2.5, 30.0)));
        for wrong in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", ""] {
            assert!(vector(wrong).is_err(), "{wrong}");
        }
        assert!(direction("0,0,-0").is_err());
        assert!(direction("0,0,1e-9").is_ok());
    }

    #[test]
    fn numbers_stay_in_their_ranges() {
        assert_eq!(positive("1e-3"), Ok(1e-3));
        assert!(positive("0").is_err() && positive("-1").is_err() && positive("nan").is_err());
        assert_eq!(not_negative("0"), Ok(0.0));
        assert!(not_negative("-0.1").is_err() && not_negative("inf").is_err());
        assert_eq!(residual("1e-8"), Ok(1e-8));
        assert!(residual("1").is_err() && residual("0").is_err());
        assert!(field_of_view("180").is_err() && field_of_view("39.6").is_ok());
        assert_eq!(threads("1024").map(usize::from), Ok(1024));
        assert!(threads("0").is_err() && threads("1025").is_err() && threads("-1").is_err());
        assert_eq!(exposure("-2"), Ok(-2.0));
        assert!(exposure("1e3").is_err());
        assert_eq!(levels("15"), Ok(15));
        assert!(levels("16").is_err() && levels("1.5").is_err() && levels("-1").is_err());
    }
}
