//! Standard output and standard error.
//!
//! Policy: results go to standard output; a reader that has gone away (`lumel inspect | head`) is
//! no failure. Errors and warnings go to standard error; when even that cannot be written there
//! is nobody left to tell, and the exit code still says it.

use std::error::Error as _;
use std::io::{self, Write};

use lumel::scene::{Notice, group_notices};
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

/// Writes what was odd in a scene to standard error, a line for each kind of oddity.
pub fn print_warnings(notices: &[Notice]) {
    let lines: String =
        group_notices(notices).iter().map(|n| format!("Warning: {}\n", line(n))).collect();
    let _ = io::stderr().write_all(lines.as_bytes());
}

/// A notice in one line.
pub fn line(notice: &Notice) -> String {
    let Notice { about, text, count } = notice;
    let times = if *count > 1 { format!(" ({count} times)") } else { String::new() };
    format!("{about}: {text}{times}").replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notices_with_one_text_become_one_line_in_the_order_of_the_first() {
        let notice = |about: &str, text: &str, count| Notice {
            about: about.into(),
            text: text.into(),
            count,
        };
        let notices = [
            notice("material \"a\"", "gloss is left out", 1),
            notice("mesh 2", "lines\nare left out", 7),
            notice("material \"b\"", "gloss is left out", 1),
            notice("material \"c\"", "gloss is left out", 1),
        ];
        assert_eq!(
            group_notices(&notices).iter().map(line).collect::<Vec<_>>(),
            [
                "material \"a\" and 2 more: gloss is left out (3 times)",
                "mesh 2: lines are left out (7 times)",
            ]
        );
    }
}
