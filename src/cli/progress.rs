//! A progress bar on standard error, on a terminal only: how far a stage is, how long the rest of it
//! will take, how long the program has run, and how long it may.

use std::io::{IsTerminal, stderr};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Least time between two drawings: work that reports every microsecond must not wait for the
/// terminal.
const PAUSE: Duration = Duration::from_millis(50);

/// Hears of progress and shows it. Any thread may call; the bar of one stage follows another's.
pub struct Progress {
    /// `None` when nothing is to be shown.
    bar: Option<Mutex<Option<(&'static str, ProgressBar)>>>,
    start: Instant,
    /// Seconds that all may take.
    limit: Option<f64>,
    /// When a bar is next drawn, milliseconds after `start`.
    next: AtomicU64,
}

impl Progress {
    /// Of work that may take `limit` seconds. Shows nothing when `quiet` or when standard error is no
    /// terminal.
    pub fn new(quiet: bool, limit: Option<f64>) -> Progress {
        let shows = !quiet && stderr().is_terminal();
        Progress {
            bar: shows.then(Mutex::default),
            start: Instant::now(),
            limit,
            next: AtomicU64::new(0),
        }
    }

    /// Notes that `done` of `total` steps of a stage are done. Of calls that follow each other
    /// closely only the first and the last of a stage are sure to be shown.
    pub fn hear(&self, stage: &'static str, done: u64, total: u64) {
        let Some(bar) = &self.bar else { return };
        let elapsed = self.start.elapsed();
        let now = elapsed.as_millis() as u64;
        let is_boundary = done == 0 || done >= total;
        if !is_boundary && now < self.next.load(Ordering::Relaxed) {
            return;
        }
        self.next.store(now + PAUSE.as_millis() as u64, Ordering::Relaxed);
        // A thread that panicked while drawing leaves a bar that can still be drawn.
        let mut shown = bar.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let clock = clock(elapsed.as_secs_f64(), self.limit);
        match &*shown {
            Some((name, bar)) if *name == stage => {
                bar.set_prefix(clock);
                bar.set_length(total);
                bar.set_position(done);
            }
            _ => {
                if let Some((_, old)) = shown.take() {
                    old.finish_and_clear();
                }
                let fresh = fresh_bar(stage, total).with_prefix(clock);
                fresh.set_position(done);
                *shown = Some((stage, fresh));
            }
        }
    }

    /// Takes the bar away, so that other lines can be written.
    pub fn clear(&self) {
        let Some(bar) = &self.bar else { return };
        let shown = bar.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
        if let Some((_, bar)) = shown {
            bar.finish_and_clear();
        }
    }
}

fn fresh_bar(stage: &'static str, total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total).with_message(stage);
    let template = "{msg:>14} {wide_bar} {percent:>3}%, {eta} left; {prefix}";
    // The template is a constant; were it wrong, the plain bar would be shown.
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// How long the program has run, and may.
fn clock(elapsed: f64, limit: Option<f64>) -> String {
    let words = |seconds: f64| match seconds as u64 {
        s @ 0..60 => format!("{s}s"),
        s @ 60..3600 => format!("{}m{:02}s", s / 60, s % 60),
        s => format!("{}h{:02}m", s / 3600, s / 60 % 60),
    };
    match limit {
        Some(limit) => format!("{} of {} in all", words(elapsed), words(limit)),
        None => format!("{} in all", words(elapsed)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quiet_progress_hears_and_shows_nothing() {
        let progress = Progress::new(true, None);
        progress.hear("solve", 0, 10);
        progress.hear("solve", 10, 10);
        progress.clear();
        assert!(progress.bar.is_none());
    }

    #[test]
    fn stages_follow_each_other_in_one_bar() {
        let progress = Progress {
            bar: Some(Mutex::default()),
            start: Instant::now(),
            limit: Some(90.0),
            next: AtomicU64::new(0),
        };
        progress.hear("read", 0, 2);
        progress.hear("read", 2, 2);
        progress.hear("solve", 0, 5);
        progress.hear("solve", 1, 5); // too soon to be drawn
        {
            let shown = progress.bar.as_ref().unwrap().lock().unwrap();
            let (name, bar) = shown.as_ref().unwrap();
            assert_eq!((*name, bar.position(), bar.length()), ("solve", 0, Some(5)));
            assert!(bar.prefix().ends_with("s of 1m30s in all"), "{}", bar.prefix());
        }
        progress.hear("solve", 5, 5);
        progress.clear();
        assert!(progress.bar.unwrap().into_inner().unwrap().is_none());
    }

    #[test]
    fn clocks_are_short() {
        assert_eq!(clock(0.4, None), "0s in all");
        assert_eq!(clock(61.0, Some(7322.0)), "1m01s of 2h02m in all");
    }
}
