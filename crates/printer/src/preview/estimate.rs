//! How long a file takes on a machine, with the planner's own look-ahead but without steps.
//!
//! Counts what [`PlanStream`](crate::planner::PlanStream) counts: motion and the file's own dwells; neither homing nor
//! waiting for temperatures. Times in seconds.

use std::{collections::VecDeque, sync::Arc};

use gcode::{Action, LineNumber, Move, Wait};
use motion::{Limits, LookAhead, MoveRequest, PlannedMove};
use units::Seconds;

use super::encoder::Segment;
use super::vertex::FEATURES;
use crate::{
    config::PrinterConfig,
    error::PrinterError,
    machine,
    planner::PLAN_CLOCK,
    step_rate::StepRates,
    transform::{Profiles, Transform},
};

/// What a planned move is counted under: 5 bits of the tag are the feature, the rest is the layer.
const TRAVEL_TAG: u32 = 31;
const TAG_BITS: u32 = 5;

/// Adds up the time of moves.
#[derive(Debug)]
pub(super) struct Estimate {
    machine: Limits,
    look_ahead: LookAhead,
    /// The lines of the moves in the look-ahead.
    lines: VecDeque<LineNumber>,
    step_rates: StepRates,
    /// From the file's coordinates to the machine's …
    transform: Transform,
    /// … and what can be loaded.
    profiles: Arc<Profiles>,
    /// The first move that is found to be too fast for its motors, until it is taken.
    pub(super) too_fast: Option<PrinterError>,
    running: bool,
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
            lines: VecDeque::new(),
            step_rates: StepRates::new(config, PLAN_CLOCK),
            transform: Transform::default(),
            profiles: Arc::clone(&config.profiles),
            too_fast: None,
            running: false,
            total_s: 0.0,
            failed: false,
            feature_s: [0.0; FEATURES],
            layer_s: Vec::new(),
        })
    }

    pub(super) fn mv(&mut self, mv: &Move, segment: Segment, layer: u32) {
        let (from, to) = (mv.from.to_array(), mv.to.to_array());
        if from == to {
            return;
        }
        if !self.running {
            self.look_ahead.begin_run();
            self.running = true;
        }
        let feature = match segment {
            Segment::Travel => TRAVEL_TAG,
            Segment::Extrusion(feature) => u32::from(feature),
        };
        let request = MoveRequest { from, to, feed: mv.feed, tag: layer << TAG_BITS | feature };
        if self.transform.is_identity() || from[..3] == to[..3] {
            return self.push(&request, mv.line);
        }
        let [x, y, z, e] = from;
        let [x, y, z] = self.transform.machine_from_gcode([x, y, z]);
        let mut at = [x, y, z, e];
        for to in self.transform.pieces(from, to) {
            self.push(&MoveRequest { from: at, to, ..request }, mv.line);
            at = to;
        }
    }

    fn push(&mut self, request: &MoveRequest, line: LineNumber) {
        let before = self.look_ahead.len();
        if self.look_ahead.push(request).is_err() {
            self.failed = true;
            self.look_ahead.begin_run();
            self.lines.clear();
        } else if self.look_ahead.len() > before {
            // One without length is dropped.
            self.lines.push_back(line);
        }
        self.take();
    }

    /// What is not a move: some of it needs the machine at rest.
    pub(super) fn act(&mut self, action: &Action) {
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
            Action::Skew(_) | Action::BedMesh(_) => {
                // What cannot be loaded has been said by the check.
                let _ = self.transform.set(action, &self.profiles);
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

    fn end_run(&mut self) {
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
        let line = self.lines.pop_front().unwrap_or_default();
        if let Err(error) = self.step_rates.judge_planned(planned) {
            self.too_fast.get_or_insert(error.at_line(line.0));
        }
    }

    /// No more moves come: the whole time, unless a move could not be planned.
    pub(super) fn finish(&mut self) -> Option<Seconds> {
        self.end_run();
        (!self.failed).then_some(Seconds(self.total_s))
    }
}
