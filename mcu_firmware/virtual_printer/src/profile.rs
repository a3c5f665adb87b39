//! Boards: their clocks, pins, memory and links.
//!
//! Does not know what is wired to the pins.
//! Source: the RP2040 and STM32F103 data sheets; clocks as Klipper's firmware runs its timers there.

use units::{Hertz, Seconds, Ticks};
use wire::dictionary::{Constant, Description};

/// Seconds from power-up to the first wrap of the 32-bit clock: every session meets it, and early.
const WRAP_AFTER_S: u64 = 20;

/// A board.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardProfile {
    /// The name by which users choose it.
    pub name: &'static str,
    /// The chip, as the dictionary's `MCU`.
    pub mcu: &'static str,
    /// The clock.
    pub clock: Hertz,
    /// How many moves its memory holds, at most [`MOVES_MAX`].
    pub move_count: u16,
    /// Rows of pin names that count upwards: first name, its number, how many.
    pub pins: &'static [(&'static str, u8, u8)],
    /// The numbers of the pins with a converter.
    pub analog_pins: &'static [u8],
    /// The way to the host.
    pub link: LinkProfile,
    /// The clock at power-up.
    pub clock_at_start: Ticks,
    /// What a restart of the firmware takes; a USB board is gone from the bus in the meantime.
    pub restart: Seconds,
    /// Whether the firmware has our motion clock.
    pub motion_clock: bool,
    /// Whether the firmware regulates heaters.
    pub board_heaters: bool,
    /// Whether the firmware knows the block check. Without all three the board is as one with plain Klipper firmware.
    pub block_check: bool,
}

/// Most moves that any board's queue holds.
pub const MOVES_MAX: usize = 8000;

/// How bytes travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LinkProfile {
    /// USB full speed: fast, with a frame's latency.
    Usb,
    /// A UART behind a USB bridge.
    Uart {
        /// Bits a second; 10 bits a byte.
        baud: u32,
        /// Unacknowledged bytes that the board has room for.
        receive_window: u16,
    },
}

impl LinkProfile {
    /// Bytes a second, each way.
    pub fn bytes_per_s(self) -> f64 {
        match self {
            Self::Usb => 500_000.0,
            Self::Uart { baud, .. } => f64::from(baud.max(1)) / 10.0,
        }
    }
}

impl BoardProfile {
    /// Boards by the names that users give; with `-plain` behind it, as it is with plain Klipper firmware.
    pub fn named(name: &str) -> Option<Self> {
        let (name, is_plain) = name.strip_suffix("-plain").map_or((name, false), |name| (name, true));
        let profile = Self::all().into_iter().find(|profile| profile.name == name)?;
        Some(if is_plain { profile.plain() } else { profile })
    }

    /// The same board with plain Klipper firmware: without our extensions.
    #[must_use]
    pub fn plain(self) -> Self {
        Self { motion_clock: false, board_heaters: false, block_check: false, ..self }
    }

    /// Every board.
    pub fn all() -> [Self; 2] {
        [Self::rp2040(), Self::stm32f103()]
    }

    /// A Raspberry Pi RP2040 on USB.
    pub fn rp2040() -> Self {
        let clock = Hertz(12_000_000);
        Self {
            name: "rp2040",
            mcu: "rp2040",
            clock,
            move_count: 8000,
            pins: &[("gpio0", 0, 30)],
            analog_pins: &[26, 27, 28, 29],
            link: LinkProfile::Usb,
            clock_at_start: before_the_wrap(clock),
            restart: Seconds(0.5),
            motion_clock: true,
            board_heaters: true,
            block_check: true,
        }
    }

    /// An STM32F103 on a UART.
    pub fn stm32f103() -> Self {
        let clock = Hertz(72_000_000);
        Self {
            name: "stm32f103",
            mcu: "stm32f103xe",
            clock,
            move_count: 700,
            pins: &[("PA0", 0, 16), ("PB0", 16, 16), ("PC0", 32, 16), ("PD0", 48, 16)],
            analog_pins: &[0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 32, 33, 34, 35, 36, 37],
            link: LinkProfile::Uart { baud: 250_000, receive_window: 192 },
            clock_at_start: before_the_wrap(clock),
            restart: Seconds(0.1),
            motion_clock: true,
            board_heaters: true,
            block_check: true,
        }
    }

    /// The number of a pin by its name.
    pub fn pin(&self, name: &str) -> Option<u8> {
        let digits = name.find(|c: char| c.is_ascii_digit())?;
        let (stem, number) = name.split_at(digits);
        let number: u8 = number.parse().ok()?;
        self.pins.iter().find_map(|&(first, value, count)| {
            (first.strip_suffix('0') == Some(stem) && number < count).then_some(value + number)
        })
    }

    /// Whether a pin with this number exists.
    pub fn has_pin(&self, pin: u8) -> bool {
        self.pins.iter().any(|&(_, first, count)| (first..first + count).contains(&pin))
    }

    /// What the board says of itself.
    pub fn description(&self) -> Description {
        let number = |name: &str, value: f64| (name.to_owned(), Constant::Number(value));
        let mut constants = vec![
            ("MCU".to_owned(), Constant::Text(self.mcu.to_owned())),
            number("CLOCK_FREQ", f64::from(self.clock.0)),
            number("ADC_MAX", f64::from(crate::thermistor::ADC_MAX)),
            number("STATS_SUMSQ_BASE", f64::from(firmware_core::STATS_SUMSQ_BASE)),
            number("PWM_MAX", 255.0),
        ];
        if let LinkProfile::Uart { baud, receive_window } = self.link {
            constants.push(number("SERIAL_BAUD", f64::from(baud)));
            constants.push(number("RECEIVE_WINDOW", f64::from(receive_window)));
        }
        Description {
            version: format!("stepcast-virtual-{}", env!("CARGO_PKG_VERSION")),
            build_versions: "virtual".to_owned(),
            constants,
            pins: self.pins.iter().map(|&(name, first, count)| (name.to_owned(), first, count)).collect(),
            motion_clock: self.motion_clock,
            board_heaters: self.board_heaters,
            block_check: self.block_check,
        }
    }
}

fn before_the_wrap(clock: Hertz) -> Ticks {
    Ticks((1 << 32) - WRAP_AFTER_S * u64::from(clock.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use wire::dictionary::Dictionary;

    #[test]
    fn pins_have_the_numbers_that_the_dictionary_gives() {
        for profile in BoardProfile::all() {
            let dictionary = Dictionary::parse(&profile.description().compressed()).expect("a dictionary");
            for name in ["gpio0", "gpio29", "PA0", "PB7", "PD15", "gpio30", "PE0", "gpio05", "x", "PA"] {
                assert_eq!(profile.pin(name), dictionary.pin(name), "{} {name}", profile.name);
            }
            assert_eq!(dictionary.number("CLOCK_FREQ"), Some(f64::from(profile.clock.0)));
            assert_eq!(dictionary.number("ADC_MAX"), Some(4095.0));
            assert!(profile.analog_pins.iter().all(|&pin| profile.has_pin(pin)));
            assert!(profile.clock_at_start < Ticks(1 << 32));
            assert!(usize::from(profile.move_count) <= MOVES_MAX);
        }
        assert_eq!(BoardProfile::named("stm32f103").map(|profile| profile.move_count), Some(700));
        assert_eq!(BoardProfile::named("nothing"), None);
        assert_eq!(BoardProfile::named("rp2040-plain"), Some(BoardProfile::rp2040().plain()));
    }
}
