//! `stepcast check`: what is wrong with a file, by line.

use std::{fmt::Write as _, path::Path, process::ExitCode};

use gcode::Diagnostic;
use printer::{
    check::{CheckReport, Checker},
    config::PrinterConfig,
};
use serde::Serialize;

use crate::{
    cli::CheckArgs,
    config_file,
    console::{self, ErrorReport, Progress},
    input::Input,
};

/// The result as JSON; the keys are stable.
#[derive(Debug, Serialize)]
struct Report {
    /// Nothing stands against printing the file.
    printable: bool,
    lines: u32,
    moves: u64,
    filament_mm: f64,
    bounds_mm: Option<Bounds>,
    errors: Vec<ErrorReport>,
    /// Lines that have to be confirmed before the file is printed.
    blocking: Vec<Blocking>,
    diagnostics: Vec<Remark>,
    /// Findings beyond those listed.
    dropped: u64,
}

#[derive(Debug, Serialize)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Debug, Serialize)]
struct Blocking {
    line: u32,
    message: String,
}

#[derive(Debug, Serialize)]
struct Remark {
    line: u32,
    /// The first and the last character in question, counted from 1.
    columns: [u32; 2],
    severity: &'static str,
    code: &'static str,
    message: String,
}

impl From<&Diagnostic> for Remark {
    fn from(diagnostic: &Diagnostic) -> Self {
        let columns = &diagnostic.columns;
        Self {
            line: diagnostic.line.0,
            columns: [columns.start + 1, columns.end.max(columns.start + 1)],
            severity: diagnostic.severity.as_str(),
            code: diagnostic.code.as_str(),
            message: diagnostic.message.clone(),
        }
    }
}

impl From<&CheckReport> for Report {
    fn from(report: &CheckReport) -> Self {
        let blocking = report.blocking.iter();
        Self {
            printable: report.is_printable() && report.blocking.is_empty(),
            lines: report.lines,
            moves: report.moves,
            filament_mm: report.filament_mm,
            bounds_mm: report.bounds_mm.map(|[min, max]| Bounds { min, max }),
            errors: report.errors.iter().map(ErrorReport::from).collect(),
            blocking: blocking
                .map(|found| Blocking { line: found.line, message: found.message.clone() })
                .collect(),
            diagnostics: report.diagnostics.iter().map(Remark::from).collect(),
            dropped: report.dropped,
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let config = args.config.as_deref().map(config_file::load).transpose()?;
    let report = check(&args.file, config.as_ref())?;
    if args.json {
        console::print_json(&Report::from(&report))?;
    } else {
        console::print(&text(&args.file, &report));
    }
    if report.is_printable() && report.blocking.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    console::note(&verdict(&args.file, &report));
    Ok(ExitCode::FAILURE)
}

/// Reads a whole file as the printer would.
pub(crate) fn check(file: &Path, config: Option<&PrinterConfig>) -> anyhow::Result<CheckReport> {
    let mut input = Input::open(file)?;
    let progress = Progress::new("checking", input.size());
    let mut checker = Checker::new(config);
    loop {
        let chunk = input.next_chunk()?;
        if chunk.is_empty() {
            return Ok(checker.finish());
        }
        checker.feed(chunk);
        progress.set(input.position());
    }
}

/// Why a file is not printed as it is, in one line.
fn verdict(file: &Path, report: &CheckReport) -> String {
    let (errors, blocking) = (report.errors.len(), report.blocking.len());
    let file = file.display();
    let count = |number: usize, what: &str| format!("{number} {what}{}", if number == 1 { "" } else { "s" });
    match (errors, blocking) {
        (_, 0) => format!("error: {file} cannot be printed: {}", count(errors, "error")),
        (0, _) => format!("error: {file} is printed only when {} been confirmed", {
            if blocking == 1 { "1 line has".to_owned() } else { format!("{blocking} lines have") }
        }),
        _ => format!(
            "error: {file} cannot be printed: {}, and {} to be confirmed",
            count(errors, "error"),
            count(blocking, "line")
        ),
    }
}

fn text(file: &Path, report: &CheckReport) -> String {
    // Errors of the reader's come as diagnostics too: each is shown once, in the order of the file.
    let mut findings: Vec<(u32, String)> = Vec::new();
    for diagnostic in &report.diagnostics {
        findings.push((diagnostic.line.0, format!("{}:{diagnostic}", file.display())));
    }
    let has_diagnostic = |line: u32, message: &str| {
        report.diagnostics.iter().any(|found| found.line.0 == line && message.contains(&found.message))
    };
    for error in &report.errors {
        let line = error.line.unwrap_or(0);
        if !has_diagnostic(line, &error.detail) {
            findings.push((line, format!("{}: error [{}] {error}", place(file, line), error.code)));
        }
    }
    for blocking in &report.blocking {
        if !has_diagnostic(blocking.line, &blocking.message) {
            findings.push((
                blocking.line,
                format!("{}: blocking {}", place(file, blocking.line), blocking.message),
            ));
        }
    }
    findings.sort_by_key(|finding| finding.0);
    let mut text = String::new();
    for (_, finding) in findings {
        let _ = writeln!(text, "{finding}");
    }
    if report.dropped > 0 {
        let _ = writeln!(text, "and {} more findings", report.dropped);
    }
    let _ = writeln!(
        text,
        "{} lines, {} moves, {:.1} mm of filament{}",
        report.lines,
        report.moves,
        report.filament_mm,
        report.bounds_mm.map_or_else(String::new, |[min, max]| format!(
            ", X {:.1} to {:.1}, Y {:.1} to {:.1}, Z {:.2} to {:.2} mm",
            min[0], max[0], min[1], max[1], min[2], max[2]
        ))
    );
    text
}

fn place(file: &Path, line: u32) -> String {
    if line == 0 { file.display().to_string() } else { format!("{}:{line}", file.display()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(gcode: &str) -> CheckReport {
        let mut checker = Checker::new(None);
        checker.feed(gcode.as_bytes());
        checker.finish()
    }

    #[test]
    fn findings_are_shown_once_in_the_order_of_the_file() {
        let report = checked("G28\nSTART_PRINT BED=60\nG1 X1e400\nG1 X5 E1\n");
        let text = text(Path::new("a.gcode"), &report);
        let at = |needle: &str| text.find(needle).unwrap_or_else(|| panic!("{needle} in\n{text}"));
        assert!(at("a.gcode:2:") < at("a.gcode:3:"));
        assert_eq!(text.matches("a.gcode:3:").count(), 1, "{text}");
        assert_eq!(text.matches("a.gcode:2:").count(), 1, "{text}");
        assert!(verdict(Path::new("a.gcode"), &report).contains("cannot be printed: 1 error, and 1 line"));
    }

    #[test]
    fn the_json_has_the_keys_that_are_documented() {
        let json = serde_json::to_value(Report::from(&checked("G28\nFOO\nG1 X5 Y6 E1\n"))).unwrap();
        assert_eq!(json["printable"], false);
        assert_eq!(json["lines"], 3);
        assert_eq!(json["blocking"][0]["line"], 2);
        assert_eq!(json["diagnostics"][0]["line"], 2);
        assert_eq!(json["diagnostics"][0]["severity"], "blocking");
        assert_eq!(json["bounds_mm"]["max"][1], 6.0);
        let json = serde_json::to_value(Report::from(&checked("G28\nG1 X5 E1\n"))).unwrap();
        assert_eq!(json["printable"], true);
        assert_eq!(json["errors"], serde_json::json!([]));
    }
}
