//! How long a file takes on a machine, with the planner's own look-ahead but without steps.
//!
//! Counts what [`PlanStream`](crate::planner::PlanStream) counts: motion and the file's own dwells; neither homing nor
//! waiting for temperatures. Times in seconds.

use std::collections::VecDeque;

use gcode::{Action, Heater, LineNumber, Move, Wait};
use motion::{Bend, Limits, LookAhead, MoveRequest, PlannedMove};
use units::{Celsius, Seconds};

use super::channels::{Asked, Channels, Scene};
use super::encoder::Segment;
use super::vertex::FEATURES;
use crate::{
    config::PrinterConfig,
    error::PrinterError,
    machine::{self, EXTRUDER},
    planner::{MoveEstimate, MoveKind, PLAN_CLOCK, Position, settled},
    step_rate::StepRates,
};

/// What a planned move is counted under: 5 bits of the tag are the feature, the rest is the layer.
const TRAVEL_TAG: u32 = 31;
const TAG_BITS: u32 = 5;

/// A move of the file, and what the onlooker has made of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asking<'a> {
    pub(super) mv: &'a Move,
    pub(super) bend: Option<&'a Bend>,
    pub(super) segment: Segment,
    pub(super) layer: u32,
    /// The vertex at which it ends.
    pub(super) vertex: Option<u32>,
}

/// Adds up the time of moves.
#[derive(Debug)]
pub(super) struct Estimate {
    machine: Limits,
    look_ahead: LookAhead,
    /// The moves in the look-ahead, with their lines.
    asked: VecDeque<(LineNumber, Asked)>,
    /// Where somebody wants them.
    pub(super) channels: Option<Channels>,
    scene: Scene,
    filament_area_mm2: f64,
    step_rates: StepRates,
    /// The first move that is found to be too fast for its motors, until it is taken.
    pub(super) too_fast: Option<PrinterError>,
    running: bool,
    /// Where the last move pushed ends.
    at: Position,
    total_s: f64,
    failed: bool,
    pub(super) feature_s: [f64; FEATURES],
    pub(super) layer_s: Vec<f64>,
}

impl Estimate {
    /// `None` where the machine's limits cannot be planned with.
    pub(super) fn new(config: &PrinterConfig) -> Option<Self> {
        let limits = machine::limits(config);
        Some(Self {
            machine: limits,
            look_ahead: LookAhead::with_profile(limits, machine::profile(config)).ok()?,
            asked: VecDeque::new(),
            channels: None,
            scene: Scene::default(),
            filament_area_mm2: machine::filament_area_mm2(config),
            step_rates: StepRates::new(config, PLAN_CLOCK),
            too_fast: None,
            running: false,
            at: [0.0; 4],
            total_s: 0.0,
            failed: false,
            feature_s: [0.0; FEATURES],
            layer_s: Vec::new(),
        })
    }

    pub(super) fn mv(&mut self, asking: &Asking<'_>) {
        let Asking { mv, bend, segment, layer, vertex } = *asking;
        let from = mv.from.to_array();
        let at = if self.running { self.at } else { from };
        let to = settled(at, mv.to.to_array());
        if at == to {
            return;
        }
        self.at = to;
        let bend = bend.filter(|bend| to[..EXTRUDER] != at[..EXTRUDER] && bend.fits(&from, &to));
        if !self.running {
            self.look_ahead.begin_run();
            self.running = true;
        }
        let feature = match segment {
            Segment::Travel => TRAVEL_TAG,
            Segment::Extrusion(feature) => u32::from(feature),
        };
        let request = MoveRequest { from, to, feed: mv.feed, tag: layer << TAG_BITS | feature };
        let before = self.look_ahead.len();
        if self.look_ahead.push_along(&request, bend).is_err() {
            self.failed = true;
            self.look_ahead.begin_run();
            self.asked.clear();
        } else if self.look_ahead.len() > before {
            // One without length is dropped.
            self.asked.push_back((mv.line, Asked { vertex, feed: mv.feed, scene: self.scene }));
        }
        self.take();
    }

    /// What is not a move: some of it needs the machine at rest.
    pub(super) fn act(&mut self, action: &Action) {
        match action {
            Action::SetTemperature { heater: Heater::Tool(_), target, .. } => self.scene.nozzle = *target,
            Action::TurnOffHeaters => self.scene.nozzle = Celsius::ZERO,
            Action::Fan { index: 0, speed } => self.scene.fan = *speed,
            _ => {}
        }
        match action {
            Action::Dwell(pause) if self.running => {
                self.look_ahead.dwell(*pause);
                self.take();
            }
            Action::Dwell(pause) => self.total_s += pause.0.max(0.0),
            Action::VelocityLimit(limit) => {
                let limits = machine::lowered(&self.machine, self.look_ahead.limits(), limit);
                // Limits that make no sense leave those that hold.
                let _ = self.look_ahead.set_limits(limits);
            }
            Action::SetTemperature { wait, .. } if *wait == Wait::No => {}
            Action::SetTemperature { .. }
            | Action::WaitForTemperature { .. }
            | Action::Home { .. }
            | Action::MotorsOff { .. }
            | Action::WaitForMoves
            | Action::Pause(_)
            | Action::Cancel
            | Action::EmergencyStop => self.end_run(),
            _ => {}
        }
    }

    pub(super) fn end_run(&mut self) {
        if self.running {
            self.look_ahead.flush();
            self.take();
            self.total_s += self.look_ahead.print_time().0;
            self.running = false;
        }
    }

    fn take(&mut self) {
        while let Some(planned) = self.look_ahead.pop() {
            self.judge(&planned);
            let time = planned.duration();
            let (layer, feature) = (planned.tag >> TAG_BITS, planned.tag & TRAVEL_TAG);
            if let Some(sum) = self.feature_s.get_mut(feature as usize) {
                *sum += time;
            }
            let layer = layer as usize;
            if self.layer_s.len() <= layer {
                self.layer_s.resize(layer + 1, 0.0);
            }
            self.layer_s[layer] += time;
        }
    }

    fn judge(&mut self, planned: &PlannedMove) {
        let Some((line, asked)) = self.asked.pop_front() else { return };
        if let Err(error) = self.step_rates.judge_planned(planned) {
            self.too_fast.get_or_insert(error.at_line(line.0));
        }
        if let Some(channels) = &mut self.channels {
            // Kind and layer are the vertex' own.
            let estimate = MoveEstimate::new(planned, MoveKind::Travel, 0, self.filament_area_mm2);
            channels.push(&asked, &estimate);
        }
    }

    /// No more moves come: the whole time, unless a move could not be planned.
    pub(super) fn finish(&mut self) -> Option<Seconds> {
        self.end_run();
        (!self.failed).then_some(Seconds(self.total_s))
    }
}
