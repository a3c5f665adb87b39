//! What the reader has to say about a line.

use core::fmt;
use core::ops::Range;

use crate::LineNumber;

/// How much a diagnostic matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Worth knowing; the print comes out as meant.
    Info,
    /// The line was acted upon, though perhaps not as meant.
    Warning,
    /// The line was skipped and may have mattered: nothing is printed until the user has confirmed this line.
    Blocking,
    /// The line is wrong and was skipped: the file cannot be printed as it is.
    Error,
}

impl Severity {
    /// A stable lower-case name.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Blocking => "blocking",
            Self::Error => "error",
        }
    }
}

macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident = $text:literal,)*) => {
        /// What a diagnostic is about.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum DiagnosticCode {
            $($(#[$doc])* $name,)*
        }

        impl DiagnosticCode {
            /// Every code there is.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// A stable kebab-case name.
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                }
            }
        }
    };
}

codes! {
    /// A line has more than [`LINE_BYTES_MAX`](crate::LINE_BYTES_MAX) bytes.
    LineTooLong = "line-too-long",
    /// A line holds bytes that are no text.
    NotText = "not-text",
    /// Something that is not a letter with a number.
    MalformedWord = "malformed-word",
    /// A line holds more than one command.
    SeveralCommands = "several-commands",
    /// `X1E5`: an exponent, or a word for the extruder?
    AmbiguousExponent = "ambiguous-exponent",
    /// A letter occurs twice in one line.
    DuplicateWord = "duplicate-word",
    /// A number is too large, or not of the kind that is needed.
    ValueOutOfRange = "value-out-of-range",
    /// A letter without its number, or a command without a word that it needs.
    MissingValue = "missing-value",
    /// A word that the command does not know.
    UnusedWord = "unused-word",
    /// The line's checksum is not that of its bytes.
    ChecksumMismatch = "checksum-mismatch",
    /// Lines are missing, or in the wrong order.
    LineNumberOutOfOrder = "line-number-out-of-order",
    /// A `G`, `M` or `T` command that is not known.
    UnknownCommand = "unknown-command",
    /// A macro or extended command that is not known.
    UnknownMacro = "unknown-macro",
    /// A command that is known, and that nothing here can carry out.
    UnsupportedCommand = "unsupported-command",
    /// A setting of the file's firmware that has no meaning here.
    IgnoredSetting = "ignored-setting",
    /// `G10` without a length for it in the printer's configuration.
    AssumedRetraction = "assumed-retraction",
    /// No circle goes through the points as given.
    ImpossibleArc = "impossible-arc",
    /// The arc's ends are not equally far from its centre.
    InaccurateArc = "inaccurate-arc",
}

impl fmt::Display for DiagnosticCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// One remark about one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The line, counted from 1.
    pub line: LineNumber,
    /// The place in the line: bytes, counted from 0.
    pub columns: Range<u32>,
    /// How much it matters.
    pub severity: Severity,
    /// What it is about.
    pub code: DiagnosticCode,
    /// What is wrong and what to do about it, for a person.
    pub message: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, columns, severity, code, message } = self;
        write!(f, "{}:{}: {} [{code}] {message}", line.0, columns.start + 1, severity.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_kebab_case_and_unique() {
        let mut names: Vec<_> = DiagnosticCode::ALL.iter().map(|code| code.as_str()).collect();
        assert!(names.iter().all(|n| n.bytes().all(|b| b.is_ascii_lowercase() || b == b'-')));
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), DiagnosticCode::ALL.len());
    }
}
