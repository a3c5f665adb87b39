//! Reads the board's dictionary, piece by piece.
//!
//! Sans-I/O: says what to ask ([`Identify::poll`]), takes the answers ([`Identify::receive`]). Responses are never
//! retransmitted by the board, so every question is asked again when its answer fails to come. Knows nothing of
//! blocks. Units: host time in seconds, sizes in bytes.

use units::Seconds;
use wire::dictionary::{Dictionary, DictionaryError};

/// Bytes asked for at a time: with its frame a piece fits a block.
pub const PIECE_BYTES: u8 = 40;
/// The largest compressed dictionary that is read; real ones are below 16 KiB.
pub const COMPRESSED_BYTES_MAX: usize = 1 << 18;
/// A board that sends nothing for this long, in seconds, is silent.
const SILENT_S: f64 = 5.0;
/// The shortest and the longest time, in seconds, after which a question is asked again.
const ASK_AGAIN_S_MIN: f64 = 0.025;
const ASK_AGAIN_S_MAX: f64 = 0.5;
/// The same before any answer has been timed.
const ASK_AGAIN_S_FIRST: f64 = 0.1;
/// A damaged dictionary is read this many times before that is an error: a damaged block passes the block's own
/// check now and then on a very bad line.
const READINGS_MAX: u32 = 3;
/// After so many attempts pieces are asked for that are half as long, and again half as long after as many.
const LONG_ATTEMPTS: u32 = 3;

/// Why there is no dictionary.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IdentifyError {
    /// The board does not answer.
    #[error("the board does not answer")]
    Silent,
    /// There is no end to it.
    #[error("the board's dictionary is larger than {COMPRESSED_BYTES_MAX} bytes")]
    TooLarge,
    /// It cannot be read.
    #[error(transparent)]
    Dictionary(#[from] DictionaryError),
}

/// A question: `identify offset=… count=…`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentifyRequest {
    /// The first byte wanted.
    pub offset: u32,
    /// How many.
    pub count: u8,
}

/// The reading of a dictionary.
#[derive(Clone, Debug)]
pub struct Identify {
    compressed: Vec<u8>,
    /// When the piece that is wanted next was asked for, and how often.
    asked: Option<(f64, u32)>,
    answer_s: Option<f64>,
    /// When the last piece came, or the first question left.
    last_s: Option<f64>,
    readings: u32,
    finished: bool,
}

impl Default for Identify {
    fn default() -> Self {
        Self::new()
    }
}

impl Identify {
    /// Nothing read yet.
    pub const fn new() -> Self {
        Self {
            compressed: Vec::new(),
            asked: None,
            answer_s: None,
            last_s: None,
            readings: 1,
            finished: false,
        }
    }

    /// Bytes read so far.
    pub fn bytes_read(&self) -> usize {
        self.compressed.len()
    }

    /// When to poll next; `None` once it is finished.
    pub fn next_wake(&self) -> Option<Seconds> {
        if self.finished {
            return None;
        }
        let Some((asked_s, times)) = self.asked else { return Some(Seconds(f64::NEG_INFINITY)) };
        let wait = self.answer_s.map_or(ASK_AGAIN_S_FIRST, |answer_s| 3.0 * answer_s);
        let doubled = wait.max(ASK_AGAIN_S_MIN) * f64::from(1_u32 << (times.clamp(1, 6) - 1));
        Some(Seconds(asked_s + doubled.min(ASK_AGAIN_S_MAX)))
    }

    /// What to ask now, if anything; an error when the board is silent.
    pub fn poll(&mut self, now: Seconds) -> Result<Option<IdentifyRequest>, IdentifyError> {
        if self.next_wake().is_none_or(|wake| now < wake) {
            return Ok(None);
        }
        let last_s = *self.last_s.get_or_insert(now.0);
        if now.0 - last_s > SILENT_S {
            self.finished = true;
            return Err(IdentifyError::Silent);
        }
        let times = self.asked.map_or(1, |(_, times)| times.saturating_add(1));
        self.asked = Some((now.0, times));
        // On a line that garbles nearly every long answer short ones come through.
        let count = PIECE_BYTES >> (times / LONG_ATTEMPTS).min(2);
        Ok(Some(IdentifyRequest { offset: self.compressed.len() as u32, count }))
    }

    /// Takes an `identify_response`; gives the dictionary when that was the last piece.
    pub fn receive(
        &mut self,
        offset: u32,
        data: &[u8],
        now: Seconds,
    ) -> Result<Option<Dictionary>, IdentifyError> {
        // Answers to questions that were asked twice, or by a host before us.
        let Some((asked_s, times)) = self.asked else { return Ok(None) };
        if self.finished || offset as usize != self.compressed.len() || data.len() > usize::from(PIECE_BYTES)
        {
            return Ok(None);
        }
        if times == 1 {
            let answer_s = now.0 - asked_s;
            self.answer_s = Some(self.answer_s.map_or(answer_s, |before| before + (answer_s - before) / 4.0));
        }
        self.asked = None;
        self.last_s = Some(now.0);
        if !data.is_empty() {
            self.compressed.extend_from_slice(data);
            if self.compressed.len() > COMPRESSED_BYTES_MAX {
                self.finished = true;
                return Err(IdentifyError::TooLarge);
            }
            return Ok(None);
        }
        match Dictionary::parse(&self.compressed) {
            Ok(dictionary) => {
                self.finished = true;
                Ok(Some(dictionary))
            }
            Err(_) if self.readings < READINGS_MAX => {
                self.readings += 1;
                self.compressed.clear();
                Ok(None)
            }
            Err(error) => {
                self.finished = true;
                Err(error.into())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::{Pcg32, rand_core::Rng};
    use wire::dictionary::{Constant, Description};

    use super::*;

    fn description() -> Description {
        let text = |name: &str, value: &str| (name.to_owned(), Constant::Text(value.to_owned()));
        Description {
            version: "1.0".to_owned(),
            build_versions: "rustc".to_owned(),
            constants: vec![("CLOCK_FREQ".to_owned(), Constant::Number(12e6)), text("MCU", "rp2040")],
            pins: vec![("gpio0".to_owned(), 0, 30)],
            ..Description::default()
        }
    }

    /// Reads `data` from a board of which every answer gets lost with some probability; gives the time it took.
    fn read(identify: &mut Identify, data: &[u8], loss: f64) -> Result<(Dictionary, f64), IdentifyError> {
        let mut chance = Pcg32::new(7, 7);
        let mut now = Seconds(1.0);
        loop {
            now = now.max(identify.next_wake().expect("not finished"));
            let Some(request) = identify.poll(now)? else { continue };
            if f64::from(chance.next_u32()) < loss * f64::from(u32::MAX) {
                continue;
            }
            now += Seconds(0.003);
            let start = data.len().min(request.offset as usize);
            let end = data.len().min(start + usize::from(request.count));
            if let Some(dictionary) = identify.receive(request.offset, &data[start..end], now)? {
                return Ok((dictionary, now.0 - 1.0));
            }
        }
    }

    #[test]
    fn the_dictionary_is_read_whole() {
        let data = description().compressed();
        let mut identify = Identify::new();
        let (dictionary, took_s) = read(&mut identify, &data, 0.0).unwrap();
        assert_eq!(dictionary.text("MCU").as_deref(), Some("rp2040"));
        assert_eq!(identify.bytes_read(), data.len());
        assert_eq!(identify.next_wake(), None);
        assert!(took_s < 0.004 * (data.len() / 40 + 2) as f64, "{took_s} s");
    }

    #[test]
    fn lost_answers_are_asked_for_again_soon() {
        let data = description().compressed();
        let (_, took_s) = read(&mut Identify::new(), &data, 0.4).unwrap();
        assert!(took_s < 0.1 * (data.len() / 40 + 2) as f64, "{took_s} s for {} bytes", data.len());
    }

    #[test]
    fn where_long_answers_do_not_come_through_short_ones_are_asked_for() {
        let data = description().compressed();
        let mut identify = Identify::new();
        let mut now = Seconds(1.0);
        let dictionary = loop {
            now = now.max(identify.next_wake().expect("not finished"));
            let Some(request) = identify.poll(now).expect("it is not silent") else { continue };
            if request.count > PIECE_BYTES / 4 {
                continue;
            }
            let start = request.offset as usize;
            let end = data.len().min(start + usize::from(request.count));
            if let Some(dictionary) = identify.receive(request.offset, &data[start..end], now).expect("sound")
            {
                break dictionary;
            }
        };
        assert_eq!(dictionary.text("MCU").as_deref(), Some("rp2040"));
    }

    #[test]
    fn a_silent_board_is_an_error() {
        assert_eq!(read(&mut Identify::new(), &[], 1.1).unwrap_err(), IdentifyError::Silent);
    }

    #[test]
    fn answers_that_were_not_asked_for_are_ignored() {
        let mut identify = Identify::new();
        assert!(identify.receive(0, b"old", Seconds(0.0)).unwrap().is_none());
        identify.poll(Seconds(0.0)).unwrap();
        assert!(identify.receive(40, b"other", Seconds(0.0)).unwrap().is_none());
        assert!(identify.receive(0, &[0; 41], Seconds(0.0)).unwrap().is_none());
        assert_eq!(identify.bytes_read(), 0);
        identify.receive(0, b"first", Seconds(0.0)).unwrap();
        identify.receive(0, b"again", Seconds(0.0)).unwrap();
        assert_eq!(identify.bytes_read(), 5);
    }

    #[test]
    fn damage_is_read_again_and_then_is_an_error() {
        let mut data = description().compressed();
        data[60] ^= 1;
        let error = read(&mut Identify::new(), &data, 0.0).unwrap_err();
        assert!(matches!(error, IdentifyError::Dictionary(_)), "{error}");
    }

    #[test]
    fn a_dictionary_without_end_is_an_error() {
        let data = vec![0; COMPRESSED_BYTES_MAX + 100];
        assert_eq!(read(&mut Identify::new(), &data, 0.0).unwrap_err(), IdentifyError::TooLarge);
    }
}
