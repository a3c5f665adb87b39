//! What a machine file says.

use printer::{
    config::{ConfigDiagnostic, Kinematics, PrinterConfig, Severity},
    transform::SavedMesh,
};
use serde::Serialize;

use super::HeaterName;

/// What was found in a `printer.cfg`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct ConfigReport {
    /// Remarks by line.
    pub findings: Vec<ConfigFinding>,
    /// The machine; `null` where the file has errors.
    pub machine: Option<MachineSummary>,
}

/// How much a remark matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum ConfigSeverity {
    /// Without effect here, and nothing is lost by it.
    Info,
    /// The machine works, but not in every way the file asks for.
    Warning,
    /// The machine cannot be run from this file.
    Error,
}

/// One remark.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct ConfigFinding {
    /// Counted from 1; 0 where something is missing that no line stands for.
    pub line: u32,
    /// How much it matters.
    pub severity: ConfigSeverity,
    /// What is wrong and what to write instead.
    pub message: String,
}

/// What the page has to know of a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct MachineSummary {
    /// The lowest X, Y, Z allowed.
    pub min_mm: [f64; 3],
    /// The highest X, Y, Z allowed.
    pub max_mm: [f64; 3],
    /// How far the head reaches from the middle where the bed is round; `null` where it is not.
    pub bed_radius_mm: Option<f64>,
    /// Where each axis finds its endstop.
    pub endstop_mm: [f64; 3],
    /// The fastest move.
    pub max_velocity_mm_s: f64,
    /// The fastest move of Z.
    pub max_z_velocity_mm_s: f64,
    /// The strongest acceleration.
    pub max_accel_mm_s2: f64,
    /// The fastest move of filament alone.
    pub max_extrude_velocity_mm_s: Option<f64>,
    /// The longest push of filament in one move.
    pub max_extrude_mm: Option<f64>,
    /// The nozzle's bore.
    pub nozzle_mm: Option<f64>,
    /// The filament's diameter.
    pub filament_mm: Option<f64>,
    /// Heaters.
    pub heaters: Vec<HeaterSummary>,
    /// Bed meshes that a print may load.
    pub meshes: Vec<MeshSummary>,
    /// Whether there is a part fan.
    pub has_fan: bool,
    /// Rate of a real serial line, bits per second.
    pub baud: u32,
}

/// A bed's shape that the machine file has, as a grid of heights.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct MeshSummary {
    /// What `BED_MESH_PROFILE LOAD=` calls it.
    pub name: String,
    /// X and Y of the first point.
    pub min_mm: [f64; 2],
    /// From point to point along X and along Y.
    pub step_mm: [f64; 2],
    /// Row by row, the lowest Y first.
    pub heights_mm: Vec<Vec<f64>>,
}

/// A heater.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct HeaterSummary {
    /// Which one.
    pub name: HeaterName,
    /// The highest target.
    pub max_c: f64,
    /// Filament may be pushed from here on; `null` for beds.
    pub min_extrude_c: Option<f64>,
}

impl ConfigReport {
    /// Reads the text of a machine file.
    pub fn of(printer_cfg: &str) -> Self {
        let (config, diagnostics) = printer::config::parse(printer_cfg);
        Self {
            findings: diagnostics.into_iter().map(ConfigFinding::from).collect(),
            machine: config.as_ref().map(MachineSummary::of),
        }
    }
}

impl From<ConfigDiagnostic> for ConfigFinding {
    fn from(diagnostic: ConfigDiagnostic) -> Self {
        let severity = match diagnostic.severity {
            Severity::Info => ConfigSeverity::Info,
            Severity::Warning => ConfigSeverity::Warning,
            Severity::Error => ConfigSeverity::Error,
        };
        Self { line: diagnostic.line, severity, message: diagnostic.message }
    }
}

impl MachineSummary {
    /// The page's view of a machine.
    pub fn of(config: &PrinterConfig) -> Self {
        let extruder = config.extruder.as_ref();
        let nozzle = extruder.map(|extruder| HeaterSummary {
            name: HeaterName::Extruder,
            max_c: extruder.heater.max_temp.0,
            min_extrude_c: Some(extruder.heater.min_extrude_temp.0),
        });
        let bed = config.heater_bed.as_ref().map(|bed| HeaterSummary {
            name: HeaterName::HeaterBed,
            max_c: bed.max_temp.0,
            min_extrude_c: None,
        });
        Self {
            min_mm: config.steppers.each_ref().map(|axis| axis.position_min.0),
            max_mm: config.steppers.each_ref().map(|axis| axis.position_max.0),
            bed_radius_mm: match &config.printer.kinematics {
                Kinematics::Delta(delta) => Some(delta.print_radius.0),
                _ => None,
            },
            endstop_mm: config.steppers.each_ref().map(|axis| axis.position_endstop.0),
            max_velocity_mm_s: config.printer.max_velocity.0,
            max_z_velocity_mm_s: config.printer.max_z_velocity.0,
            max_accel_mm_s2: config.printer.max_accel.0,
            max_extrude_velocity_mm_s: extruder.map(|extruder| extruder.max_extrude_only_velocity.0),
            max_extrude_mm: extruder.map(|extruder| extruder.max_extrude_only_distance.0),
            nozzle_mm: extruder.map(|extruder| extruder.nozzle_diameter.0),
            filament_mm: extruder.map(|extruder| extruder.filament_diameter.0),
            heaters: nozzle.into_iter().chain(bed).collect(),
            meshes: config.profiles.meshes.values().map(MeshSummary::of).collect(),
            has_fan: config.fan.is_some(),
            baud: config.mcu.baud,
        }
    }
}

impl MeshSummary {
    fn of(mesh: &SavedMesh) -> Self {
        let axes = mesh.axes();
        Self {
            name: mesh.name().to_owned(),
            min_mm: axes.map(|axis| axis.min),
            step_mm: axes.map(|axis| axis.pitch()),
            heights_mm: mesh.rows().map(<[f64]>::to_vec).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_machine_is_summed_up() {
        let report = ConfigReport::of(demo_machine::USUAL_MACHINE);
        assert!(report.findings.iter().all(|finding| finding.severity != ConfigSeverity::Error));
        let machine = report.machine.unwrap();
        assert_eq!(machine.heaters.len(), 2);
        assert!(machine.has_fan);
        for axis in 0..3 {
            assert!(machine.min_mm[axis] < machine.max_mm[axis]);
        }
    }

    #[test]
    fn errors_have_their_line_and_leave_no_machine() {
        let report = ConfigReport::of("[printer]\nkinematics: cartesian\nmax_velocity: fast\n");
        assert_eq!(report.machine, None);
        let error = |finding: &&ConfigFinding| finding.severity == ConfigSeverity::Error && finding.line == 3;
        assert!(report.findings.iter().any(|finding| error(&finding)), "{report:?}");
    }

    #[test]
    fn bed_meshes_are_handed_out_as_they_are_measured() {
        let mesh = "\n[bed_mesh cold]\npoints:\n  0.1, 0.2, 0.3\n  0.4, 0.5, 0.6\n  0.7, 0.8, 0.9\nx_count: 3\ny_count: 3\n\
                    min_x: 20\nmax_x: 120\nmin_y: 30\nmax_y: 230\n";
        let report = ConfigReport::of(&format!("{}{mesh}", demo_machine::USUAL_MACHINE));
        let machine = report.machine.unwrap();
        let [mesh] = &machine.meshes[..] else { panic!("{machine:?}") };
        assert_eq!(mesh.name, "cold");
        assert_eq!((mesh.min_mm, mesh.step_mm), ([20.0, 30.0], [50.0, 100.0]));
        assert_eq!(mesh.heights_mm, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]);
    }
}
