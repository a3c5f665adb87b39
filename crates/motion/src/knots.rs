//! Which junctions of a window of moves are knots, and how fast each is passed.
//!
//! In: moves with trapezoids of speed, and knots that are settled already; out: knots up to rest at the window's end, such
//! that the speed goes up, along and down again ([`s_curve`](crate::s_curve)) from each to the next, below the trapezoids.
//! What is found is checked as it will be driven; where nothing holds, more of the settled knots are kept, and behind them
//! rest is always possible. Does not know: print time, which moves are given out when.
//!
//! mm, mm/s, mm/s², mm/s³.

use crate::PlannedMove;
use crate::planned::Phase;
use crate::s_curve::{End, Limits, highest};

/// Where the path's direction changes by more than this, it has a corner: the cosine of 5°.
const CORNER_COS: f64 = 0.996_194_698_091_745_5;
/// Speeds that are above their limit by no more than this share are on it: rounding.
const SLACK: f64 = 1e-9;
/// The ramps of a stretch lead to its end, mm (and share of its length): rounding.
const GAP_MAX: f64 = 1e-8;
/// A limit that is below the top speed by no more than this share lowers that; one that is lower still becomes a knot.
const NEAR: f64 = 0.99;
/// Attempts to slow down at once before more of the settled knots are kept.
const BRAKINGS: u32 = 4;

/// A junction of the window whose speed is settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Knot {
    pub(crate) junction: usize,
    pub(crate) speed: f64,
}

/// A stretch between two knots, as junctions of the window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    pub(crate) first: usize,
    pub(crate) last: usize,
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

/// The moves in hand, with what has been decided at their junctions.
pub(crate) struct Window<'a> {
    moves: &'a [PlannedMove],
    /// The direction of the path before the first of them.
    before: Option<[f64; 3]>,
    jerk: f64,
    /// Path up to each junction, from the first move's start.
    distances: Vec<f64>,
    /// What is decided.
    marks: Vec<Mark>,
    /// Nothing changes at this junction and before it.
    start: usize,
    phases: Vec<Phase>,
}

/// What has been decided at one junction.
#[derive(Clone, Copy, Debug, Default)]
struct Mark {
    /// Its speed, where it is a knot.
    speed: Option<f64>,
    /// The speed that it should have if its neighbours can be reached from it.
    wish: Option<f64>,
    /// It has been a knot that its neighbours did not allow, and was taken away: as a knot again it is lowered.
    is_stubborn: bool,
    /// The stretch from here that holds: its other end and both speeds.
    proved: Option<(usize, f64, f64)>,
}

/// What is known of a stretch.
enum Proof {
    /// It can be driven.
    Holds,
    /// This junction of it is passed too fast.
    Knot(usize),
    /// One end cannot be met from the other.
    Fails,
}

impl<'a> Window<'a> {
    pub(crate) fn new(moves: &'a [PlannedMove], before: Option<[f64; 3]>, jerk: f64) -> Self {
        let mut distances = vec![0.0];
        let mut distance = 0.0;
        for one in moves {
            distance += one.length;
            distances.push(distance);
        }
        let marks = vec![Mark::default(); moves.len() + 1];
        Self { moves, before, jerk, distances, marks, start: 0, phases: Vec::new() }
    }

    /// Settles all knots: as few of the `held` ones are kept as possible, but the first. They lead to rest.
    pub(crate) fn plan(&mut self, held: &[Knot]) {
        let mut kept = 1;
        loop {
            let Some(last) = held.get(kept - 1) else { return };
            self.begin(&held[..kept], last.junction);
            if self.solve() {
                return;
            }
            if kept == held.len() {
                break;
            }
            kept = (2 * kept).min(held.len());
        }
        // From rest, one can stop at every junction.
        let last = held.last().map_or(0, |last| last.junction);
        self.begin(held, self.moves.len());
        for mark in &mut self.marks[last + 1..] {
            mark.speed = Some(0.0);
        }
    }

    /// Takes knots up to `start` as they are, and the window's end.
    fn begin(&mut self, knots: &[Knot], start: usize) {
        self.start = start;
        for mark in &mut self.marks {
            *mark = Mark { proved: mark.proved, ..Mark::default() };
        }
        if let Some(last) = self.marks.last_mut() {
            (last.speed, last.wish) = (Some(0.0), Some(0.0));
        }
        for knot in knots {
            let mark = &mut self.marks[knot.junction];
            (mark.speed, mark.wish) = (Some(knot.speed), Some(knot.speed));
        }
    }

    /// A knot behind which the rest of the window may be planned anew, the first from `count` on if there is one. Its speed is
    /// so low that each limit behind it can be met at once. None where no junction but the ends can be a knot.
    pub(crate) fn cut(&mut self, count: usize) -> Option<usize> {
        let end = self.moves.len();
        let found = (count..end).find(|&junction| self.marks[junction].speed.is_some());
        if let Some(knot) = found {
            let speed = self.safe_speed(knot, self.speed(knot));
            if speed < self.speed(knot) && knot > self.start {
                self.settle(knot, speed);
            }
            return Some(knot);
        }
        // On a smooth path: one is made, as fast as it can be.
        for junction in [count, count + (end - count) / 2, count / 2] {
            if junction > self.start && junction < end {
                let speed = self.safe_speed(junction, self.limit(junction));
                if self.settle(junction, speed) {
                    return Some(junction);
                }
            }
        }
        (1..count).rev().find(|&junction| self.marks[junction].speed.is_some())
    }

    /// The knots from a junction on.
    pub(crate) fn knots(&self, from: usize) -> impl Iterator<Item = Knot> {
        (from..self.marks.len())
            .filter_map(|junction| self.marks[junction].speed.map(|speed| Knot { junction, speed }))
    }

    /// The phases of a stretch.
    pub(crate) fn phases(&self, stretch: Stretch, out: &mut Vec<Phase>) {
        let Shape { limits, start, peak, end, length } = self.shape(stretch);
        out.clear();
        limits.phases(start, peak, end, length, out);
    }

    /// Makes a knot of a junction and solves again; changes nothing where that does not work.
    fn settle(&mut self, junction: usize, speed: f64) -> bool {
        let before = self.marks.clone();
        let mark = &mut self.marks[junction];
        (mark.wish, mark.is_stubborn) = (Some(speed), true);
        let is_solved = self.solve() && self.marks[junction].speed.is_some();
        if !is_solved {
            self.marks = before;
        }
        is_solved
    }

    /// The highest speed at a junction, up to `speed`, from which one can slow down at once for whatever is behind.
    fn safe_speed(&self, knot: usize, speed: f64) -> f64 {
        let end = self.moves.len();
        let limits = self.limits(Stretch { first: 0, last: end });
        highest(0.0, speed, |speed| {
            (knot + 1..=end).all(|junction| {
                // At the end of the window nothing is known yet.
                let limit = if junction == end { speed } else { self.limit(junction) };
                limits.way_down_max(speed, limit) <= self.length(Stretch { first: knot, last: junction })
            })
        })
    }

    /// The trapezoids' speed at a junction.
    fn limit(&self, junction: usize) -> f64 {
        self.moves.get(junction).map_or(0.0, |next| next.start_velocity)
    }

    fn speed(&self, junction: usize) -> f64 {
        self.marks[junction].speed.unwrap_or(0.0)
    }

    fn length(&self, stretch: Stretch) -> f64 {
        self.distances[stretch.last] - self.distances[stretch.first]
    }

    fn limits(&self, stretch: Stretch) -> Limits {
        let moves = &self.moves[stretch.first..stretch.last];
        Limits { accel: moves.iter().fold(f64::INFINITY, |accel, one| accel.min(one.accel)), jerk: self.jerk }
    }

    fn end(&self, junction: usize) -> End {
        self.end_at(junction, self.speed(junction))
    }

    fn end_at(&self, junction: usize, speed: f64) -> End {
        End { speed, is_free: speed > 0.0 && self.is_corner(junction) }
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
        dot < CORNER_COS
    }

    /// The stretches behind `start`, in their order or backward.
    fn stretches(&self, is_backward: bool) -> Vec<Stretch> {
        let knots: Vec<usize> = self.knots(self.start).map(|knot| knot.junction).collect();
        let pairs = knots.windows(2).map(|pair| Stretch { first: pair[0], last: pair[1] });
        if is_backward { pairs.rev().collect() } else { pairs.collect() }
    }

    /// The fastest shape of a stretch under the speed of its moves, whatever its junctions say.
    fn shape(&self, stretch: Stretch) -> Shape {
        let limits = self.limits(stretch);
        let (start, end, length) = (self.end(stretch.first), self.end(stretch.last), self.length(stretch));
        let moves = &self.moves[stretch.first..stretch.last];
        let top = moves.iter().fold(0.0, |top: f64, one| top.max(one.cruise_velocity));
        let mut shape = Shape { limits, start, end, length, peak: limits.peak(start, end, length, top) };
        // A move that is not the fastest one may have to hold the peak …
        self.lower_peak(stretch, &mut shape, f64::INFINITY);
        // … and junctions that are hardly slower.
        let near = NEAR * shape.peak;
        self.lower_peak(stretch, &mut shape, near);
        shape
    }

    /// Lowers the peak of a shape to what holds where it is driven: the speeds of moves, and of junctions not below `near`.
    fn lower_peak(&self, stretch: Stretch, shape: &mut Shape, near: f64) {
        let first = self.distances[stretch.first];
        for _ in stretch.first..stretch.last {
            let (up, down) =
                (shape.limits.way(shape.start, shape.peak), shape.limits.way(shape.end, shape.peak));
            let (from, to) = (up, shape.length - down);
            let mut lowest = f64::INFINITY;
            for junction in stretch.first..stretch.last {
                let (begin, finish) =
                    (self.distances[junction] - first, self.distances[junction + 1] - first);
                if begin <= to && finish >= from {
                    lowest = lowest.min(self.moves[junction].cruise_velocity);
                }
                let limit = self.limit(junction);
                if junction > stretch.first && begin <= to && begin >= from && limit >= near {
                    lowest = lowest.min(limit);
                }
            }
            let peak = lowest.max(shape.start.speed).max(shape.end.speed);
            if peak >= shape.peak {
                break;
            }
            shape.peak = peak;
        }
    }

    /// Makes knots of all junctions that have to be. Whether what it leaves can be driven.
    fn solve(&mut self) -> bool {
        // A junction is taken away once at most, and every round but the last makes one knot or more.
        for _ in 0..2 * self.moves.len() {
            if !self.keep_in_reach() {
                return false;
            }
            let mut is_settled = true;
            let mut open = self.stretches(true);
            while let Some(stretch) = open.pop() {
                match self.prove(stretch) {
                    Proof::Holds => {}
                    // Between knots that were made in this round: the next one lowers or moves them.
                    Proof::Fails if !is_settled => {}
                    Proof::Fails => return false,
                    Proof::Knot(junction) => {
                        let limit = Some(self.limit(junction));
                        let mark = &mut self.marks[junction];
                        (mark.speed, mark.wish) = (limit, limit);
                        open.push(Stretch { first: junction, ..stretch });
                        open.push(Stretch { last: junction, ..stretch });
                        is_settled = false;
                    }
                }
            }
            if is_settled {
                return true;
            }
        }
        false
    }

    /// Looks whether a stretch can be driven as it is.
    fn prove(&mut self, stretch: Stretch) -> Proof {
        let Stretch { first, last } = stretch;
        let (start, end) = (self.speed(first), self.speed(last));
        let key = Some((last, start, end));
        if self.marks[first].proved == key {
            return Proof::Holds;
        }
        if !(self.is_in_reach(first, last, end) && self.is_in_reach(last, first, start)) {
            return Proof::Fails;
        }
        let mut phases = std::mem::take(&mut self.phases);
        self.phases(stretch, &mut phases);
        let found = self.lowest_passed_too_fast(stretch, &phases);
        let reached = phases.last().map_or(0.0, |phase| phase.end_distance);
        self.phases = phases;
        let length = self.length(stretch);
        if let Some(junction) = found {
            return Proof::Knot(junction);
        }
        if (reached - length).abs() > GAP_MAX * length.max(1.0) {
            return Proof::Fails;
        }
        self.marks[first].proved = key;
        Proof::Holds
    }

    /// Lowers knots to what the next one can be met from, and to what the one before leads to; one that would be lowered
    /// for the first time is moved or taken away instead. Whether `start` leads to the knot behind it.
    fn keep_in_reach(&mut self) -> bool {
        let (start, end) = (self.start, self.moves.len());
        if start == end {
            return true;
        }
        for _ in 0..BRAKINGS {
            for mark in &mut self.marks[start + 1..] {
                mark.speed = mark.wish;
            }
            self.move_knots(true);
            self.move_knots(false);
            for is_backward in [true, false] {
                for Stretch { first, last } in self.stretches(is_backward) {
                    let (junction, from) = if is_backward { (first, last) } else { (last, first) };
                    if junction > start {
                        self.marks[junction].speed = Some(self.reach(from, junction, self.speed(junction)));
                    }
                }
            }
            let Some(second) = self.knots(start + 1).next() else { return true };
            let (here, there) = (self.speed(start), second.speed);
            if there >= here || self.is_in_reach(second.junction, start, here) {
                return true;
            }
            if !self.brake_at_once() {
                return false;
            }
        }
        false
    }

    /// The highest speed at a junction, up to `speed`, that the knot `from` is met from or leads to.
    fn reach(&self, from: usize, junction: usize, speed: f64) -> f64 {
        let other = self.end(from);
        if speed <= other.speed {
            return speed;
        }
        let stretch = Stretch { first: from.min(junction), last: from.max(junction) };
        self.limits(stretch).reach(other, self.end_at(junction, speed), self.length(stretch))
    }

    fn is_in_reach(&self, from: usize, junction: usize, speed: f64) -> bool {
        self.reach(from, junction, speed) >= speed
    }

    /// Moves knots that are too fast for the one behind (`is_backward`: that cannot be slowed down from) or before, away from
    /// it, up to where they can be as fast as they should; those that cannot are taken away.
    fn move_knots(&mut self, is_backward: bool) {
        let stretches = self.stretches(is_backward);
        let mut from = if is_backward { self.moves.len() } else { self.start };
        for stretch in stretches {
            let junction = if is_backward { stretch.first } else { stretch.last };
            if junction == self.start || junction == self.moves.len() {
                break;
            }
            let speed = self.speed(junction);
            if self.marks[junction].is_stubborn || self.is_in_reach(from, junction, speed) {
                from = junction;
                continue;
            }
            let mark = &mut self.marks[junction];
            (mark.speed, mark.wish, mark.is_stubborn) = (None, None, true);
            if let Some((place, speed)) = self.place(from, junction, speed) {
                let mark = &mut self.marks[place];
                (mark.speed, mark.wish) = (Some(speed), Some(speed));
                from = place;
            }
        }
    }

    /// The first place behind `junction`, seen from `from` and before the next knot, at which this speed is in reach.
    fn place(&self, from: usize, junction: usize, speed: f64) -> Option<(usize, f64)> {
        let (mut place, other) = (junction, self.end(from));
        let mut accel = self.limits(Stretch { first: from.min(junction), last: from.max(junction) }).accel;
        loop {
            let step = if junction < from { place.checked_sub(1)? } else { place + 1 };
            accel = accel.min(self.moves.get(place.min(step))?.accel);
            place = step;
            let mark = self.marks.get(place)?;
            if mark.speed.is_some() {
                return None;
            }
            let end = self.end_at(place, speed.min(self.limit(place)));
            let length = self.length(Stretch { first: from.min(place), last: from.max(place) });
            let limits = Limits { accel, jerk: self.jerk };
            if end.speed <= other.speed || limits.reach(other, end, length) >= end.speed {
                return (!mark.is_stubborn).then_some((place, end.speed));
            }
        }
    }

    /// The start is too fast for the knots behind it: slows down as late as can be, or at once and as hard as can be, up to
    /// the first junction from which the other knots are in reach.
    fn brake_at_once(&mut self) -> bool {
        let (first, end) = (self.start, self.moves.len());
        let start = self.end(first);
        let mut phases = std::mem::take(&mut self.phases);
        let mut is_found = false;
        for last in first + 1..end {
            let stretch = Stretch { first, last };
            self.marks[last] = Mark { is_stubborn: true, ..Mark::default() };
            let next = self.knots(last + 1).next().map_or(end, |next| next.junction);
            let top = self.reach(next, last, self.limit(last).min(start.speed));
            let exact = self.limits(stretch).brake(start, self.end_at(last, top), self.length(stretch));
            is_found = [top, exact].into_iter().filter(|speed| *speed <= top).any(|speed| {
                let mark = &mut self.marks[last];
                (mark.speed, mark.wish) = (Some(speed), Some(speed));
                self.phases(stretch, &mut phases);
                self.is_in_reach(last, first, start.speed)
                    && self.lowest_passed_too_fast(stretch, &phases).is_none()
            });
            if is_found {
                break;
            }
            (self.marks[last].speed, self.marks[last].wish) = (None, None);
        }
        self.phases = phases;
        is_found
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
            let speed = phase.velocity_at(phase.time_at(distance));
            let limit = self.limit(junction);
            if speed > limit * (1.0 + SLACK) + SLACK && lowest.is_none_or(|before| limit < self.limit(before))
            {
                lowest = Some(junction);
            }
        }
        lowest
    }
}
