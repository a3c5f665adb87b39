//! One pass over the words of a line: letters with numbers, comments, a checksum.
//!
//! Knows nothing of what a letter means.

use core::ops::Range;

use crate::number;

/// The largest number in a word, in whatever unit: more is a mistake, and would leave `f64` no room for micrometres.
pub(crate) const VALUE_MAX: f64 = 1e9;

/// The words of one line, by letter. Kept from line to line so that nothing is cleared but two masks.
#[derive(Clone, Debug)]
pub(crate) struct Words {
    /// Letters (bit 0: A) that the line has, with a number or without.
    present: u32,
    /// Letters without a number.
    bare: u32,
    values: [f64; 26],
    columns: [u16; 26],
}

/// A bit for a letter in masks.
pub(crate) const fn bit(letter: u8) -> u32 {
    1 << (letter - b'A')
}

/// Bits for some letters.
pub(crate) const fn bits(letters: &[u8]) -> u32 {
    let mut mask = 0;
    let mut i = 0;
    while i < letters.len() {
        mask |= bit(letters[i]);
        i += 1;
    }
    mask
}

/// What is wrong with a line of words.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum WordFault {
    /// Not a letter.
    NoLetter(Range<usize>),
    /// Control characters or worse.
    NotText(Range<usize>),
    /// This letter (upper case) occurred before.
    Duplicate(u8, Range<usize>),
    /// `X1E5` in a line whose words are apart otherwise.
    Exponent(Range<usize>),
    /// A `G` or `M` among the words of a command: a second one.
    SecondCommand(Range<usize>),
    /// More than [`VALUE_MAX`].
    TooLarge(Range<usize>),
}

/// What ended the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WordsEnd {
    /// The line's own end.
    Line,
    /// A `;`.
    Comment,
    /// A `*`, which stands there.
    Checksum(usize),
    /// A `(` that stands there and that nothing closes.
    Unclosed(usize),
}

impl Default for Words {
    fn default() -> Self {
        Self { present: 0, bare: 0, values: [0.0; 26], columns: [0; 26] }
    }
}

impl Words {
    /// Reads the words from `at`, behind a command, to the end of the line.
    #[inline]
    pub(crate) fn scan(&mut self, bytes: &[u8], at: usize) -> Result<WordsEnd, WordFault> {
        let end = self.scan_any(bytes, at)?;
        match self.first_of(bits(b"GM")) {
            Some(letter) => Err(WordFault::SecondCommand(self.columns(letter))),
            None => Ok(end),
        }
    }

    /// Reads the words from `at` to the end of the line, commands or not.
    #[inline]
    pub(crate) fn scan_any(&mut self, bytes: &[u8], mut at: usize) -> Result<WordsEnd, WordFault> {
        self.present = 0;
        self.bare = 0;
        let first = at;
        while let Some(&byte) = bytes.get(at) {
            let index = (byte | 0x20).wrapping_sub(b'a');
            if index < 26 {
                if index == b'e' - b'a' && at > first && bytes[at - 1].is_ascii_digit() {
                    Self::check_exponent(bytes, first, at)?;
                }
                at = self.word(bytes, at, index)?;
                // The usual blank.
                at += usize::from(bytes.get(at) == Some(&b' '));
                continue;
            }
            match byte {
                b' ' | b'\t' | b'\r' => at += 1,
                b';' => return Ok(WordsEnd::Comment),
                b'*' => return Ok(WordsEnd::Checksum(at)),
                b'(' => match memchr::memchr(b')', &bytes[at..]) {
                    Some(length) => at += length + 1,
                    None => return Ok(WordsEnd::Unclosed(at)),
                },
                _ => return Err(Self::no_letter(bytes, at)),
            }
        }
        Ok(WordsEnd::Line)
    }

    /// Reads the word at `at`, whose letter is that of `index`, and says where it ends.
    #[allow(clippy::inline_always)] // As `number::read`.
    #[inline(always)]
    fn word(&mut self, bytes: &[u8], at: usize, index: u8) -> Result<usize, WordFault> {
        let mask = 1 << index;
        if self.present & mask != 0 {
            return Err(WordFault::Duplicate(b'A' + index, at..at + 1));
        }
        self.present |= mask;
        let slot = usize::from(index);
        self.columns[slot] = at as u16;
        let Some((value, end)) = number::read(bytes, at + 1).or_else(|| read_apart(bytes, at + 1)) else {
            self.bare |= mask;
            return Ok(at + 1);
        };
        if value.abs() <= VALUE_MAX {
            self.values[slot] = value;
            Ok(end)
        } else {
            Err(WordFault::TooLarge(at..end))
        }
    }

    /// An `E` right behind a digit is the extruder where all words are written together, as in `G1X1E5`. Where others are
    /// apart it may be an exponent that some program wrote.
    #[cold]
    fn check_exponent(bytes: &[u8], first: usize, at: usize) -> Result<(), WordFault> {
        let apart = bytes[first..at].iter().any(|b| matches!(b, b' ' | b'\t'));
        if apart { Err(WordFault::Exponent(at - 1..at + 1)) } else { Ok(()) }
    }

    #[cold]
    fn no_letter(bytes: &[u8], at: usize) -> WordFault {
        if matches!(bytes[at], b'!'..=b'~') {
            let length =
                bytes[at..].iter().take_while(|b| b.is_ascii_graphic() && !b.is_ascii_alphabetic()).count();
            WordFault::NoLetter(at..at + length.max(1))
        } else {
            WordFault::NotText(at..at + 1)
        }
    }

    /// Letters that have no number.
    pub(crate) fn bare(&self) -> u32 {
        self.bare
    }

    /// Letters that occur.
    #[inline]
    pub(crate) fn present(&self) -> u32 {
        self.present
    }

    /// Whether a letter occurs, with or without a number.
    #[inline]
    pub(crate) fn has(&self, letter: u8) -> bool {
        self.present & bit(letter) != 0
    }

    /// A letter's number.
    #[inline]
    pub(crate) fn get(&self, letter: u8) -> Option<f64> {
        (self.present & !self.bare & bit(letter) != 0).then(|| self.values[usize::from(letter - b'A')])
    }

    /// Where a letter that occurs stands.
    pub(crate) fn columns(&self, letter: u8) -> Range<usize> {
        let at = usize::from(self.columns[usize::from(letter - b'A')]);
        at..at + 1
    }

    /// The leftmost letter of a mask that occurs.
    #[inline]
    pub(crate) fn first_of(&self, mask: u32) -> Option<u8> {
        let found = self.present & mask;
        if found == 0 { None } else { self.leftmost(found) }
    }

    #[cold]
    fn leftmost(&self, found: u32) -> Option<u8> {
        let letters = (b'A'..=b'Z').filter(|&letter| found & bit(letter) != 0);
        letters.min_by_key(|&letter| self.columns[usize::from(letter - b'A')])
    }
}

/// `X 10`: blanks between letter and number are legal, though nobody writes them.
#[cold]
fn read_apart(bytes: &[u8], at: usize) -> Option<(f64, usize)> {
    let blanks = bytes.get(at..)?.iter().take_while(|&&b| b == b' ').count();
    if blanks == 0 { None } else { number::read(bytes, at + blanks) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(text: &str) -> Result<(Words, WordsEnd), WordFault> {
        let mut words = Words::default();
        words.scan(text.as_bytes(), 0).map(|end| (words, end))
    }

    #[test]
    fn words_apart_and_together() {
        for text in [
            "X1.5 Y-2 E.25 F1800",
            "x1.5y-2e.25f1800",
            "X 1.5\tY -2 E+.25 F1800 ",
            "X1.5(way)Y-2 E.25 (x)F1800",
        ] {
            let (words, end) = scan(text).unwrap();
            let values: Vec<_> = b"XYEF".iter().map(|&l| words.get(l).unwrap()).collect();
            assert_eq!(values, [1.5, -2.0, 0.25, 1800.0], "{text}");
            assert_eq!((words.present(), end), (bits(b"XYEF"), WordsEnd::Line));
        }
    }

    #[test]
    fn letters_without_numbers_are_remembered_as_such() {
        let (words, end) = scan("X Y0;home").unwrap();
        assert_eq!((words.bare(), words.has(b'X'), words.get(b'X')), (bit(b'X'), true, None));
        assert_eq!((words.get(b'Y'), end), (Some(0.0), WordsEnd::Comment));
    }

    #[test]
    fn every_fault_has_its_place() {
        assert_eq!(scan("X1 X2").unwrap_err(), WordFault::Duplicate(b'X', 3..4));
        assert_eq!(scan("X1 Y1E300").unwrap_err(), WordFault::Exponent(4..6));
        assert_eq!(scan("X1e-5 Y1").unwrap().0.get(b'E'), Some(-5.0));
        assert_eq!(scan("X2000000000").unwrap_err(), WordFault::TooLarge(0..11));
        assert_eq!(scan("X1.2.3").unwrap_err(), WordFault::NoLetter(4..6));
        assert_eq!(scan("X1 =2").unwrap_err(), WordFault::NoLetter(3..5));
        assert_eq!(scan("X1 \u{7f}").unwrap_err(), WordFault::NotText(3..4));
        assert_eq!(scan("X1 G91").unwrap_err(), WordFault::SecondCommand(3..4));
        assert_eq!(scan("X1 (open").unwrap().1, WordsEnd::Unclosed(3));
    }
}
