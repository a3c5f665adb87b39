//! What to say about sections that nobody read: harmless, missed, or a reason not to move at all.

use super::diagnostics::{Log, excerpt};
use super::document::Section;

/// Sections of Klipper that a host like this does not need.
const NOT_NEEDED: &[&str] = &[
    "virtual_sdcard",
    "display_status",
    "pause_resume",
    "exclude_object",
    "respond",
    "gcode_arcs",
    "save_variables",
];

/// Sections without which the motors would move otherwise than the owner expects.
const MOVES_WRONGLY: &[(&str, &str)] = &[
    (
        "tmc",
        "the driver's microsteps and current are set over its own wire, which cannot be done yet, so the axis could move the wrong distance",
    ),
    ("dual_carriage", "a second carriage cannot be kept out of the way yet"),
    ("extruder_stepper", "a second motor on the filament would not turn along"),
    ("manual_stepper", "its motor would not be driven"),
    ("mcp4", "the drivers' current would not be set"),
    ("ad5206", "the drivers' current would not be set"),
    ("replicape", "the board needs set-up that cannot be done yet"),
];

/// Sections that are missed in use, but whose absence the machine survives.
const MISSED: &[(&str, &str)] = &[
    ("include", "other files are not read: copy that file's text in here"),
    ("gcode_macro", "macros are not run: the line of a file that calls one asks for confirmation"),
    ("delayed_gcode", "its commands are not run"),
    ("bed_tilt", "the bed is taken as level"),
    ("delta_calibrate", "the towers are taken as the file has them"),
    ("bed_screws", "there is no assistant for it yet"),
    ("screws_tilt_adjust", "there is no assistant for it yet"),
    ("probe", "the bed is not probed; Z homes by its own endstop"),
    ("bltouch", "the bed is not probed; Z homes by its own endstop"),
    ("smart_effector", "the bed is not probed; Z homes by its own endstop"),
    ("probe_eddy_current", "the bed is not probed; Z homes by its own endstop"),
    ("static_digital_output", "that output is left alone"),
    ("gcode_button", "that button does nothing"),
    ("adc_temperature", "that kind of sensor cannot be used"),
    ("adc_scaled", "those pins cannot be used"),
    ("sx1509", "pins of an expander cannot be used"),
    ("menu", "the printer's own display stays dark"),
    ("display_template", "the printer's own display stays dark"),
    ("display_data", "the printer's own display stays dark"),
    ("display_glyph", "the printer's own display stays dark"),
    ("safe_z_home", "homing is done where the head stands"),
    ("homing_override", "homing follows the endstops instead"),
    ("homing_heaters", "heaters stay on while homing"),
    ("resonance_tester", "resonances cannot be measured yet"),
    ("adxl345", "resonances cannot be measured yet"),
    ("heater_fan", "the hot end's own fan will not run: wire it to the supply before heating"),
    ("controller_fan", "that fan will not run"),
    ("temperature_fan", "that fan will not run"),
    ("fan_generic", "that fan will not run"),
    ("heater_generic", "that heater stays off"),
    ("temperature_sensor", "it is not read"),
    ("extruder", "only one extruder is supported so far"),
    ("output_pin", "that output is left alone"),
    ("servo", "that servo is left alone"),
    ("led", "lights are left alone"),
    ("neopixel", "lights are left alone"),
    ("dotstar", "lights are left alone"),
    ("display", "the printer's own display stays dark"),
    ("filament_switch_sensor", "a missing filament is not noticed"),
    ("filament_motion_sensor", "a blocked filament is not noticed"),
    ("endstop_phase", "endstops are used without the motor's phase"),
    ("board_pins", "aliases are not known: write the board's own pin names"),
    ("duplicate_pin_override", "each pin has one job here"),
    ("axis_twist_compensation", "it is not compensated"),
    ("z_tilt", "the gantry is not levelled"),
    ("quad_gantry_level", "the gantry is not levelled"),
];

/// Reports every section that is left.
pub(super) fn report(rest: Vec<Section>, log: &mut Log) {
    for section in rest {
        let kind = section.name.split_whitespace().next().unwrap_or_default();
        let name = excerpt(&section.name);
        if NOT_NEEDED.contains(&kind) {
            log.info(section.line, format!("[{name}] has no effect: it is not needed here"));
        } else if let Some(heater) = section.name.strip_prefix("verify_heater ") {
            log.warning(
                section.line,
                format!("[{name}] has no effect: there is no heater [{}]", excerpt(heater)),
            );
        } else if let Some(advice) = further_motor(kind) {
            log.error(section.line, format!("[{name}] is not supported yet: {advice}"));
        } else if let Some(why) = find(MOVES_WRONGLY, kind) {
            log.error(section.line, format!("[{name}] is not supported yet: {why}"));
        } else if kind == "mcu" {
            let problem = "a second board is not supported yet, its pins cannot be used";
            log.warning(section.line, format!("[{name}]: {problem}"));
        } else if let Some(consequence) = find(MISSED, kind) {
            log.warning(section.line, format!("[{name}] is not supported yet: {consequence}"));
        } else {
            log.warning(
                section.line,
                format!("[{name}] is not known: the section has no effect; check its spelling"),
            );
        }
    }
}

/// `stepper_z1` and its like: one motor of two would push against the other's brake.
fn further_motor(kind: &str) -> Option<&'static str> {
    kind.starts_with("stepper_")
        .then_some("further motors of an axis would stand still while the first one moves")
}

/// The longest entry that the section's kind begins with, so that `tmc2209` finds `tmc` and `extruder1` finds
/// `extruder`, but `extruder_stepper` itself.
fn find(table: &[(&str, &'static str)], kind: &str) -> Option<&'static str> {
    table
        .iter()
        .filter(|(name, _)| {
            kind.strip_prefix(name).is_some_and(|tail| tail.bytes().all(|byte| byte.is_ascii_digit()))
        })
        .max_by_key(|(name, _)| name.len())
        .map(|(_, text)| *text)
}
