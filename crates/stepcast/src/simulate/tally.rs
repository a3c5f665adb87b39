//! What watches the simulated motors' pins: counts, the path they draw, and their fingerprint.
//!
//! Path and fingerprint go by the motion clock, by which the print was planned: it is the board's clock, less the time
//! that motion was held.

use printer::machine::{EXTRUDER, MOTORS};
use units::{Hertz, Seconds, Ticks};
use virtual_printer::Recorder;

use super::{digest::Digest, path_check::PathCheck};

/// Everything that is made of the pulses, as they come.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    /// Pulses of each motor, both directions.
    pub(crate) pulses: [u64; MOTORS],
    /// They are those of a pause, which are not counted.
    pub(crate) is_aside: bool,
    /// The path that they draw.
    pub(crate) path: PathCheck,
    /// Their fingerprint.
    pub(crate) digest: Digest,
    /// The last step of the extruder that pushed filament.
    pub(crate) extruded_at: Option<Ticks>,
    /// The last step of any motor.
    pub(crate) last_step: Option<Ticks>,
    /// How far the motion clock is behind the board's.
    behind: Ticks,
    /// The last edge that began a pulse of each motor.
    pulse_at: [Ticks; MOTORS],
}

impl Tally {
    /// Nothing has been seen of a machine with these step distances.
    /// Input shapers may move an axis `reach` before its move, and after it.
    pub(crate) fn new(step_distance_mm: [f64; MOTORS], clock: Hertz, reach: Seconds) -> Self {
        Self {
            pulses: [0; MOTORS],
            is_aside: false,
            path: PathCheck::new(step_distance_mm, clock, reach),
            digest: Digest::default(),
            extruded_at: None,
            last_step: None,
            behind: Ticks(0),
            pulse_at: [Ticks(0); MOTORS],
        }
    }
}

impl Recorder for Tally {
    #[inline]
    fn step(&mut self, motor: usize, at: Ticks, forward: bool, count: i64) {
        let Some(pulses) = self.pulses.get_mut(motor) else { return };
        *pulses += u64::from(!self.is_aside);
        self.last_step = Some(at);
        if motor == EXTRUDER && forward {
            self.extruded_at = Some(at);
        }
        self.pulse_at[motor] = at;
        let at = at - self.behind;
        self.digest.step(motor, at, forward);
        self.path.pulse(motor, at, count);
    }

    #[inline]
    fn motion_behind(&mut self, behind: Ticks) {
        self.behind = behind;
    }

    #[inline]
    fn step_end(&mut self, motor: usize, at: Ticks) {
        let Some(&began) = self.pulse_at.get(motor) else { return };
        self.digest.step_end(motor, at - began);
    }

    #[inline]
    fn direction(&mut self, motor: usize, at: Ticks, forward: bool) {
        self.digest.direction(motor, at - self.behind, forward);
    }
}
