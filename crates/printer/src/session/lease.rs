//! The host's lease on motion (docs/motion-clock.md): while a run of motion is made, the board is told several times a
//! second up to where it has all steps and until when the host counts as alive. A host that is held up beyond that
//! finds the print at rest on its path instead of lost.
//!
//! A run begins with a lease that covers nothing of it: without more the board holds before the first step. So there is no
//! moment at which a host may die and leave motors to run out of steps at full speed. Of a run that is shorter than what
//! coming to rest takes, the board has all or nothing. Homing has no lease: its triggers have a time-out of their own.
//!
//! Knows no G-code and no jobs.

use units::{Seconds, Ticks};
use wire::Command;

use super::{board::Board, stream::Run};
use crate::config::PrinterConfig;

/// The host counts as alive for so long after each renewal.
const ALIVE: Seconds = Seconds(2.0);
/// How often the lease is renewed.
const RENEW: Seconds = Seconds(0.15);
/// A renewal that may come behind the end of the run waits until the lease has only this long to go.
const ALIVE_SPARE: Seconds = Seconds(1.0);
/// The shortest ramp between the full rate and rest …
const RAMP_MIN: Seconds = Seconds(0.3);
/// … and the longest: what runs on meanwhile has to be queued.
const RAMP_MAX: Seconds = Seconds(3.0);
/// … which adds at most this part of a motor's acceleration to the plan's own.
const ADDED_PART: f64 = 1.0 / 3.0;
/// The ramp where nothing moves, or what moves is all there.
pub(super) const RAMP_AT_REST: Seconds = Seconds(0.015);
/// The lease covers more once there is this much more motion than what coming to rest takes: renewals take their time.
const COVER_SPARE: Seconds = Seconds(0.5);
/// The board says four times a second how its motion goes while there is a lease. Without a word for this long, it may
/// have begun to hold.
const SILENCE_MAX: Seconds = Seconds(0.7);
/// Questions that are not answered are asked again after this long.
const ASK_AGAIN: Seconds = Seconds(0.15);

/// What the board was last told.
#[derive(Clone, Copy, Debug)]
struct Told {
    at: Seconds,
    covered: Ticks,
    /// Hardware clock.
    alive: Ticks,
    has_end: bool,
    /// Nothing of the run is covered yet.
    at_start: bool,
}

impl Told {
    /// Whether the lease needs no renewal: motion gets to its end before. Renewed behind that, it would be one that covers
    /// nothing, and the board would hold; so where it may be there by the time that a renewal is, that waits while it can.
    fn lasts(&self, board: &Board, now: Seconds) -> bool {
        if !self.has_end {
            return false;
        }
        let clock_now = board.clock_at(now);
        let gets_there = board.motion.at(clock_now.max(self.alive)) >= self.covered;
        let may_be_there = board.motion.latest(board.output_clock(now)) >= self.covered;
        gets_there || may_be_there && clock_now + board.ticks(ALIVE_SPARE) < self.alive
    }
}

/// The motion that may be vouched for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover {
    /// The board has all steps up to this motion clock.
    pub(super) until: Ticks,
    /// Motion comes to rest there by itself.
    pub(super) is_end: bool,
}

/// The lease on the run that is being made.
#[derive(Debug)]
pub(super) struct Lease {
    ramp: Seconds,
    told: Option<Told>,
    asked: Seconds,
}

impl Lease {
    /// Of a machine. A ramp slows a speed v by v/ramp, whatever the plan does at the time.
    pub(super) fn new(config: &PrinterConfig) -> Self {
        let printer = &config.printer;
        let mut limits = vec![
            (printer.max_velocity.0, printer.max_accel.0),
            (printer.max_z_velocity.0, printer.max_z_accel.0),
        ];
        limits.extend(
            config
                .extruder
                .as_ref()
                .map(|extruder| (extruder.max_extrude_only_velocity.0, extruder.max_extrude_only_accel.0)),
        );
        for axis in 0..2 {
            let velocity = printer.max_xy_velocity[axis].min(printer.max_velocity);
            limits.push((velocity.0, printer.max_xy_accel[axis].0));
        }
        // A plan by torque leaves motors most of it: a ramp may ask for as much again.
        for ability in config.abilities.iter().flatten() {
            let velocity = ability.top().min(printer.max_velocity);
            limits.push((velocity.0, ability.slowing_at_top().0 / ADDED_PART));
        }
        let ramps = limits.iter().map(|(velocity, accel)| velocity / (accel * ADDED_PART));
        let ramp = Seconds(ramps.fold(RAMP_MIN.0, f64::max).min(RAMP_MAX.0));
        Self { ramp, told: None, asked: Seconds(f64::NEG_INFINITY) }
    }

    /// The time between the full rate and rest.
    pub(super) const fn ramp(&self) -> Seconds {
        self.ramp
    }

    /// How long a board that is left alone may go on before it is at rest, counted at the full rate.
    pub(super) fn alone_max(&self) -> Seconds {
        ALIVE + self.ramp * 0.5
    }

    /// Whether the board has a lease.
    pub(super) const fn is_on(&self) -> bool {
        self.told.is_some()
    }

    /// The board says nothing of its motion for too long: asks it. Whether that is so.
    pub(super) fn is_in_doubt(&mut self, board: &mut Board, now: Seconds) -> bool {
        let clock_now = board.clock_at(now);
        let silence = clock_now.saturating_sub(board.motion.known_until());
        if self.told.is_none() || silence < board.ticks(SILENCE_MAX) {
            return false;
        }
        board.motion.doubt(clock_now);
        if now - self.asked >= ASK_AGAIN {
            self.asked = now;
            board.control(&Command::MotionGetState {});
        }
        true
    }

    /// Begins the lease, renews it, or says where it ends.
    pub(super) fn renew(&mut self, run: Run, cover: Cover, board: &mut Board, now: Seconds) {
        if run.homing {
            return;
        }
        let Some(told) = self.told else {
            // Until then nothing slows it down.
            if board.motion.is_steady() {
                board.motion.trust(board.clock_at(now));
                self.begin(run, board, now);
            }
            return;
        };
        if told.at_start {
            let motion_now = board.motion_at(now).max(run.start);
            let needed = board.ticks(Seconds(self.ramp.0 / 2.0) + COVER_SPARE);
            if cover.until >= motion_now + needed {
                self.tell(cover, board, now);
            } else if cover.is_end {
                self.lease(cover, RAMP_AT_REST, board, now);
            } else if now - told.at >= RENEW {
                self.begin(run, board, now);
            }
            return;
        }
        let ends = cover.is_end && !told.has_end;
        if ends || now - told.at >= RENEW && !told.lasts(board, now) {
            self.tell(cover, board, now);
        }
    }

    /// A lease on the time before the run.
    fn begin(&mut self, run: Run, board: &mut Board, now: Seconds) {
        self.lease(Cover { until: run.start, is_end: false }, RAMP_AT_REST, board, now);
        self.told.iter_mut().for_each(|told| told.at_start = true);
    }

    /// Tells the board what is covered, whatever it was told before.
    pub(super) fn tell(&mut self, cover: Cover, board: &mut Board, now: Seconds) {
        self.lease(cover, self.ramp, board, now);
    }

    fn lease(&mut self, cover: Cover, ramp: Seconds, board: &mut Board, now: Seconds) {
        let covered = self.told.map_or(cover.until, |told| told.covered.max(cover.until));
        let alive = board.clock_at(now) + board.ticks(ALIVE);
        let ramp = board.ticks(ramp).0 as u32;
        board.control(&Command::MotionLease { covered: covered.low().0, alive: alive.low().0, ramp });
        if cover.is_end {
            // Again and again: a board that came to rest on its last steps has ended the lease, and forgotten where it ends.
            board.control(&Command::MotionEnd { clock: cover.until.low().0 });
        }
        let has_end = cover.is_end || self.told.is_some_and(|told| told.has_end);
        self.told = Some(Told { at: now, covered, alive, has_end, at_start: false });
    }

    /// The run has been made to its end: nothing is left over for the time until the next.
    pub(super) fn end(&mut self, run: Run, board: &mut Board) {
        let Some(told) = self.told.take() else { return };
        if let Some(end) = run.end.filter(|_| !told.has_end) {
            board.control(&Command::MotionEnd { clock: end.low().0 });
        }
    }

    /// The board has no lease any more: it has dropped its queue, or all of that has been made.
    pub(super) const fn forget(&mut self) {
        self.told = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::motion_time::{Heard, MotionReport};

    /// Whether it is renewed each time, on a board that has said at 10 s that it is at 10 s, speeding up from a rate.
    fn renewed(rate: u16, told: Told, times: &[f64]) -> Vec<bool> {
        let config =
            crate::config::parse(include_str!("../../../../samples/printer.cfg")).0.expect("a machine");
        let mut board = Board::for_tests(&config);
        let clock = board.clock_at(Seconds(10.0));
        board.motion.trust(clock);
        board.motion.tell(4096, clock);
        let low = clock.low().0;
        let heard = Heard { clock_now: clock, said_after: Ticks(0), slack: Ticks(0) };
        assert_eq!(board.motion.report(&MotionReport::new(low, low, rate, 3, 0), heard), Some(clock));
        let run = Run { start: board.clock_at(Seconds(1.0)), end: Some(told.covered), homing: false };
        let mut lease = Lease::new(&config);
        let cover = Cover { until: told.covered, is_end: told.has_end };
        times
            .iter()
            .map(|&time| {
                lease.told = Some(told);
                lease.renew(run, cover, &mut board, Seconds(time));
                lease.told.is_some_and(|it| it.at == Seconds(time))
            })
            .collect()
    }

    #[test]
    fn it_is_not_renewed_where_that_may_come_behind_the_end() {
        let config =
            crate::config::parse(include_str!("../../../../samples/printer.cfg")).0.expect("a machine");
        let board = Board::for_tests(&config);
        let told = |covered: f64, has_end| Told {
            at: Seconds(9.9),
            covered: board.clock_at(Seconds(covered)),
            alive: board.clock_at(Seconds(11.9)),
            has_end,
            at_start: false,
        };
        // It may have ended by then, or not.
        assert_eq!(renewed(1200, told(10.2, true), &[10.06, 10.2, 10.5]), [false; 3]);
        // So slow, it may be under way for long: not without a lease.
        assert_eq!(renewed(4, told(10.2, true), &[10.2, 10.85, 10.95, 11.5]), [false, false, true, true]);
        // It cannot be there yet, or there is no end.
        assert_eq!(renewed(1200, told(20.0, true), &[10.0, 10.06, 10.2]), [false, true, true]);
        assert_eq!(renewed(1200, told(10.2, false), &[10.0, 10.06, 10.2]), [false, true, true]);
    }
}
