//! Pressure advance and input shapers, as the machine file and the lines read so far have them.
//!
//! An advance changes from a move on. What changes the filters themselves (a smooth time, a shaper, an advance that
//! begins or ends) waits until the machine is at rest: a filter looks over the boundary of moves.

use std::collections::VecDeque;

use gcode::{Action, AxisShaper, InputShaper};
use steps::{Advance, Filters, Geometry, StepGenerator};
use units::Seconds;

use super::Planner;
use crate::config::{AxisShaperConfig, PrinterConfig};

/// How the paths of the axes are changed before they become steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dynamics {
    advance: Advance,
    smooth_time: Seconds,
    shapers: [AxisShaperConfig; 2],
}

impl Dynamics {
    /// Those of a machine file.
    pub(crate) fn new(config: &PrinterConfig) -> Self {
        let extruder = config.extruder.as_ref();
        Self {
            advance: extruder.map_or(Advance::NONE, |extruder| extruder.advance),
            smooth_time: extruder.map_or(Seconds(0.04), |extruder| extruder.pressure_advance_smooth_time),
            shapers: config.input_shaper,
        }
    }

    /// Those after `SET_PRESSURE_ADVANCE` and its like. In a nonlinear model it sets the linear share.
    pub(crate) fn with_advance(mut self, advance: Option<f64>, smooth_time: Option<Seconds>) -> Self {
        if let Some(value) = advance {
            match &mut self.advance {
                Advance::Linear { pressure_advance } => *pressure_advance = value,
                Advance::Tanh(model) | Advance::Reciprocal(model) => model.linear_advance = value,
            }
        }
        self.smooth_time = smooth_time.unwrap_or(self.smooth_time);
        self
    }

    /// Those after `SET_INPUT_SHAPER`.
    pub(crate) fn with_shaper(mut self, change: &InputShaper) -> Self {
        for (shaper, change) in self.shapers.iter_mut().zip([&change.x, &change.y]) {
            let AxisShaper { kind, frequency, damping_ratio } = *change;
            shaper.kind =
                kind.and_then(|kind| steps::ShaperKind::from_name(kind.name())).unwrap_or(shaper.kind);
            shaper.frequency = frequency.unwrap_or(shaper.frequency);
            shaper.damping_ratio = damping_ratio.unwrap_or(shaper.damping_ratio);
        }
        self
    }

    fn filters(&self) -> Filters {
        let [x, y] = self.shapers.each_ref().map(AxisShaperConfig::shaper);
        let smooths = !self.advance.is_none() && self.smooth_time > Seconds::ZERO;
        Filters { shapers: [x, y, None], smooth_time: smooths.then_some(self.smooth_time) }
    }

    /// What is added to the filament's path. Without smoothing it would have to jump: then there is none.
    pub(super) fn effective_advance(&self) -> Advance {
        if self.smooth_time > Seconds::ZERO { self.advance } else { Advance::NONE }
    }
}

/// The dynamics of a source, and when they come into force.
#[derive(Debug)]
pub(super) struct Course {
    machine: Dynamics,
    /// After the last line read.
    read: Dynamics,
    /// What the generator has been told.
    filters: Filters,
    /// Advances that hold once so many moves have been planned.
    advances: VecDeque<(u64, Advance)>,
}

impl Course {
    pub(super) fn new(config: &PrinterConfig) -> Self {
        let machine = Dynamics::new(config);
        Self { machine, read: machine, filters: Filters::default(), advances: VecDeque::new() }
    }

    /// Those of the machine file hold again.
    pub(super) const fn begin_job(&mut self) {
        self.read = self.machine;
    }

    /// After the last line read.
    pub(super) const fn read(&self) -> Dynamics {
        self.read
    }

    /// A line has set others, to hold for the moves after the first `pushed`. Whether the run must end first.
    pub(super) fn set(&mut self, dynamics: Dynamics, pushed: u64) -> bool {
        self.read = dynamics;
        let advance = dynamics.effective_advance();
        match self.advances.back_mut() {
            Some((after, last)) if *after == pushed => *last = advance,
            _ => self.advances.push_back((pushed, advance)),
        }
        dynamics.filters() != self.filters
    }

    /// A run begins.
    pub(super) fn begin_run(&mut self, generator: &mut StepGenerator<Geometry>) {
        self.advances.clear();
        let filters = self.read.filters();
        if filters != self.filters {
            generator.set_filters(&filters);
            self.filters = filters;
        }
        generator.set_advance(&self.read.effective_advance());
    }

    /// So many moves have been given to the generator.
    pub(super) fn planned(&mut self, moves: u64, generator: &mut StepGenerator<Geometry>) {
        while let Some((_, advance)) = self.advances.pop_front_if(|(after, _)| *after <= moves) {
            generator.set_advance(&advance);
        }
    }
}

impl Planner {
    /// Takes an advance or a shaper; one that changes the filters lets the machine come to rest first.
    pub(super) fn set_dynamics(&mut self, action: &Action) {
        let read = self.course.read();
        let dynamics = match action {
            Action::PressureAdvance { advance, smooth_time } => read.with_advance(*advance, *smooth_time),
            Action::InputShaper(change) => read.with_shaper(change),
            _ => return,
        };
        self.step_rates.set_advance(dynamics.effective_advance().slope_max());
        if self.course.set(dynamics, self.moves_pushed) {
            self.finish_run();
        } else if self.moves_planned == self.moves_pushed {
            self.course.planned(self.moves_planned, &mut self.generator);
        }
    }
}
