//! Which simulated board a `printer.cfg` fits, and how to wire it to another one.
//!
//! A machine file names the pins of one board. Asked for another board, the same machine is wired to free pins of it, so
//! that one file can be simulated with the memory and the link of either.

use printer::{
    config::{PinSpec, PrinterConfig},
    error::{ErrorCode, PrinterError},
};
use virtual_printer::BoardProfile;

/// Every pin that the file names, and whether it is read by a converter.
fn pins(config: &mut PrinterConfig) -> Vec<(&mut PinSpec, bool)> {
    let mut pins = Vec::new();
    let mut motors = Vec::new();
    for stepper in &mut config.steppers {
        pins.push((&mut stepper.endstop_pin, false));
        motors.push(&mut stepper.motor);
    }
    let mut heaters = Vec::new();
    if let Some(extruder) = &mut config.extruder {
        motors.push(&mut extruder.motor);
        heaters.push(&mut extruder.heater);
    }
    heaters.extend(config.heater_bed.as_mut());
    for motor in motors {
        pins.push((&mut motor.step_pin, false));
        pins.push((&mut motor.dir_pin, false));
        pins.extend(motor.enable_pin.as_mut().map(|pin| (pin, false)));
    }
    for heater in heaters {
        pins.push((&mut heater.heater_pin, false));
        pins.push((&mut heater.sensor_pin, true));
    }
    pins.extend(config.fan.as_mut().map(|fan| (&mut fan.pin, false)));
    pins
}

/// The board that was asked for, or else the first that has the file's pins. Where a board was asked for that has none
/// of them, the file's pins are replaced by pins that it has.
pub fn fit(config: &mut PrinterConfig, wanted: Option<&BoardProfile>) -> Result<BoardProfile, PrinterError> {
    let mut named = pins(config);
    let unknown = |board: &BoardProfile, pins: &[(&mut PinSpec, bool)]| {
        pins.iter().filter(|(pin, _)| board.pin(&pin.name).is_none()).count()
    };
    let board =
        wanted.cloned().or_else(|| BoardProfile::all().into_iter().find(|board| unknown(board, &named) == 0));
    let Some(board) = board else {
        let rp2040 = BoardProfile::rp2040();
        return Err(missing(&rp2040, &named));
    };
    match unknown(&board, &named) {
        0 => Ok(board),
        all if wanted.is_some() && all == named.len() => {
            rewire(&board, &mut named)?;
            Ok(board)
        }
        _ => Err(missing(&board, &named)),
    }
}

fn missing(board: &BoardProfile, pins: &[(&mut PinSpec, bool)]) -> PrinterError {
    let pin = pins.iter().find(|(pin, _)| board.pin(&pin.name).is_none());
    let (name, line) = pin.map_or(("", 0), |(pin, _)| (pin.name.as_str(), pin.line));
    PrinterError::new(
        ErrorCode::PinUnknown,
        format!("line {line} of the machine file: the simulated {} has no pin \"{name}\"", board.name),
    )
}

fn rewire(board: &BoardProfile, pins: &mut [(&mut PinSpec, bool)]) -> Result<(), PrinterError> {
    let mut free: Vec<(String, bool)> = Vec::new();
    for &(first, number, count) in board.pins {
        let stem = first.strip_suffix('0').unwrap_or(first);
        free.extend((0..count).map(|at| (format!("{stem}{at}"), board.analog_pins.contains(&(number + at)))));
    }
    for (pin, analog) in pins {
        // Converters are few: they are left for those who need one.
        let Some(found) = free.iter().position(|(_, is_analog)| is_analog == analog) else {
            let detail = format!("the simulated {} has too few pins for this machine", board.name);
            return Err(PrinterError::new(ErrorCode::BoardTooSmall, detail));
        };
        pin.name = free.swap_remove(found).0;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> PrinterConfig {
        printer::config::parse(crate::USUAL_MACHINE).0.unwrap()
    }

    #[test]
    fn the_board_that_has_the_pins_is_found() {
        let mut config = sample();
        let before = config.clone();
        assert_eq!(fit(&mut config, None).unwrap().name, "rp2040");
        assert_eq!(fit(&mut config, Some(&BoardProfile::rp2040())).unwrap().name, "rp2040");
        assert_eq!(config, before);
    }

    #[test]
    fn another_board_gets_the_machine_on_its_own_pins() {
        let mut config = sample();
        let board = fit(&mut config, Some(&BoardProfile::stm32f103())).unwrap();
        let mut names: Vec<_> = pins(&mut config).into_iter().map(|(pin, _)| pin.name.clone()).collect();
        assert!(names.iter().all(|name| board.pin(name).is_some()), "{names:?}");
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
        for (pin, analog) in pins(&mut config) {
            assert_eq!(board.analog_pins.contains(&board.pin(&pin.name).unwrap()), analog, "{}", pin.name);
        }
        assert!(config.steppers[1].motor.dir_pin.inverted);
        assert_eq!(fit(&mut config, None).unwrap().name, "stm32f103");
    }

    #[test]
    fn a_single_wrong_pin_is_an_error_with_its_line() {
        let mut config = sample();
        config.steppers[0].motor.step_pin.name = "PB3".to_owned();
        for wanted in [None, Some(&BoardProfile::rp2040())] {
            let error = fit(&mut config, wanted).unwrap_err();
            assert_eq!(error.code, ErrorCode::PinUnknown);
            assert!(error.detail.contains("\"PB3\""), "{error}");
        }
    }
}
