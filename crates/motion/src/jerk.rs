//! Limits the jerk along the path of moves whose speeds have been planned.
//!
//! In: trapezoids, out: the same moves with speeds that stay below those, whose acceleration changes by no more than the
//! jerk allows, also from one move to the next. Only at corners it may jump: there the motors' speeds do so anyway.
//!
//! The trapezoids' speeds at the junctions are limits. Between two junctions whose speed is settled (*knots*, found in
//! [`knots`](crate::knots)) the speed goes up, along and down again ([`s_curve`](crate::s_curve)).
//!
//! A window of moves is worked on at a time, as if it ended at rest, and its first half is given out: when that is done
//! depends on the moves alone. What was planned behind it, down to rest, is kept: it can always be driven, whatever comes.
//! The next window uses as little of it as it can.

use crate::PlannedMove;
use crate::knots::{Knot, Stretch, Window};
use crate::planned::Phase;
use std::collections::VecDeque;

/// Moves that are worked on at a time …
pub(crate) const WINDOW_MOVES: usize = 512;
/// … fewer where they last longer, in s, so that a pause or another speed does not wait for them.
const WINDOW_TIME_S: f64 = 3.0;
/// A window with no knot to be cut at grows by this …
const GROWTH: f64 = 1.25;
/// … and up to so many moves: then it ends at rest.
const WAITING_MOVES_MAX: usize = 2 * WINDOW_MOVES;
/// Shorter pieces of a phase (s) come from rounding.
const PIECE_S_MIN: f64 = 1e-12;
/// At rest, at the start.
const REST: Knot = Knot { junction: 0, speed: 0.0 };

/// See the module's head.
#[derive(Clone, Debug)]
pub(crate) struct JerkLimiter {
    jerk: f64,
    /// Trapezoids that wait, oldest first.
    waiting: VecDeque<PlannedMove>,
    /// How long they take, s.
    waiting_time: f64,
    /// The knots that the oldest of them can be driven through, from the start of the first to rest.
    held: Vec<Knot>,
    /// How much larger than usual the window gets.
    growth: f64,
    /// The direction in which the move before them ends.
    before: Option<[f64; 3]>,
    /// Print time at which the last move that was given out ends.
    print_time: f64,
}

impl JerkLimiter {
    pub(crate) fn new(jerk_mm_s3: f64) -> Self {
        Self {
            jerk: jerk_mm_s3,
            waiting: VecDeque::new(),
            waiting_time: 0.0,
            held: vec![REST],
            growth: 1.0,
            before: None,
            print_time: 0.0,
        }
    }

    pub(crate) fn begin_run(&mut self) {
        *self = Self::new(self.jerk);
    }

    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }

    pub(crate) const fn print_time(&self) -> f64 {
        self.print_time
    }

    /// How long the moves that wait take at least.
    pub(crate) const fn pending_time(&self) -> f64 {
        self.waiting_time
    }

    /// The machine waits at rest, with nothing left to give out.
    pub(crate) const fn dwell_until(&mut self, print_time: f64) {
        self.print_time = print_time;
    }

    /// Takes a move that is final but for its jerk.
    pub(crate) fn push(&mut self, planned: PlannedMove, out: &mut VecDeque<PlannedMove>) {
        self.waiting_time += planned.duration();
        self.waiting.push_back(planned);
        let waiting = self.waiting.len();
        let share = (waiting as f64 / WINDOW_MOVES as f64).max(if waiting >= 2 {
            self.waiting_time / WINDOW_TIME_S
        } else {
            0.0
        });
        let is_full = waiting >= WAITING_MOVES_MAX;
        if share >= self.growth || is_full {
            let count = if is_full { usize::MAX } else { waiting / 2 };
            self.growth = if self.release(count, out) { 1.0 } else { share * GROWTH };
        }
    }

    /// All moves are given out; the last ends at rest.
    pub(crate) fn flush(&mut self, out: &mut VecDeque<PlannedMove>) {
        self.release(usize::MAX, out);
    }

    /// Gives out the oldest moves, some `count` or all, up to a knot. Whether there was one.
    fn release(&mut self, count: usize, out: &mut VecDeque<PlannedMove>) -> bool {
        let moves = self.waiting.make_contiguous();
        let mut window = Window::new(moves, self.before, self.jerk);
        window.plan(&self.held);
        let end = if count < moves.len() { window.cut(count) } else { Some(moves.len()) };
        let Some(end) = end else { return false };
        let knots: Vec<Knot> = window.knots(0).collect();
        let mut phases = Vec::new();
        for pair in knots.windows(2).take_while(|pair| pair[1].junction <= end) {
            let stretch = Stretch { first: pair[0].junction, last: pair[1].junction };
            window.phases(stretch, &mut phases);
            self.print_time = cut(&moves[stretch.first..stretch.last], &phases, self.print_time, out);
        }
        self.held = window.knots(end).map(|knot| Knot { junction: knot.junction - end, ..knot }).collect();
        if let Some(last) = end.checked_sub(1) {
            self.before = moves.get(last).map(|one| one.heading(true));
        }
        self.waiting.drain(..end);
        self.waiting_time = self.waiting.iter().map(PlannedMove::duration).sum();
        true
    }
}

/// Cuts the phases of a stretch into those of its moves; gives the print time at its end.
fn cut(moves: &[PlannedMove], phases: &[Phase], mut print_time: f64, out: &mut VecDeque<PlannedMove>) -> f64 {
    let mut next = 0;
    // How far the phase in hand has been used up.
    let mut used = 0.0;
    let mut begin = 0.0;
    for (index, one) in moves.iter().enumerate() {
        let end = begin + one.length;
        let is_last = index + 1 == moves.len();
        let mut pieces: Vec<Phase> = Vec::new();
        while let Some(phase) = phases.get(next) {
            let is_within = is_last || phase.end_distance <= end;
            let until = if is_within { phase.duration } else { phase.time_at(end).max(used) };
            if until - used > PIECE_S_MIN {
                pieces.push(Phase {
                    duration: until - used,
                    start_distance: phase.distance_at(used) - begin,
                    end_distance: phase.distance_at(until) - begin,
                    velocity: phase.velocity_at(used),
                    accel: phase.accel + phase.jerk * used,
                    jerk: phase.jerk,
                });
            }
            if !is_within {
                used = until;
                break;
            }
            next += 1;
            used = 0.0;
        }
        let planned = one.reshaped(pieces, print_time);
        print_time = planned.end_time();
        out.push_back(planned);
        begin = end;
    }
    print_time
}
