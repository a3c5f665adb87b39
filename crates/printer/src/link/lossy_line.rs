//! A board at the end of a bad line, in virtual time, for tests: bytes are flipped, lost, doubled and delayed by a
//! seeded chance, and the board takes blocks in order only and answers each.

use std::collections::VecDeque;

use rand_pcg::{Pcg32, rand_core::Rng};
use units::{Hertz, Seconds, Ticks};
use wire::{
    block::{Block, Deframer, Frame, SEQUENCE_MASK},
    check::BlockCheck,
    dictionary::BlockChecks,
};

use super::Link;

/// The board's clock.
pub(super) const CLOCK: Hertz = Hertz(12_000_000);

/// What the line does to bytes. Probabilities are per byte, times in seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conditions {
    pub(super) latency_s: f64,
    pub(super) jitter_s: f64,
    pub(super) bytes_per_s: f64,
    pub(super) corrupt: f64,
    pub(super) drop: f64,
    pub(super) duplicate: f64,
    pub(super) stall: f64,
}

impl Conditions {
    pub(super) const USB: Self = Self {
        latency_s: 0.001,
        jitter_s: 0.0005,
        bytes_per_s: 500_000.0,
        corrupt: 0.0,
        drop: 0.0,
        duplicate: 0.0,
        stall: 0.0,
    };
    pub(super) const UART: Self = Self { latency_s: 0.002, bytes_per_s: 25_000.0, ..Self::USB };
}

/// One direction.
#[derive(Debug)]
struct Channel {
    conditions: Conditions,
    chance: Pcg32,
    busy_until_s: f64,
    last_arrival_s: f64,
    bytes: VecDeque<(f64, u8)>,
}

impl Channel {
    fn new(conditions: Conditions, seed: u64, stream: u64) -> Self {
        let chance = Pcg32::new(seed, stream);
        Self { conditions, chance, busy_until_s: 0.0, last_arrival_s: 0.0, bytes: VecDeque::new() }
    }

    fn happens(&mut self, probability: f64) -> bool {
        self.part() < probability
    }

    /// Evenly spread over 0..1.
    fn part(&mut self) -> f64 {
        f64::from(self.chance.next_u32()) / (f64::from(u32::MAX) + 1.0)
    }

    fn send(&mut self, bytes: &[u8], now_s: f64) {
        const STALL_S_MAX: f64 = 0.02;
        let Conditions { latency_s, jitter_s, bytes_per_s, corrupt, drop, duplicate, stall } =
            self.conditions;
        let jitter_s = jitter_s * self.part();
        for &byte in bytes {
            self.busy_until_s = self.busy_until_s.max(now_s) + 1.0 / bytes_per_s;
            let mut arrival_s = (self.busy_until_s + latency_s + jitter_s).max(self.last_arrival_s);
            // All that follows is held up as well.
            if self.happens(stall) {
                arrival_s += STALL_S_MAX * self.part();
            }
            self.last_arrival_s = arrival_s;
            if self.happens(drop) {
                continue;
            }
            let flip = if self.happens(corrupt) { 1 << (self.chance.next_u32() % 8) } else { 0 };
            self.bytes.push_back((arrival_s, byte ^ flip));
            if self.happens(duplicate) {
                self.bytes.push_back((arrival_s, byte));
            }
        }
    }

    fn next_s(&self) -> Option<f64> {
        self.bytes.front().map(|&(arrival_s, _)| arrival_s)
    }

    fn take(&mut self, now_s: f64, into: &mut Vec<u8>) {
        into.clear();
        while let Some((_, byte)) = self.bytes.pop_front_if(|&mut (arrival_s, _)| arrival_s <= now_s) {
            into.push(byte);
        }
    }
}

/// The checks of a board that knows them.
pub(super) fn checks() -> BlockChecks {
    BlockChecks { to_board: BlockCheck::new(40), from_board: BlockCheck::new(90), starting: vec![75] }
}

/// Takes blocks in order and answers each one.
#[derive(Debug)]
pub(super) struct Board {
    deframer: Deframer,
    pub(super) expected: u8,
    /// Says no only once until a valid block comes, as some firmwares do.
    pub(super) laconic: bool,
    refused: bool,
    /// The payloads taken, in order, with the time.
    pub(super) taken: Vec<(f64, Vec<u8>)>,
    /// It answers a payload that starts with this byte at once with a message.
    pub(super) question: Option<u8>,
    /// It checks blocks, from the first one with a check on.
    pub(super) checks: Option<BlockChecks>,
    pub(super) is_checking: bool,
}

impl Board {
    fn receive(&mut self, bytes: &[u8], now_s: f64, out: &mut Vec<u8>) {
        let Self { deframer, expected, laconic, refused, taken, question, checks, is_checking } = self;
        deframer.push(bytes, |frame| {
            let frame = match (frame, checks.as_ref()) {
                (Frame::Block { sequence, payload }, Some(checks)) => {
                    match checks.to_board.open(sequence, payload) {
                        Some(payload) => {
                            *is_checking = true;
                            Frame::Block { sequence, payload }
                        }
                        None if *is_checking => Frame::Garbage,
                        None => frame,
                    }
                }
                _ => frame,
            };
            let framed = |expected: u8, payload: &[u8]| match checks.as_ref().filter(|_| *is_checking) {
                Some(checks) => checks.from_board.seal(expected, payload),
                None => Block::new(expected, payload),
            };
            let good = match frame {
                Frame::Block { sequence, payload } if sequence == *expected => {
                    *expected = (*expected + 1) & SEQUENCE_MASK;
                    if !payload.is_empty() {
                        taken.push((now_s, payload.to_vec()));
                    }
                    if question.is_some() && payload.first() == question.as_ref() {
                        out.extend(framed(*expected, b"answer").as_bytes());
                    }
                    *refused = false;
                    true
                }
                Frame::Block { .. } => {
                    *refused = false;
                    true
                }
                Frame::Garbage => false,
            };
            if good || !*laconic || !*refused {
                out.extend(framed(*expected, &[]).as_bytes());
                *refused |= !good;
            }
        });
    }
}

/// A link, a board and the line between them.
#[derive(Debug)]
pub(super) struct Line {
    pub(super) link: Link,
    pub(super) board: Board,
    up: Channel,
    down: Channel,
    pub(super) now_s: f64,
    /// What the board said, with the times that the link gave.
    pub(super) heard: Vec<(Seconds, Option<Seconds>)>,
    /// How often the link was called only because it asked to be.
    pub(super) wakes: u64,
}

impl Line {
    pub(super) fn new(conditions: Conditions, seed: u64) -> Self {
        let mut link = Link::new();
        link.set_board(CLOCK, 8000);
        Self {
            link,
            board: Board {
                deframer: Deframer::new(),
                expected: (seed % 16) as u8,
                laconic: false,
                refused: false,
                taken: Vec::new(),
                question: None,
                checks: None,
                is_checking: false,
            },
            up: Channel::new(conditions, seed, 1),
            down: Channel::new(conditions, seed, 2),
            now_s: 0.0,
            heard: Vec::new(),
            wakes: 0,
        }
    }

    pub(super) fn clock(&self) -> Ticks {
        CLOCK.ticks_in(Seconds(self.now_s))
    }

    /// The board says something of its own accord.
    pub(super) fn board_says(&mut self, payload: &[u8]) {
        self.down.send(Block::new(self.board.expected, payload).as_bytes(), self.now_s);
    }

    /// Both ends know the block check, once they have met.
    pub(super) fn check(&mut self) {
        self.board.checks = Some(checks());
        assert!(self.link.is_connected(), "the board has been found");
        self.link.set_checks(checks());
    }

    /// Lets time pass until `until_s`, or until `done` says so after something happened; `false` if it never did.
    pub(super) fn run(&mut self, until_s: f64, mut done: impl FnMut(&mut Self) -> bool) -> bool {
        let (mut bytes, mut out) = (Vec::new(), Vec::new());
        loop {
            if done(self) {
                return true;
            }
            out.clear();
            let clock = self.clock();
            let wake = self.link.poll(Seconds(self.now_s), clock, &mut out);
            self.up.send(&out, self.now_s);
            let next_s = [wake.map(|wake| wake.0), self.up.next_s(), self.down.next_s()]
                .into_iter()
                .flatten()
                .min_by(f64::total_cmp);
            match next_s {
                Some(next_s) if next_s <= until_s => self.now_s = self.now_s.max(next_s),
                _ => {
                    self.now_s = self.now_s.max(until_s);
                    return done(self);
                }
            }
            let arriving = [self.up.next_s(), self.down.next_s()].into_iter().flatten();
            self.wakes += u64::from(arriving.min_by(f64::total_cmp).is_none_or(|next_s| next_s > self.now_s));
            self.up.take(self.now_s, &mut bytes);
            out.clear();
            self.board.receive(&bytes, self.now_s, &mut out);
            self.down.send(&out, self.now_s);
            self.down.take(self.now_s, &mut bytes);
            let heard = &mut self.heard;
            self.link
                .receive(&bytes, Seconds(self.now_s), |payload| heard.push((payload.received, payload.sent)));
        }
    }
}
