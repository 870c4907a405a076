//! Ctrl-C: the first asks the work to stop, the second ends the process at once.

use std::sync::atomic::{AtomicBool, Ordering};

use lumel::{Error, Result};

static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Exit code of an interrupted process.
const INTERRUPTED: i32 = 130;

/// Listens to Ctrl-C (and to requests of the system to end) from now on.
pub fn listen() -> Result<()> {
    ctrlc::set_handler(|| {
        if CANCELLED.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED);
        }
    })
    .map_err(|e| Error::Runtime(format!("Ctrl-C cannot be listened to: {e}")))
}

/// Becomes true when the work should stop.
pub fn flag() -> &'static AtomicBool {
    &CANCELLED
}
