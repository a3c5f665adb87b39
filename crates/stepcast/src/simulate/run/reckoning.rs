//! What came of a simulated print, once it is over: the report, and what the campaign wants to know besides.

use std::collections::BTreeMap;

use units::Ticks;
use virtual_printer::State;

use super::{Aftermath, Simulation};
use crate::{
    console::ErrorReport,
    simulate::{
        observer::Observer,
        own_error,
        report::{After, Motor, Outcome, Report},
        tally::Tally,
    },
};

impl Simulation {
    /// How it ended, as the machine saw it.
    pub(crate) fn aftermath(&self) -> Aftermath {
        let tally = self.printer.recorder();
        Aftermath {
            began: self.observer.began,
            lease_rest: self.lease.rest(),
            last_step: tally.last_step,
            strays: tally.path.strays().0,
            ..self.aftermath
        }
    }

    /// What came of it.
    pub(crate) fn into_report(mut self) -> Report {
        let virtual_time = self.virtual_time();
        let now = self.printer.now();
        self.observer.finish();
        let state = self.printer.state();
        let profile_name = self.printer.profile().name;
        let motion_now = self.printer.motion_now();
        let tally = self.printer.recorder_mut();
        if self.observer.done {
            tally.path.finish();
        } else if state.shutdown.is_none() {
            tally.path.settle(motion_now);
        }
        let still = tally.last_step.is_none_or(|at| at + Ticks(1) < now);
        self.after = After {
            heaters_off: state.heaters.iter().all(|heater| heater.duty == 0.0),
            motors_still: still,
            shutdown: state.shutdown.map(|reason| reason.text().to_owned()),
        };
        let motors = motors(&self.observer, tally, &state);
        let overdue = self.is_overdue.then(|| own_error("no-end", "it was given up: it did not end in time"));
        let error = overdue.or_else(|| self.observer.session_error()).or_else(|| {
            wrong(&self.observer, tally, &motors, self.path_error_max_mm)
                .map(|found| own_error("wrong-pulses", found))
        });
        let worst = tally.path.worst();
        let stats = self.session.link_stats().unwrap_or_default();
        Report {
            result: if error.is_none() { Outcome::Done } else { Outcome::Failed },
            reason: error.as_ref().map(|error: &ErrorReport| error.what_happened.clone()),
            error,
            blocking_lines: Vec::new(),
            board: profile_name,
            seed: self.seed,
            print_time_s: self.observer.print_time.0,
            virtual_time_s: virtual_time.0,
            speed_ratio: if self.wall_s > 0.0 { virtual_time.0 / self.wall_s } else { 0.0 },
            moves: self.observer.moves,
            path_error_max_mm: worst.distance_mm,
            path_error_line: (worst.line > 0).then_some(worst.line),
            filament_error_max_mm: tally.path.filament_worst_mm(),
            temperature_error_max_c: self.observer.nozzle.error_max().map(|error| error.0),
            temperature_overshoot_max_c: self.observer.nozzle.overshoot_max().0,
            sent_bytes: stats.bytes_sent,
            retransmitted_bytes: stats.bytes_retransmitted,
            damaged_bytes: state.damaged_bytes,
            min_queued_s: self.observer.min_queued.map(|ahead| ahead.0),
            pulse_digest: tally.digest.text(),
            step_digest: tally.digest.step_text(),
            homing: std::mem::take(&mut self.observer.homing),
            pauses: self.observer.pauses,
            holds: self.observer.holds,
            after: self.after,
            course: self.course.finish(virtual_time, self.journal.len()),
            motors,
        }
    }
}

fn motors(observer: &Observer, tally: &Tally, state: &State) -> BTreeMap<&'static str, Motor> {
    let of = |motor: usize| Motor {
        planned_steps: observer.planned[motor],
        counted_steps: tally.pulses[motor],
        lost_steps: state.motors.get(motor).map_or(0, |view| view.lost.0),
        end_position_mm: tally.path.position_mm(motor),
    };
    observer.names.iter().enumerate().map(|(motor, &name)| (name, of(motor))).collect()
}

/// What is wrong with the pulses of a print that the session takes for done.
fn wrong(
    observer: &Observer,
    tally: &Tally,
    motors: &BTreeMap<&'static str, Motor>,
    path_error_max_mm: f64,
) -> Option<String> {
    if let Some(mismatch) = &observer.mismatch {
        return Some(mismatch.clone());
    }
    for (index, name) in observer.names.iter().enumerate() {
        let Motor { planned_steps, counted_steps, lost_steps, end_position_mm } = &motors[name];
        if observer.is_filtered(index) {
            let end = observer.end.map_or(*end_position_mm, |end| tally.path.motor_mm(index, end));
            // Where motors that stop together at an endstop stopped, each is rounded once more.
            let off_max = observer.step_distance_mm[index] * if tally.path.is_coupled() { 1.5 } else { 1.0 };
            if (end_position_mm - end).abs() > off_max {
                return Some(format!("{name} stands at {end_position_mm} mm, the print ends at {end} mm"));
            }
        } else if !is_as_planned(*planned_steps, *counted_steps, observer.unsure[index]) {
            return Some(format!(
                "{name}: {planned_steps} steps were planned, {counted_steps} pulses were counted"
            ));
        }
        if *lost_steps != 0 {
            return Some(format!("{name} lost {lost_steps} steps: it was driven harder than it can"));
        }
    }
    let worst = tally.path.worst();
    if worst.distance_mm > path_error_max_mm {
        let (distance, line) = (worst.distance_mm, worst.line);
        return Some(format!("the path strays by {distance:.3} mm from line {line}"));
    }
    let (strays, _) = tally.path.strays();
    (strays > 0).then(|| format!("{strays} pulses came while no line was being executed"))
}

/// Whether so many steps are those that were planned; of these some may be made or not, there and back.
const fn is_as_planned(planned: u64, counted: u64, unsure: u64) -> bool {
    let by = planned.abs_diff(counted);
    by <= unsure && by.is_multiple_of(2)
}
