//! Lines that are not as they should be: words, checksums, line numbers.

use super::{Interpreter, Out};
use crate::annotation::text_of;
use crate::diagnostic::DiagnosticCode as Code;
use crate::diagnostic::Severity::{Blocking, Error, Info};
use crate::lines::LINE_BYTES_MAX;
use crate::words::{WordFault, WordsEnd};

/// What some editors put before the first line.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Says what is wrong with the words of a line.
#[cold]
pub(super) fn word_fault(fault: &WordFault, bytes: &[u8], out: &mut Out<'_>) {
    let skipped = "The line is skipped; slice the file again.";
    match fault.clone() {
        WordFault::NoLetter(at) => {
            let text = text_of(&bytes[at.clone()]);
            out.say(Error, Code::MalformedWord, at, format!("`{text}` is not a letter with a number. {skipped}"));
        }
        WordFault::NotText(at) => {
            let byte = bytes[at.start];
            out.say(Error, Code::NotText, at, format!("Byte 0x{byte:02x} is no text: the file is damaged. {skipped}"));
        }
        WordFault::Duplicate(letter, at) => {
            let letter = char::from(letter);
            out.say(Error, Code::DuplicateWord, at, format!("`{letter}` occurs twice in this line. {skipped}"));
        }
        WordFault::SecondCommand(at) => {
            let message = "A second command begins here, but only one a line is read. The line is skipped: write each command \
                           on a line of its own.";
            out.say(Error, Code::SeveralCommands, at, message);
        }
        WordFault::Exponent(at) => out.say(
            Error,
            Code::AmbiguousExponent,
            at,
            "This `E` may be an exponent or the extruder. Write numbers without exponent, or a blank before the `E`.",
        ),
        WordFault::TooLarge(at) => {
            out.say(Error, Code::ValueOutOfRange, at, format!("This number is far too large. {skipped}"));
        }
    }
}

impl Interpreter {
    /// What `read_words` found unusual. `false` where the line must not be acted upon.
    #[cold]
    pub(super) fn check_words(&mut self, bytes: &[u8], bare: u32, end: WordsEnd, out: &mut Out<'_>) -> bool {
        if let Some(letter) = self.words.first_of(bare) {
            let message =
                format!("`{}` has no number. The line is skipped; slice the file again.", char::from(letter));
            out.say(Error, Code::MissingValue, self.words.columns(letter), message);
            return false;
        }
        match end {
            WordsEnd::Checksum(star) => return checksum_holds(bytes, star, out),
            WordsEnd::Unclosed(open) => {
                let message = "This `(` is never closed: the rest of the line is taken for a comment.";
                out.say(Info, Code::MalformedWord, open..bytes.len(), message);
            }
            WordsEnd::Line | WordsEnd::Comment => {}
        }
        true
    }

    /// `N12 G1 X1*57`
    #[cold]
    pub(super) fn numbered(&mut self, bytes: &[u8], at: usize, out: &mut Out<'_>) {
        let Some((number, end)) = crate::number::read(bytes, at + 1) else {
            return self.odd(bytes, at, out);
        };
        if number.abs() > f64::from(u32::MAX) || number % 1.0 != 0.0 {
            let message = "This is no line number. The line is skipped; slice the file again.";
            return out.say(Error, Code::ValueOutOfRange, at..end, message);
        }
        let number = number as i64;
        // A `*` in a comment or in a text is no checksum, but in a numbered line the last one always is.
        let code_end = memchr::memchr(b';', bytes).unwrap_or(bytes.len());
        let star = memchr::memrchr(b'*', &bytes[..code_end]);
        if let Some(star) = star {
            if !checksum_holds(bytes, star, out) {
                self.last_number = Some(number);
                return;
            }
            if self.last_number.is_some_and(|last| number != last + 1) {
                let last = self.last_number.unwrap_or_default();
                let message = format!(
                    "Line N{number} follows N{last}: lines are missing or mixed up. Slice the file again."
                );
                out.say(Blocking, Code::LineNumberOutOfOrder, at..end, message);
            }
            self.last_number = Some(number);
        }
        let rest = &bytes[..star.unwrap_or(bytes.len())];
        let blanks = rest[end.min(rest.len())..].iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
        let at = end + blanks;
        match rest.get(at) {
            None | Some(b';') => {}
            Some(first) if first.is_ascii_alphabetic() || *first == b'_' => self.command(rest, at, out),
            Some(_) => self.odd(rest, at, out),
        }
    }

    /// A line that begins with none of the letters: a comment in brackets, a `%`, a byte order mark, or garbage.
    #[cold]
    pub(super) fn odd(&mut self, bytes: &[u8], at: usize, out: &mut Out<'_>) {
        if let Some(rest) = bytes[at..].strip_prefix(BYTE_ORDER_MARK)
            && out.line.0 == 1
        {
            if rest.starts_with(BYTE_ORDER_MARK) {
                return word_fault(&WordFault::NotText(at + 3..at + 4), bytes, out);
            }
            let (line, mut actions, mut diagnostics) = (out.line, Vec::new(), Vec::new());
            self.line(line, rest, &mut actions, &mut diagnostics);
            for diagnostic in &mut diagnostics {
                diagnostic.columns = diagnostic.columns.start + 3..diagnostic.columns.end + 3;
            }
            out.actions.append(&mut actions);
            out.diagnostics.append(&mut diagnostics);
            return;
        }
        if bytes[at] == b'%' && bytes[at + 1..].trim_ascii().is_empty() {
            return;
        }
        match self.words.scan_any(bytes, at) {
            Ok(end) if self.words.present() == 0 => {
                self.check_words(bytes, 0, end, out);
            }
            Ok(_) if bytes[at] == b'(' => {
                let at = behind_comments(bytes, at);
                if bytes[at].is_ascii_alphabetic() {
                    self.command(bytes, at, out);
                }
            }
            Ok(_) => {
                let message = "The line does not begin with a command. It is skipped; slice the file again.";
                out.say(Error, Code::MalformedWord, at..at + 1, message);
            }
            Err(fault) => word_fault(&fault, bytes, out),
        }
    }

    /// A line that was cut off. Comments may be as long as they like.
    #[cold]
    pub(super) fn too_long(bytes: &[u8], out: &mut Out<'_>) {
        if bytes.trim_ascii_start().first() == Some(&b';') {
            return;
        }
        let message = format!(
            "The line has more than {LINE_BYTES_MAX} bytes and is skipped. Check that the file is G-code."
        );
        out.say(Error, Code::LineTooLong, 0..LINE_BYTES_MAX, message);
    }
}

/// The first place from `at` on that is neither blank nor in brackets; there is one.
fn behind_comments(bytes: &[u8], mut at: usize) -> usize {
    while at + 1 < bytes.len() {
        match bytes[at] {
            b' ' | b'\t' | b'\r' => at += 1,
            b'(' => at += memchr::memchr(b')', &bytes[at..]).map_or(1, |length| length + 1),
            _ => break,
        }
    }
    at.min(bytes.len() - 1)
}

/// Whether the bytes before the `*` at `star`, XORed, give the number behind it.
fn checksum_holds(bytes: &[u8], star: usize, out: &mut Out<'_>) -> bool {
    let actual = bytes[..star].iter().fold(0, |sum, byte| sum ^ byte);
    let (stated, end) = super::digits(bytes, star + 1);
    let rest = bytes[end..].trim_ascii_start().first();
    match stated {
        Some(stated) if stated == u32::from(actual) && matches!(rest, None | Some(b';' | b'(')) => true,
        Some(stated) if stated != u32::from(actual) => {
            let message = format!(
                "The checksum is {stated}, but the line's bytes give {actual}: the line is damaged and skipped. Copy or \
                 slice the file again."
            );
            out.say(Error, Code::ChecksumMismatch, star..end, message);
            false
        }
        _ => {
            let message =
                "A `*` must be followed by the line's checksum and nothing else. The line is skipped.";
            out.say(Error, Code::MalformedWord, star..end.max(star + 1), message);
            false
        }
    }
}
