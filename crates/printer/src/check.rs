//! Reads a whole file before it is printed, as the printer would, and says what would go wrong.
//!
//! Plans nothing and takes no time worth mentioning: modal state, limits of the machine file, heaters' targets. (Who plans
//! the file as well adds what only shows there: an extruder that has to step too fast along with the axes.) What
//! depends on the hour (is the nozzle warm by now?) is judged by the targets. Bounded: a file with a million faults
//! costs no more memory than one with a thousand.

#[cfg(test)]
mod tests;

use gcode::{
    Action, Arc, CHORD_TOLERANCE, Diagnostic, Heater, Interpreter, LineNumber, Lines, Move, Settings,
    Severity, VelocityLimit,
};
use motion::{Bend, Limits};
use units::Celsius;

use crate::{
    arcs,
    config::{HeaterConfig, PrinterConfig},
    error::{ErrorCode, PrinterError},
    machine,
    planner::{ExtrusionPermit, Guard, PLAN_CLOCK},
    step_rate::StepRates,
    transform::Transform,
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

/// How fast a machine may move and step.
#[derive(Debug)]
struct Speeds {
    machine: Limits,
    /// As lowered by the file.
    limits: Limits,
    step_rates: StepRates,
}

impl Speeds {
    fn new(config: &PrinterConfig) -> Self {
        let machine = machine::limits(config);
        Self { machine, limits: machine, step_rates: StepRates::new(config, PLAN_CLOCK) }
    }

    fn limit(&mut self, limit: &VelocityLimit) {
        let limits = machine::lowered(&self.machine, &self.limits, limit);
        // Limits that make no sense leave those that hold.
        if limits.check().is_ok() {
            self.limits = limits;
        }
    }

    fn judge(&self, mv: &Move, bend: Option<&Bend>) -> Result<(), PrinterError> {
        let (from, to) = (mv.from.to_array(), mv.to.to_array());
        arcs::straight_ends(from, to, bend)
            .try_for_each(|end| self.step_rates.judge_request(from, end, mv.feed, &self.limits, mv.line))
    }
}

/// Reads a file in pieces.
#[derive(Debug)]
pub struct Checker {
    config: Option<PrinterConfig>,
    guard: Option<Guard>,
    /// From the file's coordinates to the machine's.
    transform: Transform,
    speeds: Option<Speeds>,
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
            transform: Transform::default(),
            speeds: config.map(Speeds::new),
            lines: Lines::new(),
            interpreter: Interpreter::new(settings),
            actions: Vec::new(),
            found: Vec::new(),
            nozzle: Celsius::ZERO,
            report: CheckReport::default(),
        }
    }

    /// Reads as [`Self::new`] does, but judges no moves: for whoever wants to know quickly where they lead.
    pub(crate) fn reader(config: &PrinterConfig) -> Self {
        Self { guard: None, speeds: None, ..Self::new(Some(config)) }
    }

    /// Pictures are among the actions that [`Self::feed_with`] shows.
    pub fn show_pictures(&mut self) {
        self.interpreter.show_pictures();
    }

    /// Takes the next bytes of the file.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.feed_with(bytes, |_, _| {});
    }

    /// The same, and shows each action with its line to `each`, so that others need not read the file again.
    pub fn feed_with(&mut self, bytes: &[u8], each: impl FnMut(Action, LineNumber)) {
        self.lines.feed(bytes);
        self.read(each);
    }

    /// Says that the file has ended, and shows the last line's actions to `each`.
    pub fn end_with(&mut self, each: impl FnMut(Action, LineNumber)) {
        self.lines.end();
        self.read(each);
    }

    /// The file has ended: what came of it.
    pub fn finish(mut self) -> CheckReport {
        self.end_with(|_, _| {});
        // What others have found came later than its line was read.
        self.report.errors.sort_by_key(|error| error.line);
        let line = self.report.lines;
        if self.report.moves == 0 {
            self.error(ErrorCode::FileEmpty, "the file makes no move".into(), None);
        } else if self.nozzle > Celsius::ZERO {
            // Many files leave the bed to the idle time-out, but none ends with the nozzle hot.
            self.block(line, "the file ends with the nozzle still hot: it was probably cut off".into());
        }
        self.report
    }

    fn read(&mut self, mut each: impl FnMut(Action, LineNumber)) {
        while let Some(line) = self.lines.next() {
            let number = line.number;
            self.report.lines = number.0;
            self.interpreter.line(number, line.bytes, &mut self.actions, &mut self.found);
            let mut actions = core::mem::take(&mut self.actions);
            for action in actions.drain(..) {
                self.act(&action, number);
                each(action, number);
            }
            self.actions = actions;
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
        // The chords of one arc are wrong together.
        let is_same =
            |last: &PrinterError| last.line.is_some() && (last.line, last.code) == (error.line, error.code);
        if self.report.errors.last().is_some_and(is_same) {
            return;
        }
        if self.report.errors.len() < FINDINGS_MAX {
            self.report.errors.push(error);
        } else {
            self.report.dropped += 1;
        }
    }

    /// What somebody else has found, who plans the file.
    pub(crate) fn add(&mut self, error: Option<PrinterError>) {
        if let Some(error) = error {
            self.keep(error);
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
            Action::Move(ref mv) => self.judge(mv, None),
            Action::Arc(ref arc) => self.judge_arc(arc),
            Action::Home { x, y, z } => self.home([x, y, z]),
            Action::SetTemperature { heater, target, .. } => self.target(heater, target, line),
            Action::WaitForTemperature { heater, .. } => _ = self.limits_of(heater, line),
            Action::VelocityLimit(ref limit) => {
                if let Some(speeds) = &mut self.speeds {
                    speeds.limit(limit);
                }
            }
            Action::TurnOffHeaters => self.nozzle = Celsius::ZERO,
            Action::Skew(_) | Action::BedMesh(_) => {
                if let Some(config) = &self.config
                    && let Err(problem) = self.transform.set(action, &config.profiles)
                {
                    self.error(ErrorCode::NoSuchProfile, problem, Some(line.0));
                }
            }
            Action::MotorsOff { x, y, z, .. } => {
                if let Some(guard) = &mut self.guard {
                    let off = [x, y, z, false];
                    let off =
                        self.config.as_ref().map_or(off, |config| machine::geometry(config).coupled(off));
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

    fn judge(&mut self, mv: &Move, bend: Option<&Bend>) {
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
        let allowed = self.guard.as_ref().map_or(Ok(()), |guard| judge(guard, &self.transform, mv, bend));
        let possible = self.speeds.as_ref().map_or(Ok(()), |speeds| speeds.judge(mv, bend));
        if let Err(error) = allowed.and(possible) {
            self.keep(error);
        }
    }

    /// An arc may lead out of the machine between two places that are in it.
    fn judge_arc(&mut self, arc: &Arc) {
        if let Some(guard) = &self.guard {
            let place = |at: gcode::Position| self.transform.machine_from_gcode([at.x, at.y, at.z]);
            let reach = |to: gcode::Position| guard.judge_travel(place(arc.from), place(to), arc.line);
            if let Err(error) = arc.extremes().try_for_each(reach) {
                self.keep(error);
            }
        }
        let mut chords = arc.chords(CHORD_TOLERANCE);
        while let Some(piece) = chords.next_piece() {
            let bend = arcs::bend(&piece);
            let fits = bend.fits(&piece.chord.from.to_array(), &piece.chord.to.to_array());
            self.judge(&piece.chord, (fits && self.transform.is_identity()).then_some(&bend));
        }
    }

    fn home(&mut self, axes: [bool; 3]) {
        let of = |config: &PrinterConfig| {
            let endstops = config.steppers.each_ref().map(|stepper| stepper.position_endstop.0);
            (machine::homed_together(config, axes), endstops)
        };
        let (axes, endstops) = self.config.as_ref().map_or((axes, [0.0; 3]), of);
        for axis in (0..3).filter(|&axis| axes[axis]) {
            if let Some(guard) = &mut self.guard {
                guard.set_homed(axis, true);
            }
        }
        self.transform.home(&mut self.interpreter, axes, endstops);
    }

    /// The machine file's heater; one that it does not have is an error.
    fn limits_of(&mut self, heater: Heater, line: LineNumber) -> Option<HeaterConfig> {
        let config = self.config.as_ref()?;
        let limits = match heater {
            Heater::Tool(0) => config.extruder.as_ref().map(|extruder| extruder.heater.clone()),
            Heater::Bed => config.heater_bed.clone(),
            _ => None,
        };
        if limits.is_none() {
            let detail = format!("{} is not in the machine file", machine::heater_name(heater));
            self.error(ErrorCode::NoSuchHeater, detail, Some(line.0));
        }
        limits
    }

    fn target(&mut self, heater: Heater, target: Celsius, line: LineNumber) {
        if heater == Heater::Tool(0) {
            self.nozzle = target;
        }
        // Switching off what is not there is what many files end with.
        if target == Celsius::ZERO && heater != Heater::Tool(0) {
            return;
        }
        let Some(limits) = self.limits_of(heater, line) else { return };
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

/// Why a move may not be made, if so: where the machine goes for it, and what it extrudes.
fn judge(guard: &Guard, transform: &Transform, mv: &Move, bend: Option<&Bend>) -> Result<(), PrinterError> {
    let (from, to) = (mv.from.to_array(), mv.to.to_array());
    if transform.is_identity() {
        guard.judge(mv)?;
        return bend.map_or(Ok(()), |bend| guard.judge_bend(bend, from, to, mv.line));
    }
    if from[..3] != to[..3] {
        let [x, y, z, _] = from;
        let mut at = transform.machine_from_gcode([x, y, z]);
        for [x, y, z, _] in transform.pieces(from, to) {
            guard.judge_travel(at, [x, y, z], mv.line)?;
            at = [x, y, z];
        }
    }
    guard.judge_extrusion(mv)
}
