//! Planned moves in, commands for all motors out, in the order of time.

use crate::compressor::{Compressor, gap_min_ticks};
use crate::crossing::{Grid, Piece, nearest_step};
use crate::stabbing::larger;
use crate::{Cartesian, Kinematics, MotorSegment, StepCommand};
use motion::{PlannedMove, RUN_TIME_MAX};
use std::collections::VecDeque;
use thiserror::Error;
use units::{Hertz, Mm, Seconds, StepCount, Ticks};

/// The most stretches of one motor's path that wait to be turned into steps.
pub const PIECES_MAX: usize = 4096;
/// Steps of one motor that are generated before the others get their turn.
const TURN_STEPS: u32 = 256;
/// Positions are below this many steps: beyond it a float's half steps blur.
const POSITION_STEPS_MAX: f64 = 1e15;
/// A move must start this close (mm) to where the one before it ended.
const GAP_MAX_MM: f64 = 1e-6;
/// Step times may be off by this much at most, whoever asks for more.
const ERROR_MAX: Seconds = Seconds(1e-3);

/// One motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepperSpec {
    /// How far the axis goes in one step.
    pub step_distance: Mm,
    /// How early or late a step may come; never more than a quarter of the gap to either neighbour.
    pub max_error: Seconds,
}

impl StepperSpec {
    /// The usual allowance for the time of a step.
    pub const MAX_ERROR: Seconds = Seconds(25e-6);

    /// A motor with the usual allowance.
    pub const fn new(step_distance: Mm) -> Self {
        Self { step_distance, max_error: Self::MAX_ERROR }
    }
}

/// Why steps cannot be generated for a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SpecError {
    /// The list of steppers is not as long as the kinematics has motors.
    #[error("the kinematics needs {needed} motors, {given} are given")]
    Motors {
        /// What the kinematics has.
        needed: usize,
        /// What was given.
        given: usize,
    },
    /// A step distance outside 1 nm ..= 1 m.
    #[error("the step distance of motor {motor} is not usable")]
    StepDistance {
        /// Place in the list.
        motor: usize,
    },
    /// An allowance outside 0 ..= 1 ms.
    #[error("the step time error of motor {motor} is not usable")]
    MaxError {
        /// Place in the list.
        motor: usize,
    },
    /// A clock below 100 kHz.
    #[error("the clock is too slow to time steps")]
    Clock,
}

/// Why a move was not taken. Nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PushError {
    /// The motor would have to make more than 2 million steps a second, or more than a step in 4 ticks.
    #[error("motor {motor} would have to step faster than any driver can")]
    StepRate {
        /// Place in the list.
        motor: usize,
    },
    /// A position or time is not a number or too large.
    #[error("motor {motor} would leave the range of positions or times")]
    Range {
        /// Place in the list.
        motor: usize,
    },
    /// The move does not start where the run or the move before it left the motor.
    #[error("the move does not start where motor {motor} is")]
    Gap {
        /// Place in the list.
        motor: usize,
    },
    /// Steps must be taken with [`StepGenerator::pop`] first.
    #[error("steps must be taken before more moves are pushed")]
    Full,
    /// [`StepGenerator::end_run`] was called: a new run must begin first.
    #[error("the run has ended")]
    Ended,
}

/// What one motor has been given since the generator was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorStats {
    /// Steps, both ways.
    pub steps: u64,
    /// Commands of the kind `QueueStep`.
    pub queue_steps: u64,
    /// Commands of the kind `SetDir`.
    pub direction_changes: u64,
    /// The fastest two steps of one direction followed each other, in steps a second; 0 where none did.
    pub peak_steps_per_s: f64,
    /// The worst distance of a step from the time at which it was due.
    pub max_error: Seconds,
}

#[derive(Clone, Debug)]
struct Motor {
    grid: Grid,
    /// Position of the last move's end, mm.
    position: f64,
    /// Grid position at the end of the pieces.
    count: i64,
    pieces: VecDeque<Piece>,
    compressor: Compressor,
    /// No step that is still to be generated comes before this run clock, ticks.
    generated: f64,
}

/// Turns a run of motion into commands. It works only when it is asked for them, a bounded bit at a time.
#[derive(Clone, Debug)]
pub struct StepGenerator<K = Cartesian> {
    kinematics: K,
    clock: Hertz,
    motors: Vec<Motor>,
    /// Run clock at which the last move pushed ends, ticks.
    pushed: f64,
    ended: bool,
    segments: Vec<MotorSegment>,
    /// What the move in hand adds, before it is accepted.
    staged: Vec<(usize, Piece)>,
    staged_counts: Vec<i64>,
}

impl<K: Kinematics> StepGenerator<K> {
    /// A generator at rest at position 0, for a board whose clock runs at `clock`.
    pub fn new(clock: Hertz, steppers: &[StepperSpec], kinematics: K) -> Result<Self, SpecError> {
        if steppers.len() != kinematics.motors() {
            return Err(SpecError::Motors { needed: kinematics.motors(), given: steppers.len() });
        }
        if clock.0 < 100_000 {
            return Err(SpecError::Clock);
        }
        let ticks_per_s = f64::from(clock.0);
        let mut motors = Vec::with_capacity(steppers.len());
        for (motor, spec) in steppers.iter().enumerate() {
            if !(1e-6..=1e3).contains(&spec.step_distance.0) {
                return Err(SpecError::StepDistance { motor });
            }
            if !(0.0..=ERROR_MAX.0).contains(&spec.max_error.0) {
                return Err(SpecError::MaxError { motor });
            }
            motors.push(Motor {
                grid: Grid { steps_per_mm: 1.0 / spec.step_distance.0, ticks_per_s },
                position: 0.0,
                count: 0,
                pieces: VecDeque::new(),
                compressor: Compressor::new(motor, ticks_per_s, spec.max_error),
                generated: 0.0,
            });
        }
        Ok(Self {
            kinematics,
            clock,
            motors,
            pushed: 0.0,
            ended: false,
            segments: Vec::new(),
            staged: Vec::new(),
            staged_counts: Vec::new(),
        })
    }

    /// A run of motion starts at rest at `position` (x, y, z, e in mm), at tick 0. Whatever was not taken from the run
    /// before is forgotten.
    pub fn begin_run(&mut self, position: [f64; 4]) -> Result<(), PushError> {
        for motor in 0..self.motors.len() {
            let at = self.kinematics.motor_position(motor, &position);
            if !is_in_range(at * self.motors[motor].grid.steps_per_mm) {
                return Err(PushError::Range { motor });
            }
        }
        for (index, motor) in self.motors.iter_mut().enumerate() {
            motor.position = self.kinematics.motor_position(index, &position);
            motor.count = nearest_step(motor.position * motor.grid.steps_per_mm);
            motor.pieces.clear();
            motor.compressor.begin_run();
            motor.generated = 0.0;
        }
        self.pushed = 0.0;
        self.ended = false;
        Ok(())
    }

    /// Takes the next move of the run.
    pub fn push(&mut self, planned: &PlannedMove) -> Result<(), PushError> {
        if self.ended {
            return Err(PushError::Ended);
        }
        if self.is_full() {
            return Err(PushError::Full);
        }
        let end_time = planned.end_time();
        let times = [planned.start_time, planned.accel_time, planned.cruise_time, planned.decel_time];
        // Written so that NaN is refused too.
        if !(times.iter().all(|&time| time >= 0.0) && end_time <= 2.0 * RUN_TIME_MAX.0) {
            return Err(PushError::Range { motor: 0 });
        }
        self.staged.clear();
        self.staged_counts.clear();
        for motor in 0..self.motors.len() {
            self.stage(motor, planned)?;
        }
        for (motor, piece) in self.staged.drain(..) {
            self.motors[motor].pieces.push_back(piece);
        }
        for (index, motor) in self.motors.iter_mut().enumerate() {
            motor.count = self.staged_counts[index];
            motor.position = self.kinematics.motor_position(index, &planned.to);
        }
        self.pushed = self.pushed.max(end_time * f64::from(self.clock.0));
        Ok(())
    }

    fn is_full(&self) -> bool {
        self.motors.iter().any(|motor| motor.pieces.len() >= PIECES_MAX)
    }

    /// Works out one motor's share of a move.
    fn stage(&mut self, index: usize, planned: &PlannedMove) -> Result<(), PushError> {
        let motor = &self.motors[index];
        let start = self.kinematics.motor_position(index, &planned.from);
        let end = self.kinematics.motor_position(index, &planned.to);
        if !(is_in_range(start * motor.grid.steps_per_mm) && is_in_range(end * motor.grid.steps_per_mm)) {
            return Err(PushError::Range { motor: index });
        }
        if (start - motor.position).abs() > GAP_MAX_MM {
            return Err(PushError::Gap { motor: index });
        }
        self.segments.clear();
        self.kinematics.motor_segments(planned, index, &mut self.segments);
        let mut count = motor.count;
        let rate_max = 1.0 / gap_min_ticks(motor.grid.ticks_per_s);
        for segment in &self.segments {
            // A stretch without a step may claim any speed.
            let is_possible = motor.grid.peak_rate(segment) <= rate_max;
            let mut is_fast = false;
            motor.grid.split(segment, &mut count, &mut |piece| {
                is_fast |= !is_possible || piece.is_faster_than(rate_max);
                self.staged.push((index, piece));
            });
            if is_fast {
                return Err(PushError::StepRate { motor: index });
            }
        }
        self.staged_counts.push(count);
        Ok(())
    }

    /// The run ends at rest with what has been pushed: [`Self::pop`] now gives everything out.
    pub const fn end_run(&mut self) {
        self.ended = true;
    }

    /// With `end`, the same as [`Self::end_run`]. Without, nothing: steps are given out as soon as they are final.
    pub const fn flush(&mut self, end: bool) {
        self.ended |= end;
    }

    /// The next command, in the order of the (true) time of its first step over all motors; `None` until more is pushed
    /// or the run is ended.
    pub fn pop(&mut self) -> Option<StepCommand> {
        loop {
            let is_full = self.is_full();
            let order = |a: &&mut Motor, b: &&mut Motor| a.earliest().total_cmp(&b.earliest());
            let first = self.motors.iter_mut().min_by(order)?;
            if first.compressor.is_ready() {
                return first.compressor.pop();
            }
            if !first.advance(self.pushed, self.ended) {
                if !is_full {
                    return None;
                }
                // Its open command holds up a motor whose pieces have no room left.
                first.compressor.close_early(self.pushed);
                if !first.compressor.is_ready() {
                    return None;
                }
            }
        }
    }

    /// After [`Self::pop`] gave `None`: every step that is due before this run clock has been given out.
    pub fn settled(&self) -> Ticks {
        Ticks(self.motors.iter().map(Motor::earliest).fold(f64::INFINITY, f64::min) as u64)
    }

    /// Grid position of a motor at the end of the last move pushed, in steps; 0 for a motor that is not there.
    pub fn motor_steps(&self, motor: usize) -> StepCount {
        StepCount(self.motors.get(motor).map_or(0, |motor| motor.count))
    }

    /// What each motor has been given, in the order of the steppers.
    pub fn stats(&self) -> Vec<MotorStats> {
        let ticks_per_s = f64::from(self.clock.0);
        let of = |motor: &Motor| {
            let tally = &motor.compressor.tally;
            MotorStats {
                steps: tally.steps,
                queue_steps: tally.queue_steps,
                direction_changes: tally.direction_changes,
                peak_steps_per_s: ticks_per_s / tally.gap_min,
                max_error: Seconds(tally.error_max / ticks_per_s),
            }
        };
        self.motors.iter().map(of).collect()
    }
}

impl Motor {
    /// No step of this motor that has not been taken is due before this run clock, ticks.
    fn earliest(&self) -> f64 {
        self.compressor.first_time().unwrap_or(self.generated)
    }

    /// Generates some steps; `false` where nothing can be done before more is pushed.
    fn advance(&mut self, pushed: f64, ended: bool) -> bool {
        let Some(piece) = self.pieces.front_mut() else {
            let before = self.generated;
            if ended {
                self.generated = f64::INFINITY;
                self.compressor.end();
            } else {
                self.generated = larger(before, pushed);
                self.compressor.idle_until(pushed);
            }
            return self.generated > before || self.compressor.is_ready();
        };
        for _ in 0..TURN_STEPS {
            if piece.steps == 0 {
                break;
            }
            let time = piece.next_time();
            self.compressor.step(time, piece.forward);
            self.generated = time;
        }
        if piece.steps == 0 {
            self.pieces.pop_front();
        }
        true
    }
}

fn is_in_range(steps: f64) -> bool {
    steps.abs() <= POSITION_STEPS_MAX
}
