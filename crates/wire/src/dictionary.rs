//! The data dictionary: how a board tells a host what it understands.
//!
//! It is JSON, compressed with zlib, and travels in pieces by `identify`. A board's build (or the virtual printer)
//! makes one with [`Description::compressed`]; a host reads any board's with [`Dictionary::parse`].

use alloc::{
    borrow::ToOwned,
    collections::BTreeMap,
    format,
    string::{String, ToString},
    vec::Vec,
};

use serde::{Deserialize, Serialize};

use crate::{
    messages::{Command, CommandKind, DecodeError, MessageSpec, Response, ResponseKind, decode_id},
    vlq::{self, Sink},
};

mod description;

pub use description::{BOARD_HEATERS, Description, MOTION_CLOCK};

/// The largest dictionary that is accepted once unpacked: real ones are below 64 KiB.
pub const DICTIONARY_BYTES_MAX: usize = 1 << 20;

/// Why a dictionary cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DictionaryError {
    /// The zlib stream is damaged or too large.
    #[error("the board's dictionary does not unpack ({0})")]
    Compression(String),
    /// It is not the JSON that it should be.
    #[error("the board's dictionary is not valid JSON ({0})")]
    Json(String),
    /// A message format that cannot be read.
    #[error("the board's dictionary has a message format that cannot be read: \"{0}\"")]
    Format(String),
    /// A command that is needed is missing or has other fields.
    #[error("the board's firmware has no \"{wanted}\"{}", found.as_ref().map(|f| format!(" (it has \"{f}\")")).unwrap_or_default())]
    Command {
        /// The format that is needed.
        wanted: String,
        /// What the board has under that name.
        found: Option<String>,
    },
}

/// A constant in the dictionary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Constant {
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

/// A member of an enumeration: one value, or the first of a row of names that count upwards (`"PA0": [0, 16]`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum EnumerationValue {
    /// The name's value.
    One(i64),
    /// The value of the first name and how many there are.
    Row([i64; 2]),
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Json {
    #[serde(default)]
    version: String,
    #[serde(default)]
    build_versions: String,
    #[serde(default)]
    config: BTreeMap<String, Constant>,
    #[serde(default)]
    commands: BTreeMap<String, i32>,
    #[serde(default)]
    responses: BTreeMap<String, i32>,
    #[serde(default)]
    output: BTreeMap<String, i32>,
    #[serde(default)]
    enumerations: BTreeMap<String, BTreeMap<String, EnumerationValue>>,
}

fn format_of(spec: &MessageSpec) -> String {
    spec.fields
        .iter()
        .fold(spec.name.to_owned(), |format, field| format + " " + field.name + "=" + field.format)
}

/// A message format of the board's, read.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Format {
    text: String,
    name: String,
    /// Whether each field is a string of bytes (the rest are integers).
    fields: Vec<(String, FieldType)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FieldType {
    Integer(&'static str),
    Bytes,
}

impl FieldType {
    fn parse(text: &str) -> Option<Self> {
        Some(match text {
            "%u" => Self::Integer("%u"),
            "%i" => Self::Integer("%i"),
            "%hu" => Self::Integer("%hu"),
            "%hi" => Self::Integer("%hi"),
            "%c" => Self::Integer("%c"),
            "%s" | "%*s" | "%.*s" => Self::Bytes,
            _ => return None,
        })
    }
}

impl Format {
    fn parse(text: &str) -> Result<Self, DictionaryError> {
        let fail = || DictionaryError::Format(text.to_owned());
        let mut words = text.split(' ');
        let name = words.next().filter(|name| !name.is_empty()).ok_or_else(fail)?.to_owned();
        let fields = words
            .map(|word| {
                let (name, kind) = word.split_once('=').ok_or_else(fail)?;
                Ok((name.to_owned(), FieldType::parse(kind).ok_or_else(fail)?))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { text: text.to_owned(), name, fields })
    }

    /// Debug output of a board: free text with conversions in it.
    fn parse_output(text: &str) -> Self {
        let fields = text
            .match_indices('%')
            .filter_map(|(at, _)| {
                let end = text[at + 1..].find(|c: char| c.is_ascii_alphabetic() && c != 'h')? + at + 2;
                Some((String::new(), FieldType::parse(text.get(at..end)?)?))
            })
            .collect();
        Self { text: text.to_owned(), name: String::new(), fields }
    }

    /// Whether the board's message has the fields of our declaration, in the same order.
    fn agrees_with(&self, spec: &MessageSpec) -> bool {
        self.fields.len() == spec.fields.len()
            && self.fields.iter().zip(spec.fields).all(|((name, kind), field)| {
                name == field.name && Some(*kind) == FieldType::parse(field.format)
            })
    }

    /// Skips a message of this format; `None` when it is cut off.
    fn skip(&self, bytes: &mut &[u8]) -> Option<()> {
        for (_, kind) in &self.fields {
            let value = vlq::decode(bytes)?;
            if *kind == FieldType::Bytes {
                *bytes = bytes.get(usize::try_from(value).ok()?..)?;
            }
        }
        Some(())
    }
}

/// A message from a board, as a host sees it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Received<'a> {
    /// One of the messages that we know.
    Known(Response<'a>),
    /// A message or debug output that only this board has; its format says what.
    Other(&'a str),
}

/// A board's dictionary, read: the only way for a host to write to it or to understand it.
#[derive(Clone, Debug)]
pub struct Dictionary {
    /// The firmware's version.
    pub version: String,
    /// Its tool versions.
    pub build_versions: String,
    constants: BTreeMap<String, Constant>,
    enumerations: BTreeMap<String, BTreeMap<String, EnumerationValue>>,
    commands: Vec<Result<u16, Option<String>>>,
    incoming: BTreeMap<u16, Incoming>,
}

#[derive(Clone, Debug)]
struct Incoming {
    known: Option<ResponseKind>,
    format: Format,
}

impl Dictionary {
    /// The dictionary that every board has before it is asked for its own: `identify` and its answer.
    pub fn bootstrap() -> Self {
        let identify = CommandKind::Identify.spec();
        let response = ResponseKind::IdentifyResponse.spec();
        let json = Json {
            commands: [(format_of(&identify), i32::from(identify.id))].into(),
            responses: [(format_of(&response), i32::from(response.id))].into(),
            ..Json::default()
        };
        Self::from_json(json).expect("our own declarations are well formed")
    }

    /// Reads a dictionary as it came over the wire.
    pub fn parse(compressed: &[u8]) -> Result<Self, DictionaryError> {
        let json = miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(compressed, DICTIONARY_BYTES_MAX)
            .map_err(|error| DictionaryError::Compression(error.to_string()))?;
        let json = serde_json::from_slice(&json).map_err(|error| DictionaryError::Json(error.to_string()))?;
        Self::from_json(json)
    }

    fn from_json(json: Json) -> Result<Self, DictionaryError> {
        let number =
            |id: i32, text: &str| u16::try_from(id).map_err(|_| DictionaryError::Format(text.to_owned()));
        let mut by_name = BTreeMap::new();
        for (text, &id) in &json.commands {
            let format = Format::parse(text)?;
            by_name.insert(format.name.clone(), (number(id, text)?, format));
        }
        let commands = CommandKind::ALL
            .iter()
            .map(|kind| {
                let spec = kind.spec();
                match by_name.get(spec.name) {
                    Some((id, format)) if format.agrees_with(&spec) => Ok(*id),
                    Some((_, format)) => Err(Some(format.text.clone())),
                    None => Err(None),
                }
            })
            .collect();
        let mut incoming = BTreeMap::new();
        for (text, &id) in &json.responses {
            let format = Format::parse(text)?;
            let same = |kind: &&ResponseKind| {
                let spec = kind.spec();
                spec.name == format.name && format.agrees_with(&spec)
            };
            let known = ResponseKind::ALL.iter().find(same).copied();
            incoming.insert(number(id, text)?, Incoming { known, format });
        }
        for (text, &id) in &json.output {
            incoming.insert(number(id, text)?, Incoming { known: None, format: Format::parse_output(text) });
        }
        Ok(Self {
            version: json.version,
            build_versions: json.build_versions,
            constants: json.config,
            enumerations: json.enumerations,
            commands,
            incoming,
        })
    }

    /// A numeric constant such as `CLOCK_FREQ`.
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.constants.get(name)? {
            Constant::Number(value) => Some(*value),
            Constant::Text(text) => text.parse().ok(),
        }
    }

    /// A constant as text, such as `MCU`.
    pub fn text(&self, name: &str) -> Option<String> {
        Some(match self.constants.get(name)? {
            Constant::Number(value) => value.to_string(),
            Constant::Text(text) => text.clone(),
        })
    }

    /// All constants, by name.
    pub fn constants(&self) -> impl Iterator<Item = (&str, &Constant)> {
        self.constants.iter().map(|(name, value)| (name.as_str(), value))
    }

    /// The value that an enumeration gives a name, rows included (`PA7` in `"PA0": [0, 16]`).
    pub fn enumeration(&self, enumeration: &str, name: &str) -> Option<i64> {
        let members = self.enumerations.get(enumeration)?;
        match members.get(name) {
            Some(EnumerationValue::One(value) | EnumerationValue::Row([value, _])) => return Some(*value),
            None => {}
        }
        let (root, at) = split_number(name)?;
        members.iter().find_map(|(first, value)| {
            let EnumerationValue::Row([value, count]) = value else { return None };
            let (first_root, first_at) = split_number(first)?;
            let place = at.checked_sub(first_at).filter(|place| (0..*count).contains(place))?;
            (first_root == root).then(|| value.checked_add(place))?
        })
    }

    /// The value of a pin's name.
    pub fn pin(&self, name: &str) -> Option<u8> {
        u8::try_from(self.enumeration("pin", name)?).ok()
    }

    /// The name that an enumeration gives a value: the text of a shutdown's reason, for one.
    pub fn enumeration_name(&self, enumeration: &str, value: i64) -> Option<&str> {
        let members = self.enumerations.get(enumeration)?;
        members
            .iter()
            .find(|(_, member)| **member == EnumerationValue::One(value))
            .map(|(name, _)| name.as_str())
    }

    /// Whether the board understands a command, with the fields that we declare for it.
    pub fn supports(&self, kind: CommandKind) -> bool {
        self.commands[kind as usize].is_ok()
    }

    /// An error that names the first of `kinds` that the board lacks.
    pub fn require(&self, kinds: &[CommandKind]) -> Result<(), DictionaryError> {
        kinds.iter().try_for_each(|&kind| self.command_id(kind).map(drop))
    }

    fn command_id(&self, kind: CommandKind) -> Result<u16, DictionaryError> {
        self.commands[kind as usize].as_ref().copied().map_err(|found| DictionaryError::Command {
            wanted: format_of(&kind.spec()),
            found: found.clone(),
        })
    }

    /// Appends a command as this board numbers it.
    pub fn encode(&self, command: &Command<'_>, out: &mut impl Sink) -> Result<(), DictionaryError> {
        let id = self.command_id(command.kind())?;
        vlq::encode(i32::from(id), out);
        command.encode_fields(out);
        Ok(())
    }

    /// Takes one message off the front of `bytes`.
    pub fn decode<'a>(&'a self, bytes: &mut &'a [u8]) -> Result<Received<'a>, DecodeError> {
        let id = decode_id(bytes)?;
        let incoming = self.incoming.get(&id).ok_or(DecodeError::UnknownId(id))?;
        if let Some(kind) = incoming.known {
            return kind.decode(bytes).map(Received::Known);
        }
        incoming.format.skip(bytes).ok_or(DecodeError::CutOff)?;
        Ok(Received::Other(&incoming.format.text))
    }
}

/// `"gpio12"` is `("gpio", 12)`.
fn split_number(name: &str) -> Option<(&str, i64)> {
    let root = name.trim_end_matches(|c: char| c.is_ascii_digit());
    Some((root, name[root.len()..].parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    fn ours() -> Dictionary {
        let description = Description {
            version: "v1".into(),
            build_versions: "rustc".into(),
            constants: vec![
                ("CLOCK_FREQ".into(), Constant::Number(12e6)),
                ("MCU".into(), Constant::Text("rp2040".into())),
            ],
            pins: vec![("gpio0".into(), 0, 30), ("LED".into(), 40, 1)],
            motion_clock: true,
            board_heaters: true,
        };
        Dictionary::parse(&description.compressed()).unwrap()
    }

    #[test]
    fn a_host_understands_what_our_board_says_of_itself() {
        let dictionary = ours();
        assert_eq!(dictionary.number("CLOCK_FREQ"), Some(12e6));
        assert_eq!(dictionary.text("MCU").as_deref(), Some("rp2040"));
        assert_eq!(dictionary.pin("gpio0"), Some(0));
        assert_eq!(dictionary.pin("gpio29"), Some(29));
        assert_eq!(dictionary.pin("gpio30"), None);
        assert_eq!(dictionary.pin("LED"), Some(40));
        assert_eq!(dictionary.enumeration_name("static_string_id", 3), Some("Timer too close"));
        assert_eq!(dictionary.require(CommandKind::ALL), Ok(()));
    }

    #[test]
    fn a_plain_board_does_not_have_the_extension() {
        let plain = Dictionary::parse(&Description::default().compressed()).unwrap();
        assert_eq!(plain.number(MOTION_CLOCK), None);
        assert!(plain.supports(CommandKind::UpdateDigitalOut) && !plain.supports(CommandKind::MotionHold));
        let state = Response::MotionState { clock: 1, motion: 2, rate: 3, state: 0, reason: 0 };
        let mut bytes = vec![];
        state.encode(&mut bytes);
        assert!(plain.decode(&mut &bytes[..]).is_err());
        assert_eq!(ours().decode(&mut &bytes[..]), Ok(Received::Known(state)));
        assert_eq!(ours().number(MOTION_CLOCK), Some(1.0));
    }

    #[test]
    fn commands_and_answers_pass() {
        let dictionary = ours();
        let command = Command::QueueStep { oid: 1, interval: 2, count: 3, add: -4 };
        let mut bytes = vec![];
        dictionary.encode(&command, &mut bytes).unwrap();
        assert_eq!(Command::decode(&mut &bytes[..]), Ok(command));
        bytes.clear();
        let answer = Response::Clock { clock: 99 };
        answer.encode(&mut bytes);
        assert_eq!(dictionary.decode(&mut &bytes[..]), Ok(Received::Known(answer)));
    }

    #[test]
    fn a_board_with_other_fields_is_told_apart_and_named() {
        let json = r#"{"commands": {"identify offset=%u count=%c": 1, "queue_step oid=%c interval=%u count=%hu": 9},
            "responses": {"identify_response offset=%u data=%.*s": 0, "novelty a=%u b=%*s": 70},
            "output": {"debug %u of %hu: %.*s": 71}, "config": {"CLOCK_FREQ": "72000000"}}"#;
        let dictionary =
            Dictionary::parse(&miniz_oxide::deflate::compress_to_vec_zlib(json.as_bytes(), 6)).unwrap();
        assert_eq!(dictionary.number("CLOCK_FREQ"), Some(72e6));
        assert!(!dictionary.supports(CommandKind::QueueStep));
        let error = dictionary.require(&[CommandKind::QueueStep]).unwrap_err().to_string();
        assert!(error.contains("add=%hi") && error.contains("it has"), "{error}");
        // Messages that only this board has are stepped over, so that those behind them in the block are read.
        let bytes = vec![70, 5, 2, 0xff, 0xff, 71, 1, 2, 1, b'x', 0, 3, 1, 7];
        let mut rest = &bytes[..];
        assert_eq!(dictionary.decode(&mut rest), Ok(Received::Other("novelty a=%u b=%*s")));
        assert_eq!(dictionary.decode(&mut rest), Ok(Received::Other("debug %u of %hu: %.*s")));
        assert_eq!(
            dictionary.decode(&mut rest),
            Ok(Received::Known(Response::IdentifyResponse { offset: 3, data: &[7] }))
        );
    }

    #[test]
    fn rows_without_end_are_no_harm() {
        let json = r#"{"enumerations": {"pin": {"PA0": [9223372036854775807, 9223372036854775807],
            "PB9223372036854775807": [1, 9223372036854775807], "PC3": [-5, -9223372036854775808]}}}"#;
        let dictionary =
            Dictionary::parse(&miniz_oxide::deflate::compress_to_vec_zlib(json.as_bytes(), 6)).unwrap();
        assert_eq!(dictionary.enumeration("pin", "PA7"), None);
        assert_eq!(dictionary.enumeration("pin", "PA9223372036854775806"), None);
        assert_eq!(dictionary.enumeration("pin", "PB9"), None);
        assert_eq!(dictionary.enumeration("pin", "PC4"), None);
    }

    #[test]
    fn damaged_dictionaries_are_errors() {
        assert!(matches!(Dictionary::parse(b"nonsense"), Err(DictionaryError::Compression(_))));
        let not_json = miniz_oxide::deflate::compress_to_vec_zlib(b"[]x", 6);
        assert!(matches!(Dictionary::parse(&not_json), Err(DictionaryError::Json(_))));
        let bomb = miniz_oxide::deflate::compress_to_vec_zlib(&vec![b' '; DICTIONARY_BYTES_MAX + 1], 6);
        assert!(matches!(Dictionary::parse(&bomb), Err(DictionaryError::Compression(_))));
    }

    #[test]
    fn the_bootstrap_knows_identify_and_nothing_else() {
        let dictionary = Dictionary::bootstrap();
        assert!(dictionary.supports(CommandKind::Identify));
        assert!(!dictionary.supports(CommandKind::QueueStep));
    }
}
