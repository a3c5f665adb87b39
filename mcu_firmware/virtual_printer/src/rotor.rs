//! One motor by itself, without a board: a field that pulses turn, and the rotor that follows as it can.
//!
//! Clocks in ticks, angles in microsteps. Knows no pins and no frame.

use crate::motor::{Mechanics, MotorState, Stops, TIME_STEP_US};

/// A motor whose driver is on, at rest at tick 0.
#[derive(Clone, Debug)]
pub struct Rotor(MotorState);

impl Rotor {
    /// A motor on a clock of so many ticks a second.
    pub fn new(mechanics: &Mechanics, clock_hz: u32) -> Self {
        let mut state = MotorState::new(mechanics, clock_hz, 0, TIME_STEP_US, Stops::NONE);
        state.energise(0, true);
        Self(state)
    }

    /// A step pulse, not before any earlier one.
    #[inline]
    pub fn step(&mut self, clock: u64, forward: bool) {
        self.0.step(clock, forward);
    }

    /// Lets time pass.
    pub fn run_until(&mut self, clock: u64) {
        self.0.advance(clock);
    }

    /// Microsteps by which the rotor has slipped: whole electrical periods, 0 while in step.
    pub fn lost(&self) -> i64 {
        self.0.lost()
    }
}
