//! Numbers, lengths, values out of range, noise.

use super::*;
use crate::check::MESSAGE_BYTES_MAX;
use alloc::{vec, vec::Vec};
use proptest::prelude::*;

#[test]
fn numbers_are_unique_and_the_fixed_ones_are_right() {
    let commands = CommandKind::ALL.iter().map(|kind| kind.spec().id);
    let mut ids: Vec<u16> = commands.chain(ResponseKind::ALL.iter().map(|kind| kind.spec().id)).collect();
    ids.sort_unstable();
    let all = ids.len();
    ids.dedup();
    assert_eq!(ids.len(), all);
    assert!(ids.iter().all(|&id| id < 96), "all numbers travel as one byte");
    assert_eq!(CommandKind::Identify.spec().id, 1);
    assert_eq!(ResponseKind::IdentifyResponse.spec().id, 0);
}

#[test]
fn every_message_fits_a_block_beside_a_check() {
    let longest = |spec: MessageSpec| -> usize {
        let field = |field: &FieldSpec| match field.format {
            "%u" | "%i" => 5,
            "%hu" | "%hi" => 3,
            "%c" => 2,
            // Whoever fills such a field keeps it short.
            _ => 0,
        };
        1 + spec.fields.iter().map(field).sum::<usize>()
    };
    let commands = CommandKind::ALL.iter().map(|kind| kind.spec());
    for spec in commands.chain(ResponseKind::ALL.iter().map(|kind| kind.spec())) {
        assert!(longest(spec) <= MESSAGE_BYTES_MAX, "{}", spec.name);
    }
}

#[test]
fn a_value_beyond_its_type_is_an_error() {
    let mut bytes = Vec::new();
    vlq::encode(i32::from(CommandKind::AllocateOids.spec().id), &mut bytes);
    vlq::encode(256, &mut bytes);
    assert_eq!(Command::decode(&mut &bytes[..]), Err(DecodeError::OutOfRange));
}

#[test]
fn an_unknown_number_is_an_error() {
    let mut bytes = Vec::new();
    vlq::encode(60, &mut bytes);
    assert_eq!(Command::decode(&mut &bytes[..]), Err(DecodeError::UnknownId(60)));
    assert_eq!(Response::decode(&mut &bytes[..]), Err(DecodeError::UnknownId(60)));
}

proptest! {
    #[test]
    fn messages_come_back_as_they_went(oid: u8, interval: u32, count: u16, add: i16, data: Vec<u8>) {
        let step = Command::QueueStep { oid, interval, count, add };
        let reply = Response::AnalogInState { oid, next_clock: interval, values: &data };
        let mut bytes = vec![];
        prop_assert!(step.encode(&mut bytes));
        prop_assert_eq!(Command::decode(&mut &bytes[..]), Ok(step));
        bytes.clear();
        prop_assert!(reply.encode(&mut bytes));
        prop_assert_eq!(Response::decode(&mut &bytes[..]), Ok(reply));
    }

    #[test]
    fn garbage_is_an_error_and_never_a_panic(bytes: Vec<u8>) {
        let mut rest = &bytes[..];
        while Command::decode(&mut rest).is_ok() && !rest.is_empty() {}
        let mut rest = &bytes[..];
        while Response::decode(&mut rest).is_ok() && !rest.is_empty() {}
    }
}
