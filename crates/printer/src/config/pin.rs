//! Pins as a printer.cfg writes them: `gpio2`, `!gpio4` (inverted), `^gpio5` (pull-up), `~gpio5` (pull-down),
//! `mcu:PA1`. Whether the board has a pin of that name is its dictionary's to say.

/// The resistor inside the board that holds an unconnected input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pull {
    /// None: the wiring alone sets the level.
    #[default]
    None,
    /// To the supply (`^`).
    Up,
    /// To ground (`~`).
    Down,
}

/// One pin with what the file says about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PinSpec {
    /// Its name in the board's `pin` enumeration.
    pub name: String,
    /// Low means on.
    pub inverted: bool,
    /// Only inputs may have one.
    pub pull: Pull,
    /// Line of the printer.cfg, for messages about this pin.
    pub line: u32,
}

/// What a pin is used for, which decides what may be written before its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PinUse {
    /// `!` only.
    Output,
    /// `!`, `^`, `~`.
    Input,
    /// Nothing.
    Analog,
}

/// Longest name of a pin; on the wire it is an entry of an enumeration, so longer ones exist on no board.
const PIN_NAME_BYTES_MAX: usize = 40;

impl PinSpec {
    /// Reads a pin; the error says what to write instead.
    pub(super) fn parse(text: &str, line: u32, usage: PinUse) -> Result<Self, String> {
        let mut rest = text.trim();
        let mut pull = Pull::None;
        let mut inverted = false;
        if usage != PinUse::Analog {
            if let Some(after) = rest.strip_prefix('^') {
                (pull, rest) = (Pull::Up, after.trim_start());
            } else if let Some(after) = rest.strip_prefix('~') {
                (pull, rest) = (Pull::Down, after.trim_start());
            }
            if let Some(after) = rest.strip_prefix('!') {
                (inverted, rest) = (true, after.trim_start());
            }
        }
        if pull != Pull::None && usage == PinUse::Output {
            return Err("an output has no pull-up or pull-down: leave `^` or `~` away".to_owned());
        }
        if let Some((chip, pin)) = rest.split_once(':') {
            if chip.trim() != "mcu" {
                return Err(
                    "only pins of the main board are supported so far: write the pin's bare name".to_owned()
                );
            }
            rest = pin.trim_start();
        }
        if rest.is_empty() {
            return Err(
                "the pin's name is missing: write it as the board names it, e.g. gpio5 or PA1".to_owned()
            );
        }
        if rest.len() > PIN_NAME_BYTES_MAX
            || !rest.chars().all(|c| c.is_ascii_alphanumeric() || "_.-".contains(c))
        {
            return Err(match usage {
                PinUse::Analog => {
                    "write a bare pin name, e.g. gpio26: a sensor's pin takes no `!`, `^` or `~`"
                }
                PinUse::Output => "write a pin name, e.g. gpio5, or !gpio5 where low means on",
                PinUse::Input => {
                    "write a pin name, e.g. gpio5, ^gpio5 with a pull-up, ^!gpio5 where low means closed"
                }
            }
            .to_owned());
        }
        Ok(Self { name: rest.to_owned(), inverted, pull, line })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_read_in_klippers_order() {
        let pin = PinSpec::parse("^!gpio5", 7, PinUse::Input).unwrap();
        assert_eq!(pin, PinSpec { name: "gpio5".to_owned(), inverted: true, pull: Pull::Up, line: 7 });
        let pin = PinSpec::parse(" ~ mcu:PA1 ", 7, PinUse::Input).unwrap();
        assert_eq!(pin, PinSpec { name: "PA1".to_owned(), inverted: false, pull: Pull::Down, line: 7 });
        assert!(PinSpec::parse("!P1.23", 1, PinUse::Output).unwrap().inverted);
    }

    #[test]
    fn what_a_use_cannot_have_is_refused() {
        for (text, usage) in [
            ("^gpio1", PinUse::Output),
            ("^gpio1", PinUse::Analog),
            ("!gpio1", PinUse::Analog),
            ("", PinUse::Input),
            ("^!", PinUse::Input),
            ("!^gpio1", PinUse::Input),
            ("probe:z_virtual_endstop", PinUse::Input),
            ("gpio 1", PinUse::Output),
            ("gpiö1", PinUse::Output),
        ] {
            assert!(PinSpec::parse(text, 1, usage).is_err(), "{text}");
        }
    }
}
