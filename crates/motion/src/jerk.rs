//! Limits the jerk along the path of moves whose speeds have been planned.
//!
//! In: trapezoids, out: the same moves with speeds that stay below those, whose acceleration changes by no more than the
//! jerk allows, also from one move to the next. Only at corners it may jump: there the motors' speeds do so anyway.
//!
//! The trapezoids' speeds at the junctions are limits. Between two junctions whose speed is settled (*knots*) the
//! speed goes up, along and down again ([`s_curve`](crate::s_curve)). That lies below the trapezoids wherever their speed
//! rises and falls once; where it does not, the lowest junction that is passed too fast becomes a knot too, until none is.
//! What a knot cannot be reached from, or cannot reach, lowers it: one pass backward and one forward over all of them.
//!
//! A window of moves is worked on at a time, as if it ended at rest, and its first half is given out: when that is done
//! depends on the moves alone. Where the window is cut, the speed is so low that every limit behind can be met
//! whatever comes after the window.

use crate::PlannedMove;
use crate::planned::Phase;
use crate::s_curve::{End, Limits, highest};
use std::collections::VecDeque;

/// Moves that are worked on at a time …
pub(crate) const WINDOW_MOVES: usize = 512;
/// … fewer where they last longer, in s, so that a pause or another speed does not wait for them.
const WINDOW_TIME_S: f64 = 3.0;
/// Where the path's direction changes by more than this, it has a corner: the cosine of 5°.
const CORNER_COS: f64 = 0.996_194_698_091_745_5;
/// Speeds that are above their limit by no more than this share are on it: rounding.
const SLACK: f64 = 1e-9;
/// Steps in the search for the time at which a place is passed …
const ITERATIONS: u32 = 60;
/// … and how near they get, s.
const TIME_ERROR_S: f64 = 1e-13;
/// Shorter pieces of a phase (s) come from rounding.
const PIECE_S_MIN: f64 = 1e-12;

/// See the module's head.
#[derive(Clone, Debug)]
pub(crate) struct JerkLimiter {
    jerk: f64,
    /// Trapezoids that wait, oldest first.
    waiting: VecDeque<PlannedMove>,
    /// How long they take, s.
    waiting_time: f64,
    /// Speed at the start of the first of them.
    speed: f64,
    /// The direction in which the move before it ends.
    before: Option<[f64; 3]>,
    /// Print time at which the last move that was given out ends.
    print_time: f64,
}

/// A stretch between two knots, as junctions of the window.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    first: usize,
    last: usize,
}

impl JerkLimiter {
    pub(crate) fn new(jerk_mm_s3: f64) -> Self {
        Self {
            jerk: jerk_mm_s3,
            waiting: VecDeque::new(),
            waiting_time: 0.0,
            speed: 0.0,
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
        if waiting >= WINDOW_MOVES || waiting >= 2 && self.waiting_time >= WINDOW_TIME_S {
            self.release(waiting / 2, out);
        }
    }

    /// All moves are given out; the last ends at rest.
    pub(crate) fn flush(&mut self, out: &mut VecDeque<PlannedMove>) {
        self.release(usize::MAX, out);
    }

    /// Gives out the oldest moves, at least `count` or all, up to a knot.
    fn release(&mut self, count: usize, out: &mut VecDeque<PlannedMove>) {
        let moves = self.waiting.make_contiguous();
        if moves.is_empty() {
            return;
        }
        let mut window = Window::new(moves, self.speed, self.before, self.jerk);
        window.solve();
        let end = window.cut_at(count);
        let knots = window.knots();
        let mut phases = Vec::new();
        for pair in knots.windows(2).take_while(|pair| pair[1] <= end) {
            let stretch = Stretch { first: pair[0], last: pair[1] };
            phases.clear();
            window.shape(stretch).phases(&mut phases);
            self.print_time = cut(&moves[stretch.first..stretch.last], &phases, self.print_time, out);
        }
        self.speed = window.speed(end);
        self.before = end.checked_sub(1).map(|last| moves[last].heading(true));
        self.waiting.drain(..end);
        self.waiting_time = self.waiting.iter().map(PlannedMove::duration).sum();
    }
}

/// The moves in hand, with what has been decided at their junctions.
struct Window<'a> {
    moves: &'a [PlannedMove],
    /// The direction of the path before the first of them.
    before: Option<[f64; 3]>,
    jerk: f64,
    /// Path up to each junction, from the first move's start.
    distances: Vec<f64>,
    /// The speed at each junction that is a knot.
    speeds: Vec<Option<f64>>,
}

/// Up, along and down between two knots.
#[derive(Clone, Copy, Debug)]
struct Shape {
    limits: Limits,
    start: End,
    peak: f64,
    end: End,
    length: f64,
}

impl Shape {
    fn phases(&self, out: &mut Vec<Phase>) {
        self.limits.phases(self.start, self.peak, self.end, self.length, out);
    }
}

impl<'a> Window<'a> {
    fn new(moves: &'a [PlannedMove], speed: f64, before: Option<[f64; 3]>, jerk: f64) -> Self {
        let mut distances = vec![0.0];
        let mut distance = 0.0;
        for one in moves {
            distance += one.length;
            distances.push(distance);
        }
        let mut speeds = vec![None; moves.len() + 1];
        speeds[0] = Some(speed);
        speeds[moves.len()] = Some(0.0);
        Self { moves, before, jerk, distances, speeds }
    }

    fn knots(&self) -> Vec<usize> {
        (0..self.speeds.len()).filter(|&junction| self.speeds[junction].is_some()).collect()
    }

    /// The trapezoids' speed at a junction.
    fn limit(&self, junction: usize) -> f64 {
        self.moves.get(junction).map_or(0.0, |next| next.start_velocity)
    }

    fn length(&self, stretch: Stretch) -> f64 {
        self.distances[stretch.last] - self.distances[stretch.first]
    }

    fn limits(&self, stretch: Stretch) -> Limits {
        let moves = &self.moves[stretch.first..stretch.last];
        Limits { accel: moves.iter().fold(f64::INFINITY, |accel, one| accel.min(one.accel)), jerk: self.jerk }
    }

    /// The fastest shape of a stretch under the speed of its moves, whatever its junctions say.
    fn shape(&self, stretch: Stretch) -> Shape {
        let limits = self.limits(stretch);
        let (start, end, length) = (self.end(stretch.first), self.end(stretch.last), self.length(stretch));
        let moves = &self.moves[stretch.first..stretch.last];
        let top = moves.iter().fold(0.0, |top: f64, one| top.max(one.cruise_velocity));
        let mut shape = Shape { limits, start, end, length, peak: limits.peak(start, end, length, top) };
        // A move that is not the fastest one may have to hold the peak.
        for _ in 0..moves.len() {
            let (from, to) = (limits.way(start, shape.peak), length - limits.way(end, shape.peak));
            let first = self.distances[stretch.first];
            let slowest = moves
                .iter()
                .enumerate()
                .filter(|(index, _)| {
                    let [begin, finish] = [stretch.first + index, stretch.first + index + 1]
                        .map(|junction| self.distances[junction] - first);
                    begin <= to && finish >= from
                })
                .fold(f64::INFINITY, |slowest, (_, one)| slowest.min(one.cruise_velocity));
            if slowest >= shape.peak {
                break;
            }
            shape.peak = slowest.max(start.speed).max(end.speed);
        }
        shape
    }

    fn end(&self, junction: usize) -> End {
        End { speed: self.speed(junction), is_free: self.is_corner(junction) }
    }

    /// Whether the path bends at a junction.
    fn is_corner(&self, junction: usize) -> bool {
        let before = if junction == 0 {
            self.before
        } else {
            self.moves.get(junction - 1).map(|one| one.heading(true))
        };
        let (Some(before), Some(after)) = (before, self.moves.get(junction)) else { return false };
        let after = after.heading(false);
        let dot: f64 = (0..3).map(|axis| before[axis] * after[axis]).sum();
        dot < CORNER_COS && self.speed(junction) > 0.0
    }

    fn speed(&self, junction: usize) -> f64 {
        self.speeds[junction].unwrap_or(0.0)
    }

    /// Makes knots of all junctions that have to be.
    fn solve(&mut self) {
        let mut phases = Vec::new();
        // Every round but the last makes one knot or more.
        for _ in 0..self.moves.len() {
            let knots = self.knots();
            let mut is_settled = true;
            for pair in knots.windows(2).filter(|pair| pair[1] - pair[0] > 1) {
                let stretch = Stretch { first: pair[0], last: pair[1] };
                phases.clear();
                self.shape(stretch).phases(&mut phases);
                if let Some(junction) = self.lowest_passed_too_fast(stretch, &phases) {
                    self.speeds[junction] = Some(self.limit(junction));
                    is_settled = false;
                }
            }
            if is_settled {
                break;
            }
            self.keep_in_reach();
        }
    }

    /// Lowers knots to what the next one can be met from, and to what the one before leads to.
    fn keep_in_reach(&mut self) {
        let knots = self.knots();
        for pair in knots.windows(2).rev() {
            self.lower(pair[0], pair[1], Stretch { first: pair[0], last: pair[1] });
        }
        for pair in knots.windows(2) {
            self.lower(pair[1], pair[0], Stretch { first: pair[0], last: pair[1] });
        }
    }

    fn lower(&mut self, junction: usize, from: usize, stretch: Stretch) {
        let (speed, other) = (self.speed(junction), self.speed(from));
        // The first one holds already: the window before saw to it.
        if speed > other && junction > 0 {
            let reached =
                self.limits(stretch).reach(self.end(from), self.end(junction), self.length(stretch));
            self.speeds[junction] = Some(reached);
        }
    }

    /// The first knot behind `count` moves, its speed lowered so that whatever comes can be met.
    fn cut_at(&mut self, count: usize) -> usize {
        let end = self.moves.len();
        if count >= end {
            return end;
        }
        let found = (count..end).find(|&junction| self.speeds[junction].is_some());
        let knot = found.unwrap_or_else(|| {
            // On a smooth path: one is made, as fast as it can be.
            self.speeds[count] = Some(self.limit(count));
            self.keep_in_reach();
            self.solve();
            count
        });
        let limits = self.limits(Stretch { first: 0, last: end });
        let is_safe = |speed: f64| {
            (knot + 1..=end).all(|junction| {
                // At the end of the window nothing is known yet.
                let limit = if junction == end { speed } else { self.limit(junction) };
                let length = self.length(Stretch { first: knot, last: junction });
                limits.way_down_max(speed, limit) <= length
            })
        };
        let safe = highest(0.0, self.speed(knot), is_safe);
        if knot < end && safe < self.speed(knot) {
            self.speeds[knot] = Some(safe);
            self.keep_in_reach();
            // From a lower speed more acceleration builds up, and another junction may be passed faster than before.
            self.solve();
        }
        knot
    }

    /// Of the junctions inside a stretch that its shape passes above their limit, the one with the lowest.
    fn lowest_passed_too_fast(&self, stretch: Stretch, phases: &[Phase]) -> Option<usize> {
        let first = self.distances[stretch.first];
        let mut phases = phases.iter().peekable();
        let mut lowest: Option<usize> = None;
        for junction in stretch.first + 1..stretch.last {
            let distance = self.distances[junction] - first;
            while phases.peek().is_some_and(|phase| phase.end_distance < distance) {
                phases.next();
            }
            let Some(phase) = phases.peek() else { break };
            let speed = phase.velocity_at(time_at(phase, distance));
            let limit = self.limit(junction);
            if speed > limit * (1.0 + SLACK) + SLACK && lowest.is_none_or(|before| limit < self.limit(before))
            {
                lowest = Some(junction);
            }
        }
        lowest
    }
}

/// When a phase gets to a distance: it never goes back. Newton's steps where they stay inside, halving where not.
fn time_at(phase: &Phase, distance: f64) -> f64 {
    let (mut low, mut high) = (0.0, phase.duration);
    let mut time = 0.5 * phase.duration;
    for _ in 0..ITERATIONS {
        let ahead = phase.distance_at(time) - distance;
        if ahead < 0.0 {
            low = time;
        } else {
            high = time;
        }
        let step = time - ahead / phase.velocity_at(time);
        let next = if step > low && step < high { step } else { 0.5 * (low + high) };
        if (next - time).abs() <= TIME_ERROR_S {
            return next;
        }
        time = next;
    }
    time
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
            let until = if is_within { phase.duration } else { time_at(phase, end).max(used) };
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
