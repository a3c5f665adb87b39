//! A move with its place in time: one trapezoid of speed.

use crate::junction::Entry;

/// One move, planned: it speeds up, cruises and slows down along a straight line. Any of the three may take no time.
///
/// Times in seconds of print time (from the start of the run of motion), lengths in mm, speeds in mm/s along the path,
/// accelerations in mm/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedMove {
    /// What the caller gave with the move: the line of the file, say.
    pub tag: u32,
    /// Where it starts: x, y, z, e.
    pub from: [f64; 4],
    /// Where it ends, exactly.
    pub to: [f64; 4],
    /// Change of x, y, z and e per mm of path. The path of a move of the filament alone is the filament's.
    pub direction: [f64; 4],
    /// Length of the path.
    pub length: f64,
    /// Print time at which it starts.
    pub start_time: f64,
    /// How long it speeds up.
    pub accel_time: f64,
    /// How long it cruises.
    pub cruise_time: f64,
    /// How long it slows down.
    pub decel_time: f64,
    /// Speed at its start.
    pub start_velocity: f64,
    /// Its highest speed.
    pub cruise_velocity: f64,
    /// Speed at its end.
    pub end_velocity: f64,
    /// The acceleration of both ramps, positive.
    pub accel: f64,
}

impl PlannedMove {
    /// How long it takes, in seconds.
    pub const fn duration(&self) -> f64 {
        self.accel_time + self.cruise_time + self.decel_time
    }

    /// Print time at which it ends.
    pub const fn end_time(&self) -> f64 {
        self.start_time + self.duration()
    }

    /// Path driven while speeding up, in mm.
    pub const fn accel_length(&self) -> f64 {
        0.5 * (self.start_velocity + self.cruise_velocity) * self.accel_time
    }

    /// Path driven while slowing down, in mm.
    pub const fn decel_length(&self) -> f64 {
        0.5 * (self.cruise_velocity + self.end_velocity) * self.decel_time
    }

    /// Path driven `time` seconds after the start of the move, in mm; its ends outside the move.
    pub fn distance_at(&self, time: f64) -> f64 {
        if time <= 0.0 {
            return 0.0;
        }
        let until_decel = self.accel_time + self.cruise_time;
        if time < self.accel_time {
            (self.start_velocity + 0.5 * self.accel * time) * time
        } else if time < until_decel {
            self.accel_length() + self.cruise_velocity * (time - self.accel_time)
        } else {
            let left = self.duration() - time;
            if left <= 0.0 {
                return self.length;
            }
            self.length - (self.end_velocity + 0.5 * self.accel * left) * left
        }
    }

    /// The trapezoid between two squared speeds under a squared cruising speed, all of which the window has made
    /// reachable.
    pub(crate) fn new(entry: &Entry, start_v2: f64, cruise_v2: f64, end_v2: f64, start_time: f64) -> Self {
        let (start_velocity, cruise_velocity, end_velocity) =
            (start_v2.sqrt(), cruise_v2.sqrt(), end_v2.sqrt());
        let half_inverse = 0.5 / entry.accel;
        let accel_length = (cruise_v2 - start_v2) * half_inverse;
        let decel_length = (cruise_v2 - end_v2) * half_inverse;
        // Where a move never cruises, rounding may leave a few 1e-16 mm on either side.
        let cruise_length = (entry.length - accel_length - decel_length).max(0.0);
        let ramp_time = |length: f64, slow: f64| {
            if length > 0.0 { length / (0.5 * (slow + cruise_velocity)) } else { 0.0 }
        };
        Self {
            tag: entry.tag,
            from: entry.from,
            to: entry.to,
            direction: entry.direction.into(),
            length: entry.length,
            start_time,
            accel_time: ramp_time(accel_length, start_velocity),
            cruise_time: if cruise_length > 0.0 { cruise_length / cruise_velocity } else { 0.0 },
            decel_time: ramp_time(decel_length, end_velocity),
            start_velocity,
            cruise_velocity,
            end_velocity,
            accel: entry.accel,
        }
    }
}
