//! What is written is what is read, whatever becomes of it in between.

use super::*;
use proptest::prelude::*;

fn began() -> Record {
    Record::Began {
        format: FORMAT,
        print: 7,
        machine: 1,
        clock: 12_000_000,
        position: [0.1 + 0.2, 1.0 / 3.0, f64::MIN_POSITIVE, 4.0],
        homed: [true, false, true],
        transform: TransformRecord {
            skew: crate::transform::Skew { xy: 0.1 + 0.2, xz: -1.0 / 3.0, yz: 0.0 },
            mesh: Some("cold bed".into()),
        },
        confirmed: [3, 9].into(),
        confirm_all: false,
        start_line: None,
    }
}

fn written(records: &[Record]) -> String {
    let mut writer = Writer::default();
    for record in records {
        writer.write(record);
    }
    writer.take()
}

#[test]
fn what_was_written_is_read_to_the_last_bit() {
    let at = Place { items: 12, drained: Some(345) };
    let from = [RowPlace { done: 1, left: 2 }; MOTORS];
    let dropped = Dropped { received: 7, done: 5, left: 3, dir: true, position: -77, crc: u32::MAX };
    let records = [
        began(),
        Record::Input { at, input: Input::Speed(0.1 + 0.7) },
        Record::Input { at, input: Input::FinishRun },
        Record::Run { id: 8, run: 1, start: u32::MAX, from },
        Record::Continued { inputs: 1 },
        Record::Input { at, input: Input::Target(HeaterName::Bed, 60.5) },
        Record::Parked(Parked {
            id: 9,
            of: 8,
            is_cut: true,
            motors: [dropped; MOTORS],
            rest: 3,
            retract: 0.1 + 0.2,
        }),
        Record::Progress { line: 77, elapsed: 1.5 },
        Record::Off([0.1 + 0.2, 0.0, -1.0 / 3.0]),
    ];
    let text = written(&records);
    let journal = Journal::read(text.as_bytes()).unwrap();
    assert_eq!(journal.off_mm, [0.1 + 0.2, 0.0, -1.0 / 3.0]);
    assert_eq!(
        journal.position.map(f64::to_bits),
        [0.1 + 0.2, 1.0 / 3.0, f64::MIN_POSITIVE, 4.0].map(f64::to_bits)
    );
    assert_eq!(journal.inputs, [(at, Input::Speed(0.1 + 0.7)), (at, Input::Target(HeaterName::Bed, 60.5))]);
    assert!(journal.knows(8) && journal.knows(9) && !journal.knows(7) && !journal.has_ended);
    let board = BoardQueue { id: 9, ..BoardQueue::default() };
    let (queue, parked) = journal.unparked(board);
    assert_eq!((queue.id, queue.is_held, queue.motors[2].left), (8, true, 3));
    assert_eq!((parked.unwrap().retract.to_bits(), journal.last_id), ((0.1_f64 + 0.2).to_bits(), 9));
    assert_eq!(journal.unparked(queue), (queue, None));
    assert_eq!((journal.progress, journal.bytes), (Some((77, Seconds(1.5))), text.len()));
    assert!(Journal::read((text + &written(&[Record::Ended])).as_bytes()).unwrap().has_ended);
}

#[test]
fn what_is_none_of_ours_is_refused() {
    let mut other = began();
    if let Record::Began { format, .. } = &mut other {
        *format = FORMAT + 1;
    }
    let other = written(&[other]);
    assert_eq!(Journal::read(other.as_bytes()), Err(JournalError::Format(FORMAT + 1)));
    for bytes in [&b""[..], b"\n", b"00000000 {}\n", written(&[Record::Ended]).as_bytes()] {
        assert_eq!(Journal::read(bytes), Err(JournalError::NoBegin));
    }
    // Two prints in one journal are none.
    assert!(Journal::read(written(&[began(), began()]).as_bytes()).unwrap().has_ended);
}

#[test]
fn a_writer_that_nobody_reads_stops_and_says_no_more() {
    let mut writer = Writer::default();
    (0..100_000).for_each(|line| writer.write(&Record::Progress { line, elapsed: 0.0 }));
    assert!(writer.take().len() <= PENDING_BYTES_MAX);
    writer.write(&Record::Ended);
    assert_eq!(writer.take(), "");
}

proptest! {
    #[test]
    fn damage_never_adds_anything(flips in prop::collection::vec((0..600_usize, 1..=255_u8), 1..4)) {
        let records = [
            began(),
            Record::Run { id: 8, run: 1, start: 5, from: [RowPlace::default(); MOTORS] },
            Record::Progress { line: 1, elapsed: 1.0 },
            Record::Ended,
        ];
        let mut bytes = written(&records).into_bytes();
        for (at, mask) in flips {
            let len = bytes.len();
            bytes[at % len] ^= mask;
        }
        // It is what was written up to the damage.
        if let Ok(journal) = Journal::read(&bytes) {
            let whole = |count: usize| Journal::read(written(&records[..count]).as_bytes()).unwrap();
            prop_assert!((1..=4).any(|count| whole(count) == journal));
        }
    }

    #[test]
    fn anything_can_be_read(bytes: Vec<u8>) {
        drop(Journal::read(&bytes));
    }
}
