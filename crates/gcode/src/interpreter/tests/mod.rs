//! What lines mean, by area.

mod commands;
mod dialects;
mod moves;
mod robustness;

use super::*;
use crate::action::Wait;

/// What a text gave.
struct Read {
    interpreter: Interpreter,
    actions: Vec<Action>,
    diagnostics: Vec<Diagnostic>,
}

impl Read {
    fn moves(&self) -> Vec<[f64; 4]> {
        self.actions
            .iter()
            .filter_map(|a| if let Action::Move(m) = a { Some(m.to.to_array()) } else { None })
            .collect()
    }

    fn feeds(&self) -> Vec<f64> {
        self.actions
            .iter()
            .filter_map(|a| if let Action::Move(m) = a { Some(m.feed.0) } else { None })
            .collect()
    }

    /// `line:column-column severity code`
    fn said(&self) -> Vec<String> {
        let place = |d: &Diagnostic| format!("{}:{}-{}", d.line.0, d.columns.start, d.columns.end);
        self.diagnostics.iter().map(|d| format!("{} {} {}", place(d), d.severity.as_str(), d.code)).collect()
    }
}

fn read(text: &str) -> Read {
    read_with(Settings::default(), text)
}

fn read_with(settings: Settings, text: &str) -> Read {
    let mut interpreter = Interpreter::new(settings);
    let (mut actions, mut diagnostics) = (Vec::new(), Vec::new());
    for (index, line) in text.lines().enumerate() {
        interpreter.line(LineNumber(index as u32 + 1), line.as_bytes(), &mut actions, &mut diagnostics);
    }
    Read { interpreter, actions, diagnostics }
}

/// Reads what must be right.
fn clean(text: &str) -> Read {
    let read = read(text);
    assert_eq!(read.said(), [""; 0], "{text}");
    read
}
