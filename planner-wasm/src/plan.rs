//! Plans for JavaScript: the blocks that would be sent to a board.

use printer::planner;
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::{read_config, thrown};

/// Turns G-code into the blocks that would be sent to a board: feed it, then finish it.
#[wasm_bindgen]
pub struct PlanStream(planner::PlanStream);

/// What a finished plan amounts to.
#[wasm_bindgen]
pub struct Plan {
    report: planner::PlanReport,
    blocks: Vec<u8>,
}

#[wasm_bindgen]
impl PlanStream {
    /// A plan for the machine that the text of a `printer.cfg` describes.
    #[wasm_bindgen(constructor)]
    pub fn new(printer_cfg: &str) -> Result<PlanStream, JsError> {
        let config = read_config(printer_cfg).map_err(|error| thrown(&error))?;
        Ok(Self(planner::PlanStream::new(&config).map_err(|error| thrown(&error))?))
    }

    /// How many bytes may be fed now.
    pub fn wants(&self) -> usize {
        self.0.wants()
    }

    /// Takes G-code; returns the blocks that follow from it.
    pub fn feed(&mut self, gcode: &[u8]) -> Result<Vec<u8>, JsError> {
        let mut blocks = Vec::new();
        self.0.feed(gcode, &mut blocks, |_| {}).map_err(|error| thrown(&error))?;
        Ok(blocks)
    }

    /// Says that the file has ended.
    pub fn finish(self) -> Result<Plan, JsError> {
        let mut blocks = Vec::new();
        let report = self.0.finish(&mut blocks, |_| {}).map_err(|error| thrown(&error))?;
        Ok(Plan { report, blocks })
    }
}

#[wasm_bindgen]
impl Plan {
    /// The last blocks.
    #[wasm_bindgen(getter)]
    pub fn blocks(&self) -> Vec<u8> {
        self.blocks.clone()
    }

    /// From the first move to the last, in s.
    #[wasm_bindgen(getter)]
    pub fn print_time_s(&self) -> f64 {
        self.report.print_time.get()
    }

    /// Steps of each motor (X, Y, Z, E), in both directions together.
    #[wasm_bindgen(getter)]
    pub fn steps(&self) -> Vec<u64> {
        self.report.motors.iter().map(|motor| motor.steps).collect()
    }
}
