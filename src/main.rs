//! The program `lumel`: reads what was typed, has it done, and says how it went.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let typed = match cli::args::Cli::try_parse() {
        Ok(typed) => typed,
        // Help and version come this way too, with the exit code 0. When they cannot be printed
        // there is nobody to tell.
        Err(answer) => {
            let _ = answer.print();
            return ExitCode::from(u8::try_from(answer.exit_code()).unwrap_or(2));
        }
    };
    match cli::commands::run(typed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            cli::console::print_error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}
