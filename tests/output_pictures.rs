//! Pictures written and read back by other readers than the writers.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::*;
use glam::DVec3;
use image::ImageDecoder;
use lumel::output::camera_matrices::CameraMatrices;
use lumel::output::picture::{
    Picture, PictureFormat, PictureOptions, Quantity, encode, write_picture,
};
use lumel::output::png_file::srgb_from_linear;
use lumel::scene::{Camera, Projection};

const WIDTH: u32 = 37;
const HEIGHT: u32 = 21;

/// Smooth values over many magnitudes, another one in each channel and pixel.
fn picture() -> Picture {
    let pixels = (0..HEIGHT)
        .flat_map(|y| (0..WIDTH).map(move |x| (x as f32, y as f32)))
        .map(|(x, y)| [0.01 + x / 40.0, (y / 7.0).exp2() - 1.0, (x - y).exp() * 1e-6])
        .collect();
    let camera = Camera {
        name: "c".into(),
        eye: DVec3::new(1.0, 2.0, 3.0),
        right: DVec3::X,
        up: DVec3::Y,
        forward: DVec3::NEG_Z,
        projection: Projection::Perspective { vertical_fov: 0.8, aspect: None },
    };
    let settings = ["scene", "basis", "max-edge", "residual", "two-sided", "reflectance"];
    Picture {
        width: WIDTH,
        height: HEIGHT,
        pixels,
        quantity: Quantity::Radiance,
        metadata: settings.map(|name| (name.into(), format!("value of {name}"))).into(),
        camera: Some(CameraMatrices::of(&camera, f64::from(WIDTH) / f64::from(HEIGHT))),
    }
}

fn bytes(picture: &Picture, format: PictureFormat) -> Vec<u8> {
    encode(picture, format, &PictureOptions::default()).unwrap()
}

#[test]
fn exr_keeps_every_bit_and_says_what_it_is() {
    let mut picture = picture();
    picture.pixels[5] = [f32::NAN, f32::INFINITY, -1.5];
    picture.metadata.push(("name".into(), "Küche \u{2126}".into()));
    let file = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| vec![[0f32; 3]; size.area()],
            |pixels, at, (r, g, b): (f32, f32, f32)| {
                pixels[at.y() * WIDTH as usize + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes(&picture, PictureFormat::Exr)))
        .unwrap();
    let layer = &file.layer_data;
    assert_eq!((layer.size.x() as u32, layer.size.y() as u32), (WIDTH, HEIGHT));
    let bits = |pixels: &[[f32; 3]]| -> Vec<u32> {
        pixels.iter().flatten().map(|v| v.to_bits()).collect()
    };
    assert_eq!(bits(&layer.channel_data.pixels), bits(&picture.pixels));

    let attributes = &layer.attributes;
    let camera = picture.camera.unwrap();
    assert_eq!(attributes.world_to_camera, Some(camera.world_to_camera));
    assert_eq!(attributes.world_to_normalized_device, Some(camera.world_to_ndc));
    assert!(attributes.software_name.as_ref().unwrap().to_string().starts_with("lumel "));
    assert!(file.attributes.chromaticities.is_some());
    let other = |name: &str| match attributes.other.get(&Text::from(name)) {
        Some(AttributeValue::Text(value)) => String::from_utf8(value.bytes().to_vec()).unwrap(),
        found => panic!("{name}: {found:?}"),
    };
    assert_eq!(other("lumel:quantity"), "radiance");
    assert_eq!(other("lumel:unit"), "W/(m^2 sr)");
    assert_eq!(other("lumel:basis"), "value of basis");
    assert_eq!(other("lumel:name"), "Küche \u{2126}");
}

#[test]
fn the_same_picture_gives_the_same_bytes() {
    // The maps that the EXR library keeps attributes in have another order each time.
    for format in [PictureFormat::Exr, PictureFormat::Png, PictureFormat::Hdr] {
        let first = bytes(&picture(), format);
        for _ in 0..20 {
            assert!(first == bytes(&picture(), format), "{format:?}");
        }
    }
}

fn read_png(bytes: Vec<u8>) -> (png::Info<'static>, Vec<u8>) {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut data).unwrap();
    data.truncate(frame.buffer_size());
    (reader.info().clone(), data)
}

#[test]
fn png_is_srgb_within_half_a_level_with_exposure_and_text() {
    let mut picture = picture();
    picture.metadata.push(("camera".into(), "\u{2126}".into()));
    let options = PictureOptions { exposure_ev: -1.5, png_bits: 8 };
    let (info, data) = read_png(encode(&picture, PictureFormat::Png, &options).unwrap());
    assert_eq!((info.width, info.height), (WIDTH, HEIGHT));
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    assert!(info.srgb.is_some());
    let text = |key: &str| {
        info.uncompressed_latin1_text.iter().find(|t| t.keyword == key).unwrap().text.clone()
    };
    assert!(text("Software").starts_with("lumel "));
    assert_eq!(text("Quantity"), "radiance");
    assert_eq!(text("Exposure"), "-1.5 EV");
    assert_eq!(text("basis"), "value of basis");
    assert_eq!(info.utf8_text[0].keyword, "camera");
    for (&linear, &level) in picture.pixels.iter().flatten().zip(&data) {
        let c = (f64::from(linear) * (-1.5f64).exp2()).clamp(0.0, 1.0);
        assert!((srgb_from_linear(c) * 255.0 - f64::from(level)).abs() <= 0.5 + 1e-9);
    }
}

#[test]
fn png_of_16_bits_is_big_endian_and_as_fine() {
    let picture = picture();
    let options = PictureOptions { exposure_ev: 0.0, png_bits: 16 };
    let (info, data) = read_png(encode(&picture, PictureFormat::Png, &options).unwrap());
    assert_eq!(info.bit_depth, png::BitDepth::Sixteen);
    for (&linear, level) in picture.pixels.iter().flatten().zip(data.chunks_exact(2)) {
        let level = f64::from(u16::from_be_bytes([level[0], level[1]]));
        let c = f64::from(linear).clamp(0.0, 1.0);
        assert!((srgb_from_linear(c) * 65535.0 - level).abs() <= 0.5 + 1e-9);
    }
}

#[test]
fn png_turns_what_is_no_light_into_black_and_too_much_into_white() {
    let mut picture = picture();
    picture.pixels[0] = [f32::NAN, -3.0, f32::NEG_INFINITY];
    picture.pixels[1] = [f32::INFINITY, f32::MAX, 1.0];
    let (_, data) = read_png(bytes(&picture, PictureFormat::Png));
    assert_eq!(data[..6], [0, 0, 0, 255, 255, 255]);
    let odd = PictureOptions { exposure_ev: 0.0, png_bits: 12 };
    assert_eq!(encode(&picture, PictureFormat::Png, &odd).unwrap_err().exit_code(), 2);
}

#[test]
fn hdr_is_within_half_a_level_of_the_largest_channel() {
    // Narrower than 8 pixels the format has no run lengths: both kinds of file.
    for width in [WIDTH, 7] {
        let mut picture = picture();
        picture.width = width;
        picture.pixels.truncate((width * HEIGHT) as usize);
        let decoder =
            image::codecs::hdr::HdrDecoder::new(Cursor::new(bytes(&picture, PictureFormat::Hdr)))
                .unwrap();
        assert_eq!(decoder.dimensions(), (width, HEIGHT));
        let header = decoder.metadata().custom_attributes;
        assert!(header.iter().any(|(k, v)| k == "SOFTWARE" && v.starts_with("lumel ")));
        let mut data = vec![0; decoder.total_bytes() as usize];
        decoder.read_image(&mut data).unwrap();
        let values: Vec<f32> =
            data.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap())).collect();
        let mut bias = 0.0;
        for (want, got) in picture.pixels.iter().zip(values.chunks_exact(3)) {
            let largest = want.iter().fold(0f32, |a, &b| a.max(b));
            for (want, got) in want.iter().zip(got) {
                assert!((want - got).abs() <= largest / 256.0, "{want} {got}");
                bias += (got - want) / largest;
            }
        }
        // Truncation would give about -1/384.
        assert!((bias / values.len() as f32).abs() < 5e-4, "bias {bias}");
    }
}

#[test]
fn hdr_settings_stand_in_the_header_a_line_each() {
    let mut picture = picture();
    picture.metadata = vec![("name".into(), "two\nlines".into())];
    let file = bytes(&picture, PictureFormat::Hdr);
    assert!(file.starts_with(b"#?RADIANCE\n"));
    let text = String::from_utf8_lossy(&file[..300.min(file.len())]).into_owned();
    assert!(text.contains("\n# name: two lines\n"), "{text}");
    assert!(text.contains("\n# quantity: radiance\n"), "{text}");
}

#[test]
fn an_old_picture_is_unharmed_when_the_new_one_cannot_be_made() {
    let room = tempfile::tempdir().unwrap();
    let path = room.path().join("view.exr");
    std::fs::write(&path, b"old").unwrap();
    let mut broken = picture();
    broken.pixels.pop();
    assert!(write_picture(&path, &broken, &PictureOptions::default()).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    write_picture(&path, &picture(), &PictureOptions::default()).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes(&picture(), PictureFormat::Exr));
    let wrong = write_picture(Path::new("view.bmp"), &picture(), &PictureOptions::default());
    assert_eq!(wrong.unwrap_err().exit_code(), 2);
}
