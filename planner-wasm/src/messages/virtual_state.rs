//! The virtual printer at a moment, as an onlooker sees it.

use serde::Serialize;
use virtual_printer::State;

/// The whole machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct VirtualState {
    /// Seconds since power-up.
    pub time_s: f64,
    /// Whether the host has a connection.
    pub connected: bool,
    /// X, Y, Z, extruder.
    pub motors: Vec<MotorState>,
    /// Nozzle, bed.
    pub heaters: Vec<HeaterState>,
    /// Fans.
    pub fans: Vec<FanState>,
    /// Limit switches.
    pub endstops: Vec<EndstopState>,
    /// Why the firmware has stopped everything, if it has.
    pub shutdown: Option<String>,
}

/// A motor.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct MotorState {
    /// Its name, as in the machine file.
    pub name: String,
    /// Pulses of both directions since power-up.
    pub pulses: u64,
    /// Forward less backward pulses since power-up.
    pub count: i64,
    /// Steps by which the rotor is behind its pulses.
    pub lost_steps: i64,
    /// Where the load stands.
    pub position_mm: f64,
    /// Current is on.
    pub energised: bool,
}

/// A heater.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct HeaterState {
    /// Its name, as in the machine file.
    pub name: String,
    /// The body's true temperature.
    pub temperature_c: f64,
    /// The share of time that it is on.
    pub duty: f64,
}

/// A fan.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct FanState {
    /// Its name.
    pub name: String,
    /// 0 … 1.
    pub speed: f64,
}

/// A limit switch.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct EndstopState {
    /// Its name.
    pub name: String,
    /// It is pressed.
    pub triggered: bool,
}

impl VirtualState {
    /// What the page is told.
    pub fn of(state: State, time_s: f64, connected: bool) -> Self {
        let motors = state.motors.into_iter().map(|motor| MotorState {
            name: motor.name,
            pulses: motor.pulses,
            count: motor.count.0,
            lost_steps: motor.lost.0,
            position_mm: motor.position.0,
            energised: motor.energised,
        });
        let heaters = state.heaters.into_iter().map(|heater| HeaterState {
            name: heater.name,
            temperature_c: heater.temperature.0,
            duty: heater.duty,
        });
        let endstops = state.endstops.into_iter();
        Self {
            time_s,
            connected,
            motors: motors.collect(),
            heaters: heaters.collect(),
            fans: state.fans.into_iter().map(|fan| FanState { name: fan.name, speed: fan.speed }).collect(),
            endstops: endstops
                .map(|endstop| EndstopState { name: endstop.name, triggered: endstop.triggered })
                .collect(),
            shutdown: state.shutdown.map(|reason| reason.text().to_owned()),
        }
    }
}
