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
    check::BlockCheck,
    messages::{Command, CommandKind, DecodeError, MessageSpec, Response, ResponseKind, decode_id},
    vlq::{self, Sink},
};

mod description;

#[cfg(test)]
mod tests;

pub use description::{BLOCK_CHECK, BLOCK_CHECK_VERSION, BOARD_HEATERS, Description, MOTION_CLOCK};

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

/// How blocks are checked between a host and a board that knows the block check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockChecks {
    /// The check of blocks to the board.
    pub to_board: BlockCheck,
    /// The check of blocks from it.
    pub from_board: BlockCheck,
    /// The payload by which a board says, without a check, that it has just started and checks no more.
    pub starting: Vec<u8>,
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

    /// The checks of blocks to the board and from it, where the board knows the block check.
    pub fn block_checks(&self) -> Option<BlockChecks> {
        if self.number(BLOCK_CHECK) != Some(BLOCK_CHECK_VERSION) {
            return None;
        }
        let response = |wanted: ResponseKind| {
            self.incoming.iter().find(|(_, incoming)| incoming.known == Some(wanted)).map(|(&id, _)| id)
        };
        let mut starting = Vec::new();
        vlq::encode(i32::from(response(ResponseKind::Starting)?), &mut starting);
        Some(BlockChecks {
            to_board: BlockCheck::new(self.command_id(CommandKind::BlockCheck).ok()?),
            from_board: BlockCheck::new(response(ResponseKind::BlockChecked)?),
            starting,
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
