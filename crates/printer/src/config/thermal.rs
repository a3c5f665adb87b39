//! `[extruder]`, `[heater_bed]`, `[verify_heater …]`, `[thermistor …]` and `[fan]`.

use std::collections::BTreeMap;

use units::{Celsius, Mm, MmPerS, MmPerS2, Ohms, Seconds};

use super::Builder;
use super::diagnostics::excerpt;
use super::pin::{PinSpec, PinUse};
use super::reader::{Checked, Range, Reader};
use super::stepper::{MotorConfig, motor};
use crate::heater::{PidGains, VerifyHeaterConfig};
use crate::thermistor::{PULLUP_DEFAULT, SensorCurve, Thermistor};

/// How a heater is regulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControlConfig {
    /// `control: pid`.
    Pid(PidGains),
    /// `control: watermark`: on below target − max_delta, off above target + max_delta.
    Watermark {
        /// Half the dead band.
        max_delta: Celsius,
    },
}

/// One heater with its sensor, loop and runaway check.
#[derive(Clone, Debug, PartialEq)]
pub struct HeaterConfig {
    /// The section's name: `extruder` or `heater_bed`.
    pub name: String,
    /// Its output.
    pub heater_pin: PinSpec,
    /// Largest duty, above 0 to 1.
    pub max_power: f64,
    /// Its sensor's type as written.
    pub sensor_type: String,
    /// Its sensor's analog pin.
    pub sensor_pin: PinSpec,
    /// Its sensor with the resistors around it.
    pub thermistor: Thermistor,
    /// Its loop.
    pub control: ControlConfig,
    /// Lowest reading of a sound sensor.
    pub min_temp: Celsius,
    /// Highest reading and target allowed.
    pub max_temp: Celsius,
    /// Lowest temperature at which filament may be pushed; absolute zero for a bed, which holds nothing back.
    pub min_extrude_temp: Celsius,
    /// Time over which readings are averaged.
    pub smooth_time: Seconds,
    /// Length of one on–off cycle of the output.
    pub pwm_cycle_time: Seconds,
    /// What a board that regulates the heater by itself keeps it at when the host falls silent, where its target is not
    /// lower anyway; 0 is off (an option of our own).
    pub standby_temp: Celsius,
    /// Limits of the runaway check.
    pub verify: VerifyHeaterConfig,
}

/// `[extruder]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtruderConfig {
    /// Its motor; distances are of filament.
    pub motor: MotorConfig,
    /// The hot end.
    pub heater: HeaterConfig,
    /// The nozzle's bore.
    pub nozzle_diameter: Mm,
    /// The filament's diameter.
    pub filament_diameter: Mm,
    /// Thickest extrusion with travel, mm².
    pub max_extrude_cross_section: f64,
    /// Sudden change of the filament's speed allowed at a junction.
    pub instantaneous_corner_velocity: MmPerS,
    /// Longest push without travel.
    pub max_extrude_only_distance: Mm,
    /// Top speed of a push without travel.
    pub max_extrude_only_velocity: MmPerS,
    /// Acceleration of a push without travel.
    pub max_extrude_only_accel: MmPerS2,
    /// Pressure advance.
    pub advance: steps::Advance,
    /// Time over which pressure advance is smoothed.
    pub pressure_advance_smooth_time: Seconds,
}

impl ExtruderConfig {
    /// Area of the filament's cross-section, mm².
    pub fn filament_area_mm2(&self) -> f64 {
        circle_area(self.filament_diameter.0)
    }

    /// Most millimetres of filament per millimetre of travel that max_extrude_cross_section allows.
    pub fn max_extrude_ratio(&self) -> f64 {
        self.max_extrude_cross_section / self.filament_area_mm2()
    }
}

fn circle_area(diameter: f64) -> f64 {
    core::f64::consts::PI * diameter * diameter / 4.0
}

/// `[fan]`: the part fan.
#[derive(Clone, Debug, PartialEq)]
pub struct FanConfig {
    /// Its output.
    pub pin: PinSpec,
    /// Largest duty, above 0 to 1.
    pub max_power: f64,
    /// Speed in a shutdown, 0..=1.
    pub shutdown_speed: f64,
    /// Length of one on–off cycle of the output.
    pub cycle_time: Seconds,
    /// Whether the board's PWM unit is to be used.
    pub hardware_pwm: bool,
    /// Full speed for this long when starting.
    pub kick_start_time: Seconds,
    /// Speeds below this are off, 0..=1.
    pub off_below: f64,
}

impl FanConfig {
    /// The duty (0..=max_power) for a speed of 0..=1.
    pub fn duty(&self, speed: f64) -> f64 {
        // Not a number is off.
        let speed = if speed > 0.0 { speed.min(1.0) } else { 0.0 };
        if speed < self.off_below { 0.0 } else { speed * self.max_power }
    }
}

/// `[thermistor NAME]` sections by NAME.
pub(super) type CustomSensors = BTreeMap<String, Checked<SensorCurve>>;

const ABSOLUTE_ZERO: f64 = -273.15;

/// Hotter than any printer's heater; a thermistor's curve means nothing there.
const TEMPERATURE_MAX: f64 = 1_000.0;

pub(super) fn custom_sensors(builder: &mut Builder<'_>) -> CustomSensors {
    let names: Vec<String> = builder.document.names_starting_with("thermistor ");
    let mut sensors = CustomSensors::new();
    for full_name in names {
        let Some(mut reader) = builder.section(&full_name) else { continue };
        let sensor = custom_sensor(&mut reader);
        reader.finish();
        sensors.insert(full_name["thermistor ".len()..].to_owned(), sensor);
    }
    sensors
}

fn custom_sensor(reader: &mut Reader<'_>) -> Checked<SensorCurve> {
    let celsius = Range::above(ABSOLUTE_ZERO).to(TEMPERATURE_MAX);
    let ohms = Range::above(0.0).to(1e7);
    let first = (reader.number("temperature1", celsius), reader.number("resistance1", ohms));
    let beta = reader.optional_number("beta", Range::above(0.0).to(1e5))?;
    let result = if let Some(beta) = beta {
        for key in ["temperature2", "temperature3", "resistance2", "resistance3"] {
            if reader.text(key).is_some() {
                reader.warning(key, "has no effect beside beta; delete one of them");
            }
        }
        SensorCurve::from_beta(Celsius(first.0?), Ohms(first.1?), beta)
    } else {
        let second = (reader.number("temperature2", celsius), reader.number("resistance2", ohms));
        let third = (reader.number("temperature3", celsius), reader.number("resistance3", ohms));
        let mut points = [(first.0?, first.1?), (second.0?, second.1?), (third.0?, third.1?)];
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        SensorCurve::from_points(
            points.map(|(temperature, resistance)| (Celsius(temperature), Ohms(resistance))),
        )
    };
    result.map_err(|error| reader.error("temperature1", error))
}

struct Sensor {
    kind: String,
    pin: PinSpec,
    thermistor: Thermistor,
}

fn sensor(reader: &mut Reader<'_>, custom: &CustomSensors) -> Checked<Sensor> {
    let sensor_type = reader.required_text("sensor_type");
    let pin = reader.pin("sensor_pin", PinUse::Analog);
    let pullup = reader.number_or("pullup_resistor", PULLUP_DEFAULT.0, Range::above(0.0));
    let inline = reader.number_or("inline_resistor", 0.0, Range::from(0.0));
    let sensor_type = sensor_type?;
    let curve = match custom.get(&sensor_type) {
        // A faulty section of its own was reported there.
        Some(sensor) => (*sensor)?,
        None => SensorCurve::named(&sensor_type).ok_or_else(|| {
            let (name, known) = (excerpt(&sensor_type), SensorCurve::names().collect::<Vec<_>>().join(", "));
            let advice = format!("write one of: {known}; or describe it in a [thermistor] section");
            reader.error("sensor_type", format!("`{name}` is not supported; {advice}"))
        })?,
    };
    let thermistor = Thermistor { curve, pullup: Ohms(pullup?), inline: Ohms(inline?) };
    Ok(Sensor { kind: sensor_type, pin: pin?, thermistor })
}

fn control(reader: &mut Reader<'_>) -> Checked<ControlConfig> {
    let gain = Range::from(0.0).to(1e6);
    match reader.required_text("control").as_deref() {
        Ok("watermark") => {
            let max_delta = reader.number_or("max_delta", 2.0, Range::above(0.0).to(50.0));
            reader.without_effect(&["pid_kp", "pid_ki", "pid_kd"], "the heater is controlled by watermark");
            Ok(ControlConfig::Watermark { max_delta: Celsius(max_delta?) })
        }
        Ok("pid") => {
            reader.without_effect(&["max_delta"], "the heater is controlled by PID");
            let kp = reader.number("pid_kp", gain);
            let ki = reader.number("pid_ki", gain);
            let kd = reader.number("pid_kd", gain);
            Ok(ControlConfig::Pid(PidGains { kp: kp?, ki: ki?, kd: kd? }))
        }
        other => {
            // Keeps the options of either from being called unknown on top of the real mistake.
            let _ = ["pid_kp", "pid_ki", "pid_kd", "max_delta"].map(|key| reader.text(key));
            let problem =
                format!("`{}` is unknown; write `pid` or `watermark`", excerpt(other.map_err(|r| *r)?));
            Err(reader.error("control", problem))
        }
    }
}

/// The heater half of a section; the runaway check has a section of its own.
fn heater(
    reader: &mut Reader<'_>,
    custom: &CustomSensors,
    verify: Checked<VerifyHeaterConfig>,
    extrudes: bool,
) -> Checked<HeaterConfig> {
    let heater_pin = reader.pin("heater_pin", PinUse::Output);
    let max_power = reader.number_or("max_power", 1.0, Range::above(0.0).to(1.0));
    let sensor = sensor(reader, custom);
    let control = control(reader);
    let smooth_time = reader.number_or("smooth_time", 1.0, Range::above(0.0).to(60.0));
    let cycle = reader.number_or("pwm_cycle_time", 0.1, Range::above(0.0).to(1.0));
    let min = reader.number("min_temp", Range::from(ABSOLUTE_ZERO).to(TEMPERATURE_MAX));
    let max = reader.number("max_temp", Range::above(0.0).to(TEMPERATURE_MAX));
    let min_extrude = if extrudes { min_extrude_temp(reader, min, max) } else { Ok(ABSOLUTE_ZERO) };
    let standby = standby_temp(reader, min, max, extrudes);
    let (min, max) = (min?, max?);
    if max <= min {
        return Err(reader.error("max_temp", format!("{max} must be above min_temp, which is {min}")));
    }
    let sensor = sensor?;
    Ok(HeaterConfig {
        name: reader.name().to_owned(),
        heater_pin: heater_pin?,
        max_power: max_power?,
        sensor_type: sensor.kind,
        sensor_pin: sensor.pin,
        thermistor: sensor.thermistor,
        control: control?,
        min_temp: Celsius(min),
        max_temp: Celsius(max),
        min_extrude_temp: Celsius(min_extrude?),
        smooth_time: Seconds(smooth_time?),
        pwm_cycle_time: Seconds(cycle?),
        standby_temp: Celsius(standby?),
        verify: verify?,
    })
}

fn min_extrude_temp(reader: &mut Reader<'_>, min: Checked<f64>, max: Checked<f64>) -> Checked<f64> {
    const DEFAULT: f64 = 170.0;
    let limit =
        reader.number_or("min_extrude_temp", DEFAULT, Range::from(ABSOLUTE_ZERO).to(TEMPERATURE_MAX))?;
    let (min, max) = (min?, max?);
    if (min..=max).contains(&limit) || max <= min {
        return Ok(limit);
    }
    let problem = format!("{limit} must lie within min_temp and max_temp, {min} to {max}");
    Err(reader.error("min_extrude_temp", problem))
}

/// A nozzle is kept below where filament runs or burns; a bed as it is, so that the part stays on it.
fn standby_temp(
    reader: &mut Reader<'_>,
    min: Checked<f64>,
    max: Checked<f64>,
    extrudes: bool,
) -> Checked<f64> {
    const NOZZLE: f64 = 140.0;
    let (min, max) = (min?, max?);
    let default = if extrudes { NOZZLE.min(max) } else { max };
    let standby = reader.number_or("standby_temp", default, Range::from(0.0).to(TEMPERATURE_MAX))?;
    if standby == 0.0 || (min..=max).contains(&standby) || max <= min {
        return Ok(standby);
    }
    let problem =
        format!("{standby} must be 0, which is off, or lie within min_temp and max_temp, {min} to {max}");
    Err(reader.error("standby_temp", problem))
}

/// `[verify_heater NAME]`, or the defaults for this kind of heater.
fn verify_heater(builder: &mut Builder<'_>, heater: &str) -> Checked<VerifyHeaterConfig> {
    let default = if heater == "heater_bed" { VerifyHeaterConfig::BED } else { VerifyHeaterConfig::EXTRUDER };
    let Some(mut reader) = builder.section(&format!("verify_heater {heater}")) else { return Ok(default) };
    // The upper ends keep the check alive: with larger numbers it would never speak in time.
    let max_error = reader.number_or("max_error", default.max_error_c_s, Range::from(0.0).to(10_000.0));
    let time = reader.number_or("check_gain_time", default.check_gain_time.0, Range::from(1.0).to(600.0));
    let hysteresis = reader.number_or("hysteresis", default.hysteresis.0, Range::from(0.0).to(50.0));
    let gain = reader.number_or("heating_gain", default.heating_gain.0, Range::above(0.0).to(50.0));
    reader.finish();
    Ok(VerifyHeaterConfig {
        max_error_c_s: max_error?,
        check_gain_time: Seconds(time?),
        hysteresis: Celsius(hysteresis?),
        heating_gain: Celsius(gain?),
    })
}

struct FilamentLimits {
    nozzle: f64,
    filament: f64,
    cross_section: f64,
    velocity: Option<f64>,
    accel: Option<f64>,
}

fn filament_limits(reader: &mut Reader<'_>) -> Checked<FilamentLimits> {
    let nozzle = reader.number("nozzle_diameter", Range::above(0.0).to(10.0));
    let filament = reader.number("filament_diameter", Range::above(0.0).to(20.0));
    let cross_section = reader.optional_number("max_extrude_cross_section", Range::above(0.0).to(10_000.0));
    let velocity = reader.optional_number("max_extrude_only_velocity", Range::above(0.0).to(10_000.0));
    let accel = reader.optional_number("max_extrude_only_accel", Range::above(0.0).to(1_000_000.0));
    let (nozzle, filament) = (nozzle?, filament?);
    if filament < nozzle {
        return Err(reader.error(
            "filament_diameter",
            format!("{filament} must not be below nozzle_diameter, which is {nozzle}"),
        ));
    }
    let cross_section = cross_section?.unwrap_or(4.0 * nozzle * nozzle);
    Ok(FilamentLimits { nozzle, filament, cross_section, velocity: velocity?, accel: accel? })
}

pub(super) fn extruder(
    builder: &mut Builder<'_>,
    custom: &CustomSensors,
    limits: Checked<(MmPerS, MmPerS2)>,
) -> Checked<Option<ExtruderConfig>> {
    let Some(section) = builder.document.take("extruder") else { return Ok(None) };
    let verify = verify_heater(builder, "extruder");
    let mut reader = builder.reader(section);
    let motor = motor(&mut reader);
    let heater = heater(&mut reader, custom, verify, true);
    let filament = filament_limits(&mut reader);
    let corner = reader.number_or("instantaneous_corner_velocity", 1.0, Range::from(0.0).to(1_000.0));
    let distance = reader.number_or("max_extrude_only_distance", 50.0, Range::from(0.0).to(100_000.0));
    let advance = super::dynamics::advance(&mut reader);
    let smooth = reader.number_or("pressure_advance_smooth_time", 0.040, Range::from(0.0).to(0.2));
    reader.finish();
    let (filament, (max_velocity, max_accel)) = (filament?, limits?);
    // Filament may always go as fast as it must for the widest usual extrusion at full speed.
    let usual_ratio = 4.0 * filament.nozzle * filament.nozzle / circle_area(filament.filament);
    Ok(Some(ExtruderConfig {
        motor: motor?,
        heater: heater?,
        nozzle_diameter: Mm(filament.nozzle),
        filament_diameter: Mm(filament.filament),
        max_extrude_cross_section: filament.cross_section,
        instantaneous_corner_velocity: MmPerS(corner?),
        max_extrude_only_distance: Mm(distance?),
        max_extrude_only_velocity: MmPerS(filament.velocity.unwrap_or(max_velocity.0 * usual_ratio)),
        max_extrude_only_accel: MmPerS2(filament.accel.unwrap_or(max_accel.0 * usual_ratio)),
        advance: advance?,
        pressure_advance_smooth_time: Seconds(smooth?),
    }))
}

pub(super) fn heater_bed(builder: &mut Builder<'_>, custom: &CustomSensors) -> Checked<Option<HeaterConfig>> {
    let Some(section) = builder.document.take("heater_bed") else { return Ok(None) };
    let verify = verify_heater(builder, "heater_bed");
    let mut reader = builder.reader(section);
    let heater = heater(&mut reader, custom, verify, false);
    reader.finish();
    Ok(Some(heater?))
}

pub(super) fn fan(builder: &mut Builder<'_>) -> Checked<Option<FanConfig>> {
    let Some(mut reader) = builder.section("fan") else { return Ok(None) };
    let pin = reader.pin("pin", PinUse::Output);
    let max_power = reader.number_or("max_power", 1.0, Range::above(0.0).to(1.0));
    let shutdown_speed = reader.number_or("shutdown_speed", 0.0, Range::from(0.0).to(1.0));
    let cycle_time = reader.number_or("cycle_time", 0.010, Range::above(0.0).to(1.0));
    let hardware_pwm = reader.boolean_or("hardware_pwm", false);
    let kick_start_time = reader.number_or("kick_start_time", 0.1, Range::from(0.0).to(10.0));
    let off_below = reader.number_or("off_below", 0.0, Range::from(0.0).to(1.0));
    reader.not_supported(&["enable_pin"], "the fan is driven by its `pin` alone");
    let why = "the fan's turns are not measured yet";
    reader.without_effect(&["tachometer_pin", "tachometer_ppr", "tachometer_poll_interval"], why);
    reader.finish();
    Ok(Some(FanConfig {
        pin: pin?,
        max_power: max_power?,
        shutdown_speed: shutdown_speed?,
        cycle_time: Seconds(cycle_time?),
        hardware_pwm: hardware_pwm?,
        kick_start_time: Seconds(kick_start_time?),
        off_below: off_below?,
    }))
}
