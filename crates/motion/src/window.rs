//! The look-ahead: speeds at the junctions of the moves in the window, and which of them nothing can change any more.
//!
//! Two profiles are planned side by side, both in squared speeds. The *real* one uses each move's acceleration. The
//! *virtual* one speeds up and slows down more gently (`minimum_cruise_ratio`): where it goes straight from speeding
//! up to slowing down, its peak is the ceiling of the real speed from where it began to speed up to where it ends slowing
//! down.
//!
//! The pass runs backward from rest at the end of the window. A junction's speed is *final* where it is not this end that
//! limits it: later moves can then no longer change it. Every release depends on the moves alone, never on when
//! somebody looks, so the same moves always give the same plan; a forced release happens after a fixed number of moves.

use crate::PlannedMove;
use crate::junction::Entry;
use std::collections::VecDeque;

/// What the backward pass found for one move.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Squared speed at its start, real profile.
    start_v2: f64,
    /// The squared top speed, or `None` where the virtual profile only slows down: then the move may not speed up.
    ceiling_v2: Option<f64>,
    /// Whether nothing pushed later can change this move.
    is_final: bool,
}

/// Moves whose speeds may still change, oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Window {
    entries: VecDeque<Entry>,
    /// One for each entry after a backward pass.
    nodes: Vec<Node>,
    /// Sum of the entries' nominal times, s.
    nominal_time: f64,
    /// Squared speed at which the last released move ends.
    released_end_v2: f64,
    /// Ceiling of the last released move.
    released_ceiling_v2: f64,
}

impl Window {
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The least time in which these moves can run, s.
    pub(crate) fn nominal_time(&self) -> f64 {
        self.nominal_time
    }

    pub(crate) fn push(&mut self, mut entry: Entry) {
        if let Some(previous) = self.entries.back() {
            entry.follow(previous);
        }
        self.nominal_time += entry.nominal_time;
        self.entries.push_back(entry);
    }

    /// Releases every move that nothing can change any more.
    pub(crate) fn release_final(&mut self, print_time: &mut f64, out: &mut VecDeque<PlannedMove>) {
        self.plan();
        let count = self.nodes.iter().rposition(|node| node.is_final).map_or(0, |last| last + 1);
        self.release(count, print_time, out);
    }

    /// Releases the oldest `count` moves as they are planned now, as if the window ended at rest. What remains goes on
    /// from there.
    pub(crate) fn release_oldest(
        &mut self,
        count: usize,
        print_time: &mut f64,
        out: &mut VecDeque<PlannedMove>,
    ) {
        self.plan();
        self.release(count.min(self.len()), print_time, out);
        let end_v2 = self.released_end_v2;
        let Some(first) = self.entries.front_mut() else { return };
        // The junction is now fixed: to both profiles it is a limit like that of a corner.
        first.start_limit = end_v2;
        first.smoothed_start_limit = end_v2;
        let mut previous = *first;
        for entry in self.entries.iter_mut().skip(1) {
            entry.start_limit = entry.start_limit.min(previous.start_limit + previous.gain);
            entry.smoothed_start_limit = entry
                .start_limit
                .min(entry.smoothed_start_limit)
                .min(previous.smoothed_start_limit + previous.smoothed_gain);
            previous = *entry;
        }
    }

    /// The backward pass, from rest at the end.
    fn plan(&mut self) {
        self.nodes.clear();
        let mut next = After { v2: 0.0, smoothed_v2: 0.0, is_final: false, smoothed_is_final: false };
        // The peak of the virtual profile behind the move in hand, and whether it (or its absence) is final.
        let mut ceiling: Option<f64> = None;
        let mut ceiling_is_final = false;
        for entry in self.entries.iter().rev() {
            let reach = next.v2 + entry.gain;
            let smoothed_reach = next.smoothed_v2 + entry.smoothed_gain;
            let here = After {
                v2: entry.start_limit.min(reach),
                smoothed_v2: entry.smoothed_start_limit.min(smoothed_reach),
                is_final: entry.start_limit <= reach || next.is_final,
                smoothed_is_final: entry.smoothed_start_limit <= smoothed_reach || next.smoothed_is_final,
            };
            if here.smoothed_v2 < smoothed_reach {
                let has_peak = here.smoothed_v2 + entry.smoothed_gain > next.smoothed_v2;
                if has_peak || ceiling.is_none() {
                    ceiling_is_final =
                        next.smoothed_is_final && here.smoothed_is_final && (has_peak || ceiling_is_final);
                    ceiling = Some(entry.cruise_limit.min(0.5 * (here.smoothed_v2 + smoothed_reach)));
                }
            } else {
                ceiling = None;
                ceiling_is_final = next.smoothed_is_final;
            }
            self.nodes.push(Node {
                start_v2: here.v2,
                ceiling_v2: ceiling,
                is_final: next.is_final && next.smoothed_is_final && ceiling_is_final,
            });
            next = here;
        }
        self.nodes.reverse();
    }

    /// Turns the first `count` nodes into trapezoids.
    fn release(&mut self, count: usize, print_time: &mut f64, out: &mut VecDeque<PlannedMove>) {
        for index in 0..count {
            let Some(entry) = self.entries.pop_front() else { break };
            let node = self.nodes[index];
            let next = self.nodes.get(index + 1);
            let start_v2 = self.released_end_v2;
            let ceiling_v2 = node.ceiling_v2.unwrap_or(self.released_ceiling_v2.min(node.start_v2));
            let end_v2 = next
                .map_or(0.0, |next| {
                    next.start_v2.min(ceiling_v2).min(next.ceiling_v2.unwrap_or(f64::INFINITY))
                })
                .min(start_v2 + entry.gain);
            let cruise_v2 = entry
                .cruise_limit
                .min(0.5 * (start_v2 + end_v2 + entry.gain))
                .min(ceiling_v2)
                .max(start_v2)
                .max(end_v2);
            let planned = PlannedMove::new(&entry, start_v2, cruise_v2, end_v2, *print_time);
            *print_time = planned.end_time();
            out.push_back(planned);
            self.released_end_v2 = end_v2;
            self.released_ceiling_v2 = ceiling_v2;
            self.nominal_time -= entry.nominal_time;
        }
        if self.entries.is_empty() {
            self.nominal_time = 0.0;
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
