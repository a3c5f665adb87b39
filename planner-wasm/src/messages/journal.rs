//! What a print's journal says, for those who ask whether to go on with it.

use printer::journal::Journal;
use serde::Serialize;

/// A journal, as far as it could be read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
pub struct JournalView {
    /// The print's own number.
    pub print: u32,
    /// It came to its end, one way or another.
    pub has_ended: bool,
    /// The board that was asked about holds this very print.
    pub is_held: bool,
    /// The line of the last move that was seen to be made; 0 where none was.
    pub line: u32,
    /// Print time then, in s.
    pub elapsed_s: f64,
    /// How many bytes could be read; what follows them was torn off or damaged.
    pub readable_bytes: u32,
}

impl JournalView {
    /// Of a journal; `held` is the number under which a board holds a print.
    pub fn of(journal: &Journal, held: Option<u32>) -> Self {
        let (line, elapsed) = journal.progress.unwrap_or_default();
        Self {
            print: journal.print,
            has_ended: journal.has_ended,
            is_held: held.is_some_and(|id| journal.knows(id)),
            line,
            elapsed_s: elapsed.0,
            // A journal is not read beyond 64 MiB.
            readable_bytes: journal.bytes as u32,
        }
    }
}
