//! A board's side: what it says of itself.

use alloc::{borrow::ToOwned, collections::BTreeMap, string::String, vec::Vec};

use super::{Constant, EnumerationValue, Json, format_of};
use crate::{
    messages::{CommandKind, Extension, MessageSpec, ResponseKind},
    shutdown::ShutdownReason,
};

/// What a board says of itself, apart from the messages, which are the same on all of ours.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// The firmware's version.
    pub version: String,
    /// Tool versions.
    pub build_versions: String,
    /// Constants such as `CLOCK_FREQ`.
    pub constants: Vec<(String, Constant)>,
    /// Pin names: the first name of a row, its value, how many there are.
    pub pins: Vec<(String, u8, u8)>,
    /// Whether the board has the motion clock: its messages, and the constant [`MOTION_CLOCK`].
    pub motion_clock: bool,
    /// Whether the board regulates heaters: the messages for that, and the constant [`BOARD_HEATERS`].
    pub board_heaters: bool,
    /// Whether the board knows the block check: its messages, and the constant [`BLOCK_CHECK`].
    pub block_check: bool,
}

/// The constant by which a board says that it has a motion clock: the extension's version.
pub const MOTION_CLOCK: &str = "MOTION_CLOCK";
/// The version that is described in docs/motion-clock.md.
const MOTION_CLOCK_VERSION: f64 = 1.0;
/// The constant by which a board says that it regulates heaters: the extension's version.
pub const BOARD_HEATERS: &str = "BOARD_HEATERS";
/// The version that is described in docs/board-heaters.md.
const BOARD_HEATERS_VERSION: f64 = 1.0;
/// The constant by which a board says that it knows the block check: the extension's version.
pub const BLOCK_CHECK: &str = "BLOCK_CHECK";
/// The version that is described in docs/block-check.md.
pub const BLOCK_CHECK_VERSION: f64 = 1.0;

impl Description {
    const fn has(&self, extension: Option<Extension>) -> bool {
        match extension {
            None => true,
            Some(Extension::MotionClock) => self.motion_clock,
            Some(Extension::Heaters) => self.board_heaters,
            Some(Extension::BlockCheck) => self.block_check,
        }
    }

    /// The dictionary as JSON.
    pub fn json(&self) -> String {
        let formats = |specs: &mut dyn Iterator<Item = MessageSpec>| -> BTreeMap<String, i32> {
            specs.map(|spec| (format_of(&spec), i32::from(spec.id))).collect()
        };
        let pins = self.pins.iter().map(|(name, first, count)| {
            let value = match count {
                1 => EnumerationValue::One(i64::from(*first)),
                _ => EnumerationValue::Row([i64::from(*first), i64::from(*count)]),
            };
            (name.clone(), value)
        });
        let reasons = ShutdownReason::ALL
            .iter()
            .map(|&reason| (reason.text().to_owned(), EnumerationValue::One(i64::from(reason as u16))));
        let versions = [
            (Extension::MotionClock, MOTION_CLOCK, MOTION_CLOCK_VERSION),
            (Extension::Heaters, BOARD_HEATERS, BOARD_HEATERS_VERSION),
            (Extension::BlockCheck, BLOCK_CHECK, BLOCK_CHECK_VERSION),
        ];
        let extensions = versions
            .into_iter()
            .filter(|&(extension, ..)| self.has(Some(extension)))
            .map(|(_, name, version)| (name.to_owned(), Constant::Number(version)));
        let json = Json {
            version: self.version.clone(),
            build_versions: self.build_versions.clone(),
            config: self.constants.iter().cloned().chain(extensions).collect(),
            commands: formats(
                &mut CommandKind::ALL
                    .iter()
                    .filter(|kind| self.has(kind.extension()))
                    .map(|kind| kind.spec()),
            ),
            responses: formats(
                &mut ResponseKind::ALL
                    .iter()
                    .filter(|kind| self.has(kind.extension()))
                    .map(|kind| kind.spec()),
            ),
            output: BTreeMap::new(),
            enumerations: [
                ("pin".to_owned(), pins.collect()),
                ("static_string_id".to_owned(), reasons.collect()),
            ]
            .into(),
        };
        serde_json::to_string(&json).expect("maps of strings and numbers are always JSON")
    }

    /// The dictionary as it travels.
    pub fn compressed(&self) -> Vec<u8> {
        const LEVEL: u8 = 9;
        miniz_oxide::deflate::compress_to_vec_zlib(self.json().as_bytes(), LEVEL)
    }
}
