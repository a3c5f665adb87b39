//! The native command `stepcast`: checks, plans and simulates G-code, and serves a virtual printer.
//!
//! A thin shell: files, terminals and exit statuses are here, everything else is in the crates it stands on.

mod campaign;
mod check;
mod cli;
mod config_file;
mod console;
mod input;
mod plan;
mod simulate;
mod torque;
mod trace_file;
mod virtual_printer;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use cli::{Cli, CommandLine};

fn main() -> ExitCode {
    // Wrong usage ends here, with status 2.
    let cli = Cli::parse();
    let (result, json) = match &cli.command {
        CommandLine::Check(args) => (check::run(args), args.json),
        CommandLine::Plan(args) => (plan::run(args), args.json),
        CommandLine::Simulate(args) => (simulate::run(args), args.json),
        CommandLine::Campaign(args) => (campaign::run(args), args.json),
        CommandLine::Torque(args) => (torque::run(args), args.json),
        CommandLine::VirtualPrinter(args) => (virtual_printer::run(args), false),
        CommandLine::Completions { shell } => (completions(*shell), false),
    };
    result.unwrap_or_else(|error| {
        let report = console::ErrorReport::from(&error);
        if json {
            // The keys of a result are not there: this one says why.
            let why =
                serde_json::json!({ "result": "failed", "reason": &report.what_happened, "error": &report });
            let _ = console::print_json(&why);
        }
        console::show_error(&report);
        ExitCode::FAILURE
    })
}

fn completions(shell: clap_complete::Shell) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "stepcast", &mut script);
    console::print(&String::from_utf8(script)?);
    Ok(ExitCode::SUCCESS)
}
