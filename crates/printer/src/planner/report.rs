//! What a plan amounts to: times, steps and the bytes that would travel, without any board.

use gcode::{Diagnostic, LineNumber, Severity};
use motion::PlannedMove;
use steps::{StepCommand, StepCommandKind, StepSearch};
use units::{Hertz, MmPerS3, Seconds};
use wire::{
    Command,
    block::{Block, PAYLOAD_BYTES_MAX},
};

use super::{
    Barrier, Estimates, LayerTotal, MoveEstimate, Planned, Planner, Source, TimedAction, Total, TraceSample,
};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine::{self, EXTRUDER, MOTORS},
};

/// The clock for which a plan's bytes are stated.
pub const PLAN_CLOCK: Hertz = Hertz(12_000_000);

/// One motor's share of a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorReport {
    /// Steps in both directions together.
    pub steps: u64,
    /// `queue_step` messages.
    pub queue_steps: u64,
    /// The highest step rate, in steps per second.
    pub peak_steps_per_s: f64,
}

/// What a file takes on a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanReport {
    /// From the first move to the last, waits for temperatures not counted.
    pub print_time: Seconds,
    /// Moves with a length.
    pub moves: u64,
    /// Per motor, in the order of [`crate::machine::MOTOR_NAMES`].
    pub motors: [MotorReport; MOTORS],
    /// Bytes of all motion messages, in whole blocks as sent.
    pub bytes: u64,
    /// The worst distance of any step from its exact time.
    pub step_error_max: Seconds,
    /// Filament pushed less filament pulled back, in mm.
    pub filament_mm: f64,
    /// Lines that were left out because they are wrong or not understood, and the first of them: [`crate::check`] lists them.
    pub skipped_lines: u32,
    /// See `skipped_lines`.
    pub first_skipped: Option<LineNumber>,
    /// The least time that the same moves could take under the same limits, where it was asked for.
    pub bound: Option<Seconds>,
    /// What each kind of extrusion takes, and what is none: [`Estimates::features`]. All times together are the print time.
    pub features: Vec<(&'static str, Total)>,
    /// What each layer takes, from the lowest; all times together are the print time.
    pub layers: Vec<LayerTotal>,
}

/// Takes what a plan gives on its way.
pub trait PlanSink {
    /// A move has its final speeds.
    fn mv(&mut self, _planned: &PlannedMove, _estimate: &MoveEstimate) {}

    /// The axes' paths at the next time, where they were asked for ([`PlanOptions::trace`]).
    fn sample(&mut self, _sample: &TraceSample) {}
}

/// Looks at planned moves only.
struct EachMove<F>(F);

impl<F: FnMut(&PlannedMove)> PlanSink for EachMove<F> {
    fn mv(&mut self, planned: &PlannedMove, _: &MoveEstimate) {
        (self.0)(planned);
    }
}

/// What a plan may differ in from what would be printed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanOptions {
    /// Every feed of the file is multiplied by this.
    pub feed_scale: f64,
    /// Work out the least time too.
    pub bound: bool,
    /// The machine's minimum cruise ratio, where another is wanted.
    pub minimum_cruise_ratio: Option<f64>,
    /// How ramps are shaped, where not as the machine file says.
    pub ramps: Option<Ramps>,
    /// How early or late a step may come, where not as usual ([`machine::STEP_ERROR_MAX`]); 1 ms at most.
    pub step_error: Option<Seconds>,
    /// How step commands are searched for, where not as the machine file says.
    pub step_search: Option<StepSearch>,
    /// How far apart the axes' paths are sampled, where they are; above 0.
    pub trace: Option<Seconds>,
}

/// How speed goes up and down along the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ramps {
    /// At the acceleration of the limits, whatever else the machine file says.
    Even,
    /// As the motors' torque allows: the machine file has to say what that is.
    Torque,
    /// With no more jerk than this, or than the machine file says.
    Jerk(Option<MmPerS3>),
}

impl Ramps {
    fn apply(self, config: &mut PrinterConfig) -> Result<(), PrinterError> {
        let wrong = |what: &str| Err(PrinterError::new(ErrorCode::ConfigInvalid, what));
        match self {
            Self::Even => {
                config.abilities = Default::default();
                config.printer.max_jerk = None;
            }
            Self::Torque if config.abilities.iter().all(Option::is_none) => {
                return wrong("the machine file has no [motor_torque …] section");
            }
            Self::Torque => config.printer.max_jerk = None,
            Self::Jerk(jerk) => {
                config.abilities = Default::default();
                config.printer.max_jerk = jerk.or(config.printer.max_jerk);
                if config.printer.max_jerk.is_none() {
                    return wrong("the machine file has no max_jerk in [printer]");
                }
            }
        }
        Ok(())
    }
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            feed_scale: 1.0,
            bound: false,
            minimum_cruise_ratio: None,
            ramps: None,
            step_error: None,
            step_search: None,
            trace: None,
        }
    }
}

/// Plans a source without a board and packs the step commands into the blocks that would be sent. Homing takes no time
/// and no steps: the homed axes are at 0 then. Heaters are taken to be where they should.
#[derive(Debug)]
pub struct PlanStream {
    planner: Planner,
    source: Source,
    payload: Vec<u8>,
    sequence: u8,
    report: PlanReport,
    estimates: Estimates,
    /// Up to here the present run's time has been given to a layer.
    accounted: Seconds,
    /// Waits of the file outside of any run of motion.
    dwelt: Seconds,
    /// The line that was left out last.
    last_skipped: Option<LineNumber>,
}

impl PlanStream {
    /// A plan for a machine.
    pub fn new(config: &PrinterConfig) -> Result<Self, PrinterError> {
        Self::with_options(config, PlanOptions::default())
    }

    /// A plan for a machine that differs from what would be printed.
    pub fn with_options(config: &PrinterConfig, options: PlanOptions) -> Result<Self, PrinterError> {
        let mut config = config.clone();
        if let Some(ratio) = options.minimum_cruise_ratio {
            config.printer.minimum_cruise_ratio = ratio;
        }
        if let Some(ramps) = options.ramps {
            ramps.apply(&mut config)?;
        }
        if let Some(search) = options.step_search {
            config.printer.step_search = search;
        }
        let config = &config;
        let mut planner = Planner::new(config, PLAN_CLOCK)?;
        if let Some(step_error) = options.step_error {
            planner.generator = machine::step_generator(config, PLAN_CLOCK, step_error)?;
        }
        if options.bound {
            planner.bound(config);
        }
        if let Some(step) = options.trace.filter(|step| step.0 > 0.0) {
            planner.trace(step);
        }
        planner.guard.extrusion = super::ExtrusionPermit::Allowed;
        let mut source = Source::new(machine::gcode_settings(config));
        planner.adopt(&mut source);
        source.interpreter.set_speed_factor(options.feed_scale);
        Ok(Self {
            planner,
            source,
            payload: Vec::with_capacity(PAYLOAD_BYTES_MAX),
            sequence: 0,
            report: PlanReport::default(),
            estimates: Estimates::new(machine::filament_area_mm2(config)),
            accounted: Seconds::ZERO,
            dwelt: Seconds::ZERO,
            last_skipped: None,
        })
    }

    /// How many bytes of G-code may be fed now.
    pub fn wants(&self) -> usize {
        self.source.wants()
    }

    /// Takes G-code and appends the blocks that follow from it to `blocks`; each planned move goes to `each_move`.
    pub fn feed(
        &mut self,
        gcode: &[u8],
        blocks: &mut Vec<u8>,
        each_move: impl FnMut(&PlannedMove),
    ) -> Result<(), PrinterError> {
        self.feed_to(gcode, blocks, &mut EachMove(each_move))
    }

    /// The same, with all that there is to say of the plan.
    pub fn feed_to(
        &mut self,
        gcode: &[u8],
        blocks: &mut Vec<u8>,
        sink: &mut impl PlanSink,
    ) -> Result<(), PrinterError> {
        self.source.feed(gcode);
        self.run(blocks, sink)
    }

    /// Says that the file has ended, and tells what it amounts to.
    pub fn finish(
        self,
        blocks: &mut Vec<u8>,
        each_move: impl FnMut(&PlannedMove),
    ) -> Result<PlanReport, PrinterError> {
        self.finish_to(blocks, &mut EachMove(each_move))
    }

    /// The same, with all that there is to say of the plan.
    pub fn finish_to(
        mut self,
        blocks: &mut Vec<u8>,
        sink: &mut impl PlanSink,
    ) -> Result<PlanReport, PrinterError> {
        self.source.end();
        self.run(blocks, sink)?;
        self.send(blocks);
        let stats = self.planner.generator().stats();
        for (motor, stats) in self.report.motors.iter_mut().zip(stats) {
            *motor = MotorReport {
                steps: stats.steps,
                queue_steps: stats.queue_steps,
                peak_steps_per_s: stats.peak_steps_per_s,
            };
            self.report.step_error_max = self.report.step_error_max.max(stats.max_error);
        }
        self.report.bound = self.planner.bound.as_ref().map(|bound| bound.total() + self.dwelt);
        self.report.features = self.estimates.features().collect();
        self.report.layers = self.estimates.layers().collect();
        Ok(self.report)
    }

    fn run(&mut self, blocks: &mut Vec<u8>, sink: &mut impl PlanSink) -> Result<(), PrinterError> {
        loop {
            match self.planner.next(&mut self.source)? {
                Planned::NeedsInput | Planned::EndOfSource => return Ok(()),
                Planned::Move(planned, _) => {
                    self.report.moves += 1;
                    self.report.filament_mm += planned.to[EXTRUDER] - planned.from[EXTRUDER];
                    self.account(Seconds(planned.start_time));
                    self.accounted = Seconds(planned.end_time());
                    sink.mv(&planned, &self.estimates.take(&planned));
                    self.sample(sink);
                }
                Planned::Steps(command) => self.pack(&command, blocks),
                Planned::RunStarted(position) => {
                    self.accounted = Seconds::ZERO;
                    self.planner.trace.iter_mut().for_each(|trace| trace.begin_run(position));
                    for motor in 0..MOTORS {
                        self.pack_message(&Command::ResetStepClock { oid: motor as u8, clock: 0 }, blocks);
                    }
                }
                Planned::RunEnded(at) => {
                    self.account(at);
                    self.rest(at, sink);
                }
                Planned::Barrier { barrier: Barrier::Dwell(duration), .. } => {
                    self.dwelt += duration;
                    self.estimates.pause(duration);
                    self.rest(duration, sink);
                }
                Planned::Barrier { barrier, .. } => self.pass(&barrier),
                Planned::Timed { line, action: TimedAction::Annotation(annotation), .. } => {
                    self.estimates.annotate(line.0, &annotation);
                }
                Planned::Notice(notice) => self.note(&notice),
                Planned::Timed { .. } => {}
            }
        }
    }

    /// Counts a line that was left out, once.
    fn note(&mut self, notice: &Diagnostic) {
        let is_skipped = matches!(notice.severity, Severity::Blocking | Severity::Error);
        if is_skipped && self.last_skipped != Some(notice.line) {
            self.last_skipped = Some(notice.line);
            self.report.first_skipped.get_or_insert(notice.line);
            self.report.skipped_lines = self.report.skipped_lines.saturating_add(1);
        }
    }

    /// Up to this time of the run nothing moves.
    fn account(&mut self, until: Seconds) {
        self.estimates.pause((until - self.accounted).max(Seconds::ZERO));
    }

    /// A run or a rest has ended after this time.
    fn rest(&mut self, time: Seconds, sink: &mut impl PlanSink) {
        self.report.print_time += time;
        self.planner.trace.iter_mut().for_each(|trace| trace.last_until(time));
        self.sample(sink);
        self.planner.trace.iter_mut().for_each(|trace| trace.go_on_after(time));
    }

    fn sample(&mut self, sink: &mut impl PlanSink) {
        let Some(trace) = &mut self.planner.trace else { return };
        while let Some(sample) = trace.next() {
            sink.sample(&sample);
        }
    }

    fn pass(&mut self, barrier: &Barrier) {
        match barrier {
            Barrier::Home(axes) => {
                for axis in (0..3).filter(|&axis| axes[axis]) {
                    self.planner.set_axis(axis, 0.0, true);
                }
                self.planner.tell_homed(*axes, &mut self.source);
            }
            Barrier::Dwell(_)
            | Barrier::WaitTemperature { .. }
            | Barrier::MotorsOff(_)
            | Barrier::WaitForMoves
            | Barrier::WaitForTemperature { .. }
            | Barrier::Pause(_)
            | Barrier::Cancel
            | Barrier::EmergencyStop => {}
        }
    }

    fn pack(&mut self, command: &StepCommand, blocks: &mut Vec<u8>) {
        let oid = command.motor as u8;
        let message = match command.kind {
            StepCommandKind::SetDir { forward } => Command::SetNextStepDir { oid, dir: u8::from(forward) },
            StepCommandKind::QueueStep { interval, count, add } => {
                Command::QueueStep { oid, interval, count, add }
            }
        };
        self.pack_message(&message, blocks);
    }

    fn pack_message(&mut self, message: &Command<'_>, blocks: &mut Vec<u8>) {
        let before = self.payload.len();
        message.encode(&mut self.payload);
        if self.payload.len() > PAYLOAD_BYTES_MAX {
            let message = self.payload.split_off(before);
            self.send(blocks);
            self.payload.extend_from_slice(&message);
        }
    }

    fn send(&mut self, blocks: &mut Vec<u8>) {
        if self.payload.is_empty() {
            return;
        }
        let block = Block::new(self.sequence, &self.payload);
        self.sequence = self.sequence.wrapping_add(1);
        self.report.bytes += block.as_bytes().len() as u64;
        blocks.extend_from_slice(block.as_bytes());
        self.payload.clear();
    }
}
