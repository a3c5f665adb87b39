//! The part that was printed, as a shape: what was laid where, whether it is what the clean print has laid, and whether the
//! nozzle has gone through it.
//!
//! Knows places and lines, and nothing of how they came about. Lengths in mm.

use std::collections::{BTreeMap, HashMap};

use super::trace::{Doing, Sample};

/// A layer that was gone on with lies no farther from the clean print's, in X and Y and in Z.
pub(super) const OFF_MAX_MM: f64 = 0.05;
/// The nozzle may be so far below what is laid under it: it touches, it does not go through.
const TOUCH_MM: f64 = 0.05;
/// Straight down it may get onto what may have been laid above a line that is made twice: a layer, no more. In mm.
const DOWN_MM: f64 = 0.4;
/// What is laid is so wide to each side, and so is the nozzle's tip.
const BEAD_MM: f64 = 0.2;
/// The edge of the cells in which is noted how high the part is.
const CELL_MM: f64 = 0.1;
/// A place is looked for among those of its line that are so many behind or before the last found.
const NEAR_PLACES: usize = 400;

/// A line with no more places than these is looked for among the lines around it, where it is not found itself.
const SHORT_PLACES: usize = 2;
const NEAR_LINES: u32 = 4;

/// How one print lies to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Off {
    /// The greatest distance across …
    pub(super) xy_mm: f64,
    /// … and of heights, where that is not.
    pub(super) z_mm: f64,
    /// A line with either.
    pub(super) line: u32,
    /// Places that no line of the other print is for.
    pub(super) strays: u64,
}

/// A line's share of a way.
#[derive(Clone, Debug, Default)]
struct Line {
    places: Vec<[f64; 3]>,
    /// The same with the places right before and behind, between which it ends.
    way: Vec<[f64; 3]>,
}

/// What was laid, line by line.
#[derive(Clone, Debug, Default)]
pub(super) struct Laid(BTreeMap<u32, Line>);

impl Laid {
    /// Of a way.
    pub(super) fn of(way: &[(Sample, Doing)]) -> Self {
        let mut lines: BTreeMap<u32, Line> = BTreeMap::new();
        for (at, (sample, doing)) in way.iter().enumerate() {
            let Doing::Line { line, extrudes: true } = doing else { continue };
            let is_same = |other: usize| way.get(other).is_some_and(|(_, other)| other == doing);
            let laid = lines.entry(*line).or_default();
            let [before, behind] =
                [at.wrapping_sub(1), at + 1].map(|end| (!is_same(end)).then(|| way.get(end)).flatten());
            laid.way.extend(before.map(|(sample, _)| sample.place));
            laid.way.push(sample.place);
            laid.way.extend(behind.map(|(sample, _)| sample.place));
            laid.places.push(sample.place);
        }
        Self(lines)
    }

    /// Both together.
    pub(super) fn and(mut self, other: &Self) -> Self {
        for (line, laid) in &other.0 {
            let mine = self.0.entry(*line).or_default();
            mine.places.extend(&laid.places);
            mine.way.extend(&laid.way);
        }
        self
    }

    /// The lines up to one, without it; and the others.
    pub(super) fn split(mut self, line: u32) -> [Self; 2] {
        let behind = self.0.split_off(&line);
        [self, Self(behind)]
    }

    /// How far all of it is from the same lines of another.
    pub(super) fn off(&self, other: &Self) -> Off {
        let mut off = Off::default();
        for (line, Line { places, .. }) in &self.0 {
            // A line that is shorter than what is noted of the way may have no place of its own.
            let around = || other.0.range(line.saturating_sub(NEAR_LINES)..=line.saturating_add(NEAR_LINES));
            let others = match other.0.get(line) {
                Some(others) => &others.way,
                None if places.len() <= SHORT_PLACES => {
                    &around().flat_map(|(_, line)| line.way.iter().copied()).collect()
                }
                None => &Vec::new(),
            };
            if others.is_empty() {
                off.strays += places.len() as u64;
                off.line = *line;
                continue;
            }
            let mut last = 0;
            for place in places {
                let (at, [xy, z]) = nearest(*place, others, last);
                last = at;
                if xy > off.xy_mm || z > off.z_mm {
                    off.line = *line;
                }
                off.xy_mm = off.xy_mm.max(xy);
                off.z_mm = off.z_mm.max(z);
            }
        }
        off
    }
}

/// The nearest piece of a way, first around the last one found; and how far it is across, and in height.
fn nearest(place: [f64; 3], way: &[[f64; 3]], last: usize) -> (usize, [f64; 2]) {
    let search = |range: core::ops::Range<usize>| {
        let of = |at: usize| (at, distance(place, way[at], way[(at + 1).min(way.len() - 1)]));
        range.map(of).min_by(|(_, a), (_, b)| (a[0] + a[1]).total_cmp(&(b[0] + b[1])))
    };
    let near = last.saturating_sub(NEAR_PLACES)..(last + NEAR_PLACES).min(way.len());
    match search(near) {
        Some((at, [xy, z])) if xy <= OFF_MAX_MM && z <= OFF_MAX_MM => (at, [xy, z]),
        _ => search(0..way.len()).unwrap_or((0, [f64::INFINITY; 2])),
    }
}

/// How far a place is from a straight piece, across and in height.
fn distance(place: [f64; 3], from: [f64; 3], to: [f64; 3]) -> [f64; 2] {
    let way = [to[0] - from[0], to[1] - from[1]];
    let off = [place[0] - from[0], place[1] - from[1]];
    let length2 = way[0] * way[0] + way[1] * way[1];
    let part =
        if length2 > 0.0 { ((off[0] * way[0] + off[1] * way[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
    let across = libm::hypot(off[0] - part * way[0], off[1] - part * way[1]);
    [across, (place[2] - (from[2] + part * (to[2] - from[2]))).abs()]
}

/// How high the part is, everywhere.
#[derive(Clone, Debug, Default)]
pub(super) struct Heights(HashMap<[i32; 2], f64>);

fn cell(mm: f64) -> i32 {
    (mm / CELL_MM).floor() as i32
}

/// The cells around a place, so far away at most.
fn cells(place: [f64; 3], radius_mm: f64) -> impl Iterator<Item = [i32; 2]> {
    let reach = (radius_mm / CELL_MM).ceil() as i32;
    let [x, y] = [cell(place[0]), cell(place[1])];
    (-reach..=reach)
        .flat_map(move |i| (-reach..=reach).map(move |j| [x + i, y + j]))
        .filter(move |&[i, j]| libm::hypot(f64::from(i - x), f64::from(j - y)) * CELL_MM <= radius_mm)
}

impl Heights {
    /// Something is laid there.
    fn lay(&mut self, place: [f64; 3]) {
        for at in cells(place, BEAD_MM) {
            let height = self.0.entry(at).or_insert(place[2]);
            *height = height.max(place[2]);
        }
    }

    /// How deep in the part or the bed a nozzle is there; not at all where it is not above 0.
    fn depth(&self, place: [f64; 3]) -> f64 {
        let heights = cells(place, BEAD_MM).filter_map(|at| self.0.get(&at));
        heights.fold(f64::max(0.0, -place[2]), |depth, height| f64::max(depth, height - place[2]))
    }

    /// Follows a way: what it lays becomes part of the part, and where it goes across it must not be inside. How deep it
    /// was, and how often. Lines up to `twice` may have been made before, and something above them: where they are laid again
    /// they are no way through the part.
    pub(super) fn follow(&mut self, way: &[(Sample, Doing)], twice: u32) -> (f64, u64) {
        let (mut deepest, mut times) = (0.0_f64, 0);
        let mut last: Option<[f64; 3]> = None;
        for (sample, doing) in way {
            let place = sample.place;
            let is_laid_again = matches!(*doing, Doing::Line { line, extrudes: true } if line <= twice);
            let goes_across = last.is_some_and(|last| last[..2] != place[..2]);
            let goes_down = last.is_some_and(|last| last[2] > place[2]);
            if !is_laid_again && (goes_across || goes_down) {
                let depth = self.depth(place);
                let may = if goes_across { TOUCH_MM } else { DOWN_MM };
                deepest = deepest.max(depth);
                times += u64::from(depth > may);
            }
            last = Some(place);
            if matches!(doing, Doing::Line { extrudes: true, .. }) {
                self.lay(place);
            }
        }
        (deepest, times)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::Ticks;

    /// A square of 20 mm from line 10 on, laid at a height, shifted and begun with a line.
    fn square(z: f64, shift: f64, from_line: u32) -> Vec<(Sample, Doing)> {
        let corners = [[10.0, 10.0], [30.0, 10.0], [30.0, 30.0], [10.0, 30.0], [10.0, 10.0]];
        let mut way = Vec::new();
        for (side, ends) in corners.windows(2).enumerate() {
            let line = 10 + side as u32;
            for part in 0..=400 {
                let part = f64::from(part) / 400.0;
                let [x, y] = [0, 1].map(|axis| ends[0][axis] + part * (ends[1][axis] - ends[0][axis]));
                let sample = Sample { at: Ticks(0), place: [x + shift, y, z] };
                if line >= from_line {
                    way.push((sample, Doing::Line { line, extrudes: true }));
                }
            }
        }
        way
    }

    /// A way that leads across at a height.
    fn across(z: f64) -> Vec<(Sample, Doing)> {
        let at = |step: i32| [f64::from(step) * 0.1, 20.0, z];
        (0..400).map(|step| (Sample { at: Ticks(0), place: at(step) }, Doing::Other)).collect()
    }

    #[test]
    fn the_same_print_lies_on_itself() {
        let clean = Laid::of(&square(0.2, 0.0, 0));
        assert_eq!(clean.off(&clean), Off::default());
        let [before, behind] = clean.clone().split(12);
        assert_eq!((before.0.len(), behind.0.len()), (2, 2));
        assert_eq!(clean.off(&before.and(&behind)), Off::default());
    }

    #[test]
    fn a_way_straight_down_into_part_or_bed_is_found() {
        let mut part = Heights::default();
        part.follow(&square(1.0, 0.0, 0), 0);
        let down = |x: f64, to: f64| {
            let at = move |step: i32| [x, 10.0, to + f64::from(step) * 0.05];
            (0..60).rev().map(move |step| (Sample { at: Ticks(0), place: at(step) }, Doing::Other))
        };
        for (x, to, times) in [(20.0, 0.7, 0), (20.0, 0.5, 2), (5.0, 0.0, 0), (5.0, -0.5, 2)] {
            let (_, found) = part.follow(&down(x, to).collect::<Vec<_>>(), 0);
            assert!(found.abs_diff(times) <= 1 && (found > 0) == (times > 0), "{x} {to}: {found}");
        }
    }

    #[test]
    fn a_wrong_height_is_found() {
        let clean = Laid::of(&square(0.2, 0.0, 0));
        // Two full steps of the usual screw.
        let off = Laid::of(&square(0.28, 0.0, 0)).off(&clean);
        assert!(off.z_mm > OFF_MAX_MM && off.xy_mm < OFF_MAX_MM, "{off:?}");
    }

    #[test]
    fn a_shift_is_found() {
        let clean = Laid::of(&square(0.2, 0.0, 0));
        let off = Laid::of(&square(0.2, 0.06, 0)).off(&clean);
        assert!(off.xy_mm > OFF_MAX_MM && off.z_mm < OFF_MAX_MM, "{off:?}");
    }

    #[test]
    fn what_is_left_out_is_found() {
        let clean = Laid::of(&square(0.2, 0.0, 0));
        assert!(clean.off(&Laid::of(&square(0.2, 0.0, 12))).strays > 0);
        // Half a line.
        let mut half = square(0.2, 0.0, 0);
        half.truncate(200);
        let [first, _] = clean.clone().split(11);
        assert!(first.off(&Laid::of(&half)).xy_mm > 5.0);
        assert!(Laid::of(&half).off(&first).xy_mm < 1e-9);
    }

    #[test]
    fn a_way_through_the_part_is_found_and_one_above_it_is_none() {
        let mut heights = Heights::default();
        assert_eq!(heights.follow(&square(5.0, 0.0, 0), 0), (0.0, 0));
        // At the height of the layer it slides over it.
        assert_eq!(heights.follow(&across(5.0), 99), (0.0, 0));
        assert_eq!(heights.follow(&across(7.0), 99), (0.0, 0));
        let (depth, times) = heights.follow(&across(4.9), 99);
        assert!((depth - 0.1).abs() < 1e-9 && times >= 2, "{depth} {times}");
        // What is laid again may be below what was laid since, and nothing else.
        assert_eq!(heights.follow(&square(4.8, 0.0, 0), 13).1, 0);
        assert!(heights.follow(&square(4.8, 0.0, 0), 12).1 > 0);
        // Up out of what it stands in is no way through it.
        let up: Vec<_> =
            [4.0, 4.5, 5.0].map(|z| (Sample { at: Ticks(0), place: [10.0, 20.0, z] }, Doing::Other)).to_vec();
        assert_eq!(heights.follow(&up, 99).1, 0);
    }
}
