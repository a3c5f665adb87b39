//! How far the path that the pulses draw strays from the path that the G-code asks for.
//!
//! Both ways and in order. Every pulse: the head's position after it is measured against the line, or the arc, that is being executed
//! at that moment. Every line: its end point is measured against what has been drawn when the line ends. Since a pulse
//! moves the head by a single step, a head that stays beside the line and comes to its end has drawn all of it.
//! Near the boundary of two lines a pulse may be early or late by the error that step compression is allowed, so
//! that within [`BOUNDARY_TOLERANCE`] either line counts.
//!
//! Knows pulses and lines, not G-code: see [`super::gcode_path`] for where lines come from. Fed online, keeps only the
//! lines that have not been executed yet. Positions in mm, times on the board's clock.

use std::collections::VecDeque;

use units::{Hertz, Seconds, Ticks};
use virtual_printer::Gantry;

use super::arc_way::ArcWay;

/// How early or late a step may come: within this time of a boundary the neighbouring line counts too.
pub(crate) const BOUNDARY_TOLERANCE: Seconds = Seconds(25e-6);

/// The most lines that may be announced and not yet executed.
pub(crate) const LINES_AHEAD_MAX: usize = 1 << 20;

/// X, Y, Z.
const AXES: usize = 3;

/// One line as it is going to be executed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    /// The line of the file; 0 for moves that no line asked for.
    pub(crate) line: u32,
    /// When it starts.
    pub(crate) start: Ticks,
    /// When it ends.
    pub(crate) end: Ticks,
    /// Where it starts: X, Y, Z, filament.
    pub(crate) from: [f64; 4],
    /// Where it ends.
    pub(crate) to: [f64; 4],
    /// The G-code's own way, where it is not straight.
    pub(crate) arc: Option<ArcWay>,
    /// A homing move: a trigger may cut it short, and positions have no meaning before it ends. Not measured.
    pub(crate) homing: bool,
}

/// The worst distance found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Worst {
    pub(crate) distance_mm: f64,
    /// The line where it was found.
    pub(crate) line: u32,
}

/// More lines were announced than [`LINES_AHEAD_MAX`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooFarAhead;

#[derive(Clone, Copy, Debug)]
struct Segment {
    from: [f64; AXES],
    way: [f64; AXES],
    /// 0 for a segment that does not move the head.
    inverse_length_squared: f64,
    to: [f64; AXES],
    filament: f64,
    arc: Option<ArcWay>,
    start: u64,
    end: u64,
    line: u32,
    measured: bool,
    /// The smallest distance from its end point seen around its end.
    end_squared: f64,
    filament_off: f64,
}

impl Segment {
    fn new(span: &Span) -> Self {
        let [x, y, z, _] = span.from;
        let [to_x, to_y, to_z, filament] = span.to;
        let way = [to_x - x, to_y - y, to_z - z];
        let length_squared = dot(way, way);
        Self {
            from: [x, y, z],
            way,
            inverse_length_squared: if length_squared > 0.0 { 1.0 / length_squared } else { 0.0 },
            to: [to_x, to_y, to_z],
            filament,
            arc: span.arc,
            start: span.start.0,
            end: span.end.0,
            line: span.line,
            measured: !span.homing,
            end_squared: f64::INFINITY,
            filament_off: f64::INFINITY,
        }
    }

    #[inline]
    fn distance_squared(&self, point: [f64; AXES]) -> f64 {
        let offset = minus(point, self.from);
        let along = (dot(offset, self.way) * self.inverse_length_squared).clamp(0.0, 1.0);
        if let Some(arc) = &self.arc {
            return arc.distance_squared(point, along);
        }
        let [x, y, z] = self.way;
        let rest = minus(offset, [along * x, along * y, along * z]);
        dot(rest, rest)
    }

    fn note_end(&mut self, position: [f64; AXES], filament: f64) {
        let off = minus(position, self.to);
        self.end_squared = self.end_squared.min(dot(off, off));
        self.filament_off = self.filament_off.min((filament - self.filament).abs());
    }
}

#[inline]
fn dot(a: [f64; AXES], b: [f64; AXES]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
fn minus(a: [f64; AXES], b: [f64; AXES]) -> [f64; AXES] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Measures pulses against lines.
#[derive(Clone, Debug)]
pub(crate) struct PathCheck {
    step_distance_mm: [f64; 4],
    /// How the motors hold the head.
    gantry: Gantry,
    /// Where each motor is.
    motors_mm: [f64; AXES],
    /// Position of each motor at count 0.
    origin_mm: [f64; 4],
    counts: [i64; 4],
    position: [f64; AXES],
    filament: f64,
    tolerance: u64,
    /// Lines that are being executed or still to come.
    segments: VecDeque<Segment>,
    /// Lines that were put aside in a pause.
    aside: VecDeque<Segment>,
    /// From here, for `quiet_ticks`, only the first of `segments` has to be looked at.
    quiet_from: u64,
    quiet_ticks: u64,
    /// Squared distance from the first segment beyond which a pulse is the worst so far.
    threshold_squared: f64,
    worst: Worst,
    filament_worst_mm: f64,
    strays: u64,
    first_stray: Option<Ticks>,
}

impl PathCheck {
    /// A check for a machine with these step distances (X, Y, Z, extruder), standing at 0 with all counts 0.
    /// A motor may be early or late by `reach` besides.
    pub(crate) fn new(step_distance_mm: [f64; 4], clock: Hertz, reach: Seconds) -> Self {
        Self {
            step_distance_mm,
            gantry: Gantry::default(),
            motors_mm: [0.0; AXES],
            origin_mm: [0.0; 4],
            counts: [0; 4],
            position: [0.0; AXES],
            filament: 0.0,
            tolerance: clock.ticks_in(BOUNDARY_TOLERANCE + reach).0,
            segments: VecDeque::new(),
            aside: VecDeque::new(),
            quiet_from: 0,
            quiet_ticks: 0,
            threshold_squared: 0.0,
            worst: Worst::default(),
            filament_worst_mm: 0.0,
            strays: 0,
            first_stray: None,
        }
    }

    /// The machine's motors hold its head like this.
    pub(crate) const fn set_gantry(&mut self, gantry: Gantry) {
        self.gantry = gantry;
    }

    /// An axis that stands still is at this position from now on.
    pub(crate) fn set_position(&mut self, axis: usize, position_mm: f64) {
        let Some(slot) = self.position.get_mut(axis) else {
            return self.set_origin(axis, position_mm);
        };
        *slot = position_mm;
        let head = self.position;
        for (motor, at) in self.gantry.motors(head).into_iter().enumerate() {
            self.set_origin(motor, at);
        }
        // Axes that have not been said yet may belong to no place of the motors.
        self.position = head;
    }

    fn set_origin(&mut self, motor: usize, position_mm: f64) {
        let (Some(origin), Some(distance)) =
            (self.origin_mm.get_mut(motor), self.step_distance_mm.get(motor))
        else {
            return;
        };
        *origin = position_mm - self.counts[motor] as f64 * distance;
        self.place(motor);
    }

    /// Announces the next line to be executed. Lines come in the order of time, before their pulses.
    pub(crate) fn expect(&mut self, span: &Span) -> Result<(), TooFarAhead> {
        if self.segments.len() >= LINES_AHEAD_MAX {
            return Err(TooFarAhead);
        }
        // An approach to an endstop ends where its trigger says, mostly long before its planned end.
        if let Some(last) = self.segments.back_mut().filter(|last| !last.measured) {
            last.end = last.end.min(span.start.0);
        }
        self.segments.push_back(Segment::new(span));
        if self.segments.len() <= 2 {
            self.look_at_first();
        }
        Ok(())
    }

    /// Motion rests at `at`, and the lines that have not ended by then are put aside.
    pub(crate) fn put_aside(&mut self, at: Ticks) {
        self.retire(at.0);
        self.aside = core::mem::take(&mut self.segments);
        self.look_at_first();
    }

    /// Motion rests at `at`, and the lines that have not ended by then will not be executed.
    pub(crate) fn forget(&mut self, at: Ticks) {
        self.retire(at.0);
        self.segments.clear();
        self.look_at_first();
    }

    /// The lines that were put aside go on, so much later.
    pub(crate) fn go_on(&mut self, by: Ticks) {
        for mut segment in core::mem::take(&mut self.aside) {
            segment.start += by.0;
            segment.end += by.0;
            self.segments.push_back(segment);
        }
        self.look_at_first();
    }

    /// A pulse on a motor's pins; `count` is forward less backward pulses, this one included.
    #[inline]
    pub(crate) fn pulse(&mut self, motor: usize, at: Ticks, count: i64) {
        if at.0.wrapping_sub(self.quiet_from) >= self.quiet_ticks {
            self.pulse_near_boundary(motor, at, count);
            return;
        }
        self.count(motor, count);
        if motor >= AXES {
            return;
        }
        if let Some(first) = self.segments.front() {
            let distance_squared = first.distance_squared(self.position);
            if distance_squared > self.threshold_squared && first.measured {
                let worst = Worst { distance_mm: distance_squared.sqrt(), line: first.line };
                self.note(worst);
            }
        }
    }

    /// Time has come to `now`, and no more pulses come before it: lines that have ended are judged.
    pub(crate) fn settle(&mut self, now: Ticks) {
        self.retire(now.0);
    }

    /// Everything that was announced must have been drawn by now.
    pub(crate) fn finish(&mut self) {
        self.retire(u64::MAX);
    }

    /// The worst distance so far, from a line to a pulse or from a line's end to what was drawn.
    pub(crate) const fn worst(&self) -> Worst {
        self.worst
    }

    /// The worst distance of the extruder at the end of a line, in mm of filament.
    pub(crate) const fn filament_worst_mm(&self) -> f64 {
        self.filament_worst_mm
    }

    /// Pulses of X, Y or Z at times when no line was being executed, and the first of them.
    pub(crate) const fn strays(&self) -> (u64, Option<Ticks>) {
        (self.strays, self.first_stray)
    }

    /// Where the pulses have brought a motor, in mm.
    pub(crate) fn position_mm(&self, motor: usize) -> f64 {
        self.motors_mm.get(motor).copied().unwrap_or(self.filament)
    }

    /// Whether motors move axes together.
    pub(crate) const fn is_coupled(&self) -> bool {
        self.gantry.is_coupled()
    }

    /// Where a motor is when the machine is there.
    pub(crate) fn motor_mm(&self, motor: usize, [x, y, z, e]: [f64; 4]) -> f64 {
        self.gantry.motors([x, y, z]).get(motor).copied().unwrap_or(e)
    }

    #[inline]
    fn count(&mut self, motor: usize, count: i64) {
        if let Some(slot) = self.counts.get_mut(motor) {
            *slot = count;
            self.place(motor);
        }
    }

    #[inline]
    fn place(&mut self, motor: usize) {
        let at = self.origin_mm[motor] + self.counts[motor] as f64 * self.step_distance_mm[motor];
        let Some(slot) = self.motors_mm.get_mut(motor) else {
            self.filament = at;
            return;
        };
        *slot = at;
        match &self.gantry {
            Gantry::Cartesian => self.position[motor] = at,
            gantry => self.position = gantry.head(self.motors_mm),
        }
    }

    #[cold]
    #[inline(never)]
    fn pulse_near_boundary(&mut self, motor: usize, at: Ticks, count: i64) {
        self.retire(at.0);
        // Around a line's end both the position before this pulse and the one after it have been there.
        self.note_ends(at.0);
        self.count(motor, count);
        self.note_ends(at.0);
        if motor >= AXES {
            return;
        }
        let near = |segment: &&Segment| segment.start <= at.0.saturating_add(self.tolerance);
        let mut best: Option<Worst> = None;
        for segment in self.segments.iter().take_while(near) {
            if !segment.measured {
                return;
            }
            let distance_mm = segment.distance_squared(self.position).sqrt();
            if best.is_none_or(|best| distance_mm < best.distance_mm) {
                best = Some(Worst { distance_mm, line: segment.line });
            }
        }
        if let Some(best) = best {
            self.note(best);
        } else {
            self.strays += 1;
            self.first_stray.get_or_insert(at);
        }
    }

    fn note_ends(&mut self, at: u64) {
        let (position, filament, tolerance) = (self.position, self.filament, self.tolerance);
        for segment in &mut self.segments {
            if segment.end > at.saturating_add(tolerance) {
                break;
            }
            segment.note_end(position, filament);
        }
    }

    /// Judges and forgets the lines that ended longer ago than the tolerance.
    fn retire(&mut self, at: u64) {
        let mut any = false;
        while let Some(first) = self.segments.front()
            && first.end.saturating_add(self.tolerance) < at
        {
            let mut ended = *first;
            self.segments.pop_front();
            any = true;
            if !ended.measured {
                continue;
            }
            ended.note_end(self.position, self.filament);
            self.note(Worst { distance_mm: ended.end_squared.sqrt(), line: ended.line });
            self.filament_worst_mm = self.filament_worst_mm.max(ended.filament_off);
        }
        if any {
            self.look_at_first();
        }
    }

    fn note(&mut self, found: Worst) {
        if found.distance_mm > self.worst.distance_mm {
            self.worst = found;
            self.threshold_squared = found.distance_mm * found.distance_mm;
        }
    }

    fn look_at_first(&mut self) {
        match self.segments.front() {
            Some(first) => {
                self.quiet_from = first.start;
                self.quiet_ticks = first.end.saturating_sub(self.tolerance).saturating_sub(first.start);
            }
            None => self.quiet_ticks = 0,
        }
    }
}

#[cfg(test)]
mod tests;
