//! Where the nozzle really was: the way that the motors' fields took, sampled, and what it was doing there.
//!
//! Knows pulses and which move is under way when; nothing of what anybody claims. Positions are those of the machine, in
//! mm, which a loss of power does not move along with the claims.

use std::collections::BTreeMap;

use printer::{machine::EXTRUDER, session::ScheduledMove};
use units::Ticks;
use virtual_printer::Recorder;

/// The nozzle's place is noted each time that it has gone so far, in mm.
const SAMPLE_MM: f64 = 0.05;
/// The most places: hours of motion.
const SAMPLES_MAX: usize = 20_000_000;

/// A place on the way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// The motion clock.
    pub(super) at: Ticks,
    pub(super) place: [f64; 3],
}

/// What is done at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Doing {
    /// A line of the file is carried out, and extrudes on its way or does not.
    Line { line: u32, extrudes: bool },
    /// Something else: homing, the way to a first line.
    Other,
}

#[derive(Clone, Copy, Debug)]
struct Span {
    start: Ticks,
    end: Ticks,
    doing: Doing,
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    step_mm: [f64; 3],
    start_mm: [f64; 3],
    place: [f64; 3],
    samples: Vec<Sample>,
    spans: Vec<Span>,
    behind: Ticks,
    /// Pulses of the extruder, and whether they push.
    filament: Vec<(Ticks, bool)>,
    /// Pulses of all motors.
    pub(super) pulses: u64,
    /// Of these, those that push filament.
    pub(super) pushes: u64,
}

impl Trace {
    /// Of a machine with these steps that stands there.
    pub(super) fn new(step_mm: [f64; 3], start_mm: [f64; 3]) -> Self {
        Self {
            step_mm,
            start_mm,
            place: start_mm,
            samples: Vec::new(),
            spans: Vec::new(),
            behind: Ticks(0),
            filament: Vec::new(),
            pulses: 0,
            pushes: 0,
        }
    }

    /// A move has been planned, on the motion clock.
    pub(super) fn expect(&mut self, mv: &ScheduledMove, clock_of: impl Fn(Ticks) -> Ticks) {
        let way = (0..2).any(|axis| mv.from[axis] != mv.to[axis]);
        let extrudes = way && mv.to[EXTRUDER] > mv.from[EXTRUDER];
        let doing =
            if mv.line > 0 && !mv.homing { Doing::Line { line: mv.line, extrudes } } else { Doing::Other };
        self.spans.push(Span { start: clock_of(mv.start), end: clock_of(mv.end), doing });
    }

    /// How many steps of filament each line of the file was given so far; then that begins anew.
    pub(super) fn take_filament(&mut self) -> BTreeMap<u32, i64> {
        let mut steps = BTreeMap::new();
        let mut next = self.spans.iter().peekable();
        let mut present = None;
        for (at, pushes) in core::mem::take(&mut self.filament) {
            while let Some(span) = next.next_if(|span| span.start < at) {
                present = Some(span.doing);
            }
            if let Some(Doing::Line { line, .. }) = present {
                *steps.entry(line).or_default() += if pushes { 1 } else { -1 };
            }
        }
        steps
    }

    /// All places so far, each with what was done; then both begin anew.
    pub(super) fn take(&mut self) -> Vec<(Sample, Doing)> {
        let samples = core::mem::take(&mut self.samples);
        let spans = core::mem::take(&mut self.spans);
        let mut next = spans.iter().copied().peekable();
        let mut present: Option<Span> = None;
        let doing = |sample: &Sample| {
            while let Some(span) = next.next_if(|span| span.start < sample.at) {
                present = Some(span);
            }
            present.filter(|span| sample.at <= span.end).map_or(Doing::Other, |span| span.doing)
        };
        let doing: Vec<Doing> = samples.iter().map(doing).collect();
        samples.into_iter().zip(doing).collect()
    }
}

impl Recorder for Trace {
    fn step(&mut self, motor: usize, at: Ticks, forward: bool, count: i64) {
        self.pulses += 1;
        if motor == EXTRUDER && self.filament.len() < SAMPLES_MAX {
            self.pushes += u64::from(forward);
            self.filament.push((at - self.behind, forward));
        }
        let Some(&step_mm) = self.step_mm.get(motor) else { return };
        self.place[motor] = self.start_mm[motor] + count as f64 * step_mm;
        let far = |last: &Sample| {
            let [x, y, z] = core::array::from_fn(|axis| last.place[axis] - self.place[axis]);
            x * x + y * y + z * z >= SAMPLE_MM * SAMPLE_MM
        };
        if self.samples.last().is_none_or(far) && self.samples.len() < SAMPLES_MAX {
            self.samples.push(Sample { at: at - self.behind, place: self.place });
        }
    }

    fn motion_behind(&mut self, behind: Ticks) {
        self.behind = behind;
    }
}
