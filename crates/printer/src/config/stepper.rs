//! `[stepper_x]`, `[stepper_y]`, `[stepper_z]`, and what an extruder and a delta's towers share with them.

use units::{Mm, MmPerS, Seconds};

use super::Builder;
use super::diagnostics::excerpt;
use super::pin::{PinSpec, PinUse};
use super::reader::{Checked, Range, Reader};

/// A stepper motor and its driver.
#[derive(Clone, Debug, PartialEq)]
pub struct MotorConfig {
    /// Output that steps.
    pub step_pin: PinSpec,
    /// Output that sets the direction; not inverted, high is forward.
    pub dir_pin: PinSpec,
    /// Output that powers the driver; without one it is always powered.
    pub enable_pin: Option<PinSpec>,
    /// Travel in one turn of the (geared) shaft.
    pub rotation_distance: Mm,
    /// Microsteps a full step.
    pub microsteps: u32,
    /// Full steps a turn of the motor.
    pub full_steps_per_rotation: u32,
    /// Turns of the motor for one of the shaft.
    pub gear_ratio: f64,
    /// Shortest pulse the driver sees.
    pub step_pulse_duration: Seconds,
}

impl MotorConfig {
    /// Travel of one microstep.
    pub fn step_distance(&self) -> Mm {
        let steps = f64::from(self.full_steps_per_rotation) * f64::from(self.microsteps) * self.gear_ratio;
        Mm(self.rotation_distance.0 / steps)
    }
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct StepperConfig {
    /// The section's name, e.g. `stepper_x`.
    pub name: String,
    /// Its motor.
    pub motor: MotorConfig,
    /// Input that shows whether the axis is at its endstop.
    pub endstop_pin: PinSpec,
    /// Position at which the endstop triggers.
    pub position_endstop: Mm,
    /// Lowest position allowed.
    pub position_min: Mm,
    /// Highest position allowed.
    pub position_max: Mm,
    /// Speed of the first approach.
    pub homing_speed: MmPerS,
    /// Speed of the second approach.
    pub second_homing_speed: MmPerS,
    /// Speed of backing off between the two.
    pub homing_retract_speed: MmPerS,
    /// How far to back off; zero means that there is no second approach.
    pub homing_retract_dist: Mm,
    /// Whether the endstop lies at the high end.
    pub homing_positive_dir: bool,
}

impl StepperConfig {
    /// Travel of one microstep.
    pub fn step_distance(&self) -> Mm {
        self.motor.step_distance()
    }
}

/// Klipper's default for drivers that are not configured over a serial line.
const STEP_PULSE_DEFAULT_S: f64 = 2e-6;
const POSITION_MAX_MM: f64 = 100_000.0;
const HOMING_SPEED_MAX: f64 = 1_000.0;
/// Steps shorter than this are a wrong gear ratio; they would also exceed what counters and clocks can hold.
const STEP_DISTANCE_MIN_MM: f64 = 1e-5;
const STEP_DISTANCE_MAX_MM: f64 = 10.0;

/// The options that every motor has.
pub(super) fn motor(reader: &mut Reader<'_>) -> Checked<MotorConfig> {
    let step_pin = reader.pin("step_pin", PinUse::Output);
    let dir_pin = reader.pin("dir_pin", PinUse::Output);
    let enable_pin = reader.optional_pin("enable_pin", PinUse::Output);
    let rotation_distance = reader.number("rotation_distance", Range::above(0.0).to(100_000.0));
    let microsteps = reader.integer("microsteps", 1, 256);
    let full_steps = reader.integer_or("full_steps_per_rotation", 200, 4, 100_000);
    let gear_ratio = gear_ratio(reader);
    let pulse = reader.number_or("step_pulse_duration", STEP_PULSE_DEFAULT_S, Range::from(0.0).to(0.001));
    if full_steps.is_ok_and(|steps| steps % 4 != 0) {
        return Err(reader.error(
            "full_steps_per_rotation",
            "must be a multiple of 4: write 200 for a 1.8° motor, 400 for 0.9°",
        ));
    }
    let motor = MotorConfig {
        step_pin: step_pin?,
        dir_pin: dir_pin?,
        enable_pin: enable_pin?,
        rotation_distance: Mm(rotation_distance?),
        microsteps: microsteps?,
        full_steps_per_rotation: full_steps?,
        gear_ratio: gear_ratio?,
        step_pulse_duration: Seconds(pulse?),
    };
    let distance = motor.step_distance().0;
    if !(STEP_DISTANCE_MIN_MM..=STEP_DISTANCE_MAX_MM).contains(&distance) {
        return Err(reader.error(
            "rotation_distance",
            format!("one microstep comes out as {distance:e} mm; check rotation_distance, microsteps and gear_ratio"),
        ));
    }
    Ok(motor)
}

/// `57:11, 2:1`: the product of all pairs; 1 where there are none.
fn gear_ratio(reader: &mut Reader<'_>) -> Checked<f64> {
    let Some(text) = reader.text("gear_ratio") else { return Ok(1.0) };
    let mut ratio = 1.0;
    for pair in text.split([',', '\n']) {
        let teeth =
            |side: &str| side.trim().parse::<f64>().ok().filter(|teeth| *teeth > 0.0 && *teeth <= 1e6);
        let Some((driven, driving)) = pair.split_once(':').and_then(|(a, b)| Some((teeth(a)?, teeth(b)?)))
        else {
            let problem = "is not a pair of teeth; write driven:driving, e.g. 50:17";
            return Err(reader.error("gear_ratio", format!("`{}` {problem}", excerpt(pair))));
        };
        ratio *= driven / driving;
    }
    if (1e-4..=1e4).contains(&ratio) {
        return Ok(ratio);
    }
    let problem = "makes no gear; write driven:driving, e.g. 50:17";
    Err(reader.error("gear_ratio", format!("`{}` {problem}", excerpt(&text))))
}

/// Where an axis goes.
#[derive(Clone, Copy)]
pub(super) struct Span {
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) endstop: f64,
}

fn span(reader: &mut Reader<'_>) -> Checked<Span> {
    let anywhere = Range::from(-POSITION_MAX_MM).to(POSITION_MAX_MM);
    let min = reader.number_or("position_min", 0.0, anywhere);
    let max = reader.number("position_max", anywhere);
    let endstop = reader.number("position_endstop", anywhere);
    let (min, max) = (min?, max?);
    if max <= min {
        return Err(reader.error("position_max", format!("{max} must be above position_min, which is {min}")));
    }
    let endstop = endstop?;
    if !(min..=max).contains(&endstop) {
        return Err(reader.error(
            "position_endstop",
            format!("{endstop} must lie within position_min and position_max, {min} to {max}"),
        ));
    }
    Ok(Span { min, max, endstop })
}

/// Towards which end homing goes; not written, it is the end whose quarter of the axis holds the endstop.
fn homing_direction(reader: &mut Reader<'_>, span: Checked<Span>) -> Checked<bool> {
    let said = reader.optional_boolean("homing_positive_dir")?;
    let Span { min, max, endstop } = span?;
    let quarter = (max - min) / 4.0;
    let positive = match said {
        Some(positive) => positive,
        None if endstop <= min + quarter => false,
        None if endstop >= max - quarter => true,
        None => {
            return Err(reader.error(
                "homing_positive_dir",
                "the endstop lies in the middle of the axis, so the direction of homing is unclear; \
                 write `homing_positive_dir: true` or `false`",
            ));
        }
    };
    if (positive && endstop == min) || (!positive && endstop == max) {
        return Err(reader.error(
            "homing_positive_dir",
            "homing would move away from the endstop; correct it or position_endstop",
        ));
    }
    Ok(positive)
}

pub(super) fn axis(builder: &mut Builder<'_>, name: &str) -> Checked<StepperConfig> {
    let mut reader = builder.required_section(name)?;
    let motor = motor(&mut reader);
    let endstop_pin = reader.pin("endstop_pin", PinUse::Input);
    let span = span(&mut reader);
    let homing_positive_dir = homing_direction(&mut reader, span);
    let speeds = HomingSpeeds::read(&mut reader);
    reader.finish();
    Ok(speeds?.stepper(name, motor?, endstop_pin?, span?, homing_positive_dir?))
}

/// How an axis looks for its endstop.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HomingSpeeds {
    homing: MmPerS,
    second: MmPerS,
    retract: MmPerS,
    retract_dist: Mm,
}

impl HomingSpeeds {
    /// The options that say so.
    pub(super) const KEYS: &[&'static str] =
        &["homing_speed", "second_homing_speed", "homing_retract_speed", "homing_retract_dist"];

    pub(super) fn read(reader: &mut Reader<'_>) -> Checked<Self> {
        let speed = Range::above(0.0).to(HOMING_SPEED_MAX);
        let homing = reader.number_or("homing_speed", 5.0, speed);
        let second = reader.optional_number("second_homing_speed", speed);
        let retract = reader.optional_number("homing_retract_speed", speed);
        let retract_dist = reader.number_or("homing_retract_dist", 5.0, Range::from(0.0).to(1_000.0));
        let homing = homing?;
        Ok(Self {
            homing: MmPerS(homing),
            second: MmPerS(second?.unwrap_or(homing / 2.0)),
            retract: MmPerS(retract?.unwrap_or(homing)),
            retract_dist: Mm(retract_dist?),
        })
    }

    /// Those of another one.
    pub(super) const fn of(stepper: &StepperConfig) -> Self {
        Self {
            homing: stepper.homing_speed,
            second: stepper.second_homing_speed,
            retract: stepper.homing_retract_speed,
            retract_dist: stepper.homing_retract_dist,
        }
    }

    /// With all the rest of an axis.
    pub(super) fn stepper(
        self,
        name: &str,
        motor: MotorConfig,
        endstop_pin: PinSpec,
        span: Span,
        homing_positive_dir: bool,
    ) -> StepperConfig {
        StepperConfig {
            name: name.to_owned(),
            motor,
            endstop_pin,
            position_endstop: Mm(span.endstop),
            position_min: Mm(span.min),
            position_max: Mm(span.max),
            homing_speed: self.homing,
            second_homing_speed: self.second,
            homing_retract_speed: self.retract,
            homing_retract_dist: self.retract_dist,
            homing_positive_dir,
        }
    }
}
