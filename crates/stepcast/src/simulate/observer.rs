//! What is made of a session's events while it prints on the virtual printer.
//!
//! Knows the session's side (what it says that it does) and the file's (what it should do); the pulses' side is
//! [`Tally`]'s, which it tells what to expect.

use gcode::Heater;
use printer::{
    config::{Kinematics, PrinterConfig},
    error::PrinterError,
    machine::{EXTRUDER, MOTOR_NAMES, MOTORS},
    session::{Event, PhaseName, ScheduledMove},
};
use units::{Seconds, Ticks};
use virtual_printer::{Gantry, VirtualPrinter};

use super::{
    arc_way::ArcWay,
    gcode_path::{GcodePath, Piece},
    path_check::Span,
    report::Homing,
    tally::Tally,
    temperature::TemperatureWatch,
};
use crate::{
    console::{self, ErrorReport},
    input::Input,
};

/// The most homings that are reported one by one.
const HOMINGS_MAX: usize = 300;
/// The most texts of the file's that are passed on.
const MESSAGES_MAX: u32 = 100;

/// What the events ask of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wish {
    /// The printer is ready: start the job.
    Start,
    /// The board holds a print whose host is gone.
    TakeUp,
    /// The job is paused, and nobody is there: go on.
    Resume,
    /// The board holds its motion, and nobody is there.
    Held,
    /// It is over.
    End,
}

/// A run that was put aside: when, where it began unless it has been told to its end, and the end of its last move.
#[derive(Clone, Copy, Debug)]
struct Aside {
    at: Ticks,
    run_start: Option<Ticks>,
    told_until: Ticks,
}

/// Follows a print.
pub(super) struct Observer {
    pub(super) step_distance_mm: [f64; MOTORS],
    /// How the motors hold the head, as the machine has it.
    gantry: Gantry,
    pub(super) names: [&'static str; MOTORS],
    /// Where the carriage is that presses each endstop, in mm.
    switch_mm: [f64; 3],
    endstop_mm: [f64; 3],
    gcode: GcodePath<Input>,
    /// Steps of all moves that were scheduled …
    pub(super) planned: [u64; MOTORS],
    /// … of which so many may be made or not: there and back, where a motor comes to the middle of two positions and turns.
    pub(super) unsure: [u64; MOTORS],
    /// Which way each motor went last.
    heading: [f64; MOTORS],
    /// Motors whose path is filtered: they make steps of their own, and end where the file wants them.
    filtered: [bool; MOTORS],
    /// Where the last move ends that was made for the file.
    pub(super) end: Option<[f64; MOTORS]>,
    pub(super) moves: u64,
    pub(super) homing: Vec<Homing>,
    pub(super) pauses: u32,
    pub(super) holds: u32,
    pub(super) nozzle: TemperatureWatch,
    pub(super) min_queued: Option<Seconds>,
    pub(super) print_time: Seconds,
    pub(super) line: u32,
    /// What the session says went wrong.
    pub(super) error: Option<PrinterError>,
    /// Where the session's moves are not the file's.
    pub(super) mismatch: Option<String>,
    /// Why the board last held its motion.
    pub(super) held: Option<PrinterError>,
    /// The whole job was printed.
    pub(super) done: bool,
    /// A run that has begun and not yet had its first move.
    new_run: Option<Ticks>,
    /// Where the present run began, unless it homes.
    run_start: Option<Ticks>,
    is_homing: bool,
    /// Where the first run began that does not home.
    pub(super) began: Option<Ticks>,
    /// The run that is put aside in a pause …
    aside: Option<Aside>,
    /// … and the moves of those that were are told again.
    repeats: bool,
    /// Another host has taken the first one's place: it tells of moves again that were planned before.
    pub(super) is_taken_up: bool,
    /// The end of the last move that was told.
    told_until: Ticks,
    /// The print does not begin with its file, and has not begun.
    begins_within: bool,
    /// When anything happened last.
    pub(super) last_change: Ticks,
    messages: u32,
    quiet: bool,
}

impl Observer {
    /// Nothing has happened yet. `reference` is the file, opened a second time; `quiet` shows none of its texts.
    pub(super) fn new(
        config: &PrinterConfig,
        gantry: Gantry,
        reference: Input,
        start: Ticks,
        quiet: bool,
    ) -> Self {
        let profiles = std::sync::Arc::clone(&config.profiles);
        let mut gcode = GcodePath::new(reference, printer::machine::gcode_settings(config), profiles);
        gcode.homes_together = matches!(gantry, Gantry::Delta(_));
        let endstop_mm = config.steppers.each_ref().map(|axis| axis.position_endstop.0);
        Self {
            gantry,
            names: printer::machine::motor_names(config),
            switch_mm: match config.printer.kinematics {
                Kinematics::Delta(delta) => delta.endstops().map(|at| at.0),
                _ => endstop_mm,
            },
            step_distance_mm: printer::machine::step_distances(config).map(|distance| distance.0),
            endstop_mm,
            gcode,
            planned: [0; MOTORS],
            unsure: [0; MOTORS],
            heading: [0.0; MOTORS],
            filtered: filtered(config, &gantry),
            end: None,
            moves: 0,
            homing: Vec::new(),
            pauses: 0,
            holds: 0,
            nozzle: TemperatureWatch::default(),
            min_queued: None,
            print_time: Seconds::ZERO,
            line: 0,
            error: None,
            mismatch: None,
            held: None,
            done: false,
            new_run: None,
            run_start: None,
            is_homing: false,
            began: None,
            aside: None,
            repeats: false,
            is_taken_up: false,
            told_until: Ticks(0),
            begins_within: false,
            last_change: start,
            messages: 0,
            quiet,
        }
    }

    /// The print begins with this line.
    pub(super) fn begin_with(&mut self, line: u32) {
        self.gcode.begin_with(line, self.endstop_mm);
        self.begins_within = true;
    }

    /// Takes in what happened.
    pub(super) fn take(&mut self, event: Event, printer: &mut VirtualPrinter<Tally>) -> Option<Wish> {
        if !matches!(event, Event::Temperature { .. }) {
            self.last_change = printer.now();
        }
        match event {
            Event::Phase(PhaseName::Ready) => return Some(Wish::Start),
            Event::Phase(PhaseName::Holding) => return Some(Wish::TakeUp),
            Event::Phase(PhaseName::Failed | PhaseName::Shutdown) | Event::JobCancelled => {
                return Some(Wish::End);
            }
            Event::RunStarted { at, .. } => self.new_run = Some(self.clock_of(at, printer)),
            Event::Move(scheduled) => self.take_move(&scheduled, printer),
            // An approach to an endstop was told further than it is made.
            Event::RunBroken { at } if self.is_homing => self.told_until = self.clock_of(at, printer),
            Event::RunBroken { at } => self.put_aside(at, printer),
            Event::RunResumed { at, .. } => self.go_on(at, printer),
            Event::RunEnded { at } => {
                if let Some(start) = self.run_start.take() {
                    let at = self.clock_of(at, printer);
                    self.print_time += printer.profile().clock.duration_of(at.saturating_sub(start));
                }
            }
            Event::Homed { axis, position_mm, steps } => self.take_homed(axis, position_mm, steps, printer),
            Event::Temperature { heater: Heater::Tool(0), target, .. } => {
                let state = printer.state();
                let nozzle = state.heaters.iter().find(|heater| heater.name == MOTOR_NAMES[EXTRUDER]);
                if let Some(nozzle) = nozzle {
                    self.nozzle.set_target(target, nozzle.temperature);
                }
            }
            Event::Progress { line, .. } => self.line = line,
            Event::Message(text) => {
                self.messages += 1;
                if self.messages <= MESSAGES_MAX && !self.quiet {
                    console::note(&format!("printer: {text}"));
                }
            }
            Event::Paused => {
                self.pauses += 1;
                return Some(Wish::Resume);
            }
            Event::Held(error) => {
                self.holds += 1;
                self.held = Some(error);
                return Some(Wish::Held);
            }
            Event::JobDone => {
                self.done = true;
                return Some(Wish::End);
            }
            Event::Error(error) => {
                self.error.get_or_insert(error);
                return Some(Wish::End);
            }
            Event::Dropped(count) => {
                self.mismatch.get_or_insert(format!("{count} events of the session were lost"));
            }
            Event::Identified { .. }
            | Event::Phase(_)
            | Event::Temperature { .. }
            | Event::Annotation(_)
            | Event::Object(_)
            | Event::Notice(_)
            | Event::Resumed => {}
        }
        None
    }

    fn take_move(&mut self, scheduled: &ScheduledMove, printer: &mut VirtualPrinter<Tally>) {
        let &ScheduledMove { line, from, to, homing, .. } = scheduled;
        let [start, end] = [scheduled.start, scheduled.end].map(|at| self.clock_of(at, printer));
        if (self.is_taken_up || self.repeats) && end <= self.told_until {
            return;
        }
        self.told_until = end;
        let tally = printer.recorder_mut();
        if let Some(at) = self.new_run.take() {
            tally.digest.expect_run(at, homing);
            self.is_homing = homing;
            self.run_start = (!homing && self.aside.is_none()).then_some(at);
            self.began = self.began.or(self.run_start);
            if line > 0 && core::mem::take(&mut self.begins_within) {
                // What was done on the way there has nothing to do with the file's filament.
                tally.path.set_position(EXTRUDER, from[EXTRUDER]);
            }
        }
        let mut piece = Piece { line, from, to, arc: None };
        if !homing {
            self.moves += 1;
            if line > 0 && self.mismatch.is_none() {
                match self.gcode.take(line, from, to) {
                    Ok(found) => {
                        piece.from[..EXTRUDER].copy_from_slice(&found.from[..EXTRUDER]);
                        piece.to[..EXTRUDER].copy_from_slice(&found.to[..EXTRUDER]);
                        piece.arc = found.arc;
                    }
                    Err(error) => self.mismatch = Some(format!("{error:#}")),
                }
            }
        }
        if self.aside.is_none() {
            self.plan_steps(scheduled, piece.arc.as_ref());
            self.end = Some(to);
        }
        let span = Span { line, start, end, from: piece.from, to: piece.to, arc: piece.arc, homing };
        if tally.path.expect(&span).is_err() {
            self.mismatch
                .get_or_insert_with(|| format!("line {line} was planned too far ahead to be followed"));
        }
    }

    /// Whether a run has been put aside.
    pub(super) const fn is_aside(&self) -> bool {
        self.aside.is_some()
    }

    /// The present run is put aside in a pause; what is made until it goes on, and may be broken off, is not the file's.
    fn put_aside(&mut self, at: Ticks, printer: &mut VirtualPrinter<Tally>) {
        let at = self.clock_of(at, printer);
        if self.aside.is_some() {
            return printer.recorder_mut().path.forget(at);
        }
        let (run_start, told_until) = (self.run_start.take(), self.told_until);
        self.aside = Some(Aside { at, run_start, told_until });
        self.told_until = at;
        let tally = printer.recorder_mut();
        tally.is_aside = true;
        tally.digest.put_aside();
        tally.path.put_aside(at);
    }

    /// It goes on.
    fn go_on(&mut self, at: Ticks, printer: &mut VirtualPrinter<Tally>) {
        let at = self.clock_of(at, printer);
        let Some(aside) = self.aside.take() else { return };
        let by = at.saturating_sub(aside.at);
        self.run_start = aside.run_start.map(|start| start + by);
        self.told_until = aside.told_until + by;
        self.repeats = true;
        let tally = printer.recorder_mut();
        tally.is_aside = false;
        tally.digest.go_on(by);
        tally.path.go_on(by);
    }

    /// A motion clock of the session's in 64 bits as the machine has them: a host that came later knows only 32.
    fn clock_of(&self, at: Ticks, printer: &VirtualPrinter<Tally>) -> Ticks {
        if self.is_taken_up { printer.motion_now().nearest(at.low()) } else { at }
    }

    /// Whether a motor may make other steps than its moves alone would take.
    pub(super) fn is_filtered(&self, motor: usize) -> bool {
        self.filtered[motor] || self.gcode.filters
    }

    /// Counts the steps of a move: those where it crosses half-way between two positions of a motor. An approach to an
    /// endstop counts by what was made of it, which comes with [`Event::Homed`].
    fn plan_steps(&mut self, scheduled: &ScheduledMove, arc: Option<&ArcWay>) {
        let (from, to) = (scheduled.from, scheduled.to);
        // A step or two are no approach: motors that have not stopped together are put right.
        let short = 3.0 * self.step_distance_mm[..EXTRUDER].iter().copied().fold(0.0, f64::max);
        let reaches =
            |axis: usize| to[axis] == self.endstop_mm[axis] && (from[axis] - to[axis]).abs() > short;
        if scheduled.homing && (0..EXTRUDER).any(reaches) {
            return;
        }
        let motors = |[x, y, z, e]: [f64; MOTORS]| {
            let [a, b, c] = self.gantry.motors([x, y, z]);
            [a, b, c, e]
        };
        let (from, to) = (motors(from), motors(to));
        for motor in 0..MOTORS {
            let distance = self.step_distance_mm[motor];
            let along = |way: [f64; 3]| self.gantry.motors(way)[motor];
            let turn = arc.filter(|_| motor < EXTRUDER).and_then(|arc| arc.turning_point(along));
            let turn = turn.unwrap_or(from[motor]);
            for (begin, end) in [(from[motor], turn), (turn, to[motor])] {
                self.planned[motor] += grid(begin, distance).abs_diff(grid(end, distance));
                if begin == end {
                    continue;
                }
                let turns = (end - begin) * self.heading[motor] < 0.0;
                if turns && is_half_way(begin, distance) {
                    self.unsure[motor] += 2;
                }
                self.heading[motor] = (end - begin).signum();
            }
        }
    }

    fn take_homed(
        &mut self,
        axis: usize,
        position_mm: f64,
        steps: [u64; MOTORS],
        printer: &mut VirtualPrinter<Tally>,
    ) {
        let state = printer.state();
        printer.recorder_mut().path.set_position(axis, position_mm);
        self.gcode.homed(axis, position_mm);
        for (planned, made) in self.planned.iter_mut().zip(steps) {
            *planned += made;
        }
        if self.homing.len() < HOMINGS_MAX {
            let found_mm = state.endstops.get(axis).map_or(f64::NAN, |endstop| endstop.position.0);
            self.homing.push(Homing {
                motor: self.names[axis],
                position_mm,
                error_mm: found_mm - self.switch_mm[axis],
                steps: steps[axis],
            });
        }
    }

    /// How much motion the board has ahead of it, while a run is being made and more of it is to come.
    pub(super) fn queued(&mut self, ahead: Option<Seconds>) {
        if let Some(ahead) = ahead {
            self.min_queued = Some(self.min_queued.map_or(ahead, |least| least.min(ahead)));
        }
    }

    /// All moves have been made: the file must have none left.
    pub(super) fn finish(&mut self) {
        if self.done
            && self.mismatch.is_none()
            && let Err(error) = self.gcode.finish()
        {
            self.mismatch = Some(format!("the print stopped early: {error:#}"));
        }
    }

    /// Why the job failed, as far as the session knows.
    pub(super) fn session_error(&self) -> Option<ErrorReport> {
        if let Some(error) = &self.error {
            return Some(error.into());
        }
        (!self.done).then(|| super::own_error("cancelled", "the job was cancelled before its end"))
    }
}

/// The motors on whose paths the machine file has a filter, and those whose way is not straight where the head's is.
fn filtered(config: &PrinterConfig, gantry: &Gantry) -> [bool; MOTORS] {
    let [x, y] = config.input_shaper.each_ref().map(|shaper| shaper.shaper().is_some());
    let e = config.extruder.as_ref().is_some_and(|extruder| !extruder.advance.is_none());
    let follows = |motor: usize, axis: usize| {
        let way: [f64; 3] = core::array::from_fn(|it| f64::from(u8::from(it == axis)));
        gantry.motors(way)[motor] != gantry.motors([0.0; 3])[motor]
    };
    let is_delta = matches!(gantry, Gantry::Delta(_));
    let of = |motor: usize| is_delta || (x && follows(motor, 0)) || (y && follows(motor, 1));
    [of(0), of(1), of(2), e]
}

/// An arc's path may be so far from the file's, in mm, and rounding besides.
const ARC_ERROR_MM: f64 = 2e-6;

/// Whether a place is in the middle of two motor positions, as far as an arc's place is known.
fn is_half_way(position_mm: f64, step_distance_mm: f64) -> bool {
    let steps = position_mm / step_distance_mm;
    (steps - steps.floor() - 0.5).abs() * step_distance_mm <= ARC_ERROR_MM
}

/// The number of the motor position nearest to a place; one exactly half-way belongs to the upper one. Steps a mm are what
/// counts, to the last bit.
fn grid(position_mm: f64, step_distance_mm: f64) -> i64 {
    (position_mm * (1.0 / step_distance_mm) + 0.5).floor() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_way_belongs_to_the_upper_position() {
        assert_eq!(grid(0.5, 1.0), 1);
        assert_eq!(grid(-0.5, 1.0), 0);
        assert_eq!(grid(0.49, 1.0), 0);
        assert_eq!(grid(-0.51, 1.0), -1);
        assert!(is_half_way(1.006_25, 0.0125) && is_half_way(-1.006_251, 0.0125));
        assert!(!is_half_way(1.006_26, 0.0125) && !is_half_way(1.0, 0.0125));
    }
}
