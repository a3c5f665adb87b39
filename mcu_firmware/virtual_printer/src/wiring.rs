//! From a machine's description to the parts at work: names become numbers, and what cannot be is refused.

use crate::board::{Axis, EndstopWiring, FanWiring, HeaterWiring, Role, SimulatedBoard, Sits};
use crate::heater::{DutyMeter, FanState, HeaterState};
use crate::machine::{
    ENDSTOPS_MAX, Endstop, Fan, Filament, Heater, MOTORS_MAX, Machine, Motor, Wire, WiringError,
};
use crate::motor::{MotorState, Stops, TIME_STEP_US};
use crate::random::{Random, Source};
use crate::recorder::Recorder;
use crate::switch::Switch;
use units::Mm;

/// Most heaters, and most fans.
const OUTPUTS_MAX: usize = 32;
/// How much further out a switch opens than it closes.
const SWITCH_DIFFERENTIAL: Mm = Mm(0.02);

/// Wires a machine to a board.
pub(crate) fn wire<R: Recorder>(
    board: &mut SimulatedBoard<R>,
    machine: &Machine,
    seed: u64,
) -> Result<(), WiringError> {
    for (what, count, count_max) in [
        ("motors", machine.motors.len(), MOTORS_MAX),
        ("endstops", machine.endstops.len(), ENDSTOPS_MAX),
        ("heaters", machine.heaters.len(), OUTPUTS_MAX),
        ("fans", machine.fans.len(), OUTPUTS_MAX),
    ] {
        if count > count_max {
            return Err(WiringError::TooMany { what });
        }
    }
    for motor in &machine.motors {
        wire_motor(board, motor, machine.time_step_us.clamp(1, TIME_STEP_US))?;
    }
    if !machine.gantry.is_sound() {
        return Err(WiringError::Unsound { part: "gantry".to_owned() });
    }
    board.gantry = machine.gantry;
    for fan in &machine.fans {
        wire_fan(board, fan)?;
    }
    for heater in &machine.heaters {
        wire_heater(board, heater)?;
    }
    for endstop in &machine.endstops {
        wire_endstop(board, endstop, seed)?;
    }
    Ok(())
}

fn pin_number<R: Recorder>(board: &SimulatedBoard<R>, part: &str, pin: &str) -> Result<u8, WiringError> {
    let unknown = || WiringError::UnknownPin { part: part.to_owned(), pin: pin.to_owned() };
    board.profile.pin(pin).ok_or_else(unknown)
}

fn claim<R: Recorder>(
    board: &mut SimulatedBoard<R>,
    part: &str,
    pin: &str,
    role: Role,
) -> Result<(), WiringError> {
    let number = pin_number(board, part, pin)?;
    let slot = &mut board.roles[usize::from(number)];
    *slot = match (*slot, role) {
        (Role::Nothing, role) => role,
        // Several drivers may share one enable pin.
        (Role::Enable(others), Role::Enable(own)) => Role::Enable(others | own),
        _ => return Err(WiringError::PinTaken { part: part.to_owned(), pin: pin.to_owned() }),
    };
    Ok(())
}

fn claim_wire<R: Recorder>(
    board: &mut SimulatedBoard<R>,
    part: &str,
    wire: &Wire,
    role: Role,
) -> Result<(), WiringError> {
    claim(board, part, &wire.pin, role)
}

fn wire_motor<R: Recorder>(
    board: &mut SimulatedBoard<R>,
    motor: &Motor,
    time_step_us: u32,
) -> Result<(), WiringError> {
    let index = board.axes.len() as u8;
    let step_mm = motor.step_distance.0;
    let frame_is_sound = motor.frame.is_none_or(|(min, max)| min <= motor.start && motor.start <= max);
    let length_is_sound =
        step_mm.is_finite() && step_mm > 0.0 && motor.start.0.is_finite() && motor.sag.0.is_finite();
    if !(motor.mechanics.is_sound() && length_is_sound && frame_is_sound) {
        return Err(WiringError::Unsound { part: motor.name.clone() });
    }
    claim_wire(board, &motor.name, &motor.step, Role::Step(index))?;
    claim_wire(board, &motor.name, &motor.dir, Role::Dir(index))?;
    if let Some(enable) = &motor.enable {
        claim_wire(board, &motor.name, enable, Role::Enable(1 << index))?;
    }
    let steps = |to: Mm| (to - motor.start).0 / step_mm;
    let stops = motor.frame.map_or(Stops::NONE, |(min, max)| Stops { min: steps(min), max: steps(max) });
    let mut state =
        MotorState::new(&motor.mechanics, board.profile.clock.0, board.clock, time_step_us, stops);
    state.energise(board.clock, motor.enable.is_none());
    board.axes.push(Axis {
        name: motor.name.clone(),
        motor: state,
        step_inverted: motor.step.inverted,
        dir_inverted: motor.dir.inverted,
        enable_inverted: motor.enable.as_ref().map(|enable| enable.inverted),
        step_active: false,
        // Low, as pins are before they are driven.
        forward: motor.dir.inverted,
        pulses: 0,
        step_mm,
        start_mm: motor.start.0,
        sag: motor.sag.0 / step_mm,
    });
    Ok(())
}

fn wire_fan<R: Recorder>(board: &mut SimulatedBoard<R>, fan: &Fan) -> Result<(), WiringError> {
    let index = board.fans.len() as u8;
    claim_wire(board, &fan.name, &fan.wire, Role::Fan(index))?;
    board.fans.push(FanWiring {
        name: fan.name.clone(),
        inverted: fan.wire.inverted,
        meter: DutyMeter::new(board.clock),
        state: FanState::default(),
    });
    Ok(())
}

fn wire_heater<R: Recorder>(board: &mut SimulatedBoard<R>, heater: &Heater) -> Result<(), WiringError> {
    let index = board.heaters.len() as u8;
    let noise = heater.sensor.noise_counts;
    let sensor_is_sound = noise.is_finite() && noise >= 0.0 && heater.sensor.pull_up.0 > 0.0;
    if !(heater.plant.is_sound() && sensor_is_sound) {
        return Err(WiringError::Unsound { part: heater.name.clone() });
    }
    let missing = |wants| WiringError::NoSuchPart { part: heater.name.clone(), wants };
    if heater.fan.is_some_and(|fan| fan >= board.fans.len()) {
        return Err(missing("fan"));
    }
    let mut mm3_per_step = 0.0;
    if let Some(Filament { motor, diameter }) = heater.filament {
        let axis = board.axes.get(motor).ok_or_else(|| missing("motor"))?;
        if !(diameter.0.is_finite() && diameter.0 > 0.0) {
            return Err(WiringError::Unsound { part: heater.name.clone() });
        }
        let radius = diameter.0 / 2.0;
        mm3_per_step = axis.step_mm * core::f64::consts::PI * radius * radius;
    }
    claim_wire(board, &heater.name, &heater.wire, Role::Heater(index))?;
    let sensor_pin = pin_number(board, &heater.name, &heater.sensor_pin)?;
    if !board.profile.analog_pins.contains(&sensor_pin) {
        return Err(WiringError::NotAnalog { part: heater.name.clone(), pin: heater.sensor_pin.clone() });
    }
    claim(board, &heater.name, &heater.sensor_pin, Role::Sensor(index))?;
    board.heaters.push(HeaterWiring {
        name: heater.name.clone(),
        inverted: heater.wire.inverted,
        meter: DutyMeter::new(board.clock),
        state: HeaterState::new(heater.plant.clone()),
        sensor: heater.sensor.clone(),
        fan: heater.fan,
        filament: heater.filament,
        mm3_per_step,
        rotor: 0.0,
        stuck: None,
        reads: None,
    });
    Ok(())
}

fn wire_endstop<R: Recorder>(
    board: &mut SimulatedBoard<R>,
    endstop: &Endstop,
    seed: u64,
) -> Result<(), WiringError> {
    let index = board.endstops.len() as u8;
    claim_wire(board, &endstop.name, &endstop.wire, Role::Endstop(index))?;
    let clock_hz = board.profile.clock.0;
    let missing = || WiringError::NoSuchPart { part: endstop.name.clone(), wants: "motor" };
    if endstop.motor >= board.axes.len() {
        return Err(missing());
    }
    if !endstop.position.0.is_finite() {
        return Err(WiringError::Unsound { part: endstop.name.clone() });
    }
    let random = Random::new(seed, Source::Bounce(index));
    let sits = if board.gantry.is_coupled() {
        let motors = board.axes.get(..3).ok_or_else(missing)?;
        let head = board.gantry.head([motors[0].start_mm, motors[1].start_mm, motors[2].start_mm]);
        let at = *head.get(endstop.motor).ok_or_else(missing)?;
        let (closes, differential) = (endstop.position.0, SWITCH_DIFFERENTIAL.0);
        let switch = Switch::new(endstop.side, closes, differential, clock_hz, at, random);
        Sits::Carriage { axis: endstop.motor, switch, at, clock: board.clock }
    } else {
        let axis = &mut board.axes[endstop.motor];
        let closes = (endstop.position.0 - axis.start_mm) / axis.step_mm;
        let differential = SWITCH_DIFFERENTIAL.0 / axis.step_mm;
        let switch = axis.motor.switches.len();
        let rotor = axis.motor.rotor();
        axis.motor.switches.push(Switch::new(endstop.side, closes, differential, clock_hz, rotor, random));
        Sits::Motor(endstop.motor, switch)
    };
    board.endstops.push(EndstopWiring {
        name: endstop.name.clone(),
        sits,
        inverted: endstop.wire.inverted,
        stuck: None,
    });
    Ok(())
}
