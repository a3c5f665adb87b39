//! `stepcast simulate`: a whole print on the virtual printer in virtual time, with its pulses counted and measured.
//!
//! The file is checked, as a user's would be before a print; then a session prints it on a simulated board, while the
//! same file, read a second time, says what the pulses should draw.

mod arc_way;
mod bent_path;
mod course;
mod digest;
mod gcode_path;
mod host_clock;
mod lease_tap;
mod observer;
mod path_check;
mod pauses;
mod report;
mod run;
mod tally;
mod temperature;

use std::{collections::BTreeSet, path::Path, process::ExitCode};

use anyhow::Context;
use gcode::Severity;
use printer::{
    check::CheckReport,
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    preview::Preview,
    session::JobOptions,
};
use units::Seconds;

pub(crate) use self::{
    host_clock::HostClock,
    report::{Outcome, Report},
    run::{Aftermath, PATH_ERROR_MAX_MM, Setup, Simulation, Successor},
};
use crate::{
    check,
    cli::{Board, SimulateArgs},
    config_file,
    console::{self, ErrorReport},
    input::Input,
};

/// The most findings of the check that are shown one by one.
const FINDINGS_SHOWN_MAX: usize = 20;

/// The number of the print in its journal.
const JOURNAL: u32 = 1;

/// Runs the command.
pub(crate) fn run(args: &SimulateArgs) -> anyhow::Result<ExitCode> {
    let config = config_file::load(&args.config)?;
    let found = check::check(&args.file, Some(&config))?;
    let start_line = match args.start_layer {
        Some(layer) => Some(first_line(&args.file, &config, layer)?),
        None => args.start_line,
    };
    let options = JobOptions {
        confirmed_lines: args.confirm_lines.iter().copied().collect::<BTreeSet<u32>>(),
        confirm_all: args.confirm_all,
        journal: Some(JOURNAL),
        start_line: start_line.filter(|&line| line > 1),
        transform: None,
    };
    let setup = Setup {
        config,
        board: args.machine.board.map(Board::profile),
        faults: args.machine.faults(),
        seed: args.machine.seed,
        options: options.clone(),
        consent_after: args.confirm_holds.then_some(Seconds::ZERO),
        host_dies: None,
        successor: None,
        watched: run::AFTER,
        time_max: None,
        quiet: false,
    };
    let mut simulation = {
        let input = || Input::repeated(&args.file, args.repeat);
        Simulation::new(setup, input()?, input()?)?
    };
    if let Some(refusal) = Refusal::of(&found, &options) {
        refusal.show();
        let mut report = simulation.into_report();
        report.result = Outcome::Refused;
        report.reason = Some(refusal.reason.what_happened());
        report.error = Some((&refusal.reason).into());
        report.blocking_lines = refusal.blocking.iter().map(|(line, _)| *line).collect();
        return finish(args, &report);
    }
    simulation.run()?;
    let report = simulation.into_report();
    finish(args, &report)
}

fn finish(args: &SimulateArgs, report: &Report) -> anyhow::Result<ExitCode> {
    if args.json {
        console::print_json(report)?;
    } else {
        console::print(&report.text());
    }
    if let Some(error) = &report.error {
        console::show_error(error);
    }
    Ok(if report.result == Outcome::Done { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The line with which a layer begins.
fn first_line(file: &Path, config: &PrinterConfig, layer: u32) -> anyhow::Result<u32> {
    let mut input = Input::open(file)?;
    let mut preview = Preview::new(Some(config));
    let mut vertices = Vec::new();
    loop {
        let piece = input.next(preview.wants())?;
        if piece.is_empty() {
            break;
        }
        preview.feed(piece);
        while preview.run(&mut vertices) {
            vertices.clear();
        }
        vertices.clear();
        preview.take_marks();
    }
    let layers = preview.finish().layers;
    let found = layers.get(layer as usize - 1).map(|layer| layer.first_line);
    found.with_context(|| format!("the file has {} layers, no layer {layer}", layers.len()))
}

/// Why a file is not printed.
struct Refusal {
    reason: PrinterError,
    errors: Vec<PrinterError>,
    blocking: Vec<(u32, String)>,
}

impl Refusal {
    fn of(found: &CheckReport, options: &JobOptions) -> Option<Self> {
        let confirmed = |line: u32| options.confirm_all || options.confirmed_lines.contains(&line);
        let open = found.blocking.iter().filter(|blocking| !confirmed(blocking.line));
        let blocking: Vec<_> = open.map(|blocking| (blocking.line, blocking.message.clone())).collect();
        let reason = match (found.errors.first(), blocking.first()) {
            (Some(error), _) => error.clone(),
            (None, Some((line, message))) => {
                // The reader did not mind that line: it is the check's own remark on the end of the file.
                let end = !found
                    .diagnostics
                    .iter()
                    .any(|remark| remark.line.0 == *line && remark.severity == Severity::Blocking);
                let code =
                    if end && found.dropped == 0 { ErrorCode::FileCutOff } else { ErrorCode::UnknownCommand };
                PrinterError::new(code, message.trim_end_matches('.')).at_line(*line)
            }
            (None, None) => return None,
        };
        Some(Self { reason, errors: found.errors.clone(), blocking })
    }

    /// Names each of them on stderr.
    fn show(&self) {
        let errors = self.errors.iter().map(|error| format!("error: {error}"));
        let blocking = self.blocking.iter().map(|(line, message)| {
            format!("line {line} must be confirmed (--confirm-line {line}): {message}")
        });
        let count = self.errors.len() + self.blocking.len();
        for text in errors.chain(blocking).take(FINDINGS_SHOWN_MAX) {
            console::note(&text);
        }
        if count > FINDINGS_SHOWN_MAX {
            console::note(&format!("and {} more; `stepcast check` lists them", count - FINDINGS_SHOWN_MAX));
        }
    }
}

/// What a simulation finds out that no printer could, put as the catalogue does.
fn own_error(code: &'static str, what_happened: impl Into<String>) -> ErrorReport {
    ErrorReport {
        code,
        line: None,
        what_happened: what_happened.into(),
        what_is_safe: None,
        what_to_do: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use printer::check::Checker;

    fn found(gcode: &str) -> CheckReport {
        let mut checker = Checker::new(None);
        checker.feed(gcode.as_bytes());
        checker.finish()
    }

    #[test]
    fn unknown_commands_must_be_confirmed_line_by_line() {
        let found = found("G28\nSTART_PRINT\nFOO\nG1 X5\n");
        let refusal = Refusal::of(&found, &JobOptions::default()).unwrap();
        assert_eq!(refusal.reason.line, Some(2));
        assert_eq!(refusal.blocking.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [2, 3]);
        let one = JobOptions { confirmed_lines: BTreeSet::from([2]), ..JobOptions::default() };
        assert_eq!(Refusal::of(&found, &one).unwrap().reason.line, Some(3));
        let all = JobOptions { confirm_all: true, ..JobOptions::default() };
        assert!(Refusal::of(&found, &all).is_none());
    }

    #[test]
    fn errors_cannot_be_confirmed_away() {
        let found = found("G28\nG1 X1e400\nG1 X5\n");
        let all = JobOptions { confirm_all: true, ..JobOptions::default() };
        assert_eq!(Refusal::of(&found, &all).unwrap().reason.line, Some(2));
    }
}
