//! An error with everything that a user has to be told.

use printer::error::{ErrorCode, PrinterError};
use serde::Serialize;

/// What went wrong, from the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS), ts(rename = "PrinterError"))]
pub struct ErrorMessage {
    /// The entry in the catalogue.
    #[cfg_attr(feature = "bindings", ts(type = "ErrorCode"))]
    pub code: ErrorCode,
    /// The line of the G-code that led to it, if one did.
    pub line: Option<u32>,
    /// What happened, as a sentence.
    pub what_happened: String,
    /// What the machine does now, and what is not in danger.
    pub what_is_safe: String,
    /// What the user should do.
    pub what_to_do: String,
}

impl From<&PrinterError> for ErrorMessage {
    fn from(error: &PrinterError) -> Self {
        Self {
            code: error.code,
            line: error.line,
            what_happened: error.what_happened(),
            what_is_safe: error.what_is_safe().to_owned(),
            what_to_do: error.what_to_do().to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_tells_all_that_the_catalogue_knows() {
        let error = PrinterError::new(ErrorCode::NotHomed, "axis X").at_line(12);
        let value = serde_json::to_value(ErrorMessage::from(&error)).unwrap();
        assert_eq!(value["code"], "not-homed");
        assert_eq!(value["line"], 12);
        assert_eq!(value["what_happened"], error.what_happened());
        assert_eq!(value["what_is_safe"], error.what_is_safe());
        assert_eq!(value["what_to_do"], error.what_to_do());
    }
}
