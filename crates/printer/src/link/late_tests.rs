//! The link on lines that hold bytes up, alone and together with other damage: what is sent again, and how late a print's
//! messages come.

use wire::block::{BLOCK_BYTES_MAX, Block, SEQUENCE_MASK};

use super::{
    lossy_line::{Conditions, Line},
    tests::{MESSAGE_BYTES, connected, flood, message},
    *,
};

/// A link with full blocks on the way, whose board is played by the test.
struct Played {
    link: Link,
    /// The number that the board expects.
    expected: u8,
    now_s: f64,
    queued: u32,
}

impl Played {
    fn new() -> Self {
        let line = connected(3);
        let mut played =
            Self { link: line.link, expected: line.board.expected, now_s: line.now_s, queued: 0 };
        // A few blocks that are answered at once.
        for _ in 0..20 {
            played.queue_blocks(1);
            played.poll();
            played.now_s += 0.003;
            played.answer_next(0.0);
        }
        played
    }

    fn queue_blocks(&mut self, blocks: usize) {
        for _ in 0..blocks * (BLOCK_BYTES_MAX / MESSAGE_BYTES - 1) {
            self.link.queue(message(Lane::Control, self.queued)).unwrap();
            self.queued += 1;
        }
    }

    /// What is sent now.
    fn poll(&mut self) -> Vec<u8> {
        let mut out = Vec::new();
        self.link.poll(Seconds(self.now_s), Ticks(0), &mut out);
        out
    }

    /// Lets time pass until something is sent.
    fn wait(&mut self) -> Vec<u8> {
        for _ in 0..100 {
            let mut out = Vec::new();
            let wake = self.link.poll(Seconds(self.now_s), Ticks(0), &mut out);
            if !out.is_empty() {
                return out;
            }
            self.now_s = wake.expect("it waits for an answer").0;
        }
        panic!("nothing is sent");
    }

    /// The board says what it expects.
    fn answer(&mut self, after_s: f64) {
        self.now_s += after_s;
        self.link.receive(Block::new(self.expected, &[]).as_bytes(), Seconds(self.now_s), |_| {});
    }

    /// The board takes a block and says so.
    fn answer_next(&mut self, after_s: f64) {
        self.expected = (self.expected + 1) & SEQUENCE_MASK;
        self.answer(after_s);
    }
}

#[test]
fn after_a_time_out_late_answers_do_not_multiply_what_is_on_the_line() {
    for blocks in 1..=WINDOW_BLOCKS_MAX {
        let mut played = Played::new();
        played.queue_blocks(blocks);
        played.poll();
        assert_eq!(played.link.unacknowledged().0, blocks);
        let again = played.wait();
        assert!(again.len() <= BLOCK_BYTES_MAX + 1, "one block asks: {} bytes", again.len());
        // All had arrived: their answers were only held up, and behind them comes the one to the repetition.
        let mut sent = Vec::new();
        for _ in 0..blocks {
            played.answer_next(0.001);
            played.queue_blocks(1);
            sent.extend(played.poll());
        }
        played.answer(0.001);
        sent.extend(played.poll());
        for _ in 0..blocks {
            played.answer_next(0.003);
            sent.extend(played.poll());
        }
        let stats = played.link.stats();
        assert_eq!((stats.retransmissions, stats.timeouts), (1, 1), "{blocks} blocks");
        assert!(played.link.is_idle());
    }
}

#[test]
fn after_two_time_outs_enough_is_sent_to_end_what_the_board_takes_for_a_block_and_late_answers_still_do_no_harm()
 {
    let mut played = Played::new();
    played.queue_blocks(4);
    played.poll();
    let (first, second) = (played.wait(), played.wait());
    assert_eq!(second.len(), first.len() + BLOCK_BYTES_MAX);
    let mut deframer = Deframer::new();
    let (mut blocks, mut garbage) = (0, 0);
    deframer.push(&[BLOCK_BYTES_MAX as u8, 0x10], |_| unreachable!("a block seems to begin"));
    deframer.push(&second, |frame| match frame {
        Frame::Block { .. } => blocks += 1,
        Frame::Garbage => garbage += 1,
    });
    assert_eq!((blocks, garbage), (1, 1), "the block is found behind it");
    let mut sent = Vec::new();
    for _ in 0..4 {
        played.answer_next(0.001);
        played.queue_blocks(1);
        sent.extend(played.poll());
    }
    // The answers to both repetitions and to what the board took for noise.
    for _ in 0..3 {
        played.answer(0.001);
        sent.extend(played.poll());
    }
    for _ in 0..4 {
        played.answer_next(0.003);
        sent.extend(played.poll());
    }
    assert_eq!(played.link.stats().retransmissions, 2);
    assert!(played.link.is_idle());
}

#[test]
fn after_a_time_out_a_refusal_has_all_that_was_lost_sent_again() {
    let mut played = Played::new();
    played.queue_blocks(5);
    played.poll();
    // The first is lost, and so are the answers to the others.
    played.wait();
    played.answer_next(0.003);
    played.queue_blocks(1);
    played.poll();
    played.answer(0.003);
    let again = played.poll();
    assert!(again.len() > 4 * (BLOCK_BYTES_MAX - MESSAGE_BYTES), "{} bytes", again.len());
    for _ in 0..5 {
        played.answer_next(0.003);
    }
    assert!(played.link.is_idle());
    assert_eq!(played.link.stats().retransmissions, 2);
}

#[test]
fn after_a_time_out_what_was_lost_is_found_even_where_nothing_new_is_to_be_sent() {
    let mut played = Played::new();
    played.queue_blocks(3);
    played.poll();
    let start_s = played.now_s;
    for _ in 0..3 {
        played.wait();
        played.answer_next(0.003);
    }
    assert!(played.link.is_idle());
    assert!(played.now_s - start_s < 0.1, "{} s", played.now_s - start_s);
}

#[test]
fn answers_that_a_damaged_length_has_swallowed_are_found_with_the_next_one() {
    let mut played = Played::new();
    played.queue_blocks(3);
    played.poll();
    let mut damaged = Block::new((played.expected + 1) & SEQUENCE_MASK, &[]).as_bytes().to_vec();
    damaged[0] = BLOCK_BYTES_MAX as u8;
    played.link.receive(&damaged, Seconds(played.now_s), |_| {});
    played.expected = (played.expected + 1) & SEQUENCE_MASK;
    played.answer_next(0.001);
    played.answer_next(0.001);
    assert_eq!(played.link.unacknowledged().0, 3, "they wait for the end of a block that is none");
    played.wait();
    played.answer(0.003);
    assert!(played.link.is_idle());
    assert_eq!(played.link.stats().retransmissions, 1);
}

#[test]
fn a_line_that_only_holds_bytes_up_is_not_filled_with_repetitions() {
    // It answers within 3 ms as long as it is idle, and a window of blocks takes it ten times as long and more.
    const LINES: u32 = 50;
    for base in [Conditions::USB, Conditions::UART] {
        let (mut sum, mut slowest) = (0.0, f64::INFINITY);
        for seed in 0..LINES {
            let mut line = Line::new(Conditions { stall: 0.01, ..base }, u64::from(seed));
            idle(&mut line, 2.0);
            let before = line.link.stats();
            slowest = flood(&mut line, 2400).min(slowest);
            let after = line.link.stats();
            let again = (after.bytes_retransmitted - before.bytes_retransmitted) as f64;
            sum += again / ((after.bytes_sent - before.bytes_sent) as f64 - again);
        }
        let mean = sum / f64::from(LINES);
        assert!(mean < 0.03, "{mean:.3} of all bytes are sent again");
        assert!(slowest > 6000.0, "{slowest:.0} bytes a second");
    }
}

/// A message now and then, so that the line's usual times are known.
fn idle(line: &mut Line, lasts_s: f64) {
    let until_s = line.now_s + lasts_s;
    for number in 0.. {
        if line.now_s >= until_s {
            break;
        }
        line.link.queue(message(Lane::Control, number)).unwrap();
        let next_s = line.now_s + 0.1;
        line.run(next_s, |_| false);
    }
    line.board.taken.clear();
}

/// Sends a full block's messages as often as a print does, after a time of few; gives the longest time to the board.
fn late_s_max(line: &mut Line) -> f64 {
    const BYTES_PER_S: f64 = 3000.0;
    const BLOCKS: u32 = 200;
    const MESSAGES: u32 = 8;
    idle(line, 2.0);
    let start_s = line.now_s;
    let queued_s = |block: u32| start_s + f64::from(block * MESSAGES) * MESSAGE_BYTES as f64 / BYTES_PER_S;
    for block in 0..BLOCKS {
        line.run(queued_s(block), |_| false);
        for number in 0..MESSAGES {
            line.link.queue(message(Lane::Control, block * MESSAGES + number)).unwrap();
        }
    }
    let end_s = line.now_s + 60.0;
    assert!(line.run(end_s, |line| line.link.is_idle()), "{:?}", line.link.stats());
    let mut late_s_max = 0.0_f64;
    for (taken_s, payload) in &line.board.taken {
        for message in payload.chunks(MESSAGE_BYTES) {
            let number = u32::from_le_bytes(message[..4].try_into().unwrap());
            late_s_max = late_s_max.max(taken_s - queued_s(number / MESSAGES));
        }
    }
    late_s_max
}

#[test]
fn a_print_gets_its_messages_in_time_whatever_the_line_does_to_them() {
    let clean = Conditions { stall: 0.0, ..Conditions::USB };
    let damages = [
        Conditions { corrupt: 0.01, ..clean },
        Conditions { drop: 0.01, ..clean },
        Conditions { stall: 0.01, ..clean },
        Conditions { corrupt: 0.005, stall: 0.005, ..clean },
        Conditions { corrupt: 0.003, drop: 0.003, duplicate: 0.003, stall: 0.003, ..clean },
    ];
    for damage in damages {
        for (base, window) in [(Conditions::USB, usize::MAX), (Conditions::UART, 192)] {
            let Conditions { latency_s, bytes_per_s, .. } = base;
            for seed in 0..12 {
                let mut line = Line::new(Conditions { latency_s, bytes_per_s, ..damage }, seed);
                line.link.set_receive_window(window);
                let late_s = late_s_max(&mut line);
                assert!(late_s < 0.25, "{late_s:.3} s late: {damage:?}, {window} bytes, seed {seed}");
            }
        }
    }
}
