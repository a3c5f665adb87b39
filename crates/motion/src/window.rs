//! The look-ahead: speeds at the junctions of the moves in the window, and which of them nothing can change any more.
//!
//! Two profiles are planned side by side, both in squared speeds. The *real* one uses each move's acceleration. The
//! *virtual* one speeds up and slows down more gently (`minimum_cruise_ratio`): where it goes straight from speeding
//! up to slowing down, its peak is the ceiling of the real speed from where it began to speed up to where it ends slowing
//! down.
//!
//! The pass runs backward from the end of the window. A junction's speed is *final* where it is not this end that
//! limits it: later moves can then no longer change it. Every release depends on the moves alone, never on when
//! somebody looks, so the same moves always give the same plan; a forced release happens after a fixed number of moves.

use crate::PlannedMove;
use crate::ability::peak;
use crate::junction::Entry;
use crate::motor::MotorAbility;
use std::collections::VecDeque;

/// What the backward pass found for one move.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Squared speed at its start, real profile.
    start_v2: f64,
    /// The squared top speed, or `None` where the virtual profile only slows down: then the move may not speed up.
    ceiling_v2: Option<f64>,
    /// Whether some motor has bands of resonance and the real profile goes along at that ceiling, instead of turning below.
    is_flat: bool,
    /// Whether nothing pushed later can change this move.
    is_final: bool,
}

/// Moves whose speeds may still change, oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Window {
    /// Motors whose strength depends on speed, in the order of the coordinates; empty where none does.
    motors: Vec<Option<MotorAbility>>,
    entries: VecDeque<Entry>,
    /// One for each entry after a backward pass.
    nodes: Vec<Node>,
    /// Sum of the entries' nominal times, s.
    nominal_time: f64,
    /// Squared speed at which the last released move ends; `None` at rest, where a move may start with a jump.
    released_end_v2: Option<f64>,
    /// Ceiling of the last released move.
    released_ceiling_v2: f64,
}

impl Window {
    pub(crate) fn new(motors: Vec<Option<MotorAbility>>) -> Self {
        Self { motors, ..Self::default() }
    }

    /// The motors that limit moves.
    pub(crate) fn motors(&self) -> &[Option<MotorAbility>] {
        &self.motors
    }

    /// Forgets all moves.
    pub(crate) fn clear(&mut self) {
        *self = Self::new(core::mem::take(&mut self.motors));
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// The least time in which these moves can run, s.
    pub(crate) fn nominal_time(&self) -> f64 {
        self.nominal_time
    }

    pub(crate) fn push(&mut self, mut entry: Entry) {
        if let Some(previous) = self.entries.back_mut() {
            entry.follow(previous, &self.motors);
        }
        self.nominal_time += entry.nominal_time;
        self.entries.push_back(entry);
    }

    /// Releases every move that nothing can change any more.
    pub(crate) fn release_final(&mut self, print_time: &mut f64, out: &mut VecDeque<PlannedMove>) {
        self.plan(false);
        let count = self.nodes.iter().rposition(|node| node.is_final).map_or(0, |last| last + 1);
        self.release(count, print_time, out);
    }

    /// Releases the oldest `count` moves as they are planned now, as if the window ended at rest; it does where they are all.
    /// What remains goes on from there.
    pub(crate) fn release_oldest(
        &mut self,
        count: usize,
        print_time: &mut f64,
        out: &mut VecDeque<PlannedMove>,
    ) {
        let stops = count >= self.len();
        self.entries.back_mut().filter(|_| stops).map(Entry::end);
        self.plan(stops);
        self.release(count.min(self.len()), print_time, out);
        let (Some(first), Some(end_v2)) = (self.entries.front_mut(), self.released_end_v2) else { return };
        // The junction is now fixed: to both profiles it is a limit like that of a corner.
        first.start_limit = end_v2;
        first.smoothed_start_limit = end_v2;
        let mut previous = *first;
        for entry in self.entries.iter_mut().skip(1) {
            entry.keep_in_reach(&previous, &self.motors);
            previous = *entry;
        }
    }

    /// The backward pass, from the end. A machine that stops there may do so with a jump; a move that may still come can ask
    /// for less.
    fn plan(&mut self, stops: bool) {
        self.nodes.clear();
        let end = self.entries.back().filter(|_| stops).map_or(0.0, |last| last.jump_v2);
        let mut next = After { v2: end, smoothed_v2: end, is_final: false, smoothed_is_final: false };
        // The peak of the virtual profile behind the move in hand, and whether it (or its absence) is final.
        let mut ceiling: Option<f64> = None;
        let mut ceiling_is_final = false;
        let shakes = self.motors.iter().flatten().any(|motor| !motor.bands().is_empty());
        let mut is_flat = shakes;
        for entry in self.entries.iter().rev() {
            let motors = &self.motors;
            let reach = entry.slowing(motors).reach(next.v2, entry.length);
            let smoothed = entry.smoothed_speeding(motors);
            let smoothed_slowing = entry.smoothed_slowing(motors);
            let smoothed_reach = smoothed_slowing.reach(next.smoothed_v2, entry.length);
            let here = After {
                v2: entry.start_limit.min(reach),
                smoothed_v2: entry.smoothed_start_limit.min(smoothed_reach),
                is_final: entry.start_limit <= reach || next.is_final,
                smoothed_is_final: entry.smoothed_start_limit <= smoothed_reach || next.smoothed_is_final,
            };
            if here.smoothed_v2 < smoothed_reach {
                let has_peak = smoothed.reach(here.smoothed_v2, entry.length) > next.smoothed_v2;
                if has_peak || ceiling.is_none() {
                    ceiling_is_final =
                        next.smoothed_is_final && here.smoothed_is_final && (has_peak || ceiling_is_final);
                    let (start, end) = (here.smoothed_v2, next.smoothed_v2);
                    let top = peak(&smoothed, &smoothed_slowing, start, end, entry.length);
                    let top = entry.cruise_limit.min(top);
                    ceiling = Some(top);
                    is_flat = shakes && top < entry.peak(here.v2, next.v2, motors);
                }
            } else {
                ceiling = None;
                is_flat = shakes;
                ceiling_is_final = next.smoothed_is_final;
            }
            self.nodes.push(Node {
                start_v2: here.v2,
                ceiling_v2: ceiling,
                is_flat,
                is_final: next.is_final && next.smoothed_is_final && ceiling_is_final,
            });
            next = here;
        }
        self.nodes.reverse();
    }

    /// The squared top speed of the oldest move. Along a ceiling in a band of resonance the motors would shake: then it is
    /// the low end of the band, if the move starts no faster.
    fn ceiling(&self, entry: &Entry, node: &Node) -> f64 {
        let falling =
            || self.released_end_v2.map_or(node.start_v2, |_| self.released_ceiling_v2.min(node.start_v2));
        let ceiling_v2 = node.ceiling_v2.unwrap_or_else(falling);
        if !node.is_flat {
            return ceiling_v2;
        }
        let calm_v2 = entry.calm(ceiling_v2, &self.motors).max(self.released_end_v2.unwrap_or(0.0));
        if entry.calm(calm_v2, &self.motors) < calm_v2 { ceiling_v2 } else { calm_v2 }
    }

    /// Turns the first `count` nodes into trapezoids.
    fn release(&mut self, count: usize, print_time: &mut f64, out: &mut VecDeque<PlannedMove>) {
        for index in 0..count {
            let Some(entry) = self.entries.pop_front() else { break };
            let node = self.nodes[index];
            let next = self.nodes.get(index + 1);
            let ceiling_v2 = self.ceiling(&entry, &node);
            let start_v2 = self.released_end_v2.unwrap_or(node.start_v2.min(ceiling_v2));
            let motors = &self.motors;
            let end_v2 = next
                .map_or(entry.jump_v2, |next| next.start_v2.min(next.ceiling_v2.unwrap_or(f64::INFINITY)))
                .min(ceiling_v2)
                .min(entry.speeding(motors).reach(start_v2, entry.length));
            let top_v2 = entry.cruise_limit.min(entry.peak(start_v2, end_v2, motors));
            let mut cruise_v2 = top_v2.min(ceiling_v2).max(start_v2).max(end_v2);
            // Too fast for what is calm below: what is calm above is the way out, if there is one.
            if cruise_v2 < top_v2
                && entry.calm(cruise_v2, motors) < cruise_v2
                && entry.calm(top_v2, motors) > cruise_v2
            {
                cruise_v2 = top_v2;
            }
            let planned = PlannedMove::new(&entry, motors, [start_v2, cruise_v2, end_v2], *print_time);
            *print_time = planned.end_time();
            out.push_back(planned);
            self.released_end_v2 = Some(end_v2);
            self.released_ceiling_v2 = ceiling_v2;
            self.nominal_time -= entry.nominal_time;
        }
        if self.entries.is_empty() {
            self.nominal_time = 0.0;
            self.released_end_v2 = None;
        }
    }
}

/// Squared speeds at the junction behind the move in hand, in both profiles, and whether they are final.
#[derive(Clone, Copy)]
struct After {
    v2: f64,
    smoothed_v2: f64,
    is_final: bool,
    smoothed_is_final: bool,
}
