//! What the user of a simulated print does: says yes to what is held, pauses, and sends a print on its way.

use printer::session::{JobStatus, Request};
use units::Seconds;

use super::{Simulation, Stage};
use crate::simulate::pauses::Wanted;

/// A pause rests so much later than its ramp at most.
const PAUSE_SPARE: Seconds = Seconds(0.2);

impl Simulation {
    /// The user says yes to what is held, once that is due.
    pub(super) fn consent(&mut self, now: Seconds) -> bool {
        if self.consent_at.take_if(|at| *at <= self.printer.now()).is_none() {
            return false;
        }
        self.aftermath.restarts += u32::from(self.printer.recorder().last_step != self.held_at);
        if let Err(error) = self.session.request(Request::Resume, now) {
            self.observer.error.get_or_insert(error);
            self.end();
        }
        true
    }

    /// The user says yes to a print that begins in the middle of its file, once Z is homed.
    pub(super) fn set_out(&mut self, now: Seconds) -> bool {
        let is_homed = self.session.position().is_some_and(|(_, homed)| homed[2]);
        if !self.homes || !is_homed {
            return false;
        }
        // It is refused until the axis is at rest.
        self.homes = self.session.request(Request::Resume, now).is_err();
        !self.homes
    }

    /// Notes how long a pause took to come to rest, where it has.
    pub(super) fn note_rest(&mut self) {
        let is_aside = self.observer.is_aside();
        let Some(asked) = self.pauses.since.take_if(|_| is_aside) else { return };
        let took = self.printer.recorder().last_step.unwrap_or_default().saturating_sub(asked);
        self.aftermath.pause_rest = self.aftermath.pause_rest.max(Some(took));
        self.aftermath.pause_is_late |= took > self.lease.hold_ramp() + self.ticks(PAUSE_SPARE);
    }

    /// The user pauses the print, or resumes it, where that is due.
    pub(super) fn pause(&mut self, now: Seconds) -> bool {
        let Some(wanted) = self.pauses.take(self.printer.now()) else { return false };
        let result = match wanted {
            Wanted::Pause => {
                let is_paused = self.session.job_status() == JobStatus::Paused;
                if self.session.request(Request::Pause, now).is_err() || is_paused {
                    self.pauses.is_refused();
                } else if self.consent_at.take().is_some() {
                    // What was held is paused instead of being gone on with.
                    self.held_at = None;
                }
                Ok(())
            }
            Wanted::Resume if self.stage != Stage::Printing => Ok(()),
            Wanted::Resume => self.session.request(Request::Resume, now),
        };
        if let Err(error) = result {
            self.observer.error.get_or_insert(error);
            self.end();
        }
        true
    }
}
