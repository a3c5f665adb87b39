//! How many damaged blocks are taken for sound: by the framing alone, and with the block check (docs/block-check.md).
//!
//! `cargo run --release -p wire --example undetected -- [MILLIONS OF BLOCKS] [SEED]`. Blocks are full ones with random
//! content, one behind the other; of their bytes one in a hundred is replaced by another or has one bit flipped.

use std::collections::VecDeque;

use rand_pcg::{Pcg32, rand_core::Rng};
use wire::{
    block::{Block, Deframer, Frame, PAYLOAD_BYTES_MAX},
    check::BlockCheck,
};

const DAMAGE: f64 = 0.01;
/// A block that comes out belongs to one of so many that went in last, or to none.
const REMEMBERED: usize = 8;
const CHECK_ID: u16 = 40;

#[derive(Clone, Copy, Debug)]
enum Damage {
    AnyByte,
    OneBit,
}

#[derive(Debug, Default)]
struct Counts {
    sent: u64,
    damaged: u64,
    arrived: u64,
    undetected: u64,
}

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>().expect("a number"));
    let blocks = numbers.next().unwrap_or(10) * 1_000_000;
    let seed = numbers.next().unwrap_or(1);
    println!("{blocks} blocks, {DAMAGE} of all bytes damaged, seed {seed}");
    for damage in [Damage::AnyByte, Damage::OneBit] {
        for check in [None, Some(BlockCheck::new(CHECK_ID))] {
            let Counts { sent, damaged, arrived, undetected } = measure(blocks, seed, damage, check.as_ref());
            let name = if check.is_some() { "block check" } else { "framing alone" };
            println!(
                "{damage:?}, {name}: {damaged} blocks hit, {arrived} arrived, {undetected} wrong ones taken: {:.2e} of all \
                 blocks, {:.2e} of those hit",
                undetected as f64 / sent as f64,
                undetected as f64 / damaged.max(1) as f64,
            );
        }
    }
}

fn measure(blocks: u64, seed: u64, damage: Damage, check: Option<&BlockCheck>) -> Counts {
    let mut chance = Pcg32::new(seed, 1);
    let mut deframer = Deframer::new();
    let mut last: VecDeque<Block> = VecDeque::new();
    let mut counts = Counts { sent: blocks, ..Counts::default() };
    let room = PAYLOAD_BYTES_MAX - check.map_or(0, wire::check::BlockCheck::len);
    let mut payload = [0; PAYLOAD_BYTES_MAX];
    // How many bytes stay sound until the next one that does not.
    let mut sound = gap(&mut chance);
    for number in 0..blocks {
        chance.fill_bytes(&mut payload[..room]);
        let frame = |sequence, payload: &[u8]| match check {
            Some(check) => check.seal(sequence, payload),
            None => Block::new(sequence, payload),
        };
        let block = frame(number as u8, &payload[..room]);
        if last.len() == REMEMBERED {
            last.pop_front();
        }
        last.push_back(block);
        let mut bytes = [0; wire::block::BLOCK_BYTES_MAX];
        let bytes = &mut bytes[..block.as_bytes().len()];
        bytes.copy_from_slice(block.as_bytes());
        let mut is_hit = false;
        while sound < bytes.len() {
            bytes[sound] ^= match damage {
                Damage::AnyByte => 1 + (chance.next_u32() % 255) as u8,
                Damage::OneBit => 1 << (chance.next_u32() % 8),
            };
            sound += 1 + gap(&mut chance);
            is_hit = true;
        }
        sound -= bytes.len();
        counts.damaged += u64::from(is_hit);
        deframer.push(bytes, |found| {
            let Frame::Block { sequence, payload } = found else { return };
            let messages = match check {
                Some(check) => match check.open(sequence, payload) {
                    Some(messages) => messages,
                    None => return,
                },
                None => payload,
            };
            let is_sent = last.iter().rev().any(|sent| *sent == frame(sequence, messages));
            counts.arrived += u64::from(is_sent);
            counts.undetected += u64::from(!is_sent);
        });
    }
    counts
}

/// The sound bytes before the next damaged one: a geometric distribution.
fn gap(chance: &mut Pcg32) -> usize {
    let unit = (f64::from(chance.next_u32()) + 1.0) / (f64::from(u32::MAX) + 1.0);
    (libm::log(unit) / libm::log(1.0 - DAMAGE)) as usize
}
