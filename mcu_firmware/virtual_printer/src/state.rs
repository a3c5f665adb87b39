//! What an onlooker sees of the machine at a moment. The firmware knows none of this, only its pins.

use units::{Celsius, Mm, StepCount, Ticks};
use wire::ShutdownReason;

/// The whole machine at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// The moment.
    pub at: Ticks,
    /// Motors, in the order of the machine's description.
    pub motors: Vec<MotorView>,
    /// Heaters, likewise.
    pub heaters: Vec<HeaterView>,
    /// Fans, likewise.
    pub fans: Vec<FanView>,
    /// Endstops, likewise.
    pub endstops: Vec<EndstopView>,
    /// Why the firmware has stopped everything, if it has.
    pub shutdown: Option<ShutdownReason>,
    /// Bytes that were damaged on the way to the board and to the host.
    pub damaged_bytes: [u64; 2],
}

/// A motor.
#[derive(Clone, Debug, PartialEq)]
pub struct MotorView {
    /// Its name.
    pub name: String,
    /// Forward less backward pulses since power-up.
    pub count: StepCount,
    /// Pulses of both directions since power-up.
    pub pulses: u64,
    /// Where the rotor stands, in microsteps from where it stood at power-up.
    pub rotor: f64,
    /// Microsteps by which the rotor slipped behind its pulses, in whole electrical periods (four full steps); what
    /// came while the driver was off counts as soon as it is a period.
    pub lost: StepCount,
    /// Where the load stands.
    pub position: Mm,
    /// Current is on.
    pub energised: bool,
}

/// A heater.
#[derive(Clone, Debug, PartialEq)]
pub struct HeaterView {
    /// Its name.
    pub name: String,
    /// The body: the nozzle, the bed's plate.
    pub temperature: Celsius,
    /// What the sensor is at.
    pub sensor: Celsius,
    /// Share of the last 10 ms in which the pin was on, or 0 or 1 where a fault decides.
    pub duty: f64,
}

/// A fan.
#[derive(Clone, Debug, PartialEq)]
pub struct FanView {
    /// Its name.
    pub name: String,
    /// Share of the last 10 ms in which the pin was on.
    pub duty: f64,
    /// Its speed, 0 to 1.
    pub speed: f64,
}

/// An endstop.
#[derive(Clone, Debug, PartialEq)]
pub struct EndstopView {
    /// Its name.
    pub name: String,
    /// The contact is closed (as it reads: a fault decides where there is one).
    pub triggered: bool,
    /// Where the carriage stands that presses it.
    pub position: Mm,
}
