//! Where a print was when it was interrupted, for JavaScript.

use printer::{
    error::{ErrorCode, PrinterError},
    interruption,
    journal::Journal,
};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::{
    messages::{InterruptionView, json},
    read_config, thrown,
};

/// Finds out where a print was when it was interrupted: feed its file from the beginning as far as it is wanted, and call
/// `advance` until it is done. Moves nothing and needs no board.
#[wasm_bindgen]
pub struct Survey {
    inner: interruption::Survey,
}

#[wasm_bindgen]
impl Survey {
    /// Of a print's journal, and the text of the `printer.cfg` with which it was begun.
    #[wasm_bindgen(constructor)]
    pub fn new(printer_cfg: &str, journal: &[u8]) -> Result<Survey, JsError> {
        let config = read_config(printer_cfg).map_err(|error| thrown(&error))?;
        let journal = Journal::read(journal)
            .map_err(|error| thrown(&PrinterError::new(ErrorCode::ContinuationRefused, error.to_string())))?;
        let inner = interruption::Survey::new(&config, journal).map_err(|error| thrown(&error))?;
        Ok(Self { inner })
    }

    /// How many bytes of the file may be fed now.
    pub fn wants(&self) -> usize {
        self.inner.wants()
    }

    /// The next bytes of the file, at most what it wants.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(), JsError> {
        if bytes.len() > self.inner.wants() {
            let detail = "more of the file was handed over than was asked for";
            return Err(thrown(&PrinterError::new(ErrorCode::Internal, detail)));
        }
        self.inner.feed(bytes);
        Ok(())
    }

    /// The file has ended.
    pub fn finish(&mut self) {
        self.inner.end();
    }

    /// Reads a piece of what was fed; returns whether there is more to do without more input.
    pub fn advance(&mut self) -> Result<bool, JsError> {
        self.inner.advance().map_err(|error| thrown(&error))
    }

    /// Bytes of the file that were taken.
    #[wasm_bindgen(getter)]
    pub fn progress(&self) -> f64 {
        self.inner.fed() as f64
    }

    /// What was found out: an `InterruptionView` as JSON, or nothing while it is not done.
    pub fn report(&self) -> Option<String> {
        self.inner.report().map(|found| json(&InterruptionView::from(&found)))
    }
}
