//! Watching long work from outside: progress out, interruption in.
//!
//! The library never prints. Whoever calls it may pass a [`Monitor`] that hears of progress and
//! can stop the work; [`Monitor::silent`] does neither.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use crate::error::{Error, Result};

/// Called with (stage name, steps done, steps in all); from any thread, often.
pub type OnProgress<'a> = dyn Fn(&'static str, u64, u64) + Sync + 'a;

/// Hears of progress and says when to stop.
pub struct Monitor<'a> {
    cancelled: Option<&'a AtomicBool>,
    deadline: Option<(Instant, f64)>,
    on_progress: Option<&'a OnProgress<'a>>,
}

impl<'a> Monitor<'a> {
    /// Never stops anything, tells nobody.
    pub fn silent() -> Monitor<'static> {
        Monitor { cancelled: None, deadline: None, on_progress: None }
    }

    /// Stops when `cancelled` becomes true or `limit` seconds after now; reports to `on_progress`.
    pub fn new(
        cancelled: &'a AtomicBool,
        limit: Option<f64>,
        on_progress: &'a OnProgress<'a>,
    ) -> Self {
        let deadline = limit.and_then(|seconds| {
            let span = std::time::Duration::try_from_secs_f64(seconds).ok()?;
            Some((Instant::now().checked_add(span)?, seconds))
        });
        Monitor { cancelled: Some(cancelled), deadline, on_progress: Some(on_progress) }
    }

    /// `Err` when the work should stop: [`Error::Interrupted`] or [`Error::TimeLimit`].
    pub fn check(&self) -> Result<()> {
        if self.cancelled.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Err(Error::Interrupted);
        }
        match self.deadline {
            Some((end, seconds)) if Instant::now() >= end => Err(Error::TimeLimit(seconds)),
            _ => Ok(()),
        }
    }

    /// Seconds until the work should stop; none without a limit.
    pub fn seconds_left(&self) -> Option<f64> {
        self.deadline.map(|(end, _)| end.saturating_duration_since(Instant::now()).as_secs_f64())
    }

    /// The seconds that were allowed in all; none without a limit.
    pub fn time_limit(&self) -> Option<f64> {
        self.deadline.map(|(_, seconds)| seconds)
    }

    /// Begins a stage of `total` steps.
    pub fn stage(&self, name: &'static str, total: u64) -> Stage<'_> {
        if let Some(tell) = self.on_progress {
            tell(name, 0, total);
        }
        Stage { monitor: self, name, total, done: AtomicU64::new(0) }
    }
}

/// One stage of long work, shared by the threads that do it.
pub struct Stage<'a> {
    monitor: &'a Monitor<'a>,
    name: &'static str,
    total: u64,
    done: AtomicU64,
}

impl Stage<'_> {
    /// Notes `steps` more steps done; `Err` when the work should stop.
    pub fn advance(&self, steps: u64) -> Result<()> {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        if let Some(tell) = self.monitor.on_progress {
            tell(self.name, done, self.total);
        }
        self.monitor.check()
    }
}
