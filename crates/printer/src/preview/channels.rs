//! What the planner knows of each vertex's segment: 16 bytes a vertex, beside it (`docs/vertex.md`, "Planner channels").
//!
//! Comes later than the vertex, in the same order, with no gaps. Keeps what has not been taken. mm, s.

use units::{Celsius, MmPerS};

use crate::planner::MoveEstimate;

/// Words a vertex.
pub const CHANNEL_WORDS: usize = 4;
/// Units of a speed, a mm/s.
const SPEED_UNITS: f64 = 32.0;
/// Units of an acceleration, a mm/s².
const ACCEL_UNITS: f64 = 0.5;
/// Units of a flow, a mm³/s.
const FLOW_UNITS: f64 = 512.0;
/// Units of the fan's speed.
const FAN_UNITS: f64 = 100.0;
const HALF_BITS: u32 = 16;
const FAN_SHIFT: u32 = 25;
const TEMPERATURE_MAX: f64 = 511.0;
const HALF_MAX: f64 = 65_535.0;

/// What holds for a move besides its own plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Scene {
    /// The nozzle's target.
    pub(super) nozzle: Celsius,
    /// The part fan, 0 ..= 1.
    pub(super) fan: f64,
}

/// A move that has been pushed to the look-ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    /// The vertex at which it ends, if it has one.
    pub(super) vertex: Option<u32>,
    pub(super) feed: MmPerS,
    pub(super) scene: Scene,
}

/// Words of vertices, in order.
#[derive(Debug, Default)]
pub(super) struct Channels {
    /// The vertex whose words come next.
    next: u32,
    words: Vec<u32>,
}

fn half(value: f64, units: f64) -> u32 {
    // A float's conversion takes what is not a number for 0.
    (value * units).round().clamp(0.0, HALF_MAX) as u32
}

impl Channels {
    /// A move has been planned.
    pub(super) fn push(&mut self, asked: &Asked, estimate: &MoveEstimate) {
        let Some(vertex) = asked.vertex else { return };
        if vertex < self.next {
            return;
        }
        self.fill(vertex);
        let Scene { nozzle, fan } = asked.scene;
        let nozzle = nozzle.0.round().clamp(0.0, TEMPERATURE_MAX) as u32;
        let fan = (fan * FAN_UNITS).round().clamp(0.0, FAN_UNITS) as u32;
        self.words.extend_from_slice(&[
            half(estimate.peak_speed.0, SPEED_UNITS) | half(estimate.mean_speed.0, SPEED_UNITS) << HALF_BITS,
            half(estimate.accel.0, ACCEL_UNITS) | half(asked.feed.0, SPEED_UNITS) << HALF_BITS,
            half(estimate.flow_mm3_s, FLOW_UNITS) | nozzle << HALF_BITS | fan << FAN_SHIFT,
            (estimate.time.0 as f32).to_bits(),
        ]);
        self.next = vertex + 1;
    }

    /// Of vertices before this one nothing is known: zeros.
    pub(super) fn fill(&mut self, until: u32) {
        let missing = until.saturating_sub(self.next) as usize;
        self.words.resize(self.words.len() + missing * CHANNEL_WORDS, 0);
        self.next = self.next.max(until);
    }

    pub(super) fn take(&mut self) -> Vec<u32> {
        core::mem::take(&mut self.words)
    }
}
