//! How motors move the head: `[printer] kinematics`, and the sections of the motors that go with it.
//!
//! Which motor is which sum of axes is that of Klipper's public documentation (docs/Config_Reference.md): in CoreXY
//! `[stepper_x]` is X + Y and `[stepper_y]` X − Y, in CoreXZ likewise with Z, in the hybrids `[stepper_x]` is X − Y (X − Z)
//! and the other motor moves its own axis. A delta has `[stepper_a]`, `[stepper_b]` and `[stepper_c]`.

use steps::{Delta, Geometry, Kinematics as _, Linear, Tower};
use units::Mm;

use super::Builder;
use super::diagnostics::{Log, excerpt};
use super::machine::MachineConfig;
use super::pin::PinUse;
use super::reader::{Checked, Range, Reader, Reported};
use super::stepper::{self, HomingSpeeds, StepperConfig};

/// How motors move the head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kinematics {
    /// A motor an axis.
    Cartesian,
    /// X + Y and X − Y.
    CoreXy,
    /// X + Z and X − Z.
    CoreXz,
    /// X − Y and Y.
    HybridCoreXy,
    /// X − Z and Z.
    HybridCoreXz,
    /// Three towers.
    Delta(DeltaConfig),
}

/// A delta's towers and what can be reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeltaConfig {
    /// From the middle to the towers.
    pub delta_radius: Mm,
    /// A, B and C.
    pub towers: [TowerConfig; 3],
    /// How far from the middle the head may go.
    pub print_radius: Mm,
}

/// One tower of a delta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TowerConfig {
    /// Its direction from the middle, in degrees from X towards Y.
    pub angle: f64,
    /// From joint to joint.
    pub arm_length: Mm,
    /// How high above the bed the nozzle is, in the middle, when the carriage is at its endstop.
    pub position_endstop: Mm,
}

impl Kinematics {
    /// Where motors are when the head is somewhere, and the other way round.
    pub fn geometry(&self) -> Geometry {
        let linear = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| {
            let row = |[x, y, z]: [f64; 3]| [x, y, z, 0.0];
            let shares = [row(x), row(y), row(z), [0.0, 0.0, 0.0, 1.0]];
            Linear::new(shares).map_or(Geometry::Cartesian, Geometry::Linear)
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        match self {
            Self::Cartesian => Geometry::Cartesian,
            Self::CoreXy => linear([1.0, 1.0, 0.0], [1.0, -1.0, 0.0], z),
            Self::CoreXz => linear([1.0, 0.0, 1.0], y, [1.0, 0.0, -1.0]),
            Self::HybridCoreXy => linear([1.0, -1.0, 0.0], y, z),
            Self::HybridCoreXz => linear([1.0, 0.0, -1.0], y, z),
            // It has been checked when the file was read.
            Self::Delta(delta) => delta.delta().map_or_else(|| linear(x, y, z), Geometry::Delta),
        }
    }
}

impl DeltaConfig {
    /// Its towers and arms; none where they hold no head.
    pub fn delta(&self) -> Option<Delta> {
        let towers = self.towers.map(|tower| Tower { angle: tower.angle, arm_length: tower.arm_length });
        Delta::new(self.delta_radius, towers)
    }

    /// How high the carriages are at their endstops.
    pub fn endstops(&self) -> [Mm; 3] {
        self.towers.map(|tower| {
            let (arm, radius) = (tower.arm_length.0, self.delta_radius.0);
            tower.position_endstop + Mm(libm::sqrt(arm * arm - radius * radius))
        })
    }

    /// Where the head is then.
    fn home(&self) -> Option<[f64; 3]> {
        let [a, b, c] = self.endstops().map(|at| at.0);
        let [x, y, z, _] = self.delta()?.position(&[a, b, c, 0.0])?;
        // What rounding leaves is no place beside the middle.
        let whole = |at: f64| if at.abs() < 1e-9 { 0.0 } else { at };
        Some([whole(x), whole(y), z])
    }
}

/// The kind of machine that a file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Cartesian,
    CoreXy,
    CoreXz,
    HybridCoreXy,
    HybridCoreXz,
    Delta,
}

impl Kind {
    const NAMES: [(&'static str, Self); 6] = [
        ("cartesian", Self::Cartesian),
        ("corexy", Self::CoreXy),
        ("corexz", Self::CoreXz),
        ("hybrid_corexy", Self::HybridCoreXy),
        ("hybrid_corexz", Self::HybridCoreXz),
        ("delta", Self::Delta),
    ];

    /// Its kinematics; a delta's follow from its towers.
    pub(super) const fn linear(self) -> Kinematics {
        match self {
            Self::Cartesian | Self::Delta => Kinematics::Cartesian,
            Self::CoreXy => Kinematics::CoreXy,
            Self::CoreXz => Kinematics::CoreXz,
            Self::HybridCoreXy => Kinematics::HybridCoreXy,
            Self::HybridCoreXz => Kinematics::HybridCoreXz,
        }
    }

    /// Whether a motor moves one axis, its own.
    pub(super) fn is_alone(self, motor: usize) -> bool {
        let own: [bool; 4] = core::array::from_fn(|axis| axis == motor);
        motor == 3 || self != Self::Delta && self.linear().geometry().axes(motor) == own
    }
}

/// The sections of the motors.
pub(super) const fn motor_names(kind: Option<Kind>) -> [&'static str; 4] {
    match kind {
        Some(Kind::Delta) => ["stepper_a", "stepper_b", "stepper_c", "extruder"],
        _ => ["stepper_x", "stepper_y", "stepper_z", "extruder"],
    }
}

/// What kind of machine it is; none where the file does not say. The sections of kinds that are not known mean other
/// things, so judging them would only add noise.
pub(super) fn kind(builder: &mut Builder<'_>) -> Checked<Option<Kind>> {
    let Some(entry) = builder.document.peek("printer", "kinematics").filter(|it| !it.value.is_empty()) else {
        return Ok(None);
    };
    if let Some(&(_, kind)) = Kind::NAMES.iter().find(|(name, _)| *name == entry.value) {
        return Ok(Some(kind));
    }
    let known = Kind::NAMES.map(|(name, _)| name).join(", ");
    let problem = format!("`{}` is not supported: there are {known}", excerpt(&entry.value));
    builder.log.error(entry.line, format!("[printer] kinematics: {problem}"));
    Err(Reported)
}

/// What `[printer]` says of a delta.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeltaOptions {
    delta_radius: f64,
    delta_radius_line: u32,
    print_radius: Option<f64>,
    print_radius_line: u32,
    minimum_z: f64,
}

const LENGTH_MAX_MM: f64 = 10_000.0;
/// Less room than this above the lowest position is a mistake.
const ROOM_MIN_MM: f64 = 1.0;
/// The head hangs straight below the middle when it is home, or a little beside it where towers are not alike.
const HOME_OFF_MAX_MM: f64 = 10.0;

pub(super) fn delta_options(reader: &mut Reader<'_>) -> Checked<DeltaOptions> {
    let length = Range::above(0.0).to(LENGTH_MAX_MM);
    let delta_radius = reader.number("delta_radius", length);
    let print_radius = reader.optional_number("print_radius", length);
    let minimum_z =
        reader.number_or("minimum_z_position", 0.0, Range::from(-LENGTH_MAX_MM).to(LENGTH_MAX_MM));
    Ok(DeltaOptions {
        delta_radius: delta_radius?,
        delta_radius_line: reader.line_of("delta_radius"),
        print_radius: print_radius?,
        print_radius_line: reader.line_of("print_radius"),
        minimum_z: minimum_z?,
    })
}

/// The motors' sections. What a delta is, is put into `printer`.
pub(super) fn steppers(
    builder: &mut Builder<'_>,
    kind: Option<Kind>,
    printer: &mut Checked<(MachineConfig, Option<DeltaOptions>)>,
) -> [Checked<StepperConfig>; 3] {
    if kind != Some(Kind::Delta) {
        let [x, y, z, _] = motor_names(kind);
        return [x, y, z].map(|name| stepper::axis(builder, name));
    }
    let a = tower(builder, "stepper_a", None);
    let first = a.as_ref().ok().cloned();
    let b = tower(builder, "stepper_b", first.as_ref());
    let c = tower(builder, "stepper_c", first.as_ref());
    let (Ok((config, Some(options))), Ok(a), Ok(b), Ok(c)) = (printer, a, b, c) else {
        return [Err(Reported), Err(Reported), Err(Reported)];
    };
    match delta(builder.log, options, [&a, &b, &c]) {
        Ok((delta, home)) => {
            config.kinematics = Kinematics::Delta(delta);
            let radius = delta.print_radius.0;
            let spans = [[-radius, radius], [-radius, radius], [options.minimum_z, home[2]]];
            let mut axes = home.into_iter().zip(spans);
            [a, b, c].map(|tower| {
                let (home, [min, max]) = axes.next().ok_or(Reported)?;
                Ok(StepperConfig {
                    position_endstop: Mm(home),
                    position_min: Mm(min),
                    position_max: Mm(max),
                    ..tower.stepper
                })
            })
        }
        Err(Reported) => [Err(Reported), Err(Reported), Err(Reported)],
    }
}

/// A tower's section; its stepper's positions are yet to be said.
#[derive(Clone, Debug)]
struct TowerSection {
    stepper: StepperConfig,
    tower: TowerConfig,
    endstop_line: u32,
}

/// Reads a tower's section; what B and C do not say is as in A's.
fn tower(builder: &mut Builder<'_>, name: &str, first: Option<&TowerSection>) -> Checked<TowerSection> {
    let mut reader = builder.required_section(name)?;
    let motor = stepper::motor(&mut reader);
    let endstop_pin = reader.pin("endstop_pin", PinUse::Input);
    let angle_default = match name {
        "stepper_a" => 210.0,
        "stepper_b" => 330.0,
        _ => 90.0,
    };
    let angle = reader.number_or("angle", angle_default, Range::from(-360.0).to(720.0));
    let arms = Range::above(0.0).to(LENGTH_MAX_MM);
    let heights = Range::above(0.0).to(LENGTH_MAX_MM);
    let (arm_length, position_endstop) = match first {
        None if name == "stepper_a" => {
            (reader.number("arm_length", arms), reader.number("position_endstop", heights))
        }
        // What is wrong with the first one has been said.
        first => {
            let [arm, endstop] =
                first.map_or([1.0; 2], |a| [a.tower.arm_length.0, a.tower.position_endstop.0]);
            (
                reader.number_or("arm_length", arm, arms),
                reader.number_or("position_endstop", endstop, heights),
            )
        }
    };
    let speeds = if name == "stepper_a" {
        HomingSpeeds::read(&mut reader)
    } else {
        reader.without_effect(HomingSpeeds::KEYS, "all towers home together, as [stepper_a] says");
        Ok(first.map_or_else(HomingSpeeds::default, |a| HomingSpeeds::of(&a.stepper)))
    };
    let endstop_line = reader.line_of("position_endstop");
    reader.without_effect(
        &["homing_positive_dir", "position_min", "position_max"],
        "a delta homes upwards, and its reach follows from its arms",
    );
    reader.finish();
    let tower =
        TowerConfig { angle: angle?, arm_length: Mm(arm_length?), position_endstop: Mm(position_endstop?) };
    let span = stepper::Span { min: 0.0, max: tower.position_endstop.0, endstop: tower.position_endstop.0 };
    let stepper = speeds?.stepper(name, motor?, endstop_pin?, span, true);
    Ok(TowerSection { stepper, tower, endstop_line })
}

/// A delta and its home, if there is such a machine.
fn delta(
    log: &mut Log,
    options: &DeltaOptions,
    towers: [&TowerSection; 3],
) -> Checked<(DeltaConfig, [f64; 3])> {
    let mut config = DeltaConfig {
        delta_radius: Mm(options.delta_radius),
        towers: towers.map(|section| section.tower),
        print_radius: Mm(options.delta_radius),
    };
    let line = options.delta_radius_line;
    let Some((delta, home)) = config.delta().zip(config.home()) else {
        let problem = "arms of that length cannot hold a head between those towers: arm_length must be more than delta_radius, and the towers stand apart";
        log.error(line, format!("[printer] delta_radius: {problem}"));
        return Err(Reported);
    };
    let reach = delta.reach();
    if reach <= 0.0 {
        let problem = "the arms are too short: even below the middle a carriage would have to go three times as fast as the head";
        log.error(line, format!("[printer] delta_radius: {problem}"));
        return Err(Reported);
    }
    if let Some(wanted) = options.print_radius.filter(|&wanted| wanted > reach) {
        let problem = format!(
            "only {reach:.1} of {wanted} mm can be used: farther out the arms lie so flat that a carriage would have to go \
             more than three times as fast as the head"
        );
        log.warning(options.print_radius_line, format!("[printer] print_radius: {problem}"));
    }
    config.print_radius = Mm(options.print_radius.unwrap_or(options.delta_radius).min(reach));
    let off = libm::hypot(home[0], home[1]);
    if off > HOME_OFF_MAX_MM.min(config.print_radius.0) || home[2] < options.minimum_z + ROOM_MIN_MM {
        let problem = format!(
            "with all carriages at their endstops the nozzle would be at X {:.1} Y {:.1} Z {:.1} mm; correct position_endstop, \
             arm_length or minimum_z_position",
            home[0], home[1], home[2]
        );
        log.error(towers[0].endstop_line, format!("[stepper_a] position_endstop: {problem}"));
        return Err(Reported);
    }
    Ok((config, home))
}
