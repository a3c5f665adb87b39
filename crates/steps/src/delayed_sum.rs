//! Weighted sums of a path with copies of itself that come earlier or later, exactly: what input shapers are, and the
//! heart of pressure advance's smoothing.
//!
//! A piecewise polynomial stays one: it gets a seam where any copy has one. Times in seconds, positions in mm.

use crate::Segment;
use crate::stabbing::{larger, smaller};

/// Shorter segments are joined, and the path through them taken as straight: at 3000 mm/s² it is 2·10⁻⁷ mm off then. So
/// a file of dust fills no memory.
const SHORT: f64 = 20e-6;
/// The widest window of time that a sum may look at, in seconds.
pub(crate) const WINDOW_MAX: f64 = 0.5;
/// The most segments that a sum holds: in its window, and in the move that was pushed last.
pub const SEGMENTS_HELD_MAX: usize = (2.0 * WINDOW_MAX / SHORT) as usize + 256;

/// Segments that all copies have passed are removed when they are more than this, and no fewer than the others.
const GONE_MAX: usize = 64;

/// One copy of the path.
#[derive(Clone, Copy, Debug)]
struct Tap {
    /// How far ahead of the sum's time it looks, s; below zero: behind.
    ahead: f64,
    weight: f64,
    /// The segment that it is in.
    index: usize,
    /// When it leaves that, by the sum's time, as of the last look.
    until: f64,
}

/// A stretch of the sum; positions count from `reference`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sum {
    pub(crate) start_time: f64,
    pub(crate) duration: f64,
    /// A position that some copy is at or near.
    pub(crate) reference: f64,
    /// The weighted sum of how far the copies are from there at its start.
    pub(crate) value: f64,
    /// The coefficients of t, t², t³.
    pub(crate) powers: [f64; 3],
    /// All copies stand still at `reference`.
    pub(crate) is_rest: bool,
}

/// The path that goes in, and how far the sum has got.
#[derive(Clone, Debug)]
pub(crate) struct DelayedSum {
    /// Those that look farthest ahead first.
    taps: Vec<Tap>,
    /// Before `first`, some that all copies have passed.
    segments: Vec<Segment>,
    first: usize,
    /// Short segments that wait for more of their kind.
    short: Option<Segment>,
    time: f64,
}

impl DelayedSum {
    /// `taps`: how far ahead (s, falling) and with which weight.
    pub(crate) fn new(taps: &[(f64, f64)]) -> Self {
        let taps = taps.iter().map(|&(ahead, weight)| Tap { ahead, weight, index: 0, until: 0.0 }).collect();
        Self { taps, segments: Vec::new(), first: 0, short: None, time: 0.0 }
    }

    /// How far the sum looks ahead, s.
    pub(crate) fn lead(&self) -> f64 {
        self.taps.first().map_or(0.0, |tap| larger(tap.ahead, 0.0))
    }

    /// How far it looks back, s.
    pub(crate) fn tail(&self) -> f64 {
        self.taps.last().map_or(0.0, |tap| larger(-tap.ahead, 0.0))
    }

    /// Segments held.
    pub(crate) fn held(&self) -> usize {
        self.segments.len() - self.first
    }

    /// Starts at time 0, after a rest.
    pub(crate) fn begin(&mut self, position: f64) {
        self.segments.clear();
        self.first = 0;
        self.segments.push(Segment::rest(-self.tail(), self.tail(), position));
        self.short = None;
        self.time = 0.0;
        for tap in &mut self.taps {
            tap.index = 0;
        }
    }

    /// The sum is known up to this time.
    pub(crate) const fn time(&self) -> f64 {
        self.time
    }

    /// The path so far ends there.
    fn end(&self) -> (f64, f64) {
        let last = self.short.as_ref().or(self.segments.last());
        last.map_or((0.0, 0.0), |last| (last.end_time(), last.end))
    }

    /// The path stands still until `time`.
    pub(crate) fn rest_until(&mut self, time: f64) {
        let (end_time, position) = self.end();
        if time > end_time {
            self.rest_at(time, position);
        }
    }

    /// The path stands still at `position` until `time`.
    pub(crate) fn rest_at(&mut self, time: f64, position: f64) {
        self.close_short();
        let (end_time, _) = self.end();
        match self.segments.last_mut() {
            Some(last) if last.is_rest() && last.start == position => {
                last.duration = larger(last.duration, time - last.start_time);
                // Copies that had left it are in it again: however short the moves are in which an axis stands still, they
                // are one segment.
                let at = self.segments.len() - 1;
                for tap in &mut self.taps {
                    tap.index = tap.index.min(at);
                }
            }
            _ if time > end_time => {
                self.segments.push(Segment::rest(end_time, time - end_time, position));
            }
            _ => {}
        }
    }

    /// The path goes on with `segment`, of degree 3 at most.
    pub(crate) fn push(&mut self, segment: Segment) {
        if segment.duration >= SHORT {
            self.close_short();
            self.segments.push(segment);
            return;
        }
        let first = self.short.unwrap_or(segment);
        let duration = segment.end_time() - first.start_time;
        self.short = Some(Segment { duration, end: segment.end, ..first });
        if duration >= SHORT {
            self.close_short();
        }
    }

    /// Gives the short segments their place, as one straight line.
    fn close_short(&mut self) {
        let Some(mut short) = self.short.take() else { return };
        if short.duration > 0.0 {
            short.powers = [(short.end - short.start) / short.duration, 0.0, 0.0, 0.0, 0.0];
            self.segments.push(short);
        }
    }

    /// The next stretch of the sum; `None` until more of the path is known.
    pub(crate) fn next(&mut self) -> Option<Sum> {
        loop {
            let mut end = f64::INFINITY;
            for tap in &mut self.taps {
                tap.until = self.segments.get(tap.index)?.end_time() - tap.ahead;
                end = smaller(end, tap.until);
            }
            let sum = (end > self.time).then(|| self.sum(end));
            self.time = larger(self.time, end);
            let mut done = usize::MAX;
            for tap in &mut self.taps {
                tap.index += usize::from(tap.until <= end);
                done = done.min(tap.index);
            }
            // What the last copy has passed; one stays, so that the path's end is known.
            self.first = done.min(self.segments.len() - 1);
            if self.first > GONE_MAX && self.first >= self.held() {
                self.segments.drain(..self.first);
                for tap in &mut self.taps {
                    tap.index -= self.first;
                }
                self.first = 0;
            }
            if sum.is_some() {
                return sum;
            }
        }
    }

    /// The sum from its time to `end`, within one segment of each copy.
    fn sum(&self, end: f64) -> Sum {
        let middle = &self.segments[self.taps[self.taps.len() / 2].index];
        let reference = middle.start;
        let mut sum = Sum {
            start_time: self.time,
            duration: end - self.time,
            reference,
            value: 0.0,
            powers: [0.0; 3],
            is_rest: true,
        };
        for tap in &self.taps {
            let segment = &self.segments[tap.index];
            let from_reference = segment.start - reference;
            let [c1, c2, c3, ..] = segment.powers;
            if c1 == 0.0 && c2 == 0.0 && c3 == 0.0 {
                sum.is_rest &= from_reference == 0.0;
                sum.value += tap.weight * from_reference;
                continue;
            }
            sum.is_rest = false;
            let x = larger(self.time + tap.ahead - segment.start_time, 0.0);
            let bend = c2 + 3.0 * c3 * x;
            sum.value += tap.weight * (from_reference + x * (c1 + x * (c2 + x * c3)));
            sum.powers[0] += tap.weight * (c1 + x * (c2 + bend));
            sum.powers[1] += tap.weight * bend;
            sum.powers[2] += tap.weight * c3;
        }
        sum
    }
}
