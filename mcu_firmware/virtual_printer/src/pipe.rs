//! One direction of the link: bytes go in at one time and come out at a later one, perhaps damaged.
//!
//! Bytes keep their order. Units: ticks of the board's clock. Does not know blocks.
//! Source: USB full-speed bulk transfers (frames of 1 ms, about 500 kB/s in practice); UART framing of 10 bits a byte.

use crate::faults::ByteFaults;
use crate::profile::LinkProfile;
use crate::random::Random;
use std::collections::VecDeque;
use units::Hertz;

/// Most bytes under way; what does not fit is lost, as in a driver whose buffer overflows.
pub(crate) const PIPE_BYTES_MAX: usize = 1 << 20;
/// Shortest time from end to end, apart from the sending itself.
const LATENCY_MIN_S: f64 = 0.0005;
/// Additional time, evenly spread by chance.
const LATENCY_SPREAD_S: f64 = 0.0005;
/// The longest stall of a delayed byte.
const STALL_MAX_S: f64 = 0.02;

/// Bytes that arrive together.
#[derive(Clone, Copy, Debug)]
struct Parcel {
    at: u64,
    len: usize,
}

/// One direction of the link.
#[derive(Clone, Debug)]
pub(crate) struct Pipe {
    bytes: VecDeque<u8>,
    parcels: VecDeque<Parcel>,
    /// Bytes that travel as one: a USB packet, or what a UART's receiver hands on at once.
    parcel_bytes_max: usize,
    /// How many bytes the sender's own buffer holds.
    buffer_bytes_max: u64,
    ticks_per_byte: u64,
    latency_min: u64,
    latency_spread: u32,
    stall_max: u32,
    /// When the wire is free again.
    busy_until: u64,
    last_arrival: u64,
    faults: ByteFaults,
    latency: Random,
    chance: Random,
    /// Damaged bytes so far.
    pub(crate) damaged: u64,
}

impl Pipe {
    pub(crate) fn new(
        link: LinkProfile,
        clock: Hertz,
        faults: ByteFaults,
        latency: Random,
        chance: Random,
    ) -> Self {
        let ticks = |seconds: f64| seconds * f64::from(clock.0);
        let (parcel_bytes_max, buffer_bytes_max) = match link {
            LinkProfile::Usb => (64, 512),
            LinkProfile::Uart { .. } => (8, 128),
        };
        Self {
            bytes: VecDeque::new(),
            parcels: VecDeque::new(),
            parcel_bytes_max,
            buffer_bytes_max,
            ticks_per_byte: (ticks(1.0 / link.bytes_per_s()) as u64).max(1),
            latency_min: ticks(LATENCY_MIN_S) as u64,
            latency_spread: ticks(LATENCY_SPREAD_S) as u32,
            stall_max: ticks(STALL_MAX_S) as u32,
            busy_until: 0,
            last_arrival: 0,
            faults,
            latency,
            chance,
            damaged: 0,
        }
    }

    /// Bytes leave the sender now.
    pub(crate) fn send(&mut self, now: u64, bytes: &[u8]) {
        let room = PIPE_BYTES_MAX.saturating_sub(self.bytes.len() + bytes.len());
        if room == 0 {
            return;
        }
        for parcel in bytes.chunks(self.parcel_bytes_max) {
            self.busy_until = self.busy_until.max(now) + parcel.len() as u64 * self.ticks_per_byte;
            let latency = self.latency_min + u64::from(self.latency.below(self.latency_spread));
            let at = (self.busy_until + latency).max(self.last_arrival);
            if self.faults.is_none() {
                self.bytes.extend(parcel);
                self.arrive(at, parcel.len());
            } else {
                self.send_damaged(at, parcel);
            }
        }
    }

    fn arrive(&mut self, at: u64, len: usize) {
        if len > 0 {
            self.parcels.push_back(Parcel { at, len });
        }
        self.last_arrival = at;
    }

    fn send_damaged(&mut self, mut at: u64, parcel: &[u8]) {
        let mut len = 0;
        for &byte in parcel {
            let delay = self.chance.chance(self.faults.delay);
            let drop = self.chance.chance(self.faults.drop);
            let duplicate = self.chance.chance(self.faults.duplicate);
            let corrupt = self.chance.chance(self.faults.corrupt);
            let flip = self.chance.chance(self.faults.flip);
            self.damaged += u64::from(delay | drop | duplicate | corrupt | flip);
            if delay {
                self.arrive(at, len);
                len = 0;
                at += u64::from(self.chance.below(self.stall_max));
            }
            if drop {
                continue;
            }
            let mut byte = byte;
            if corrupt {
                byte ^= 1 + self.chance.below(255) as u8;
            }
            if flip {
                byte ^= 1 << self.chance.below(8);
            }
            let copies = 1 + usize::from(duplicate);
            self.bytes.extend(std::iter::repeat_n(byte, copies));
            len += copies;
        }
        self.arrive(at, len);
    }

    /// When the next bytes arrive.
    pub(crate) fn next_arrival(&self) -> Option<u64> {
        self.parcels.front().map(|parcel| parcel.at)
    }

    /// Takes what has arrived by now.
    pub(crate) fn take(&mut self, now: u64, out: &mut Vec<u8>) {
        while let Some(parcel) = self.parcels.front()
            && parcel.at <= now
        {
            out.extend(self.bytes.drain(..parcel.len));
            self.parcels.pop_front();
        }
    }

    /// Whether the sender's buffer takes so many bytes more.
    pub(crate) fn has_room(&self, now: u64, len: usize) -> bool {
        let waiting = self.busy_until.saturating_sub(now) / self.ticks_per_byte;
        waiting + len as u64 <= self.buffer_bytes_max
    }

    /// All that is under way is lost.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.parcels.clear();
        self.busy_until = 0;
        self.last_arrival = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Source;
    use proptest::prelude::*;

    const CLOCK: Hertz = Hertz(12_000_000);
    const UART: LinkProfile = LinkProfile::Uart { baud: 250_000, receive_window: 192 };

    fn pipe(link: LinkProfile, faults: ByteFaults) -> Pipe {
        Pipe::new(link, CLOCK, faults, Random::new(1, Source::LatencyDown), Random::new(1, Source::LinkDown))
    }

    fn all(pipe: &mut Pipe) -> Vec<u8> {
        let mut out = Vec::new();
        pipe.take(u64::MAX, &mut out);
        out
    }

    #[test]
    fn a_uart_needs_forty_microseconds_a_byte() {
        let mut pipe = pipe(UART, ByteFaults::default());
        pipe.send(0, &[7; 250]);
        let mut last = 0;
        let mut out = Vec::new();
        while let Some(at) = pipe.next_arrival() {
            last = at;
            pipe.take(at, &mut out);
        }
        assert_eq!(out.len(), 250);
        let took_s = last as f64 / 12e6;
        assert!((0.0105..=0.0111).contains(&took_s), "{took_s}");
    }

    #[test]
    fn nothing_arrives_early() {
        let mut pipe = pipe(LinkProfile::Usb, ByteFaults::default());
        pipe.send(1000, b"hello");
        let mut out = Vec::new();
        pipe.take(1000 + 5999, &mut out);
        assert!(out.is_empty());
        pipe.take(1000 + 12_200, &mut out);
        assert_eq!(out, b"hello");
    }

    #[test]
    fn faults_hit_as_often_as_they_say() {
        let hit = |faults| {
            let mut pipe = pipe(LinkProfile::Usb, faults);
            pipe.send(0, &vec![0; 100_000]);
            let hit: Vec<u8> = all(&mut pipe).into_iter().filter(|&byte| byte != 0).collect();
            assert!((850..1150).contains(&hit.len()), "{}", hit.len());
            hit
        };
        let flipped = hit(ByteFaults { flip: 0.01, ..ByteFaults::default() });
        assert!(flipped.iter().all(|byte| byte.is_power_of_two()), "one bit a byte");
        let corrupted = hit(ByteFaults { corrupt: 0.01, ..ByteFaults::default() });
        let bits = corrupted.iter().map(|byte| byte.count_ones()).sum::<u32>() as usize;
        assert!((38..42).contains(&(bits * 10 / corrupted.len())), "any byte: half of its bits");
        let faults = ByteFaults { drop: 0.1, duplicate: 0.02, ..ByteFaults::default() };
        let mut pipe = pipe(LinkProfile::Usb, faults);
        pipe.send(0, &vec![0; 100_000]);
        let got = all(&mut pipe).len();
        assert!((91_000..92_600).contains(&got), "{got}");
    }

    #[test]
    fn a_delay_holds_up_all_that_follows() {
        let mut pipe = pipe(LinkProfile::Usb, ByteFaults { delay: 0.05, ..ByteFaults::default() });
        let sent: Vec<u8> = (0..=255).collect();
        pipe.send(0, &sent);
        let mut late = 0;
        while let Some(at) = pipe.next_arrival() {
            assert!(at >= late);
            late = at;
            let mut out = Vec::new();
            pipe.take(at, &mut out);
        }
        assert!(late > 12_000_000 / 50, "{late}");
    }

    #[test]
    fn what_was_lost_holds_up_nothing() {
        let mut pipe = pipe(UART, ByteFaults::default());
        pipe.send(0, &vec![0; 25_000]);
        pipe.clear();
        pipe.send(12_000, &[1]);
        let at = pipe.next_arrival().unwrap_or(u64::MAX);
        assert!(at < 36_000, "a second's worth of lost bytes lies between: {at}");
    }

    #[test]
    fn a_flood_is_bounded() {
        let mut pipe = pipe(UART, ByteFaults::default());
        for _ in 0..40 {
            pipe.send(0, &vec![0; 100_000]);
        }
        assert!(all(&mut pipe).len() <= PIPE_BYTES_MAX);
    }

    proptest! {
        #[test]
        fn without_faults_bytes_arrive_once_and_in_order(
            pieces in prop::collection::vec((0_u64..100_000, prop::collection::vec(any::<u8>(), 0..200)), 0..20),
        ) {
            let mut pipe = pipe(LinkProfile::Usb, ByteFaults::default());
            let (mut now, mut sent, mut got) = (0, Vec::new(), Vec::new());
            for (wait, piece) in pieces {
                now += wait;
                pipe.send(now, &piece);
                sent.extend(piece);
                pipe.take(now, &mut got);
            }
            pipe.take(u64::MAX, &mut got);
            prop_assert_eq!(sent, got);
        }
    }
}
