//! Whether a faulty print kept its promise, and what it measured.

use printer::error::ErrorCode;
use units::{Hertz, Seconds, Ticks};

use super::scenario::{Case, Promise};
use crate::simulate::{Aftermath, Outcome, PATH_ERROR_MAX_MM, Report};

/// Motion rests by so much after its ramp at the latest.
const REST_SPARE: Seconds = Seconds(0.05);
/// A host that has told no lease counts as alive for so long after its last word.
const ALIVE: Seconds = Seconds(2.0);
/// The longest ramp where none was told.
const RAMP: Seconds = Seconds(0.3);
/// Heaters may go without orders for so long: then they are at stand-by, or off where the board has none.
const HEATERS_ALONE: Seconds = Seconds(5.0);
/// All of that is looked at and reported with this delay.
const HEATERS_SPARE: Seconds = Seconds(2.0);
/// The orders of a host that is gone come so late at most.
const ORDERS_COME: Seconds = Seconds(1.1);
/// Steps so long after a board has failed belong to motion that has begun anew.
const STILL_AFTER: Seconds = Seconds(0.1);

/// What a print measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Finding {
    pub(super) lost_steps: u64,
    pub(super) path_error_mm: f64,
    /// From the moment at which the lease ran out.
    pub(super) time_to_rest_s: Option<f64>,
    /// From the fault.
    pub(super) time_to_safe_heaters_s: Option<f64>,
    pub(super) wrong_resumes: u32,
    pub(super) restarts_without_consent: u32,
    pub(super) holds: u32,
    /// How far what was printed after a loss of power is from its height.
    pub(super) z_error_mm: Option<f64>,
    /// The user had to measure Z.
    pub(super) measured: u32,
    /// It was gone on with after a loss of power: the others had nothing left to print, or nothing printed yet.
    pub(super) gone_on: u32,
    /// What was promised and did not come.
    pub(super) broken: Vec<String>,
}

/// A print with the machine's side of its end.
pub(super) struct Print {
    pub(super) report: Report,
    pub(super) aftermath: Aftermath,
}

/// Judges a print against the clean one of the same window on the same board.
pub(super) fn judge(case: &Case, clean: &Print, print: &Print, standby: Seconds) -> Finding {
    let lost: i64 = print.report.motors.values().map(|motor| motor.lost_steps.abs()).sum();
    let mut finding = Finding {
        lost_steps: lost.unsigned_abs(),
        path_error_mm: print.report.path_error_max_mm,
        holds: print.report.holds,
        restarts_without_consent: print.aftermath.restarts,
        ..Finding::default()
    };
    let judging = Judging { case, clean, print, clock: case.board.clock };
    match case.promise {
        Promise::SamePulses => judging.same(true, &mut finding),
        Promise::SameStepsOrRefused if is_refused(print) => {}
        Promise::SameSteps | Promise::SameStepsOrRefused => judging.same(false, &mut finding),
        Promise::AtRest => judging.at_rest(standby, &mut finding),
        Promise::Shutdown => judging.shuts_down(standby, &mut finding),
        Promise::SameOrFails if print.report.result == Outcome::Done => judging.same(true, &mut finding),
        Promise::Fails | Promise::SameOrFails => judging.fails(standby, &mut finding),
    }
    if finding.restarts_without_consent > 0 {
        finding.broken.push("motion began again without the user's word".to_owned());
    }
    finding
}

/// Whether the print was not gone on with, and why was said.
fn is_refused(print: &Print) -> bool {
    print.report.error.as_ref().is_some_and(|error| error.code == ErrorCode::ContinuationRefused.as_str())
}

struct Judging<'a> {
    case: &'a Case,
    clean: &'a Print,
    print: &'a Print,
    clock: Hertz,
}

impl Judging<'_> {
    fn same(&self, edges: bool, finding: &mut Finding) {
        let report = &self.print.report;
        if report.result != Outcome::Done {
            let reason = report.reason.as_deref().unwrap_or("no reason");
            finding.broken.push(format!("the print failed: {reason}"));
            return;
        }
        let clean = &self.clean.report;
        let differs = if edges {
            report.pulse_digest != clean.pulse_digest
        } else {
            report.step_digest != clean.step_digest
        };
        if differs {
            finding.wrong_resumes += u32::from(report.holds > 0);
            finding.broken.push("the pulses are not those of the clean print".to_owned());
        }
        let aftermath = &self.print.aftermath;
        if let Some(rest) = aftermath.pause_rest {
            finding.time_to_rest_s = Some(self.clock.duration_of(rest).0);
        }
        if aftermath.pause_is_late {
            finding.broken.push("a pause took longer to rest than its ramp".to_owned());
        }
        if aftermath.pause_is_forgotten {
            finding.broken.push("a pause that was accepted did not come".to_owned());
        }
        // A pause while what is held is heated again is one more.
        let holds_max = u32::from(!edges) + self.case.faults.pauses.len() as u32;
        if report.holds > holds_max {
            finding.broken.push(format!("{} holds, at most {holds_max} expected", report.holds));
        }
    }

    fn at_rest(&self, standby: Seconds, finding: &mut Finding) {
        let aftermath = &self.print.aftermath;
        let Some(died) = aftermath.host_died else {
            // It was done before.
            return self.same(true, finding);
        };
        let ticks = |time| self.clock.ticks_in(time);
        let rest = aftermath.lease_rest.unwrap_or(died + ticks(ALIVE) + ticks(RAMP)).max(died);
        let alive = rest.saturating_sub(ticks(RAMP)).max(died);
        let last = aftermath.last_step.unwrap_or_default();
        finding.time_to_rest_s = Some(self.seconds(alive, last));
        if last > rest + ticks(REST_SPARE) {
            finding.broken.push(format!("it rests {:.3} s too late", self.seconds(rest, last)));
        }
        if finding.lost_steps > 0 {
            finding.broken.push(format!("{} steps were lost", finding.lost_steps));
        }
        if finding.path_error_mm > PATH_ERROR_MAX_MM {
            finding.broken.push(format!("{:.4} mm off the path", finding.path_error_mm));
        }
        if aftermath.strays > 0 {
            finding.broken.push(format!("{} pulses that no line asked for", aftermath.strays));
        }
        self.heaters(died, standby, finding);
    }

    fn fails(&self, standby: Seconds, finding: &mut Finding) {
        let report = &self.print.report;
        let at = self.case.at.map_or(Ticks(0), |at| self.print.aftermath.start + self.clock.ticks_in(at));
        // What happens after the job's end does not fail it.
        if report.result == Outcome::Done && at >= self.print.aftermath.ended {
            return;
        }
        match &report.error {
            None => finding.broken.push("the fault was not noticed".to_owned()),
            Some(error) if error.what_to_do.is_none() => {
                finding
                    .broken
                    .push(format!("it ended without a reason for the user: {}", error.what_happened));
            }
            Some(_) => {}
        }
        let last = self.print.aftermath.last_step.unwrap_or_default();
        let ended = self.print.aftermath.ended.max(at);
        if last > ended + self.clock.ticks_in(STILL_AFTER) + self.clock.ticks_in(ALIVE) {
            finding.restarts_without_consent += 1;
        }
        let stalled =
            self.case.faults.host_stalls.iter().map(|stall| stall.lasts).fold(Seconds::ZERO, Seconds::max);
        self.heaters(at + self.clock.ticks_in(stalled), standby, finding);
    }

    fn shuts_down(&self, standby: Seconds, finding: &mut Finding) {
        let aftermath = &self.print.aftermath;
        let Some(died) = aftermath.host_died else { return };
        self.heaters(died, standby, finding);
        // What the host had ordered before has come by then: nobody switches it off but the board.
        let was_heated = aftermath.heated > died + self.clock.ticks_in(ORDERS_COME);
        if was_heated && self.print.report.after.shutdown.is_none() {
            finding.broken.push("the board did not stop although its heaters had no orders".to_owned());
        }
        let still = died + self.clock.ticks_in(HEATERS_ALONE) + self.clock.ticks_in(HEATERS_SPARE);
        if was_heated && aftermath.last_step.is_some_and(|last| last > still) {
            finding.restarts_without_consent += 1;
        }
    }

    fn heaters(&self, from: Ticks, standby: Seconds, finding: &mut Finding) {
        let aftermath = &self.print.aftermath;
        let safe_s = self.seconds(from, aftermath.overheated);
        finding.time_to_safe_heaters_s = Some(safe_s);
        if safe_s > HEATERS_ALONE.0 + HEATERS_SPARE.0 {
            finding.broken.push(format!("a heater was on above its stand-by for {safe_s:.1} s more"));
        }
        let off_s = self.seconds(from, aftermath.heated);
        if off_s > HEATERS_ALONE.0 + standby.0 + HEATERS_SPARE.0 {
            finding.broken.push(format!("a heater was on for {off_s:.1} s more"));
        }
        if !self.print.report.after.heaters_off {
            finding.broken.push("a heater is still on".to_owned());
        }
    }

    fn seconds(&self, from: Ticks, to: Ticks) -> f64 {
        self.clock.duration_of(to.saturating_sub(from)).0
    }
}
