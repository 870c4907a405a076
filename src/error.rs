//! Every way in which this library can fail, and the exit code that belongs to each.
//!
//! Policy: nothing that a file or an argument can contain panics. A message names the file, the
//! object in it and the remedy. Three kinds of bad input are told apart: *unreadable* (the bytes
//! cannot be had), *invalid* (they break their format's rules) and *unsupported* (they are right,
//! but ask for something that this program does not do).

use std::path::{Path, PathBuf};

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be opened, read or decoded at all.
    #[error("{}: cannot be read: {reason}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why, in words, with the remedy where there is one.
        reason: String,
    },
    /// A file breaks the rules of its format, or describes an impossible scene.
    #[error("{}: {what}: {reason}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The object in the file, e.g. `mesh 3 "Wall", primitive 0`.
        what: String,
        /// What is wrong with it, with the remedy where there is one.
        reason: String,
    },
    /// A file is well formed but needs a feature that this program does not have.
    #[error("{}: {what}: not supported: {reason}", .path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The object in the file.
        what: String,
        /// What it asks for, with the remedy where there is one.
        reason: String,
    },
    /// Options that do not fit each other or the scene (exit code 2).
    #[error("{0}")]
    Usage(String),
    /// A failure at run time that is neither the scene's nor the user's fault.
    #[error("{0}")]
    Runtime(String),
    /// The work needs more memory than it may use.
    #[error("{what} would need about {} of memory, but only {} may be used: {remedy}", mebibytes(*.needed), mebibytes(*.allowed))]
    Memory {
        /// The stage that needs the memory.
        what: String,
        /// Forecast, in bytes.
        needed: u64,
        /// Limit, in bytes.
        allowed: u64,
        /// What to do about it.
        remedy: String,
    },
    /// An iteration stopped without reaching its tolerance.
    #[error(
        "the solve did not converge: relative residual {residual:.2e} after {iterations} iterations, asked for {tolerance:.2e}"
    )]
    NotConverged {
        /// Relative residual reached.
        residual: f64,
        /// Iterations made.
        iterations: usize,
        /// Relative residual asked for.
        tolerance: f64,
    },
    /// A result was written, but it is not as good as was asked for (exit code 4).
    #[error("{0}")]
    ToleranceNotMet(String),
    /// The user interrupted the work.
    #[error("interrupted")]
    Interrupted,
    /// The time limit ran out before there was a result.
    #[error(
        "the time limit of {0:.1} s ran out before there was a result: raise --time-limit or ask for less"
    )]
    TimeLimit(f64),
    /// A file could not be written; what stood there before is unharmed.
    #[error("{}: cannot be written: {reason}", .path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// Bytes in words.
fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Result of everything in this library that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The exit code of the program: 1 failed at run time, 2 usage, 3 bad scene, 4 tolerance or
    /// time limit not met, 130 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Unreadable { .. } | Error::Invalid { .. } | Error::Unsupported { .. } => 3,
            Error::Usage(_) => 2,
            Error::Runtime(_)
            | Error::Memory { .. }
            | Error::NotConverged { .. }
            | Error::Unwritable { .. } => 1,
            Error::ToleranceNotMet(_) | Error::TimeLimit(_) => 4,
            Error::Interrupted => 130,
        }
    }

    /// An [`Error::Unreadable`].
    pub fn unreadable(path: &Path, reason: impl ToString) -> Self {
        Error::Unreadable { path: path.to_path_buf(), reason: reason.to_string() }
    }

    /// An [`Error::Invalid`].
    pub fn invalid(path: &Path, what: impl ToString, reason: impl ToString) -> Self {
        Error::Invalid {
            path: path.to_path_buf(),
            what: what.to_string(),
            reason: reason.to_string(),
        }
    }

    /// An [`Error::Unsupported`].
    pub fn unsupported(path: &Path, what: impl ToString, reason: impl ToString) -> Self {
        Error::Unsupported {
            path: path.to_path_buf(),
            what: what.to_string(),
            reason: reason.to_string(),
        }
    }
}
