//! The virtual printer with times in seconds since its power-up.

use printer::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
};
use units::{Seconds, Ticks};
use virtual_printer::{BoardProfile, Faults, VirtualPrinter};

use crate::messages::VirtualState;

/// The machine as the board of this name has it on its pins; the board that has the file's pins where none is named.
pub(crate) fn fit(
    mut config: PrinterConfig,
    board: Option<&str>,
) -> Result<(PrinterConfig, BoardProfile), PrinterError> {
    let wanted = match board {
        Some(name) => Some(BoardProfile::named(name).ok_or_else(|| {
            let known = BoardProfile::all().map(|board| board.name).join(", ");
            PrinterError::new(
                ErrorCode::ConfigUnsupported,
                format!("there is no virtual board \"{name}\", only {known}"),
            )
        })?),
        None => None,
    };
    let profile = demo_machine::fit(&mut config, wanted.as_ref())?;
    Ok((config, profile))
}

/// A powered virtual printer.
pub struct Simulation {
    printer: VirtualPrinter<()>,
}

impl Simulation {
    /// Powers a machine up. `faults` is a script, empty for a machine in order.
    pub fn new(
        config: PrinterConfig,
        board: Option<&str>,
        seed: u64,
        faults: &str,
    ) -> Result<Self, PrinterError> {
        let (config, profile) = fit(config, board)?;
        let machine = demo_machine::machine(&config)?;
        let unsupported = |problem: &dyn core::fmt::Display| {
            PrinterError::new(ErrorCode::ConfigUnsupported, problem.to_string())
        };
        let faults = match faults.trim() {
            "" => Faults::default(),
            script => script.parse().map_err(|error| unsupported(&error))?,
        };
        let printer =
            VirtualPrinter::new(profile, &machine, &faults, seed, ()).map_err(|error| unsupported(&error))?;
        Ok(Self { printer })
    }

    /// The board's clock.
    pub fn now_ticks(&self) -> Ticks {
        self.printer.now()
    }

    /// Time since power-up.
    pub fn now(&self) -> Seconds {
        self.printer.profile().clock.duration_of(self.printer.now() - self.printer.start())
    }

    /// Whether the host has a connection.
    pub fn connected(&self) -> bool {
        self.printer.connected()
    }

    /// Bytes leave the host now.
    pub fn write(&mut self, bytes: &[u8]) {
        self.printer.write(bytes);
    }

    /// Lets time pass until `until` or until bytes reach the host, whichever comes first.
    pub fn run_until(&mut self, until: Seconds, to_host: &mut Vec<u8>) {
        // Up to a tick later, never earlier: who asks for a time has reached it then.
        let until = self.printer.start() + self.printer.profile().clock.ticks_in(until) + Ticks(1);
        self.printer.run_until(until, to_host);
    }

    /// The machine as an onlooker sees it.
    pub fn state(&mut self) -> VirtualState {
        let (time_s, connected) = (self.now().0, self.connected());
        VirtualState::of(self.printer.state(), time_s, connected)
    }
}
