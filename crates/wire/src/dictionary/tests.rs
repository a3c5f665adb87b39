//! Dictionaries: ours, others', damaged ones.

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
        block_check: true,
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
    assert_eq!((plain.number(MOTION_CLOCK), plain.block_checks()), (None, None));
    assert!(plain.supports(CommandKind::UpdateDigitalOut) && !plain.supports(CommandKind::MotionHold));
    let state = Response::MotionState { clock: 1, motion: 2, rate: 3, state: 0, reason: 0 };
    let mut bytes = vec![];
    state.encode(&mut bytes);
    assert!(plain.decode(&mut &bytes[..]).is_err());
    assert_eq!(ours().decode(&mut &bytes[..]), Ok(Received::Known(state)));
    assert_eq!(ours().number(MOTION_CLOCK), Some(1.0));
}

#[test]
fn the_block_check_is_known_by_the_boards_numbers() {
    let checks = ours().block_checks().unwrap();
    assert_eq!(checks.to_board, BlockCheck::new(CommandKind::BlockCheck.spec().id));
    assert_eq!(checks.from_board, BlockCheck::new(ResponseKind::BlockChecked.spec().id));
    let mut starting = vec![];
    Response::Starting {}.encode(&mut starting);
    assert_eq!(checks.starting, starting);
    let json = r#"{"commands": {"identify offset=%u count=%c": 1, "block_check crc=%u": 300},
        "responses": {"identify_response offset=%u data=%.*s": 0, "block_checked crc=%u": 2, "starting": 3},
        "config": {"BLOCK_CHECK": VERSION}}"#;
    let of = |version: &str| {
        let json = json.replace("VERSION", version);
        Dictionary::parse(&miniz_oxide::deflate::compress_to_vec_zlib(json.as_bytes(), 6)).unwrap()
    };
    assert_eq!(of("1").block_checks().unwrap().to_board, BlockCheck::new(300));
    assert_eq!(of("2").block_checks(), None, "another version is not ours");
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
