//! What the core asks of a chip. A real board implements it with registers, the virtual printer with a simulation.

use units::Clock32;

/// The number by which the dictionary's `pin` enumeration names a pin.
pub type Pin = u8;

/// The pin does not exist or cannot do what was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinError;

/// The resistor of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pull {
    /// None: the input floats.
    Floating,
    /// To the supply.
    Up,
    /// To ground.
    Down,
}

/// What became of a reading that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalogSample {
    /// The converter's value, 0 to `ADC_MAX`.
    Ready(u16),
    /// The converter is at work or busy with another pin; ask again after so many ticks.
    Pending(u32),
}

/// A chip, or a simulation of one. No method may block.
pub trait Board {
    /// The free-running clock, at the frequency given to [`Firmware::new`](crate::Firmware::new).
    fn now(&mut self) -> Clock32;

    /// Makes a pin an output with this level at once, without a glitch.
    fn configure_output(&mut self, pin: Pin, level: bool) -> Result<(), PinError>;

    /// Makes a pin a digital input.
    fn configure_input(&mut self, pin: Pin, pull: Pull) -> Result<(), PinError>;

    /// Makes a pin an analog input.
    fn configure_analog(&mut self, pin: Pin) -> Result<(), PinError>;

    /// Drives an output. Only called for pins that [`Self::configure_output`] accepted.
    fn set_pin(&mut self, pin: Pin, level: bool);

    /// Reads a digital input. Only called for pins that [`Self::configure_input`] accepted.
    fn read_pin(&mut self, pin: Pin) -> bool;

    /// Starts a reading, or fetches the one that was started. Only called for pins that
    /// [`Self::configure_analog`] accepted.
    fn sample_analog(&mut self, pin: Pin) -> AnalogSample;

    /// A reading that was started will not be fetched.
    fn cancel_analog(&mut self, pin: Pin) {
        let _ = pin;
    }

    /// Hands a whole block to the host, all or nothing: `false` when there is no room now. Replies and reports are
    /// then dropped (hosts ask again); acknowledgements, `starting` and `shutdown` are tried again in
    /// [`Firmware::run_tasks`](crate::Firmware::run_tasks).
    fn transmit(&mut self, block: &[u8]) -> bool;

    /// The compressed data dictionary.
    fn dictionary(&self) -> &[u8];

    /// The host asked for a restart. The board makes a new [`Firmware`](crate::Firmware) as soon as it can, at the
    /// latest when the call into the old one returns; all outputs are at their defaults by now.
    fn reset(&mut self);
}
