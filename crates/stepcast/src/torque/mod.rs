//! `stepcast torque`: what planning by the motors' torque gains over the best constant acceleration.
//!
//! Both make the same travels on the same simulated machines. Of the constant pairs (acceleration, top speed) the fastest
//! that loses no step on any machine is searched for; the plan by torque has one try. Motors lose steps by their own
//! integrated physics.

mod machine;
mod trial;

use std::{fmt::Write as _, process::ExitCode};

use serde::Serialize;
use virtual_printer::Mechanics;

use self::{
    machine::{AXLES, Drive},
    trial::Plan,
};
use crate::{
    campaign::Chance,
    cli::TorqueArgs,
    console::{self, Progress},
};

/// Top speeds that are tried, mm/s: from the first one, each so much higher than the one before.
const VELOCITY_FIRST: f64 = 150.0;
const VELOCITY_RATIO: f64 = 1.12;
const VELOCITIES: u32 = 18;
/// Accelerations that are tried, mm/s².
const ACCEL_MIN: f64 = 200.0;
const ACCEL_MAX: f64 = 100_000.0;
/// Halvings between them.
const HALVINGS: u32 = 11;

/// The result as JSON; the keys are stable.
#[derive(Debug, Serialize)]
struct Report {
    machines: usize,
    constant: Constant,
    torque: Torque,
    /// Time of the constant pair over the time by torque.
    gain: f64,
    /// Machines that lose steps at the highest acceleration of the plan by torque, held constant.
    lost_at_constant_peak: usize,
}

#[derive(Debug, Serialize)]
struct Constant {
    accel_mm_s2: f64,
    velocity_mm_s: f64,
    time_s: f64,
}

#[derive(Debug, Serialize)]
struct Torque {
    time_s: f64,
    accel_max_mm_s2: f64,
    velocity_max_mm_s: f64,
    /// Machines that lose steps.
    lost: usize,
}

type Machine = [Mechanics; AXLES.len()];

/// Runs the command.
pub(crate) fn run(args: &TorqueArgs) -> anyhow::Result<ExitCode> {
    let machines: Vec<Machine> = (0..args.seeds).map(specimen).collect();
    let text = trial::travels();
    let progress = Progress::new("searching", u64::from(VELOCITIES));
    let mut best: Option<Constant> = None;
    let mut velocity_mm_s = VELOCITY_FIRST;
    for done in 0..VELOCITIES {
        if let Some(found) = fastest(&text, velocity_mm_s, &machines)?
            && best.as_ref().is_none_or(|best| found.time_s < best.time_s)
        {
            best = Some(found);
        }
        velocity_mm_s *= VELOCITY_RATIO;
        progress.set(u64::from(done));
    }
    drop(progress);
    let constant = best.ok_or_else(|| anyhow::anyhow!("no constant acceleration keeps step"))?;
    let plan = trial::plan(&text, Drive::Torque { margin: args.torque_margin })?;
    let peak = Drive::Constant { accel: plan.accel_max, velocity: plan.velocity_max };
    let report = Report {
        machines: machines.len(),
        gain: constant.time_s / plan.time_s,
        constant,
        torque: Torque {
            time_s: plan.time_s,
            accel_max_mm_s2: plan.accel_max,
            velocity_max_mm_s: plan.velocity_max,
            lost: losing(&plan, &machines),
        },
        lost_at_constant_peak: losing(&trial::plan(&text, peak)?, &machines),
    };
    if args.json {
        console::print_json(&report)?;
    } else {
        console::print(&words(&report));
    }
    Ok(ExitCode::SUCCESS)
}

fn specimen(seed: u32) -> Machine {
    let mut chance = Chance::new(u64::from(seed), 1);
    AXLES.each_ref().map(|axle| axle.specimen(&mut chance))
}

fn losing(plan: &Plan, machines: &[Machine]) -> usize {
    machines.iter().filter(|machine| plan.loses_steps(machine)).count()
}

/// The strongest acceleration with which no machine loses a step up to this speed; `None` where even the weakest does.
fn fastest(text: &str, velocity: f64, machines: &[Machine]) -> anyhow::Result<Option<Constant>> {
    let attempt = |accel: f64| -> anyhow::Result<Option<Constant>> {
        let plan = trial::plan(text, Drive::Constant { accel, velocity })?;
        let keeps = !machines.iter().any(|machine| plan.loses_steps(machine));
        Ok(keeps.then_some(Constant { accel_mm_s2: accel, velocity_mm_s: velocity, time_s: plan.time_s }))
    };
    let mut best = attempt(ACCEL_MIN)?;
    if best.is_none() {
        return Ok(None);
    }
    let (mut low, mut high) = (ACCEL_MIN, ACCEL_MAX);
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        match attempt(middle)? {
            Some(found) => {
                low = middle;
                best = Some(found);
            }
            None => high = middle,
        }
    }
    Ok(best)
}

fn words(report: &Report) -> String {
    let Report { machines, constant, torque, gain, lost_at_constant_peak } = report;
    let mut text = String::new();
    let _ = writeln!(
        text,
        "Best constant   {:.0} mm/s², up to {:.0} mm/s: {:.2} s, no step lost on {machines} machines",
        constant.accel_mm_s2, constant.velocity_mm_s, constant.time_s
    );
    let _ = writeln!(
        text,
        "By torque       up to {:.0} mm/s² and {:.0} mm/s: {:.2} s, steps lost on {} machines",
        torque.accel_max_mm_s2, torque.velocity_max_mm_s, torque.time_s, torque.lost
    );
    let _ = writeln!(text, "Gain            {:.1} % of the constant pair's time", 100.0 * (1.0 - 1.0 / gain));
    let _ = writeln!(
        text,
        "Constant peak   the same acceleration held constant loses steps on {lost_at_constant_peak}"
    );
    text
}
