//! What is watched of a simulated print from time to time: heaters, the path, the host's idea of the clock, and that it gets on.

use printer::machine::{EXTRUDER, MOTOR_NAMES};
use units::{Seconds, Ticks};
use virtual_printer::HeaterView;

use super::{Simulation, Stage};

/// A print in which nothing happens for so long is given up.
const STALL_MAX: Seconds = Seconds(6.0 * 3600.0);
/// How often the nozzle's temperature is looked at.
pub(super) const SAMPLE_INTERVAL: Seconds = Seconds(0.1);
/// The nozzle counts as extruding for so long after a step of the extruder's.
const EXTRUDING: Seconds = Seconds(0.25);
/// A heater that is held at its stand-by is this much above it at times.
const STANDBY_BAND_C: f64 = 5.0;

impl Simulation {
    /// Looks at the machine, and at what may not grow.
    pub(super) fn sample(&mut self, now: Ticks) {
        self.next_sample = now + self.ticks(SAMPLE_INTERVAL);
        let extruding = self.ticks(EXTRUDING);
        let state = self.printer.state();
        let motion_now = self.printer.motion_now();
        let tally = self.printer.recorder_mut();
        // Up to now, no pulse is missing. A board that has stopped everything executes no line any more.
        if state.shutdown.is_none() {
            tally.path.settle(motion_now);
        }
        let extruding = tally.extruded_at.is_some_and(|at| at + extruding >= now);
        let is_hot = |heater: &&HeaterView| {
            let standby = self.standby.iter().find(|(name, _)| *name == heater.name);
            standby.is_none_or(|(_, standby)| heater.temperature.0 > standby.0 + STANDBY_BAND_C)
        };
        let mut heated = state.heaters.iter().filter(|heater| heater.duty > 0.0).peekable();
        if heated.peek().is_some() {
            self.aftermath.heated = now;
        }
        if heated.any(|heater| is_hot(&heater)) {
            self.aftermath.overheated = now;
        }
        let time = self.clock.at(now);
        self.follow(motion_now, time);
        if self.stage == Stage::Printing
            && let Some(nozzle) = state.heaters.iter().find(|heater| heater.name == MOTOR_NAMES[EXTRUDER])
        {
            self.observer.nozzle.sample(time, nozzle.temperature, extruding);
        }
    }

    /// How the host's idea of the board's clock fares, and what else may not grow.
    fn follow(&mut self, motion_now: Ticks, time: Seconds) {
        if self.away_until().is_none()
            && let Some(believed) = self.session.motion_clock(time)
        {
            let error = believed.0 as f64 - motion_now.0 as f64;
            self.course.clock_error(Seconds(error / f64::from(self.printer.profile().clock.0)));
        }
        self.course.pass(self.virtual_time(), self.journal.len());
    }

    /// A print in which nothing happens any more is an error.
    pub(super) fn check_stall(&self) -> anyhow::Result<()> {
        let still = self.printer.now().saturating_sub(self.observer.last_change);
        if still > self.ticks(STALL_MAX) {
            anyhow::bail!(
                "the simulated print did nothing for {} hours of its time after line {}",
                STALL_MAX.0 / 3600.0,
                self.observer.line
            );
        }
        Ok(())
    }

    /// One that takes too long is given up.
    pub(super) fn give_up_late(&mut self) {
        let is_late = self.time_max.is_some_and(|max| self.virtual_time() > max);
        if is_late && !matches!(self.stage, Stage::Watching(_)) {
            self.is_overdue = true;
            self.end();
        }
    }
}
