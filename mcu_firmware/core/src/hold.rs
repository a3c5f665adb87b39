//! When the motion clock slows down, stops and goes on: at the host's word, and when the host's lease on motion runs out.
//!
//! A ramp between rest and the full rate takes [`RAMP_SLICES`] slices of equal length, each at the mean of the rates at
//! its ends, so the rate jumps by 1/256 from one to the next (1.2 mm/s at 300 mm/s). Slices of a ramp are never cut: what
//! changes the ramp takes effect at the end of the slice, after 1/256 of the ramp at most.
//!
//! While a lease runs, motion can always come to rest at or before the motion clock `covered` by the lease's own
//! ramp: every slice is judged before it begins ([`Hold::is_covered`]), and the full rate ends where the last moment is.
//!
//! Does not know steppers or timers: whoever calls it re-times what is due on the motion clock when it says so.

use core::cmp::Ordering;

use units::{Clock32, Hertz};
use wire::{Response, ShutdownReason};

use crate::motion_clock::{MotionClock, RATE_ONE, SLICE_TICKS_MAX};

/// Slices of a ramp between rest and the full rate.
const RAMP_SLICES: u32 = 256;
/// What the rate changes by in a whole slice.
const LEVEL_STEP: u32 = RATE_ONE / RAMP_SLICES;
/// Slices are at least this part of a second, so that a ramp leaves time for steps.
const SLICE_SECONDS_INVERSE: u32 = 20_000;
/// The longest ramp, in ticks.
const RAMP_TICKS_MAX: u32 = 1 << 30;
/// How often the state is reported while motion is leased or not at the full rate.
const REPORT_SECONDS_INVERSE: u32 = 4;
/// The wire's unit of rates is 1/4096.
const WIRE_RATE_SHIFT: u32 = 4;
const WIRE_RATE_ONE: u16 = (RATE_ONE >> WIRE_RATE_SHIFT) as u16;
/// The most events that are worked off at a time: a quarter of the clock's range in slices as long as they get, and a
/// whole ramp. If there are more, the next call goes on.
const EVENTS_MAX: u32 = 1024;

/// What the motion clock does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum State {
    Running = 0,
    Slowing = 1,
    Held = 2,
    Speeding = 3,
}

/// Why it is held, or slows down to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Reason {
    None = 0,
    Host = 1,
    /// The host has not been heard of for too long.
    Alive = 2,
    /// The queued motion was about to end in motion.
    Covered = 3,
}

/// What the host promises of the motion that it queues.
#[derive(Clone, Copy)]
struct Lease {
    /// Motion clock.
    covered: Clock32,
    alive: Clock32,
    slice_ticks: u32,
    /// Nothing was heard until `alive`.
    is_out: bool,
}

pub(crate) struct Hold {
    pub(crate) clock: MotionClock,
    state: State,
    reason: Reason,
    /// The rate at the end of the slice.
    level: u32,
    /// The rate while not held.
    running: u32,
    is_holding: bool,
    /// Length of the slices of the ramp under way.
    slice_ticks: u32,
    slice_end: Option<Clock32>,
    lease: Option<Lease>,
    /// The motion clock where the lease ends by itself.
    end: Option<Clock32>,
    report_at: Option<Clock32>,
    event_at: Option<Clock32>,
    min_slice_ticks: u32,
    report_ticks: u32,
    pub(crate) report_pending: bool,
    /// Times on the motion clock have to be worked out anew.
    retime: bool,
}

impl Hold {
    pub(crate) const fn new(clock: Hertz) -> Self {
        Self {
            clock: MotionClock::new(),
            state: State::Running,
            reason: Reason::None,
            level: RATE_ONE,
            running: RATE_ONE,
            is_holding: false,
            slice_ticks: 0,
            slice_end: None,
            lease: None,
            end: None,
            report_at: None,
            event_at: None,
            min_slice_ticks: clock.0 / SLICE_SECONDS_INVERSE + 1,
            report_ticks: clock.0 / REPORT_SECONDS_INVERSE,
            report_pending: false,
            retime: false,
        }
    }

    /// When [`Self::advance`] has to be called.
    pub(crate) const fn event_at(&self) -> Option<Clock32> {
        self.event_at
    }

    pub(crate) fn is_held(&self) -> bool {
        self.state == State::Held
    }

    /// Whether times on the motion clock have to be worked out anew since the last time this was asked.
    pub(crate) const fn take_retime(&mut self) -> bool {
        core::mem::replace(&mut self.retime, false)
    }

    pub(crate) fn report(&self, now: Clock32) -> Response<'static> {
        Response::MotionState {
            clock: now.0,
            motion: self.clock.motion(now).0,
            rate: (self.clock.rate() >> WIRE_RATE_SHIFT) as u16,
            state: self.state as u8,
            reason: self.reason as u8,
        }
    }

    /// Renews the lease: only ever forwards, but for one that had run out.
    pub(crate) fn lease(
        &mut self,
        now: Clock32,
        covered: Clock32,
        alive: Clock32,
        ramp: u32,
    ) -> Result<(), ShutdownReason> {
        let slice_ticks = self.slice_ticks_of(ramp)?;
        let later = |new: Clock32, old: Clock32| if new.is_before(old) { old } else { new };
        let mut lease = Lease { covered, alive, slice_ticks, is_out: false };
        if let Some(old) = self.lease {
            lease.covered = later(covered, old.covered);
            if !old.is_out {
                lease.alive = later(alive, old.alive);
            }
        }
        if self.end.is_some_and(|end| end.is_before(covered)) {
            self.end = None;
        }
        self.lease = Some(lease);
        self.rearm(now);
        Ok(())
    }

    /// All that is queued comes to rest by itself at `clock`.
    pub(crate) fn end_at(&mut self, now: Clock32, clock: Clock32) {
        if self.lease.is_some() {
            self.end = Some(clock);
            self.rearm(now);
        }
    }

    pub(crate) fn hold(&mut self, now: Clock32, ramp: u32) -> Result<(), ShutdownReason> {
        let slice_ticks = self.slice_ticks_of(ramp)?;
        self.brake(now, slice_ticks, Reason::Host);
        self.rearm(now);
        Ok(())
    }

    /// Goes on, unless a lease has run out or covers nothing: then it stays held and says so.
    pub(crate) fn resume(&mut self, now: Clock32, ramp: u32) -> Result<(), ShutdownReason> {
        let slice_ticks = self.slice_ticks_of(ramp)?;
        self.report_pending = true;
        let motion = self.clock.motion(now);
        let may_go = self.lease.is_none_or(|lease| {
            !lease.is_out
                && now.is_before(lease.alive)
                && (self.end.is_some() || motion.is_before(lease.covered))
        });
        if self.is_holding && may_go {
            self.is_holding = false;
            self.reason = Reason::None;
            self.turn(now, slice_ticks);
        }
        self.rearm(now);
        Ok(())
    }

    /// The rate while not held, in 1/4096.
    pub(crate) fn set_rate(&mut self, now: Clock32, rate: u16, ramp: u32) -> Result<(), ShutdownReason> {
        let slice_ticks = self.slice_ticks_of(ramp)?;
        if rate == 0 || rate > WIRE_RATE_ONE {
            return Err(ShutdownReason::InvalidMotion);
        }
        self.running = u32::from(rate) << WIRE_RATE_SHIFT;
        if !self.is_holding {
            self.turn(now, slice_ticks);
        }
        self.report_pending = true;
        self.rearm(now);
        Ok(())
    }

    fn slice_ticks_of(&self, ramp: u32) -> Result<u32, ShutdownReason> {
        if ramp > RAMP_TICKS_MAX {
            return Err(ShutdownReason::InvalidMotion);
        }
        Ok(ramp.div_ceil(RAMP_SLICES).max(self.min_slice_ticks))
    }

    /// Works off what is due by now.
    pub(crate) fn advance(&mut self, now: Clock32) {
        for _ in 0..EVENTS_MAX {
            let Some(at) = self.event_at.filter(|&at| !now.is_before(at)) else { return };
            self.event(at);
            self.rearm(at);
        }
    }

    fn event(&mut self, at: Clock32) {
        let motion = self.clock.motion(at);
        if self.end.is_some_and(|end| !motion.is_before(end)) {
            self.forget_lease();
            self.report_pending = true;
        }
        if let Some(lease) = &mut self.lease
            && !lease.is_out
            && !at.is_before(lease.alive)
        {
            lease.is_out = true;
            let slice_ticks = lease.slice_ticks;
            self.brake(at, slice_ticks, Reason::Alive);
        }
        let is_slice_over = self.slice_end.is_some_and(|end| !at.is_before(end));
        let is_last_moment = self.state == State::Running && !self.is_covered(motion, self.level, 1);
        if is_slice_over || is_last_moment {
            self.begin_slice(at);
        }
        if self.report_at.is_some_and(|report| !at.is_before(report)) {
            self.report_at = None;
            self.report_pending = true;
        }
    }

    /// Nothing is queued any more that could be covered.
    pub(crate) const fn forget_lease(&mut self) {
        self.lease = None;
        self.end = None;
    }

    /// Heads for rest; the first reason stays.
    fn brake(&mut self, at: Clock32, slice_ticks: u32, reason: Reason) {
        if !self.is_holding {
            self.is_holding = true;
            self.reason = reason;
        }
        self.turn(at, slice_ticks);
    }

    /// Heads for another rate, now or at the end of the slice of the ramp under way.
    fn turn(&mut self, at: Clock32, slice_ticks: u32) {
        self.slice_ticks = slice_ticks;
        if matches!(self.state, State::Running | State::Held) {
            self.begin_slice(at);
        }
    }

    fn begin_slice(&mut self, at: Clock32) {
        let motion = self.clock.motion(at);
        let (mut to, mut ticks) = self.next_slice();
        let used = motion_ticks(ticks, u32::midpoint(self.level, to));
        let is_steady = to == self.level;
        let is_covered = if is_steady {
            self.is_covered(motion, to, 1)
        } else {
            self.is_covered(motion, to, i64::from(used) + 1)
        };
        if let Some(lease) = self.lease.filter(|_| !is_covered && to.max(self.level) > 0) {
            if !self.is_holding {
                self.reason = Reason::Covered;
                self.slice_ticks = lease.slice_ticks;
            }
            self.is_holding = true;
            self.slice_ticks = self.slice_ticks.min(lease.slice_ticks);
            (to, ticks) = self.next_slice();
        }
        let rate = u32::midpoint(self.level, to);
        self.clock.begin(at, rate, ticks);
        self.slice_end = (rate != RATE_ONE).then(|| at.wrapping_add(ticks));
        let state = match to.cmp(&self.level) {
            Ordering::Less => State::Slowing,
            Ordering::Greater => State::Speeding,
            Ordering::Equal if to == 0 => State::Held,
            Ordering::Equal => State::Running,
        };
        self.report_pending |= state != self.state;
        self.state = state;
        self.level = to;
        self.retime = true;
    }

    /// The rate at the end of the slice that comes next, and its length.
    fn next_slice(&self) -> (u32, u32) {
        let target = if self.is_holding { 0 } else { self.running };
        let to = match self.level.cmp(&target) {
            Ordering::Less => ((self.level / LEVEL_STEP + 1) * LEVEL_STEP).min(target),
            Ordering::Greater => ((self.level - 1) / LEVEL_STEP * LEVEL_STEP).max(target),
            Ordering::Equal => return (target, SLICE_TICKS_MAX),
        };
        (to, part_of_slice(self.slice_ticks, to.abs_diff(self.level)))
    }

    /// Whether motion that has gone on by `used` ticks can still come to rest from `level` before the lease's cover
    /// ends.
    fn is_covered(&self, motion: Clock32, level: u32, used: i64) -> bool {
        match self.lease {
            Some(lease) if self.end.is_none() => {
                i64::from(lease.covered.since(motion)) - used
                    >= i64::from(rest_ticks(level, lease.slice_ticks))
            }
            _ => true,
        }
    }

    /// Sets when to be called again.
    fn rearm(&mut self, now: Clock32) {
        let is_plain = self.lease.is_none() && self.state == State::Running && self.clock.rate() == RATE_ONE;
        if is_plain {
            self.report_at = None;
        } else if self.report_at.is_none() {
            self.report_at = Some(now.wrapping_add(self.report_ticks));
        }
        let alive = self.lease.filter(|lease| !lease.is_out).map(|lease| lease.alive);
        let over = match (self.lease, self.end) {
            (Some(_), Some(end)) => self.clock.when(end),
            (Some(lease), None) if self.state == State::Running => {
                let last = lease.covered.0.wrapping_sub(rest_ticks(self.level, lease.slice_ticks));
                self.clock.when(Clock32(last))
            }
            _ => None,
        };
        let times = [self.slice_end, alive, over, self.report_at];
        let ahead = times.iter().flatten().map(|time| time.since(now).max(0)).min();
        self.event_at = ahead.map(|ahead| now.wrapping_add(ahead as u32));
    }
}

/// Hardware ticks of a part of a slice that changes the rate by `step`.
const fn part_of_slice(slice_ticks: u32, step: u32) -> u32 {
    // Slices have 2²² ticks at most, steps 2⁸.
    (slice_ticks * step).div_ceil(LEVEL_STEP)
}

/// Motion ticks in so many hardware ticks, rounded down.
const fn motion_ticks(ticks: u32, rate: u32) -> u32 {
    (ticks as u64 * rate as u64 / RATE_ONE as u64) as u32
}

/// Motion ticks that a ramp from `level` to rest uses at most.
fn rest_ticks(level: u32, slice_ticks: u32) -> u32 {
    let slices = u64::from(level / LEVEL_STEP);
    let part = level % LEVEL_STEP;
    // The means of the whole slices' rates are 1/2, 3/2 … steps, which add up to half the square of their number.
    let whole = u64::from(slice_ticks) * slices * slices * u64::from(LEVEL_STEP / 2);
    let mid = u32::midpoint(level, level - part);
    let part = u64::from(part_of_slice(slice_ticks, part)) * u64::from(mid);
    // One more for the fraction that the motion clock holds already.
    ((whole + part) / u64::from(RATE_ONE)) as u32 + 1
}
