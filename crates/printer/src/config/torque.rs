//! `[motor_torque stepper_x]` and its like (a section of our own): what a motor can do at each speed, so that the planner
//! asks for no more. A motor without one is limited by `max_accel` and `max_velocity` alone, as in Klipper.
//!
//! Units in the file: rates in full steps a second, torque in N·m, inertia in g·cm², as in data sheets.

use motion::{MotorAbility, Torque, TorqueError};
use units::Mm;

use super::Builder;
use super::diagnostics::excerpt;
use super::reader::{Checked, Range, Reader};
use super::stepper::MotorConfig;

/// A rotor without damping loses step at a sudden demand of 0.72 of its torque, and from speeding up to slowing down the demand
/// changes by twice the margin. The rest is for parts that differ (`stepcast torque`).
const MARGIN_DEFAULT: f64 = 0.3;
/// No motor of a machine of this kind turns faster.
const RATE_MAX: f64 = 1e6;
const TORQUE_NM_MAX: f64 = 1e3;
const INERTIA_GCM2_MAX: f64 = 1e9;
/// kg·m² in a g·cm².
const KG_M2: f64 = 1e-7;

/// Reads the section of a motor, if it has one. It is refused where the motor does not move a single axis `is_alone` on.
pub(super) fn motor_torque(
    builder: &mut Builder<'_>,
    name: &str,
    motor: Option<&MotorConfig>,
    is_alone: bool,
) -> Checked<Option<MotorAbility>> {
    let Some(mut reader) = builder.section(&format!("motor_torque {name}")) else { return Ok(None) };
    if !is_alone {
        let problem = "this motor moves more than one axis, for which torque cannot be planned yet; leave the section \
                       out and limit the machine by max_accel and max_velocity";
        return Err(reader.error("pull_out_torque", problem));
    }
    let pull_out = table(&mut reader, "pull_out_torque");
    let slowing = reader.has("slowing_torque").then(|| table(&mut reader, "slowing_torque")).transpose();
    let inertia = reader.number("inertia", Range::above(0.0).to(INERTIA_GCM2_MAX));
    let load = reader.number_or("load_torque", 0.0, Range::from(0.0).to(TORQUE_NM_MAX));
    let margin = reader.number_or("torque_margin", MARGIN_DEFAULT, Range::above(0.0).to(1.0));
    let resonances = bands(&mut reader, "resonances");
    let Some(motor) = motor else {
        // What is wrong with the motor itself has been said.
        reader.finish();
        return Ok(None);
    };
    let torque = Torque {
        pull_out: pull_out?,
        pull_out_slowing: slowing?,
        load: load?,
        inertia: inertia? * KG_M2,
        margin: margin?,
        full_steps: motor.full_steps_per_rotation,
        turn: Mm(motor.rotation_distance.0 / motor.gear_ratio),
        resonances: resonances?,
    };
    advise(&mut reader, &torque, motor.microsteps);
    let ability = torque.ability().map_err(|error| {
        let key = match error {
            TorqueError::Table => "pull_out_torque",
            TorqueError::NotPositive(_) => "inertia",
            TorqueError::Overloaded => "load_torque",
            TorqueError::Resonance => "resonances",
        };
        reader.error(key, error)
    });
    reader.finish();
    ability.map(Some)
}

/// Says where the set microsteps are finer than the motor can place its load: a microstep of n shifts the field by 90°/n,
/// which pulls with sin(90°/n) of the holding torque.
fn advise(reader: &mut Reader<'_>, torque: &Torque, microsteps: u32) {
    let holding = torque.pull_out.first().map_or(0.0, |point| point.1);
    let pulls = |n: u32| holding * libm::sin(core::f64::consts::FRAC_PI_2 / f64::from(n));
    if pulls(microsteps) >= torque.load {
        return;
    }
    let real = (0..8).map(|power| 1 << power).take_while(|&n| pulls(n) >= torque.load).last().unwrap_or(1);
    let share = 100.0 * libm::sin(core::f64::consts::FRAC_PI_2 / f64::from(microsteps));
    reader.warning(
        "load_torque",
        format!(
            "one of {microsteps} microsteps has {share:.2} % of the motor's torque, less than the load's: the motor moves \
             only every few microsteps, so the set resolution is not real (1/{real} is)"
        ),
    );
}

/// `0: 2.2, 400: 2.1`: pairs of a rate and a torque.
fn table(reader: &mut Reader<'_>, key: &'static str) -> Checked<Vec<(f64, f64)>> {
    let text = reader.required_text(key)?;
    let mut points = Vec::new();
    for pair in text.split([',', '\n']).filter(|pair| !pair.trim().is_empty()) {
        let Some(point) = pair_of(pair, ':', RATE_MAX, TORQUE_NM_MAX) else {
            let problem = "is not a pair of full steps/s and N·m; write e.g. 0: 2.2, 500: 2.0, 2000: 0.6";
            return Err(reader.error(key, format!("`{}` {problem}", excerpt(pair))));
        };
        points.push(point);
    }
    Ok(points)
}

/// `20-40, 90-110`: bands of rates.
fn bands(reader: &mut Reader<'_>, key: &'static str) -> Checked<Vec<(f64, f64)>> {
    let Some(text) = reader.text(key) else { return Ok(Vec::new()) };
    let mut bands = Vec::new();
    for pair in text.split([',', '\n']).filter(|pair| !pair.trim().is_empty()) {
        let Some(band) =
            pair_of(pair, '-', RATE_MAX, RATE_MAX).filter(|band| band.0 > 0.0 && band.1 > band.0)
        else {
            let problem = "is not a band of full steps/s; write e.g. 20-40, 90-110";
            return Err(reader.error(key, format!("`{}` {problem}", excerpt(pair))));
        };
        bands.push(band);
    }
    Ok(bands)
}

fn pair_of(text: &str, between: char, first_max: f64, second_max: f64) -> Option<(f64, f64)> {
    let (first, second) = text.split_once(between)?;
    let number = |text: &str, max: f64| text.trim().parse().ok().filter(|value| (0.0..=max).contains(value));
    Some((number(first, first_max)?, number(second, second_max)?))
}
