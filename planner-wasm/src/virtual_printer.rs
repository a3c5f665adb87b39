//! The virtual printer for JavaScript.

use units::Seconds;
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::{Simulation, messages::json, read_config, thrown};

/// A printer with firmware, board and machine in virtual time, which passes only in `run_until_s`.
#[wasm_bindgen(js_name = VirtualPrinter)]
pub struct Virtual(Simulation);

#[wasm_bindgen(js_class = VirtualPrinter)]
impl Virtual {
    /// Powers up the machine that the text of a `printer.cfg` describes. `board` is `rp2040`, `stm32f103`, or left out:
    /// then it is the one that has the file's pins. All chance comes from `seed`. `faults` is a script as in
    /// `stepcast simulate --fault`, empty for a machine in order.
    #[wasm_bindgen(constructor)]
    pub fn new(
        printer_cfg: &str,
        board: Option<String>,
        seed: u32,
        faults: &str,
    ) -> Result<Virtual, JsError> {
        let built = read_config(printer_cfg)
            .and_then(|config| Simulation::new(config, board.as_deref(), seed.into(), faults));
        built.map(Self).map_err(|error| thrown(&error))
    }

    /// The board's clock, in ticks.
    pub fn now_ticks(&self) -> f64 {
        self.0.now_ticks().0 as f64
    }

    /// Seconds since power-up.
    pub fn now_s(&self) -> f64 {
        self.0.now().0
    }

    /// Whether the cable is in and the board on the bus.
    pub fn connected(&self) -> bool {
        self.0.connected()
    }

    /// Bytes leave the host now. They are lost where there is no connection.
    pub fn write(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    /// Lets time pass until `until_s`, or until bytes reach the host or the connection comes or goes, whichever is first;
    /// returns the bytes. `now_s` says how far it came.
    pub fn run_until_s(&mut self, until_s: f64) -> Vec<u8> {
        let mut to_host = Vec::new();
        self.0.run_until(Seconds(until_s), &mut to_host);
        to_host
    }

    /// The machine as an onlooker sees it: a `VirtualState` as JSON.
    pub fn state(&mut self) -> String {
        json(&self.0.state())
    }
}
