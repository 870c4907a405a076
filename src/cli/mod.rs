//! The front end: what was typed ([`args`]) becomes validated settings ([`settings`]), and a
//! command ([`commands`]) does the work with them.
//!
//! Results go to standard output or a file; progress and warnings go to standard error, and
//! progress only to a terminal ([`console`], [`progress`]).

pub mod advice;
pub mod args;
pub mod audit_text;
pub mod bake;
pub mod bake_settings;
pub mod commands;
pub mod console;
pub mod forecast;
pub mod inspect;
pub mod interrupt;
pub mod outcome;
pub mod progress;
pub mod reference_text;
pub mod session;
pub mod settings;
pub mod shell;
pub mod sight;
pub mod table;
pub mod values;
pub mod view;
