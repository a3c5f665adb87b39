//! Chores of this repository that need more than cargo: `cargo xtask layers | bindings | wasm | instruments |
//! bench motion`.
//!
//! Knows the folders and the tools, nothing of printers. What a machine lacks is named, never installed.

mod bench;
mod bindings;
mod callgrind;
mod instruments;
mod layers;
mod sources;
mod wasm;
mod workspace;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Chores of this repository", version)]
struct Arguments {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Subcommand)]
enum Chore {
    /// Check that crates use only what ARCHITECTURE.md lets them use, and that the paths named there exist
    Layers,
    /// Write the TypeScript types of the messages between page and WebAssembly
    Bindings {
        /// Write nothing; fail where the committed types differ
        #[arg(long)]
        check: bool,
    },
    /// Build the planner for WebAssembly, with bindings for Node and the web
    Wasm,
    /// Build the instruments for WebAssembly, for the page to load when they are opened
    Instruments,
    /// Measure a part of the program
    Bench {
        #[command(subcommand)]
        subject: Subject,
    },
}

#[derive(Subcommand)]
enum Subject {
    /// Instructions and bytes a step of `stepcast plan`, under valgrind
    Motion {
        /// The G-code file to plan [default: samples/test-part.gcode]
        file: Option<PathBuf>,
        /// The machine to plan for [default: samples/printer.cfg]
        #[arg(long)]
        config: Option<PathBuf>,
        /// Write the result as JSON
        #[arg(long)]
        json: bool,
    },
}

fn main() -> ExitCode {
    let result = match Arguments::parse().chore {
        Chore::Layers => layers::run(),
        Chore::Bindings { check } => bindings::run(check),
        Chore::Wasm => wasm::run(),
        Chore::Instruments => instruments::run(),
        Chore::Bench { subject: Subject::Motion { file, config, json } } => bench::motion(file, config, json),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
