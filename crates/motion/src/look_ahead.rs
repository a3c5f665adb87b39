//! Moves in, trapezoids out: the bounded window with what may be pushed into it.

use crate::jerk::JerkLimiter;
use crate::junction::Entry;
use crate::window::Window;
use crate::{Bend, Limits, LimitsError, MotorAbility, PlannedMove};
use std::collections::VecDeque;
use thiserror::Error;
use units::{MmPerS, MmPerS3, Seconds};

/// The most moves whose speeds are still open. A window of 8 is within 0.1 % of an endless one on usual prints.
pub const LOOK_AHEAD_MOVES_MAX: usize = 1024;
/// The most planned moves that wait to be taken.
pub const READY_MOVES_MAX: usize = 4 * LOOK_AHEAD_MOVES_MAX;
/// The longest run of motion: beyond it, print time would lose its nanoseconds.
pub const RUN_TIME_MAX: Seconds = Seconds(1e7);
/// Moves are planned in batches: the backward pass visits the whole window.
const BATCH_MOVES: usize = 16;
/// Jerks outside of this are typing errors.
const JERK_MIN_MM_S3: f64 = 100.0;
const JERK_MAX_MM_S3: f64 = 1e9;
/// Farther out (mm) no printer reaches, and single steps would drown in rounding.
const COORDINATE_MAX_MM: f64 = 1e9;
/// A move must start this close (mm) to where the one before it ended.
const GAP_MAX_MM: f64 = 1e-6;

/// A straight move that somebody wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveRequest {
    /// x, y, z, e in mm: where the move before it ended.
    pub from: [f64; 4],
    /// x, y, z, e in mm.
    pub to: [f64; 4],
    /// Wanted speed along the path (of the filament, where it moves alone).
    pub feed: MmPerS,
    /// Handed back with the planned move: the line of the file, say.
    pub tag: u32,
}

/// Why a move was not taken. Nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MoveError {
    /// A coordinate that is not a number, or is beyond 10⁹ mm.
    #[error("the move has a coordinate that is not a usable number")]
    Coordinate,
    /// A feed that is not a positive number.
    #[error("the move has a feed that is not a positive number")]
    Feed,
    /// The move starts elsewhere than where the one before it ended.
    #[error("the move does not start where the one before it ended")]
    Gap,
    /// The move would make the run longer than [`RUN_TIME_MAX`].
    #[error("the move is too slow to be planned")]
    TooLong,
    /// [`READY_MOVES_MAX`] planned moves wait to be taken.
    #[error("planned moves must be taken before more can be planned")]
    Full,
}

/// What shapes the speed along the path besides the limits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// Motors that have less torque the faster they turn: one entry for each of x, y, z and the extruder, or none at all.
    pub motors: Vec<Option<MotorAbility>>,
    /// The fastest that the acceleration along the path may change.
    pub max_jerk: Option<MmPerS3>,
}

/// The limiter for a jerk, if there is one.
fn limiter(
    max_jerk: Option<MmPerS3>,
    motors: &[Option<MotorAbility>],
) -> Result<Option<JerkLimiter>, LimitsError> {
    let Some(MmPerS3(jerk)) = max_jerk else { return Ok(None) };
    if !(JERK_MIN_MM_S3..=JERK_MAX_MM_S3).contains(&jerk) {
        return Err(LimitsError::OutOfRange("max_jerk"));
    }
    if motors.iter().any(Option::is_some) {
        return Err(LimitsError::JerkWithTorque);
    }
    Ok(Some(JerkLimiter::new(jerk)))
}

/// Plans moves ahead. See the crate's head for the model.
#[derive(Clone, Debug)]
pub struct LookAhead {
    limits: Limits,
    window: Window,
    /// Where the jerk is limited too.
    limiter: Option<JerkLimiter>,
    /// What the window has released and the limiter has yet to take.
    released: VecDeque<PlannedMove>,
    ready: VecDeque<PlannedMove>,
    /// Print time at which the last released move ends, s.
    print_time: f64,
    /// Where the last planned move ends; moves that went nowhere leave it.
    planned_position: Option<[f64; 4]>,
    /// Where the last move pushed ends.
    position: Option<[f64; 4]>,
    /// Moves pushed since the last backward pass.
    unplanned: usize,
}

impl LookAhead {
    /// An empty window. Limits should have passed [`Limits::check`]; see [`Self::set_limits`].
    pub fn new(limits: Limits) -> Result<Self, LimitsError> {
        Self::with_motors(limits, Vec::new())
    }

    /// The same for a machine of whose motors some have less torque the faster they turn: one entry for each of x, y, z
    /// and the extruder, or none at all.
    pub fn with_motors(limits: Limits, motors: Vec<Option<MotorAbility>>) -> Result<Self, LimitsError> {
        Self::with_profile(limits, Profile { motors, max_jerk: None })
    }

    /// The same with all that shapes the speed along the path.
    pub fn with_profile(limits: Limits, profile: Profile) -> Result<Self, LimitsError> {
        let Profile { motors, max_jerk } = profile;
        limits.check()?;
        // What limits nothing costs nothing.
        let motors = if motors.iter().any(Option::is_some) { motors } else { Vec::new() };
        Ok(Self {
            limits,
            limiter: limiter(max_jerk, &motors)?,
            window: Window::new(motors),
            released: VecDeque::new(),
            ready: VecDeque::new(),
            print_time: 0.0,
            planned_position: None,
            position: None,
            unplanned: 0,
        })
    }

    /// The limits of the moves that are pushed from now on. Limits that fail [`Limits::check`] change nothing.
    pub fn set_limits(&mut self, limits: Limits) -> Result<(), LimitsError> {
        limits.check()?;
        self.limits = limits;
        Ok(())
    }

    /// The limits of the moves that are pushed from now on.
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Starts a run of motion: print time is zero again, and the first move may start anywhere. Moves that were not
    /// taken are forgotten.
    pub fn begin_run(&mut self) {
        self.window.clear();
        self.limiter.iter_mut().for_each(JerkLimiter::begin_run);
        self.ready.clear();
        self.print_time = 0.0;
        self.planned_position = None;
        self.position = None;
        self.unplanned = 0;
    }

    /// Takes a move. One that goes nowhere (less than 10⁻⁹ mm) is dropped without a word.
    pub fn push(&mut self, request: &MoveRequest) -> Result<(), MoveError> {
        self.push_along(request, None)
    }

    /// The same for a move whose path is a piece of an arc. One that does not [fit](Bend::fits) its ends is refused.
    pub fn push_along(&mut self, request: &MoveRequest, bend: Option<&Bend>) -> Result<(), MoveError> {
        self.check(request)?;
        if bend.is_some_and(|bend| !bend.fits(&request.from, &request.to)) {
            return Err(MoveError::Gap);
        }
        // A dropped move is not forgotten: the next one starts where the plan ends.
        let from = self.planned_position.unwrap_or(request.from);
        let request = &MoveRequest { from, ..*request };
        let Some(entry) = Entry::new(request, bend, &self.limits, self.window.motors()) else {
            self.planned_position = Some(from);
            self.position = Some(request.to);
            return Ok(());
        };
        let print_time = self.print_time + self.window.nominal_time() + entry.nominal_time;
        let gain = entry.length * entry.accel;
        // Written so that NaN and infinity are refused too.
        if !(gain > 0.0 && gain.is_finite() && print_time < RUN_TIME_MAX.0) {
            return Err(MoveError::TooLong);
        }
        if self.ready.len() >= READY_MOVES_MAX {
            return Err(MoveError::Full);
        }
        self.planned_position = Some(request.to);
        self.position = Some(request.to);
        self.window.push(entry);
        self.unplanned += 1;
        if self.unplanned >= BATCH_MOVES {
            self.unplanned = 0;
            self.release(Window::release_final);
        }
        if self.window.len() >= LOOK_AHEAD_MOVES_MAX {
            self.release(|window, time, out| window.release_oldest(LOOK_AHEAD_MOVES_MAX / 2, time, out));
        }
        Ok(())
    }

    /// Everything pushed so far ends at rest and can be taken.
    pub fn flush(&mut self) {
        self.unplanned = 0;
        self.release(|window, time, out| window.release_oldest(usize::MAX, time, out));
        if let Some(limiter) = &mut self.limiter {
            limiter.flush(&mut self.ready);
        }
    }

    /// Lets the window release moves, through the limiter where there is one.
    fn release(&mut self, how: impl FnOnce(&mut Window, &mut f64, &mut VecDeque<PlannedMove>)) {
        let Some(limiter) = &mut self.limiter else {
            return how(&mut self.window, &mut self.print_time, &mut self.ready);
        };
        how(&mut self.window, &mut self.print_time, &mut self.released);
        for planned in self.released.drain(..) {
            limiter.push(planned, &mut self.ready);
        }
    }

    /// The machine waits at rest: everything pushed so far ends, and the next move starts `pause` later. Negative
    /// pauses are none; pauses stop at [`RUN_TIME_MAX`].
    pub fn dwell(&mut self, pause: Seconds) {
        self.flush();
        if pause.0 > 0.0 {
            self.print_time = (self.print_time().0 + pause.0).min(RUN_TIME_MAX.0);
            self.limiter.iter_mut().for_each(|limiter| limiter.dwell_until(self.print_time));
        }
    }

    /// The next move whose speeds are final, in order.
    pub fn pop(&mut self) -> Option<PlannedMove> {
        let planned = self.ready.pop_front()?;
        // A plan that does not lead to where it says would have the steps that are left over made all at once.
        debug_assert!(planned.gap_mm() < 1e-6 * planned.length.max(1.0), "{planned:?}");
        Some(planned)
    }

    /// Moves that have been pushed and not been taken.
    pub fn len(&self) -> usize {
        self.window.len() + self.limiter.as_ref().map_or(0, JerkLimiter::len) + self.ready.len()
    }

    /// Whether everything pushed has been taken.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How long the moves that have not been taken will last, at least: those in the window count as if they ran at
    /// full speed throughout.
    pub fn pending_time(&self) -> Seconds {
        let print_time = self.print_time().0;
        let taken_until = self.ready.front().map_or(print_time, |planned| planned.start_time);
        let limited = self.limiter.as_ref().map_or(0.0, JerkLimiter::pending_time);
        Seconds(print_time + limited + self.window.nominal_time() - taken_until)
    }

    /// Print time at which the last final move ends.
    pub fn print_time(&self) -> Seconds {
        Seconds(self.limiter.as_ref().map_or(self.print_time, JerkLimiter::print_time))
    }

    /// Where the last move pushed in this run ends: x, y, z, e in mm.
    pub const fn position(&self) -> Option<[f64; 4]> {
        self.position
    }

    fn check(&self, request: &MoveRequest) -> Result<(), MoveError> {
        let usable = |v: &f64| v.abs() <= COORDINATE_MAX_MM;
        if !(request.from.iter().all(usable) && request.to.iter().all(usable)) {
            return Err(MoveError::Coordinate);
        }
        if !(request.feed.0 > 0.0 && request.feed.0.is_finite()) {
            return Err(MoveError::Feed);
        }
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= GAP_MAX_MM;
        match &self.position {
            Some(end) if !end.iter().zip(&request.from).all(is_near) => Err(MoveError::Gap),
            _ => Ok(()),
        }
    }
}
