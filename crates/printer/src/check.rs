//! Reads a whole file before it is printed, as the printer would, and says what would go wrong.
//!
//! Plans nothing and takes no time worth mentioning: modal state, limits of the machine file, heaters' targets. What
//! depends on the hour (is the nozzle warm by now?) is judged by the targets. Bounded: a file with a million faults
//! costs no more memory than one with a thousand.

use gcode::{
    Action, CHORD_TOLERANCE, Diagnostic, Heater, Interpreter, LineNumber, Lines, Move, Settings, Severity,
};
use units::Celsius;

use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine,
    planner::{ExtrusionPermit, Guard},
};

/// The most findings of each kind that are kept; the rest are counted.
pub const FINDINGS_MAX: usize = 1000;

/// A line that nobody may pass over without the user's word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocking {
    /// Which line.
    pub line: u32,
    /// Why.
    pub message: String,
}

/// What a file holds, and what is wrong with it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckReport {
    /// What the reader remarked on, by line.
    pub diagnostics: Vec<Diagnostic>,
    /// What makes the file unprintable on this machine.
    pub errors: Vec<PrinterError>,
    /// Lines that have to be confirmed before the file is printed.
    pub blocking: Vec<Blocking>,
    /// Findings beyond [`FINDINGS_MAX`].
    pub dropped: u64,
    /// Lines in the file.
    pub lines: u32,
    /// Straight moves, the pieces of arcs among them.
    pub moves: u64,
    /// Filament pushed less filament pulled back, in mm.
    pub filament_mm: f64,
    /// The lowest and highest X, Y, Z reached while extruding, in mm.
    pub bounds_mm: Option<[[f64; 3]; 2]>,
}

impl CheckReport {
    /// Whether the file can be printed once the lines in [`Self::blocking`] have been confirmed.
    pub fn is_printable(&self) -> bool {
        self.errors.is_empty()
    }
}

/// Reads a file in pieces.
#[derive(Debug)]
pub struct Checker {
    config: Option<PrinterConfig>,
    guard: Option<Guard>,
    lines: Lines,
    interpreter: Interpreter,
    actions: Vec<Action>,
    found: Vec<Diagnostic>,
    nozzle: Celsius,
    report: CheckReport,
}

impl Checker {
    /// A check against a machine file, or of the G-code alone.
    pub fn new(config: Option<&PrinterConfig>) -> Self {
        let settings = config.map_or_else(Settings::default, machine::gcode_settings);
        Self {
            config: config.cloned(),
            guard: config.map(Guard::new),
            lines: Lines::new(),
            interpreter: Interpreter::new(settings),
            actions: Vec::new(),
            found: Vec::new(),
            nozzle: Celsius::ZERO,
            report: CheckReport::default(),
        }
    }

    /// Takes the next bytes of the file.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.lines.feed(bytes);
        self.read();
    }

    /// The file has ended: what came of it.
    pub fn finish(mut self) -> CheckReport {
        self.lines.end();
        self.read();
        let line = self.report.lines;
        if self.report.moves == 0 {
            self.error(ErrorCode::FileEmpty, "the file makes no move".into(), None);
        } else if self.nozzle > Celsius::ZERO {
            // Many files leave the bed to the idle time-out, but none ends with the nozzle hot.
            self.block(line, "the file ends with the nozzle still hot: it was probably cut off".into());
        }
        self.report
    }

    fn read(&mut self) {
        while let Some(line) = self.lines.next() {
            let number = line.number;
            self.report.lines = number.0;
            self.interpreter.line(number, line.bytes, &mut self.actions, &mut self.found);
            for action in core::mem::take(&mut self.actions) {
                self.act(&action, number);
            }
            for diagnostic in core::mem::take(&mut self.found) {
                self.remark(diagnostic);
            }
        }
    }

    fn remark(&mut self, diagnostic: Diagnostic) {
        let line = diagnostic.line.0;
        match diagnostic.severity {
            Severity::Error => self.error(ErrorCode::InvalidGcode, diagnostic.message.clone(), Some(line)),
            Severity::Blocking => self.block(line, diagnostic.message.clone()),
            Severity::Warning | Severity::Info => {}
        }
        if self.report.diagnostics.len() < FINDINGS_MAX {
            self.report.diagnostics.push(diagnostic);
        } else {
            self.report.dropped += 1;
        }
    }

    fn error(&mut self, code: ErrorCode, detail: String, line: Option<u32>) {
        let error = PrinterError::new(code, detail);
        self.keep(line.map_or(error.clone(), |line| error.at_line(line)));
    }

    fn keep(&mut self, error: PrinterError) {
        if self.report.errors.len() < FINDINGS_MAX {
            self.report.errors.push(error);
        } else {
            self.report.dropped += 1;
        }
    }

    fn block(&mut self, line: u32, message: String) {
        if self.report.blocking.len() < FINDINGS_MAX {
            self.report.blocking.push(Blocking { line, message });
        } else {
            self.report.dropped += 1;
        }
    }

    fn act(&mut self, action: &Action, line: LineNumber) {
        match *action {
            Action::Move(ref mv) => self.judge(mv),
            Action::Arc(ref arc) => arc.chords(CHORD_TOLERANCE).for_each(|chord| self.judge(&chord)),
            Action::Home { x, y, z } => self.home([x, y, z]),
            Action::SetTemperature { heater, target, .. } => self.target(heater, target, line),
            Action::TurnOffHeaters => self.nozzle = Celsius::ZERO,
            Action::MotorsOff { x, y, z, .. } => {
                if let Some(guard) = &mut self.guard {
                    let off = [x, y, z];
                    (0..3).filter(|&axis| off[axis]).for_each(|axis| guard.set_homed(axis, false));
                }
            }
            Action::SelectTool(tool) if tool > 0 && self.config.is_some() => {
                let detail = format!("tool T{tool} is not in the machine file");
                self.error(ErrorCode::NoSuchHeater, detail, Some(line.0));
            }
            _ => {}
        }
    }

    fn judge(&mut self, mv: &Move) {
        self.report.moves += 1;
        let filament = mv.to.e - mv.from.e;
        self.report.filament_mm += filament;
        if filament > 0.0 {
            for point in [mv.from, mv.to] {
                let at = [point.x, point.y, point.z];
                let [low, high] = self.report.bounds_mm.get_or_insert([at, at]);
                for axis in 0..3 {
                    low[axis] = low[axis].min(at[axis]);
                    high[axis] = high[axis].max(at[axis]);
                }
            }
        }
        if let Some(guard) = &self.guard
            && let Err(error) = guard.judge(mv)
        {
            self.keep(error);
        }
    }

    fn home(&mut self, axes: [bool; 3]) {
        let mut at = [None; 3];
        for axis in (0..3).filter(|&axis| axes[axis]) {
            at[axis] =
                Some(self.config.as_ref().map_or(0.0, |config| config.steppers[axis].position_endstop.0));
            if let Some(guard) = &mut self.guard {
                guard.set_homed(axis, true);
            }
        }
        self.interpreter.set_axes(at[0], at[1], at[2]);
    }

    fn target(&mut self, heater: Heater, target: Celsius, line: LineNumber) {
        if heater == Heater::Tool(0) {
            self.nozzle = target;
        }
        let Some(config) = &self.config else { return };
        let limits = match heater {
            Heater::Tool(0) => config.extruder.as_ref().map(|extruder| &extruder.heater),
            Heater::Bed => config.heater_bed.as_ref(),
            _ => None,
        };
        let Some(limits) = limits else {
            // Switching off what is not there is what many files end with.
            if target > Celsius::ZERO {
                let detail = format!("{} is not in the machine file", machine::heater_name(heater));
                self.error(ErrorCode::NoSuchHeater, detail, Some(line.0));
            }
            return;
        };
        let (min_extrude, max) = (limits.min_extrude_temp, limits.max_temp);
        if target > max {
            let detail = format!("{}: {target} was asked for, {max} is the most", limits.name);
            self.error(ErrorCode::TargetOutOfRange, detail, Some(line.0));
        }
        if heater == Heater::Tool(0)
            && let Some(guard) = &mut self.guard
        {
            guard.extrusion = if target >= min_extrude {
                ExtrusionPermit::Allowed
            } else {
                ExtrusionPermit::TooCold { celsius: target.0 }
            };
        }
    }
}
