//! What the limits make of a result: how long its output may take, and what is said when it is not
//! what was asked for.
//!
//! Until the time limit, meshes are refined; then the best light that was found is written. That
//! takes time too: pictures and lightmaps that are not ready within half of the limit more are made
//! again with fewer pixels, since a coarse one is better than none.

use lumel::monitor::OnProgress;
use lumel::render::RenderOptions;
use lumel::solve::Light;
use lumel::{Error, Monitor, Result};

use super::interrupt;

/// Making the output may take this share of the time limit, however late it is.
const FOR_OUTPUT: f64 = 0.5;

/// What takes longer is made again with so many times fewer pixels in each direction.
pub const COARSER: u32 = 8;

/// What watches over the making of the output.
pub fn for_output<'a>(monitor: Monitor<'a>, tell: &'a OnProgress<'a>) -> Monitor<'a> {
    match (monitor.seconds_left(), monitor.time_limit()) {
        (Some(left), Some(limit)) => {
            Monitor::new(interrupt::flag(), Some(left.max(FOR_OUTPUT * limit)), tell)
        }
        _ => monitor,
    }
}

/// What watches over coarse output, which is made however late it is.
pub fn without_limit<'a>(tell: &'a OnProgress<'a>) -> Monitor<'a> {
    Monitor::new(interrupt::flag(), None, tell)
}

/// Pixels as `draw` makes them, what it says of them, and whether time ran out, so that they are
/// coarse.
pub fn drawn<T>(
    options: &RenderOptions,
    monitor: &Monitor,
    tell: &OnProgress,
    draw: impl Fn(&RenderOptions, &Monitor) -> Result<(Vec<[f32; 3]>, T)>,
) -> Result<(Vec<[f32; 3]>, T, bool)> {
    match draw(options, monitor) {
        Err(Error::TimeLimit(_)) => {
            let coarse = RenderOptions {
                width: options.width.div_ceil(COARSER),
                height: options.height.div_ceil(COARSER),
                samples: 1,
                ..*options
            };
            let (pixels, told) = draw(&coarse, &without_limit(tell))?;
            Ok((enlarged(&pixels, &coarse, options), told, true))
        }
        done => done.map(|(pixels, told)| (pixels, told, false)),
    }
}

/// A picture with every pixel repeated until it has another size.
fn enlarged(pixels: &[[f32; 3]], from: &RenderOptions, to: &RenderOptions) -> Vec<[f32; 3]> {
    // In 64 bits no product of two sides overflows.
    let place =
        |k: u32, from: u32, to: u32| (u64::from(k) * u64::from(from) / u64::from(to)) as usize;
    let row = |y: u32| from.width as usize * place(y, from.height, to.height);
    let places = (0..to.height)
        .flat_map(|y| (0..to.width).map(move |x| (x, y)))
        .map(|(x, y)| row(y) + place(x, from.width, to.width));
    places.map(|place| pixels[place]).collect()
}

/// Whether the result is as good as was asked for, with errors of `filled` from filling in, and
/// `hurried` saying what was cut short for want of time.
pub fn met(light: &Light, filled: f64, hurried: Option<&str>) -> Result<()> {
    let cut = hurried.map(|what| {
        format!("the time limit (--time-limit) ran out while the output was made: {what}")
    });
    let short = light.apart().and_then(|source| {
        let error = source.estimate.rms.hypot(filled);
        let why = match &source.shortfall {
            Some(why) => why.as_str(),
            None if error > source.tolerance => {
                "of what was filled in, or the range of its channels"
            }
            None => return None,
        };
        Some(format!(
            "the tolerance of {} was not met: {why}. What was written has an estimated error of {} \
             (root mean square, relative to the mean irradiance)",
            percent(source.tolerance),
            percent(error)
        ))
    });
    let said: Vec<String> = cut.into_iter().chain(short).collect();
    if said.is_empty() { Ok(()) } else { Err(Error::ToleranceNotMet(said.join("; "))) }
}

fn percent(share: f64) -> String {
    let rounded = format!("{:.1e}", 100.0 * share).parse::<f64>();
    match rounded {
        Ok(percent) if percent.is_finite() => format!("{percent} %"),
        _ => "unknown size".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: RenderOptions = RenderOptions { width: 17, height: 9, samples: 3, gather: false };

    /// Every pixel is its place.
    fn places(options: &RenderOptions) -> Vec<[f32; 3]> {
        let rows = (0..options.height).flat_map(|y| (0..options.width).map(move |x| (x, y)));
        rows.map(|(x, y)| [x as f32, y as f32, options.samples as f32]).collect()
    }

    #[test]
    fn a_picture_is_coarse_only_when_time_runs_out() {
        let tell = |_: &'static str, _: u64, _: u64| {};
        let draw = |options: &RenderOptions, monitor: &Monitor| {
            monitor.check().map(|()| (places(options), ()))
        };
        let (pixels, (), coarse) = drawn(&SIZE, &Monitor::silent(), &tell, draw).unwrap();
        assert_eq!((pixels, coarse), (places(&SIZE), false));

        let late = Monitor::new(interrupt::flag(), Some(0.0), &tell);
        let (pixels, (), coarse) = drawn(&SIZE, &late, &tell, draw).unwrap();
        assert!(coarse);
        // 17 x 9 pixels from 3 x 2.
        for (got, full) in pixels.iter().zip(places(&SIZE)) {
            let want = [(full[0] * 3.0 / 17.0).floor(), (full[1] * 2.0 / 9.0).floor(), 1.0];
            assert_eq!(*got, want);
        }
        assert_eq!(pixels.len(), 17 * 9);
    }

    #[test]
    fn output_has_half_of_the_limit_however_late_it_is() {
        let tell = |_: &'static str, _: u64, _: u64| {};
        let of = |limit| for_output(Monitor::new(interrupt::flag(), limit, &tell), &tell);
        assert_eq!(of(None).time_limit(), None);
        // All of the limit is left; and of one that is over, the half of nothing.
        assert!((99.0..=100.0).contains(&of(Some(100.0)).time_limit().unwrap()));
        assert_eq!(of(Some(0.0)).time_limit(), Some(0.0));
        assert_eq!(without_limit(&tell).time_limit(), None);
    }
}
