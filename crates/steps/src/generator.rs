//! Planned moves in, commands for all motors out, in the order of time.

use crate::advance::Lines;
use crate::bent::{bent_segments, turning_axis};
use crate::compressor::{Compressor, gap_min_ticks};
use crate::crossing::{Grid, Piece, nearest_step};
use crate::filter::Filter;
use crate::merge::Merge;
use crate::segment::segments;
use crate::spec::{ERROR_MAX, MotorStats, PushError, SpecError, StepperSpec};
use crate::stabbing::larger;
use crate::{AXES, Advance, Cartesian, Kinematics, Segment, Shaper, StepCommand};
use motion::{PlannedMove, RUN_TIME_MAX};
use std::collections::VecDeque;
use units::{Hertz, Seconds, StepCount, Ticks};

/// With so many stretches of one motor's path that wait to be turned into steps, what can be taken has to be taken, and rows
/// are closed early.
pub const PIECES_MAX: usize = 4096;
/// The most that may wait for another motor's path, which the slowest shaper makes known 0.2 s late: 80 000 of them a second.
pub const PIECES_HELD_MAX: usize = 16_384;
/// The axis that pressure advance is for.
const EXTRUDER: usize = 3;
/// Positions are below this many steps: beyond it a float's half steps blur.
const POSITION_STEPS_MAX: f64 = 1e15;
/// A move must start this close (mm) to where the one before it ended.
const GAP_MAX_MM: f64 = 1e-6;

/// What shapes the paths of the axes, before the kinematics.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Filters {
    /// Input shapers of x, y and z.
    pub shapers: [Option<Shaper>; 3],
    /// The window over which the filament's path is smoothed, s, at most [`SMOOTH_TIME_MAX`]; none where there is no
    /// pressure advance.
    pub smooth_time: Option<Seconds>,
}

/// The widest window of smoothing.
pub const SMOOTH_TIME_MAX: Seconds = Seconds(0.2);
/// A shorter window smooths nothing, and would weigh the last digits of long runs.
const SMOOTH_TIME_MIN: Seconds = Seconds(0.002);

impl Filters {
    /// The filter on one axis.
    fn on(&self, axis: usize) -> Option<Filter> {
        match self.shapers.get(axis) {
            Some(shaper) => shaper.as_ref().map(Filter::shaper),
            None => self
                .smooth_time
                .map(|time| Filter::smoothing(time.0.clamp(SMOOTH_TIME_MIN.0, SMOOTH_TIME_MAX.0))),
        }
    }
}

/// The way of one axis from the moves to the kinematics.
#[derive(Clone, Debug, Default)]
struct Axis {
    filter: Option<Filter>,
    /// It is known up to this print time, s.
    known: f64,
}

#[derive(Clone, Debug)]
struct Motor {
    grid: Grid,
    /// The one axis that it follows …
    axis: Option<usize>,
    /// … or what brings several together.
    merge: Merge,
    /// Position of the last move's end, mm.
    position: f64,
    /// Grid position at the end of the pieces.
    count: i64,
    pieces: VecDeque<Piece>,
    compressor: Compressor,
    /// Its pieces are complete up to this run clock, ticks.
    known: f64,
    /// No step that is still to be generated comes before this run clock, ticks.
    generated: f64,
}

/// Turns a run of motion into commands. It works only when it is asked for them, a bounded bit at a time.
#[derive(Clone, Debug)]
pub struct StepGenerator<K = Cartesian> {
    kinematics: K,
    clock: Hertz,
    axes: [Axis; AXES],
    motors: Vec<Motor>,
    /// On the moves that are pushed from now on.
    advance: Lines,
    /// Where and when (s) the last move pushed ends.
    position: [f64; AXES],
    end_time: f64,
    ended: bool,
    /// Since the last move, everything possible has been taken.
    is_drained: bool,
    /// What the move in hand adds to the axes and to a motor.
    paths: [Vec<Segment>; AXES],
    segments: Vec<Segment>,
    /// Before it is accepted: how many pieces each motor had, and its grid position at the end of the new ones.
    staged: Vec<(usize, i64)>,
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
            let axes = kinematics.axes(motor);
            let alone = axes.iter().filter(|&&follows| follows).count() == 1;
            motors.push(Motor {
                grid: Grid { steps_per_mm: 1.0 / spec.step_distance.0, ticks_per_s },
                axis: axes.iter().position(|&follows| follows).filter(|_| alone),
                merge: Merge::new(axes),
                position: 0.0,
                count: 0,
                pieces: VecDeque::new(),
                compressor: Compressor::new(motor, ticks_per_s, spec.max_error, spec.search),
                known: 0.0,
                generated: 0.0,
            });
        }
        Ok(Self {
            kinematics,
            clock,
            axes: Default::default(),
            motors,
            advance: Lines::new(&Advance::NONE),
            position: [0.0; AXES],
            end_time: 0.0,
            ended: false,
            is_drained: false,
            paths: Default::default(),
            segments: Vec::new(),
            staged: Vec::new(),
        })
    }

    /// The filters of the runs that begin from now on. What was not taken from the run before is forgotten.
    pub fn set_filters(&mut self, filters: &Filters) {
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.filter = filters.on(index);
        }
        self.ended = true;
    }

    /// The pressure advance of the moves that are pushed from now on. It needs a smooth time in [`Filters`].
    pub fn set_advance(&mut self, advance: &Advance) {
        self.advance = Lines::new(advance);
    }

    /// How long after the start of a run its first move may begin: filters move an axis before its move.
    pub fn lead(&self) -> Seconds {
        Seconds(self.filters().map(Filter::lead).fold(0.0, f64::max))
    }

    /// How long after the end of a run's last move the motors may move on.
    pub fn tail(&self) -> Seconds {
        Seconds(self.filters().map(Filter::tail).fold(0.0, f64::max))
    }

    fn filters(&self) -> impl Iterator<Item = &Filter> {
        self.axes.iter().filter_map(|axis| axis.filter.as_ref())
    }

    /// What the last [`Self::push`] or [`Self::end_run`] has made known of each axis' path, after pressure advance and shaping,
    /// and the print time up to which all of them are known.
    pub fn axis_paths(&self) -> (&[Vec<Segment>; AXES], Seconds) {
        let known = self.axes.iter().map(|axis| axis.known).fold(f64::INFINITY, f64::min);
        (&self.paths, Seconds(known))
    }

    /// Segments that the filters hold: the most of any, see [`crate::SEGMENTS_HELD_MAX`].
    pub fn segments_held(&self) -> usize {
        self.filters().map(Filter::held).max().unwrap_or(0)
    }

    /// A run of motion starts at rest at `position` (x, y, z, e in mm), at tick 0. Whatever was not taken from the run
    /// before is forgotten.
    pub fn begin_run(&mut self, position: [f64; AXES]) -> Result<(), PushError> {
        for motor in 0..self.motors.len() {
            let at = self.kinematics.motor_position(motor, &position);
            if !is_in_range(at * self.motors[motor].grid.steps_per_mm) {
                return Err(PushError::Range { motor });
            }
        }
        for (axis, &at) in self.axes.iter_mut().zip(&position) {
            axis.known = 0.0;
            if let Some(filter) = &mut axis.filter {
                filter.begin(at);
            }
        }
        for (index, motor) in self.motors.iter_mut().enumerate() {
            motor.position = self.kinematics.motor_position(index, &position);
            motor.count = nearest_step(motor.position * motor.grid.steps_per_mm);
            motor.merge.begin(position);
            motor.pieces.clear();
            motor.compressor.begin_run();
            motor.known = 0.0;
            motor.generated = 0.0;
        }
        self.position = position;
        self.end_time = 0.0;
        self.ended = false;
        Ok(())
    }

    /// Takes the next move of the run. Where that fails, nothing has changed, but for [`PushError::StepRate`] with filters or
    /// motors that follow several axes: the run cannot go on then.
    pub fn push(&mut self, planned: &PlannedMove) -> Result<(), PushError> {
        if self.ended {
            return Err(PushError::Ended);
        }
        let most = if self.is_drained { PIECES_HELD_MAX } else { PIECES_MAX };
        if self.has_pieces(most) {
            return Err(PushError::Full);
        }
        let end_time = planned.end_time();
        let times = [planned.start_time, planned.accel_time, planned.cruise_time, planned.decel_time];
        // Written so that NaN is refused too.
        if !(times.iter().all(|&time| time >= 0.0) && end_time <= 2.0 * RUN_TIME_MAX.0) {
            return Err(PushError::Range { motor: 0 });
        }
        if planned.start_time < self.lead().0 {
            return Err(PushError::TooEarly);
        }
        self.check_ends(planned)?;
        self.push_to_axes(planned);
        if let Err(error) = self.stage() {
            let filtered = self.filters().next().is_some();
            let merged = self.motors.iter().any(|motor| motor.axis.is_none());
            self.ended |= filtered || merged;
            return Err(error);
        }
        self.accept();
        self.is_drained = false;
        self.position = planned.to;
        self.end_time = self.end_time.max(end_time);
        for (index, motor) in self.motors.iter_mut().enumerate() {
            motor.position = self.kinematics.motor_position(index, &planned.to);
        }
        Ok(())
    }

    fn has_pieces(&self, count: usize) -> bool {
        self.motors.iter().any(|motor| motor.pieces.len() >= count)
    }

    /// Whether every motor starts where it is and ends in its range.
    fn check_ends(&self, planned: &PlannedMove) -> Result<(), PushError> {
        for (index, motor) in self.motors.iter().enumerate() {
            let start = self.kinematics.motor_position(index, &planned.from);
            let end = self.kinematics.motor_position(index, &planned.to);
            let scale = motor.grid.steps_per_mm;
            if !(is_in_range(start * scale) && is_in_range(end * scale)) {
                return Err(PushError::Range { motor: index });
            }
            if (start - motor.position).abs() > GAP_MAX_MM {
                return Err(PushError::Gap { motor: index });
            }
        }
        Ok(())
    }

    /// What becomes known of each axis with a move.
    fn push_to_axes(&mut self, planned: &PlannedMove) {
        let draws = planned.bend.is_some() || planned.direction[0] != 0.0 || planned.direction[1] != 0.0;
        for (index, (axis, path)) in self.axes.iter_mut().zip(&mut self.paths).enumerate() {
            path.clear();
            let (from, to) = (planned.from[index], planned.to[index]);
            let turning = turning_axis(planned, index);
            // An arc's direction in space is that of its chord.
            let ratio =
                if planned.bend.is_some() { (to - from) / planned.length } else { planned.direction[index] };
            let Some(filter) = &mut axis.filter else {
                axis.known = planned.end_time();
                if let Some(turning) = turning {
                    bent_segments(planned, turning, [from, to], &mut |segment| path.push(segment));
                } else if from != to {
                    segments(planned, from, to, ratio, &mut |segment| path.push(segment));
                }
                continue;
            };
            let input = filter.path();
            input.rest_until(planned.start_time);
            if let Some(turning) = turning {
                bent_segments(planned, turning, [from, to], &mut |segment| input.push(segment));
            } else if from == to {
                input.rest_at(planned.end_time(), to);
            } else {
                let has_advance = index == EXTRUDER && draws && to > from;
                segments(planned, from, to, ratio, &mut |segment| {
                    if has_advance {
                        self.advance.apply(&segment, &mut |segment| input.push(segment));
                    } else {
                        input.push(segment);
                    }
                });
            }
            filter.drain(path);
            axis.known = filter.known_until();
        }
    }

    /// Works out the motors' shares of what has become known of the axes. Where that fails, they are taken back.
    fn stage(&mut self) -> Result<(), PushError> {
        self.staged.clear();
        for index in 0..self.motors.len() {
            let before = self.motors[index].pieces.len();
            let (count, is_possible) = self.stage_motor(index);
            self.staged.push((before, count));
            if !is_possible {
                for (motor, &(before, _)) in self.motors.iter_mut().zip(&self.staged) {
                    motor.pieces.truncate(before);
                }
                return Err(PushError::StepRate { motor: index });
            }
        }
        Ok(())
    }

    /// One motor's share: its grid position after that, and whether it can step that fast.
    fn stage_motor(&mut self, index: usize) -> (i64, bool) {
        let Motor { grid, pieces, merge, axis, count, .. } = &mut self.motors[index];
        let mut count = *count;
        let segments = if let Some(axis) = *axis {
            &self.paths[axis]
        } else {
            self.segments.clear();
            let known = self.axes.each_ref().map(|axis| axis.known);
            merge.take(&self.paths, &known, |stretch| {
                self.kinematics.motor_segments(index, stretch, &mut self.segments);
            });
            &self.segments
        };
        let rate_max = 1.0 / gap_min_ticks(grid.ticks_per_s);
        for segment in segments {
            let mut is_fast = false;
            // A stretch without a step may claim any speed.
            let is_possible = grid.peak_rate(segment) <= rate_max;
            grid.split(segment, &mut count, &mut |piece| {
                is_fast |= !is_possible || piece.is_faster_than(rate_max);
                pieces.push_back(piece);
            });
            if is_fast {
                return (count, false);
            }
        }
        (count, true)
    }

    /// The motors keep what was staged.
    fn accept(&mut self) {
        for (motor, &(_, count)) in self.motors.iter_mut().zip(&self.staged) {
            motor.count = count;
            let known = motor.axis.map_or(motor.merge.time(), |axis| self.axes[axis].known);
            motor.known = larger(motor.known, known * motor.grid.ticks_per_s);
        }
    }

    /// The run ends at rest with what has been pushed: [`Self::pop`] now gives everything out.
    pub fn end_run(&mut self) -> Result<(), PushError> {
        if self.ended {
            return Ok(());
        }
        self.ended = true;
        let end_time = self.end_time + self.tail().0;
        for (index, (axis, path)) in self.axes.iter_mut().zip(&mut self.paths).enumerate() {
            path.clear();
            if let Some(filter) = &mut axis.filter {
                filter.finish(self.end_time, self.position[index], path);
            }
            axis.known = end_time;
        }
        self.stage()?;
        self.accept();
        Ok(())
    }

    /// The next command, in the order of the (true) time of its first step over all motors; `None` until more is pushed
    /// or the run is ended.
    pub fn pop(&mut self) -> Option<StepCommand> {
        let command = self.next_command();
        self.is_drained = command.is_none();
        command
    }

    fn next_command(&mut self) -> Option<StepCommand> {
        loop {
            // The motor whose next step is first, and when another may be.
            let (mut index, mut earliest, mut others) = (0, f64::INFINITY, f64::INFINITY);
            for (motor, at) in self.motors.iter().map(Motor::earliest).enumerate() {
                if at < earliest {
                    (index, earliest, others) = (motor, at, earliest);
                } else if at < others {
                    others = at;
                }
            }
            let first = self.motors.get_mut(index)?;
            let is_stuck = loop {
                if first.compressor.is_ready() {
                    return first.compressor.pop();
                }
                if !first.advance(self.ended) {
                    break true;
                }
                if first.earliest() >= others {
                    break false;
                }
            };
            if is_stuck {
                if !self.has_pieces(PIECES_MAX) {
                    return None;
                }
                // Its open command holds up a motor whose pieces have no room left.
                let first = &mut self.motors[index];
                first.compressor.close_early(first.known);
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
        let steps = |motor: &Motor| nearest_step(motor.position * motor.grid.steps_per_mm);
        StepCount(self.motors.get(motor).map_or(0, steps))
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
    fn advance(&mut self, ended: bool) -> bool {
        let Some(piece) = self.pieces.front_mut() else {
            let before = self.generated;
            if ended {
                self.generated = f64::INFINITY;
                self.compressor.end();
            } else {
                self.generated = larger(before, self.known);
                self.compressor.idle_until(self.known);
            }
            return self.generated > before || self.compressor.is_ready();
        };
        self.generated = self.compressor.take_from(piece);
        if piece.steps == 0 {
            self.pieces.pop_front();
        }
        true
    }
}

fn is_in_range(steps: f64) -> bool {
    steps.abs() <= POSITION_STEPS_MAX
}
