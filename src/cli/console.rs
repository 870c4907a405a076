//! Standard output and standard error.
//!
//! Policy: results go to standard output; a reader that has gone away (`lumel inspect | head`) is
//! no failure. Errors and warnings go to standard error; when even that cannot be written there
//! is nobody left to tell, and the exit code still says it.

use std::error::Error as _;
use std::io::{self, Write};

use lumel::scene::Notice;
use lumel::{Error, Result};

/// Writes a result to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::Unwritable { path: "standard output".into(), reason: e.to_string() })
        }
        _ => Ok(()),
    }
}

/// Writes an error and what caused it to standard error.
pub fn print_error(error: &Error) {
    let mut text = format!("Error: {error}\n");
    let mut cause = error.source();
    while let Some(inner) = cause {
        text.push_str(&format!("  because: {inner}\n"));
        cause = inner.source();
    }
    let _ = io::stderr().write_all(text.as_bytes());
}

/// Writes what was odd in a scene to standard error, a line each.
pub fn print_warnings(notices: &[Notice]) {
    let lines: String =
        notices.iter().map(|notice| format!("Warning: {}\n", line(notice))).collect();
    let _ = io::stderr().write_all(lines.as_bytes());
}

/// A notice in one line.
pub fn line(notice: &Notice) -> String {
    let Notice { about, text, count } = notice;
    let times = if *count > 1 { format!(" ({count} times)") } else { String::new() };
    format!("{about}: {text}{times}").replace('\n', " ")
}
