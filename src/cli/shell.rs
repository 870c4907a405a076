//! What the program writes about its own command line: completions for shells, pages for `man`.
//!
//! Both follow from the definition in [`super::args`], as the help does, so they cannot differ from
//! what is understood.

use std::io;

use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use lumel::{Error, Result};

use super::args::Cli;

/// The script that lets a shell complete this program's command line.
pub fn completions(shell: Shell) -> String {
    let mut script = vec![];
    clap_complete::generate(shell, &mut Cli::command(), "lumel", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// The page for `man`, in roff, of the program or of one of its commands.
pub fn manual(command: Option<&str>) -> Result<String> {
    // A page `lumel-help-render` for each command would say nothing.
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    let described = match command {
        None => &program,
        Some(name) => program.find_subcommand(name).ok_or_else(|| {
            let names: Vec<&str> = program.get_subcommands().map(|c| c.get_name()).collect();
            Error::Usage(format!("there is no command {name}; there are {}", names.join(", ")))
        })?,
    };
    let page =
        page(described).map_err(|e| Error::Runtime(format!("no manual can be made: {e}")))?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}

/// The sections of a page, in their usual order.
fn page(command: &Command) -> io::Result<Vec<u8>> {
    let version = format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    let man = Man::new(command.clone()).source(version);
    let mut page = vec![];
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    man.render_options_section(&mut page)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut page)?;
    }
    if let Some(text) = command.get_after_help() {
        // As it stands: lines of examples must not be joined.
        let mut roff = Roff::new();
        roff.control("SH", ["NOTES AND EXAMPLES"]);
        roff.control("nf", []);
        for line in text.to_string().lines() {
            roff.text([roman(line)]);
        }
        roff.control("fi", []);
        roff.to_writer(&mut page)?;
    }
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn every_shell_gets_every_command_and_option() {
        for shell in Shell::value_variants() {
            let script = completions(*shell);
            for word in ["inspect", "render", "bake", "probe", "tolerance", "texels-per-metre"] {
                assert!(script.contains(word), "{shell}: {word}");
            }
        }
    }

    #[test]
    fn every_command_has_a_page_with_its_options_and_examples() {
        let program = manual(None).unwrap();
        for part in [".TH lumel 1", ".SH SUBCOMMANDS", "lumel\\-render", "Exit codes", ".nf"] {
            assert!(program.contains(part), "{part} is not in\n{program}");
        }
        let render = manual(Some("render")).unwrap();
        for part in [".TH lumel-render 1", "tolerance", ".SH SOLUTION", "Examples:"] {
            assert!(render.contains(part), "{part} is not in\n{render}");
        }
        for command in Cli::command().get_subcommands() {
            assert!(manual(Some(command.get_name())).unwrap().contains(".SH OPTIONS"));
        }
        let failure = manual(Some("paint")).unwrap_err();
        assert_eq!(failure.exit_code(), 2);
        assert!(failure.to_string().contains("render"), "{failure}");
    }
}
