//! `[mcu]`, `[printer]` and the small sections about the machine as a whole.

use steps::StepSearch;
use units::{Mm, MmPerS, MmPerS2, MmPerS3, Seconds};

use super::Builder;
use super::diagnostics::excerpt;
use super::kinematics::{self, DeltaOptions, Kind, Kinematics};
use super::reader::{Checked, Range, Reported};

/// The board. Which port it is on is the shell's to know; the name is kept for display.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct McuConfig {
    /// `serial`, or the CAN identity, as written; may be empty.
    pub serial: String,
    /// Rate of a real serial line, bits per second. USB ignores it.
    pub baud: u32,
}

/// What becomes of a move that is faster than its motors' torque allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UnreachableSpeed {
    /// It is made as fast as they can, and the user is told.
    #[default]
    Clamp,
    /// It is refused.
    Reject,
}

/// `[printer]`: limits of the whole machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineConfig {
    /// How motors move the head.
    pub kinematics: Kinematics,
    /// Top speed along the path.
    pub max_velocity: MmPerS,
    /// Acceleration along the path.
    pub max_accel: MmPerS2,
    /// Speed at a right-angled corner.
    pub square_corner_velocity: MmPerS,
    /// Share of a move that must cruise, 0..1.
    pub minimum_cruise_ratio: f64,
    /// How long a board that regulates its heaters keeps them at stand-by when the host falls silent (an option of our
    /// own); then they go off.
    pub standby_time: Seconds,
    /// By how much the head is lifted in a pause (an option of our own) …
    pub pause_lift: Mm,
    /// … and where it goes then, X and Y (two options of our own); where not given, it stays above the part.
    pub pause_position: [Option<Mm>; 2],
    /// Top speed of Z; `max_velocity` where not given.
    pub max_z_velocity: MmPerS,
    /// Acceleration of Z; `max_accel` where not given.
    pub max_z_accel: MmPerS2,
    /// Top speed of X and of Y alone (as in Kalico); infinite where not given.
    pub max_xy_velocity: [MmPerS; 2],
    /// Acceleration of X and of Y alone; infinite where not given.
    pub max_xy_accel: [MmPerS2; 2],
    /// The other rule for corners (as in Marlin), instead of `square_corner_velocity`.
    pub junction_deviation: Option<Mm>,
    /// What becomes of a move that is faster than its motors' torque allows (an option of our own).
    pub unreachable_speed: UnreachableSpeed,
    /// The fastest that the acceleration along the path may change (an option of our own); not limited where not given.
    pub max_jerk: Option<MmPerS3>,
    /// How step commands are searched for (an option of our own).
    pub step_search: StepSearch,
}

/// `[idle_timeout]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdleTimeoutConfig {
    /// Time without orders after which heaters and motors are switched off.
    pub timeout: Seconds,
}

/// `[firmware_retraction]`: what G10 and G11 do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirmwareRetraction {
    /// Filament pulled back by G10.
    pub retract_length: Mm,
    /// Its speed.
    pub retract_speed: MmPerS,
    /// Filament pushed by G11 beyond what was pulled back.
    pub unretract_extra_length: Mm,
    /// Its speed.
    pub unretract_speed: MmPerS,
}

/// Klipper's own default; firmware without a fixed rate expects it.
const BAUD_DEFAULT: u32 = 250_000;
const VELOCITY_MAX: f64 = 10_000.0;
const ACCEL_MAX: f64 = 1_000_000.0;
/// Half an hour at stand-by: time enough to come back and look.
const STANDBY_TIME_S: f64 = 1_800.0;
/// The most that a board takes.
const STANDBY_TIME_MAX_S: f64 = 14_400.0;
/// Clear of the part, and back in a second.
const PAUSE_LIFT_MM: f64 = 5.0;
const PAUSE_LIFT_MAX_MM: f64 = 100.0;
/// Slower changes of the acceleration would take minutes, faster ones are none.
const JERK_MIN: f64 = 1_000.0;
const JERK_MAX: f64 = 1e7;
/// Beyond a millimetre a corner is none.
const JUNCTION_DEVIATION_MAX_MM: f64 = 1.0;
/// At 1 the head could not speed up at all.
const MINIMUM_CRUISE_RATIO_MAX: f64 = 0.999_999;
/// A week: longer means "never", which a heater must not have.
const IDLE_TIMEOUT_MAX_S: f64 = 604_800.0;

pub(super) fn mcu(builder: &mut Builder<'_>) -> Checked<McuConfig> {
    let mut reader = builder.required_section("mcu")?;
    let serial = reader.text("serial");
    let canbus = reader.text("canbus_uuid");
    let baud = reader.integer_or("baud", BAUD_DEFAULT, 2_400, 4_000_000);
    reader.without_effect(
        &["restart_method", "canbus_interface", "max_stepper_error"],
        "connecting and restarting are done by whoever opens the port",
    );
    reader.finish();
    Ok(McuConfig { serial: serial.or(canbus).unwrap_or_default(), baud: baud? })
}

/// `[printer]`, and what it says of a delta.
pub(super) fn printer(
    builder: &mut Builder<'_>,
    kind: Option<Kind>,
) -> Checked<(MachineConfig, Option<DeltaOptions>)> {
    let mut reader = builder.required_section("printer")?;
    let kinematics = reader.required_text("kinematics").and_then(|_| kind.ok_or(Reported));
    let delta = (kind == Some(Kind::Delta)).then(|| kinematics::delta_options(&mut reader));
    let max_velocity = reader.number("max_velocity", Range::above(0.0).to(VELOCITY_MAX));
    let max_accel = reader.number("max_accel", Range::above(0.0).to(ACCEL_MAX));
    let corner = reader.number_or("square_corner_velocity", 5.0, Range::from(0.0).to(VELOCITY_MAX));
    let mut cruise =
        reader.number_or("minimum_cruise_ratio", 0.5, Range::from(0.0).to(MINIMUM_CRUISE_RATIO_MAX));
    let old_decel = reader.optional_number("max_accel_to_decel", Range::above(0.0));
    if let (Ok(Some(decel)), Ok(accel), false) = (old_decel, max_accel, reader.has("minimum_cruise_ratio")) {
        let ratio = (1.0 - decel / accel).clamp(0.0, MINIMUM_CRUISE_RATIO_MAX);
        reader.warning(
            "max_accel_to_decel",
            format!("an old name, read as `minimum_cruise_ratio: {ratio:.3}`; write that instead"),
        );
        cruise = Ok(ratio);
    }
    let standby_time =
        reader.number_or("standby_time", STANDBY_TIME_S, Range::from(0.0).to(STANDBY_TIME_MAX_S));
    let pause_lift = reader.number_or("pause_lift", PAUSE_LIFT_MM, Range::from(0.0).to(PAUSE_LIFT_MAX_MM));
    let pause_x = reader.optional_number("pause_x", Range::from(-10_000.0));
    let pause_y = reader.optional_number("pause_y", Range::from(-10_000.0));
    let max_z_velocity = reader.optional_number("max_z_velocity", Range::above(0.0).to(VELOCITY_MAX));
    let max_z_accel = reader.optional_number("max_z_accel", Range::above(0.0).to(ACCEL_MAX));
    let velocity = Range::above(0.0).to(VELOCITY_MAX);
    let xy_velocity = ["max_x_velocity", "max_y_velocity"].map(|name| reader.optional_number(name, velocity));
    let accel = Range::above(0.0).to(ACCEL_MAX);
    let xy_accel = ["max_x_accel", "max_y_accel"].map(|name| reader.optional_number(name, accel));
    let junction_deviation =
        reader.optional_number("junction_deviation", Range::from(0.0).to(JUNCTION_DEVIATION_MAX_MM));
    let max_jerk = reader.optional_number("max_jerk", Range::from(JERK_MIN).to(JERK_MAX));
    let unreachable_speed = match reader.text("unreachable_speed").as_deref() {
        None | Some("clamp") => Ok(UnreachableSpeed::Clamp),
        Some("reject") => Ok(UnreachableSpeed::Reject),
        Some(other) => {
            let problem = format!("`{}` is neither `clamp` nor `reject`", excerpt(other));
            Err(reader.error("unreachable_speed", problem))
        }
    };
    let step_search = match reader.text("step_search").as_deref() {
        None | Some("usual") => Ok(StepSearch::Usual),
        Some("ahead") => Ok(StepSearch::Ahead),
        Some(other) => {
            let problem = format!("`{}` is neither `usual` nor `ahead`", excerpt(other));
            Err(reader.error("step_search", problem))
        }
    };
    reader.finish();
    let [max_x_velocity, max_y_velocity] = xy_velocity;
    let [max_x_accel, max_y_accel] = xy_accel;
    let (max_velocity, max_accel) = (max_velocity?, max_accel?);
    old_decel?;
    let config = MachineConfig {
        kinematics: kinematics?.linear(),
        max_velocity: MmPerS(max_velocity),
        max_accel: MmPerS2(max_accel),
        square_corner_velocity: MmPerS(corner?),
        minimum_cruise_ratio: cruise?,
        standby_time: Seconds(standby_time?),
        pause_lift: Mm(pause_lift?),
        pause_position: [pause_x?.map(Mm), pause_y?.map(Mm)],
        // As in Klipper, the whole machine's limits hold for Z too.
        max_z_velocity: MmPerS(max_z_velocity?.unwrap_or(max_velocity).min(max_velocity)),
        max_z_accel: MmPerS2(max_z_accel?.unwrap_or(max_accel).min(max_accel)),
        max_xy_velocity: [max_x_velocity?, max_y_velocity?].map(|it| MmPerS(it.unwrap_or(f64::INFINITY))),
        max_xy_accel: [max_x_accel?, max_y_accel?].map(|it| MmPerS2(it.unwrap_or(f64::INFINITY))),
        junction_deviation: junction_deviation?.map(Mm),
        unreachable_speed: unreachable_speed?,
        max_jerk: max_jerk?.map(MmPerS3),
        step_search: step_search?,
    };
    Ok((config, delta.transpose()?))
}

pub(super) fn idle_timeout(builder: &mut Builder<'_>) -> Checked<IdleTimeoutConfig> {
    const DEFAULT_S: f64 = 600.0;
    let Some(mut reader) = builder.section("idle_timeout") else {
        return Ok(IdleTimeoutConfig { timeout: Seconds(DEFAULT_S) });
    };
    let timeout = reader.number_or("timeout", DEFAULT_S, Range::above(0.0).to(IDLE_TIMEOUT_MAX_S));
    reader.not_supported(&["gcode"], "heaters and motors are switched off instead of running these commands");
    reader.finish();
    Ok(IdleTimeoutConfig { timeout: Seconds(timeout?) })
}

pub(super) fn firmware_retraction(builder: &mut Builder<'_>) -> Checked<Option<FirmwareRetraction>> {
    let Some(mut reader) = builder.section("firmware_retraction") else { return Ok(None) };
    let retract_length = reader.number_or("retract_length", 0.0, Range::from(0.0).to(1_000.0));
    let retract_speed = reader.number_or("retract_speed", 20.0, Range::from(1.0).to(VELOCITY_MAX));
    let extra = reader.number_or("unretract_extra_length", 0.0, Range::from(0.0).to(1_000.0));
    let unretract_speed = reader.number_or("unretract_speed", 10.0, Range::from(1.0).to(VELOCITY_MAX));
    reader.finish();
    Ok(Some(FirmwareRetraction {
        retract_length: Mm(retract_length?),
        retract_speed: MmPerS(retract_speed?),
        unretract_extra_length: Mm(extra?),
        unretract_speed: MmPerS(unretract_speed?),
    }))
}

pub(super) fn force_move(builder: &mut Builder<'_>) -> Checked<bool> {
    let Some(mut reader) = builder.section("force_move") else { return Ok(false) };
    let enabled = reader.boolean_or("enable_force_move", false);
    reader.finish();
    enabled
}

#[cfg(test)]
mod tests {
    use super::super::tests::{assert_diagnosed, with};
    use super::super::{Severity, parse};
    use super::*;

    #[test]
    fn step_search_is_one_of_two_words() {
        let search = |line: &str| {
            let (config, diagnostics) = parse(&with("kinematics: cartesian", line));
            assert!(diagnostics.is_empty(), "{diagnostics:#?}");
            config.unwrap().printer.step_search
        };
        assert_eq!(search("kinematics: cartesian"), StepSearch::Usual);
        assert_eq!(search("kinematics: cartesian\nstep_search: usual"), StepSearch::Usual);
        assert_eq!(search("kinematics: cartesian\nstep_search: ahead"), StepSearch::Ahead);
        let wrong = with("kinematics: cartesian", "kinematics: cartesian\nstep_search: far");
        assert_diagnosed(&wrong, Severity::Error, "step_search: far", "neither `usual` nor `ahead`");
    }
}
