//! What lies between the path that was planned for an axis and the path that it is driven on: an input shaper, or the
//! smoothing of pressure advance. Exact on piecewise polynomials.
//!
//! Smoothing is the mean over a window of width `2h` with weights that fall linearly to both ends. The second derivative
//! of that mean is `(f(t + h) − 2·f(t) + f(t − h)) / h²`: a sum of three copies of the path, which is integrated twice
//! from seam to seam. Where the path rests, the mean is the path, so no rounding outlives a rest.

use crate::Segment;
use crate::delayed_sum::DelayedSum;
use crate::shaper::Shaper;

#[derive(Clone, Debug)]
enum Kind {
    /// The sum is the path.
    Shape,
    /// The sum is the path's second derivative. Position and speed at the sum's time.
    Smooth { position: f64, speed: f64 },
}

/// A filter on the path of one axis.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    kind: Kind,
    sum: DelayedSum,
    /// The last segment of the path driven: its end is only settled once it is known whether a rest follows.
    pending: Option<Segment>,
}

impl Filter {
    pub(crate) fn shaper(shaper: &Shaper) -> Self {
        Self { kind: Kind::Shape, sum: DelayedSum::new(&shaper.taps()), pending: None }
    }

    /// Over a window of `smooth_time` seconds.
    pub(crate) fn smoothing(smooth_time: f64) -> Self {
        let half = 0.5 * smooth_time;
        let weight = 1.0 / (half * half);
        let taps = [(half, weight), (0.0, -2.0 * weight), (-half, weight)];
        let kind = Kind::Smooth { position: 0.0, speed: 0.0 };
        Self { kind, sum: DelayedSum::new(&taps), pending: None }
    }

    /// How long before a move begins the axis may do so, s.
    pub(crate) fn lead(&self) -> f64 {
        self.sum.lead()
    }

    /// How long after a move has ended the axis may move, s.
    pub(crate) fn tail(&self) -> f64 {
        self.sum.tail()
    }

    /// Segments held.
    pub(crate) fn held(&self) -> usize {
        self.sum.held()
    }

    pub(crate) fn begin(&mut self, position: f64) {
        self.sum.begin(position);
        self.pending = None;
        if matches!(self.kind, Kind::Smooth { .. }) {
            self.kind = Kind::Smooth { position, speed: 0.0 };
        }
    }

    /// What has not been given out comes no earlier than this, s.
    pub(crate) fn known_until(&self) -> f64 {
        self.pending.map_or(self.sum.time(), |pending| pending.start_time)
    }

    /// The path that was planned, to be added to.
    pub(crate) const fn path(&mut self) -> &mut DelayedSum {
        &mut self.sum
    }

    /// Appends what is known of the path driven.
    pub(crate) fn drain(&mut self, out: &mut Vec<Segment>) {
        while let Some(sum) = self.sum.next() {
            let (start, powers) = match &mut self.kind {
                _ if sum.is_rest => {
                    if let Some(mut last) = self.pending.take() {
                        last.end = sum.reference;
                        out.push(last);
                    }
                    if let Kind::Smooth { position, speed } = &mut self.kind {
                        (*position, *speed) = (sum.reference, 0.0);
                    }
                    continue;
                }
                Kind::Shape => {
                    let [c1, c2, c3] = sum.powers;
                    (sum.reference + sum.value, [c1, c2, c3, 0.0, 0.0])
                }
                Kind::Smooth { position, speed } => {
                    let [c1, c2, c3] = sum.powers;
                    let powers = [*speed, sum.value / 2.0, c1 / 6.0, c2 / 12.0, c3 / 20.0];
                    let start = *position;
                    let t = sum.duration;
                    *speed += (sum.value + (c1 / 2.0 + (c2 / 3.0 + c3 / 4.0 * t) * t) * t) * t;
                    (start, powers)
                }
            };
            let mut segment =
                Segment { start_time: sum.start_time, duration: sum.duration, start, end: start, powers };
            segment.end = start + segment.way(sum.duration);
            if let Kind::Smooth { position, .. } = &mut self.kind {
                *position = segment.end;
            }
            out.extend(self.pending.replace(segment));
        }
    }

    /// The path ends at rest at `position` at print time `time`: appends all that is left.
    pub(crate) fn finish(&mut self, time: f64, position: f64, out: &mut Vec<Segment>) {
        let margin = self.lead() + self.tail();
        self.sum.rest_at(time + margin, position);
        self.drain(out);
        if let Some(mut last) = self.pending.take() {
            last.end = position;
            out.push(last);
        }
    }
}
