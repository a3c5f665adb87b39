//! What the board said, taken off the wire.

use units::{Clock32, Seconds};
use wire::{
    Response,
    dictionary::{Dictionary, Received},
};

use super::{board_heater::HeaterReport, motion_time::MotionReport};
use crate::{journal::MotorQueue, link::Link};

/// A message from the board, without borrowed bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Message {
    Config { is_config: bool, crc: u32, is_shutdown: bool, move_count: u16 },
    Clock(Clock32),
    Uptime { high: u32, low: Clock32 },
    Position { oid: u8, position: i32 },
    Endstop { oid: u8, homing: bool, pin_value: bool },
    Trigger { oid: u8, can_trigger: bool, reason: u8 },
    Analog { oid: u8, next_clock: Clock32, sum: u16 },
    Motion(MotionReport),
    Queue { oid: u8, job: u32, queue: MotorQueue },
    Heater(HeaterReport),
    Shutdown { reason: u16 },
    Starting,
}

/// A message and when the block that it answers was sent, where that is known.
pub(super) type Inbound = (Message, Option<Seconds>);

/// Takes bytes from the port and gives the messages in them. What is unknown or damaged is left out: responses are
/// never repeated, so everybody who waits for one asks again.
pub(super) fn receive(link: &mut Link, dictionary: &Dictionary, bytes: &[u8], now: Seconds) -> Vec<Inbound> {
    let mut inbox = Vec::new();
    link.receive(bytes, now, |payload| {
        let mut rest = payload.bytes;
        while !rest.is_empty() {
            match dictionary.decode(&mut rest) {
                Ok(Received::Known(response)) => {
                    inbox.extend(message(&response).map(|known| (known, payload.sent)));
                }
                Ok(Received::Other(_)) => {}
                Err(_) => break,
            }
        }
    });
    inbox
}

fn message(response: &Response<'_>) -> Option<Message> {
    Some(match *response {
        Response::_Lifetime(never, _) => match never {},
        Response::Config { is_config, crc, is_shutdown, move_count } => {
            Message::Config { is_config: is_config != 0, crc, is_shutdown: is_shutdown != 0, move_count }
        }
        Response::Clock { clock } => Message::Clock(Clock32(clock)),
        Response::Uptime { high, clock } => Message::Uptime { high, low: Clock32(clock) },
        Response::StepperPosition { oid, pos } => Message::Position { oid, position: pos },
        Response::EndstopState { oid, homing, pin_value, .. } => {
            Message::Endstop { oid, homing: homing != 0, pin_value: pin_value != 0 }
        }
        Response::TrsyncState { oid, can_trigger, trigger_reason, .. } => {
            Message::Trigger { oid, can_trigger: can_trigger != 0, reason: trigger_reason }
        }
        Response::AnalogInState { oid, next_clock, values } => {
            let sum = u16::from_le_bytes([*values.first()?, *values.get(1)?]);
            Message::Analog { oid, next_clock: Clock32(next_clock), sum }
        }
        Response::Shutdown { static_string_id, .. } | Response::IsShutdown { static_string_id } => {
            Message::Shutdown { reason: static_string_id }
        }
        Response::Starting {} => Message::Starting,
        Response::MotionState { clock, motion, rate, state, reason } => {
            Message::Motion(MotionReport::new(clock, motion, rate, state, reason))
        }
        Response::StepperQueue { oid, job, received, done, left, next, dir, pos, crc } => Message::Queue {
            oid,
            job,
            queue: MotorQueue {
                received,
                done,
                left,
                next: Clock32(next),
                dir: dir != 0,
                position: pos,
                crc,
            },
        },
        Response::HeaterState { oid, target, power, state, .. } => {
            Message::Heater(HeaterReport::new(oid, target, power, state))
        }
        Response::Stats { .. } | Response::IdentifyResponse { .. } | Response::BlockChecked { .. } => {
            return None;
        }
    })
}
