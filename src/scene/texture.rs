//! Decoded images, their pyramids of averages, and how materials use them.
//!
//! Texels are linear. The pyramid halves each side, rounding down, until one texel is left; each
//! coarser texel is the exact mean of the (possibly fractional) rectangle below it, so every level
//! has the mean of the whole image. It costs a third of the image's memory.

use std::io::Cursor;

use glam::{DVec2, DVec3};
use image::{DynamicImage, ImageFormat, ImageReader};

use super::limits::{MAX_IMAGE_SIDE, MAX_IMAGE_TEXELS};

/// A decoded image.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its name or file name in the scene file.
    pub name: String,
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// Linear R, G, B, row by row from the top left corner, which has the coordinates (0, 0).
    pub texels: Vec<[f32; 3]>,
    /// Ever coarser averages, halved from level to level.
    coarser: Vec<Level>,
}

/// One coarser image of the pyramid.
#[derive(Clone, Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Vec<[f32; 3]>,
}

/// What lies beyond the edge of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored.
    Mirror,
    /// The texels of the edge.
    Clamp,
}

/// How a material uses a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureUse {
    /// Index into [`super::Scene::textures`].
    pub texture: usize,
    /// Which set of [`super::Triangle::uv`], 0 or 1.
    pub set: usize,
    /// Rows of the affine map from a triangle's coordinates to the image's:
    /// u' = m\[0\]\[0\] u + m\[0\]\[1\] v + m\[0\]\[2\], and v' with m\[1\].
    pub transform: [[f64; 3]; 2],
    /// What lies beyond the left and right edges, and beyond the top and bottom ones.
    pub wrap: [Wrap; 2],
    /// Texels are squares of one colour rather than points to interpolate between.
    pub nearest: bool,
}

impl TextureUse {
    /// A texture used as it is: set 0, repeated, interpolated.
    pub fn plain(texture: usize) -> Self {
        TextureUse {
            texture,
            set: 0,
            transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        }
    }

    /// The image's coordinates for a triangle's.
    pub fn apply(&self, uv: DVec2) -> DVec2 {
        let row = |m: [f64; 3]| m[0] * uv.x + m[1] * uv.y + m[2];
        DVec2::new(row(self.transform[0]), row(self.transform[1]))
    }
}

impl Texture {
    /// A texture of given linear texels, row by row from the top left.
    ///
    /// # Panics
    ///
    /// If there are not `width * height` texels, or none.
    pub fn new(name: impl Into<String>, width: u32, height: u32, texels: Vec<[f32; 3]>) -> Self {
        assert!(!texels.is_empty() && texels.len() == width as usize * height as usize);
        let mut texture = Texture { name: name.into(), width, height, texels, coarser: vec![] };
        let (mut w, mut h) = (width, height);
        while w > 1 || h > 1 {
            let fine = texture.coarser.last().map_or(&texture.texels, |l| &l.texels);
            let level = halve(fine, w, h);
            (w, h) = (level.width, level.height);
            texture.coarser.push(level);
        }
        texture
    }

    /// Levels of the pyramid, the image itself included.
    pub(crate) fn levels(&self) -> usize {
        1 + self.coarser.len()
    }

    /// The value at image coordinates `uv` on a level (0 is the image itself; past the last one
    /// means the last): bilinear between texel centres, or the texel itself if `nearest`.
    pub(crate) fn sample(&self, uv: DVec2, level: usize, wrap: [Wrap; 2], nearest: bool) -> DVec3 {
        let (width, height, texels) = match level.min(self.coarser.len()) {
            0 => (self.width, self.height, &self.texels),
            l => {
                let l = &self.coarser[l - 1];
                (l.width, l.height, &l.texels)
            }
        };
        let texel = |x: i64, y: i64| {
            let x = wrapped(x, width, wrap[0]);
            let y = wrapped(y, height, wrap[1]);
            DVec3::from(texels[y * width as usize + x].map(f64::from))
        };
        let x = reduced(uv.x, wrap[0]) * f64::from(width);
        let y = reduced(uv.y, wrap[1]) * f64::from(height);
        if nearest {
            return texel(x.floor() as i64, y.floor() as i64);
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (i, j) = (x0 as i64, y0 as i64);
        let top = texel(i, j) * (1.0 - fx) + texel(i + 1, j) * fx;
        let bottom = texel(i, j + 1) * (1.0 - fx) + texel(i + 1, j + 1) * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

/// A coordinate without the whole periods, so that its texel number is small.
fn reduced(u: f64, wrap: Wrap) -> f64 {
    match wrap {
        Wrap::Repeat => u - u.floor(),
        Wrap::Mirror => u - 2.0 * (0.5 * u).floor(),
        Wrap::Clamp => u.clamp(-1.0, 2.0),
    }
}

/// The texel number inside the image that stands for one outside.
fn wrapped(i: i64, size: u32, wrap: Wrap) -> usize {
    let n = i64::from(size);
    let inside = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let k = i.rem_euclid(2 * n);
            k.min(2 * n - 1 - k)
        }
        Wrap::Clamp => i.clamp(0, n - 1),
    };
    inside as usize
}

/// The next coarser level, by exact means.
fn halve(fine: &[[f32; 3]], width: u32, height: u32) -> Level {
    let (w, h) = ((width / 2).max(1), (height / 2).max(1));
    let mut texels = Vec::with_capacity(w as usize * h as usize);
    for y in 0..h {
        for x in 0..w {
            let mut sum = DVec3::ZERO;
            for (j, wy) in shares(y, h, height) {
                for (i, wx) in shares(x, w, width) {
                    let t = fine[j * width as usize + i];
                    sum += DVec3::from(t.map(f64::from)) * (wx * wy);
                }
            }
            texels.push(sum.to_array().map(|c| c as f32));
        }
    }
    Level { width: w, height: h, texels }
}

/// The fine texels that coarse texel `i` of `n` covers, of `fine` in all, and their shares of it.
fn shares(i: u32, n: u32, fine: u32) -> impl Iterator<Item = (usize, f64)> {
    // In units of 1/n of a fine texel everything is a whole number.
    let (i, n, fine) = (u64::from(i), u64::from(n), u64::from(fine));
    let (start, end) = (i * fine, (i + 1) * fine);
    (start / n..end.div_ceil(n)).map(move |k| {
        let overlap = end.min((k + 1) * n) - start.max(k * n);
        (k as usize, overlap as f64 / fine as f64)
    })
}

/// How the numbers in an image file are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Encoding {
    /// Colours, encoded with the sRGB transfer function (unless the file holds floats).
    Srgb,
    /// Plain numbers.
    Linear,
}

/// Why an image was not decoded.
#[derive(Debug)]
pub(crate) enum DecodeError {
    /// The bytes are no valid image.
    Invalid(String),
    /// A kind or a size of image that is not read.
    Unsupported(String),
}

/// Width and height of an image, checked against the limits, without decoding it.
pub(crate) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), DecodeError> {
    let (width, height) = reader(bytes)?.into_dimensions().map_err(invalid)?;
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 {
        return Err(DecodeError::Invalid("the image is empty".into()));
    }
    if width > MAX_IMAGE_SIDE || height > MAX_IMAGE_SIDE || texels > MAX_IMAGE_TEXELS {
        return Err(DecodeError::Unsupported(format!(
            "an image of {width} x {height} texels is too large; scale it down to at most \
             {MAX_IMAGE_SIDE} a side and {MAX_IMAGE_TEXELS} in all"
        )));
    }
    Ok((width, height))
}

/// Decodes a PNG, JPEG or HDR image.
pub(crate) fn decode(bytes: &[u8], name: &str, encoding: Encoding) -> Result<Texture, DecodeError> {
    let (width, height) = dimensions(bytes)?;
    let reader = reader(bytes)?;
    if reader.format() == Some(ImageFormat::Jpeg) && !jpeg_is_whole(bytes) {
        return Err(DecodeError::Invalid("the JPEG file is cut off; export it again".into()));
    }
    let image = reader.decode().map_err(invalid)?;
    if (image.width(), image.height()) != (width, height) {
        return Err(DecodeError::Invalid("the image's size contradicts its header".into()));
    }
    let floats = matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let mut texels: Vec<[f32; 3]> = match image {
        // Eight bits have few values: the exact transfer function of each is tabulated.
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => {
            let table: Vec<f32> =
                (0..=255u8).map(|v| linear(f64::from(v) / 255.0, encoding) as f32).collect();
            let texel = |p: &image::Rgb<u8>| p.0.map(|v| table[usize::from(v)]);
            image.into_rgb8().pixels().map(texel).collect()
        }
        other => {
            let encoding = if floats { Encoding::Linear } else { encoding };
            let texel = |p: &image::Rgb<f32>| p.0.map(|v| linear(f64::from(v), encoding) as f32);
            other.into_rgb32f().pixels().map(texel).collect()
        }
    };
    if floats {
        let usable = |c: f32| c.is_finite() && c >= 0.0;
        if !texels.iter().flatten().all(|&c| usable(c)) {
            return Err(DecodeError::Invalid("a texel is negative or not finite".into()));
        }
    }
    texels.shrink_to_fit();
    Ok(Texture::new(name, width, height, texels))
}

fn invalid(error: image::ImageError) -> DecodeError {
    DecodeError::Invalid(format!("the image cannot be decoded: {error}"))
}

fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>, DecodeError> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| DecodeError::Invalid(e.to_string()))?;
    match reader.format() {
        Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Hdr) => {}
        _ => {
            return Err(DecodeError::Unsupported(
                "images are read from PNG, JPEG and HDR data; convert it to one of these".into(),
            ));
        }
    }
    let mut limits = image::Limits::default();
    // The largest image accepted, four 16-bit channels, and as much again for the decoder.
    limits.max_alloc = Some(MAX_IMAGE_TEXELS * 16);
    reader.limits(limits);
    Ok(reader)
}

/// Whether the last scan of a JPEG file has its end marker. Decoders fill what is missing with
/// grey. In a scan every byte FF is followed by 00 or a restart marker, so the search is exact.
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    let last = |marker: u8| bytes.windows(2).rposition(|w| w == [0xff, marker]);
    matches!((last(0xda), last(0xd9)), (Some(scan), Some(end)) if end > scan)
}

/// The linear value of an encoded one in [0, 1] (IEC 61966-2-1).
fn linear(v: f64, encoding: Encoding) -> f64 {
    match encoding {
        Encoding::Linear => v,
        Encoding::Srgb if v <= 0.04045 => v / 12.92,
        Encoding::Srgb => ((v + 0.055) / 1.055).powf(2.4),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_the_mean_of_the_image() {
        let texels: Vec<[f32; 3]> =
            (0..7 * 5).map(|i| [i as f32, (i * i % 11) as f32, 1.0]).collect();
        let mean = |t: &[[f32; 3]]| {
            t.iter().map(|t| DVec3::from(t.map(f64::from))).sum::<DVec3>() / t.len() as f64
        };
        let texture = Texture::new("t", 7, 5, texels);
        let want = mean(&texture.texels);
        assert_eq!(texture.levels(), 3);
        for level in &texture.coarser {
            assert!((mean(&level.texels) - want).length() < 1e-5);
        }
    }

    #[test]
    fn texel_numbers_wrap() {
        let all = |wrap| (-4..7).map(|i| wrapped(i, 3, wrap)).collect::<Vec<_>>();
        assert_eq!(all(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(all(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(all(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }

    #[test]
    fn samples_interpolate_between_centres() {
        let texture = Texture::new("t", 2, 1, vec![[0.0; 3], [1.0; 3]]);
        let at = |u, wrap, nearest| texture.sample(DVec2::new(u, 0.3), 0, [wrap; 2], nearest).x;
        assert_eq!(at(0.25, Wrap::Repeat, false), 0.0);
        assert_eq!(at(0.5, Wrap::Repeat, false), 0.5);
        assert_eq!(at(0.0, Wrap::Repeat, false), 0.5);
        assert_eq!(at(0.0, Wrap::Clamp, false), 0.0);
        assert_eq!(at(1.25, Wrap::Mirror, false), 1.0);
        assert_eq!(at(0.49, Wrap::Repeat, true), 0.0);
        assert_eq!(at(-0.01, Wrap::Repeat, true), 1.0);
        assert_eq!(at(1e300, Wrap::Clamp, false), 1.0);
        assert!(at(1e300, Wrap::Repeat, false).is_finite());
    }
}
