//! What the user sees: results on stdout, progress and everything else on stderr.

use std::io::{self, IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use printer::error::PrinterError;
use serde::Serialize;

/// An error as JSON: the same for every command.
#[derive(Debug, Serialize)]
pub(crate) struct ErrorReport {
    /// Stable, kebab-case.
    pub(crate) code: &'static str,
    /// The line of the file that led to it.
    pub(crate) line: Option<u32>,
    pub(crate) what_happened: String,
    pub(crate) what_is_safe: Option<&'static str>,
    pub(crate) what_to_do: Option<&'static str>,
}

impl From<&PrinterError> for ErrorReport {
    fn from(error: &PrinterError) -> Self {
        Self {
            code: error.code.as_str(),
            line: error.line,
            what_happened: error.what_happened(),
            what_is_safe: Some(error.what_is_safe()),
            what_to_do: Some(error.what_to_do()),
        }
    }
}

impl From<&anyhow::Error> for ErrorReport {
    fn from(error: &anyhow::Error) -> Self {
        match error.downcast_ref::<PrinterError>() {
            Some(error) => error.into(),
            None => Self {
                code: "other",
                line: None,
                what_happened: format!("{error:#}"),
                what_is_safe: None,
                what_to_do: None,
            },
        }
    }
}

/// Writes a result to stdout. A reader that has gone away is no failure of the job's.
pub(crate) fn print(text: &str) {
    let mut stdout = io::stdout().lock();
    let _ = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
}

/// Writes a result to stdout as JSON.
pub(crate) fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    print(&text);
    Ok(())
}

/// Writes a line for the user to stderr.
pub(crate) fn note(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Says on stderr why the job failed, what is safe and what to do.
pub(crate) fn show_error(error: &ErrorReport) {
    note(&error_text(error));
}

fn error_text(error: &ErrorReport) -> String {
    let mut text = format!("error: {}", error.what_happened);
    if let Some(safe) = error.what_is_safe {
        text.push_str("\n  safety: ");
        text.push_str(safe);
    }
    if let Some(todo) = error.what_to_do {
        text.push_str("\n  to do:  ");
        text.push_str(todo);
    }
    text
}

/// How far a job is, on a terminal; nothing is drawn elsewhere.
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// A job on a file of so many bytes.
    pub(crate) fn new(what: &'static str, bytes: u64) -> Self {
        let target = if io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(bytes), target);
        let template = "{prefix:>10} [{bar:40}] {percent:>3} % {msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(what);
        Self(bar)
    }

    /// So many bytes have been dealt with.
    pub(crate) fn set(&self, bytes: u64) {
        self.0.set_position(bytes);
    }

    /// What is being done just now.
    pub(crate) fn say(&self, text: String) {
        self.0.set_message(text);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// A duration as people say it: `1 h 44 min`, `12 min 5 s`, `3.2 s`.
pub(crate) fn duration_text(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use printer::error::ErrorCode;

    #[test]
    fn an_error_says_what_happened_what_is_safe_and_what_to_do() {
        let error = anyhow::Error::from(PrinterError::new(ErrorCode::MoveOutOfRange, "X 400 mm").at_line(7));
        let text = error_text(&(&error).into());
        assert!(text.starts_with("error: Line 7: "), "{text}");
        assert!(text.contains("X 400 mm") && text.contains("\n  safety: ") && text.contains("\n  to do:  "));
        let other = anyhow::anyhow!("inner").context("outer");
        assert_eq!(error_text(&(&other).into()), "error: outer: inner");
    }

    #[test]
    fn durations_read_well() {
        assert_eq!(duration_text(3.21), "3.2 s");
        assert_eq!(duration_text(725.0), "12 min 5 s");
        assert_eq!(duration_text(6292.58), "1 h 44 min");
    }
}
