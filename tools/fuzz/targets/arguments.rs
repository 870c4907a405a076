//! The command line, one argument a line, up to the settings of the command: nothing is read or written.
#![no_main]

// All of it is compiled, little of it used.
#[allow(dead_code)]
#[path = "../../../src/cli/mod.rs"]
mod cli;

use clap::Parser;
use cli::args::{Cli, Command};
use cli::bake_settings::BakeSettings;
use cli::settings::{InspectSettings, ProbeSettings, ReferenceSettings, RenderSettings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let words = std::iter::once("lumel").chain(text.lines());
    let typed = match Cli::try_parse_from(words) {
        Ok(typed) => typed,
        Err(answer) => {
            assert!(answer.exit_code() == 0 || answer.exit_code() == 2);
            assert!(!answer.to_string().is_empty());
            return;
        }
    };
    let settings = match typed.command {
        Command::Inspect(args) => InspectSettings::new(args).map(|s| s.described()),
        Command::Render(args) => RenderSettings::new(args).map(|s| s.described()),
        Command::Bake(args) => BakeSettings::new(args).map(|s| s.described()),
        Command::Probe(args) => ProbeSettings::new(args).map(|s| s.described()),
        Command::Reference(args) => Ok(ReferenceSettings::new(args).described()),
        Command::Completions(_) | Command::Manual(_) => return,
    };
    if let Err(error) = settings {
        assert_eq!(error.exit_code(), 2, "{error}");
        assert!(error.to_string().len() > 20, "{error}");
    }
});
