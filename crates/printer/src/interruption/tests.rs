use super::*;
use crate::{
    config::MotorConfig,
    journal::{FORMAT, HeaterName, Height, Input, Place, Record, Writer, machine_check},
};

const MACHINE: &str = include_str!("../../../../samples/printer.cfg");
/// Four microsteps of the sample's Z are 0.01 mm, a full step is 0.04 mm, four of them 0.16 mm.
const STEP_MM: f64 = 0.0025;

const FILE: &str = "G28\nM83\nG1 Z0.2 F600\n;LAYER_CHANGE\nG1 X10 Y10 F6000\nG1 X50 E2 F1200\nG1 Y50 E2\n\
    ;LAYER_CHANGE\nG1 Z0.4 F600\nG1 X10 E2 F1200\nG2 X10 Y50 I20 J0 E4\nG1 X12 E2 F60\nG1 X100 E9\n\
    ;LAYER_CHANGE\nG1 Z0.6\nG1 X10 E9\n";

fn config() -> PrinterConfig {
    crate::config::parse(MACHINE).0.unwrap()
}

fn journal(start_line: Option<u32>, records: &[Record]) -> Journal {
    journal_of(&config(), crate::transform::TransformRecord::default(), start_line, records)
}

fn journal_of(
    config: &PrinterConfig,
    transform: crate::transform::TransformRecord,
    start_line: Option<u32>,
    records: &[Record],
) -> Journal {
    let mut writer = Writer::default();
    writer.write(&Record::Began {
        format: FORMAT,
        print: 7,
        machine: machine_check(config),
        clock: 12_000_000,
        position: [0.0; 4],
        homed: [false; 3],
        transform,
        confirmed: [].into(),
        confirm_all: false,
        start_line,
    });
    for record in records {
        writer.write(record);
    }
    Journal::read(writer.take().as_bytes()).unwrap()
}

fn height(z: f64, count: i32, by: MovedBy) -> Height {
    Height { z, count, since_power_up: true, by }
}

fn at(line: u32) -> [Record; 2] {
    [Record::Height(height(5.0, 2000, MovedBy::File)), Record::Progress { line, elapsed: 12.5 }]
}

fn surveyed(journal: Journal) -> Result<Interruption, PrinterError> {
    surveyed_of(&config(), FILE, journal)
}

fn surveyed_of(config: &PrinterConfig, file: &str, journal: Journal) -> Result<Interruption, PrinterError> {
    let mut survey = Survey::new(config, journal)?;
    // In small pieces, as from a disk.
    for piece in file.as_bytes().chunks(7) {
        if survey.wants() == 0 {
            break;
        }
        assert_eq!(survey.report(), None);
        survey.feed(piece);
        while survey.advance()? {}
    }
    survey.end();
    while survey.advance()? {}
    Ok(survey.report().unwrap())
}

#[test]
fn line_and_layer_are_told() {
    let layers =
        [(6, 1, 0.2, 1), (7, 1, 0.2, 1), (9, 1, 0.2, 1), (10, 2, 0.4, 8), (12, 2, 0.4, 8), (16, 3, 0.6, 14)];
    for (line, layer, z, first) in layers {
        let found = surveyed(journal(None, &at(line))).unwrap();
        assert_eq!((found.line, found.start_line), (line, line + 1));
        if line != 9 {
            assert_eq!((found.layer, found.layer_z, found.layer_line), (layer, Mm(z), first), "{line}");
        }
        assert_eq!(found.elapsed, Seconds(12.5));
    }
    // Of an arc only a piece is known to have been made.
    let found = surveyed(journal(None, &at(11))).unwrap();
    assert_eq!((found.line, found.start_line), (11, 11));
    let found = surveyed(journal(Some(10), &[])).unwrap();
    assert_eq!((found.line, found.start_line), (9, 10));
    // Of a print that was begun with a line it is none before.
    let found = surveyed(journal(Some(10), &at(12))).unwrap();
    assert_eq!((found.line, found.position), (12, [Mm(12.0), Mm(50.0), Mm(0.4)]));
}

/// Of a line over a mesh only the first of many pieces is known to have been made.
#[test]
fn a_move_in_pieces_may_have_been_made_in_part() {
    const BED: &str = "\n[bed_mesh]\n[bed_mesh cold]\npoints:\n  0.2, 0.1, 0.0\n  0.1, 0.0, 0.1\n  -0.1, 0.0, 0.3\n\
        x_count: 3\ny_count: 3\nmin_x: 0\nmax_x: 100\nmin_y: 0\nmax_y: 100\n";
    const LONG: &str =
        "G28\nM83\nG1 Z1 F600\nG1 X10 Y10 F6000\nG1 X190 E9 F1200\nG1 X10 E9\nG1 E-1\nG1 Y90 E4 F60\n";
    let config = crate::config::parse(&format!("{MACHINE}{BED}"));
    let config = config.0.unwrap_or_else(|| panic!("{:?}", config.1));
    let mesh = || crate::transform::TransformRecord { mesh: Some("cold".into()), ..Default::default() };
    let found = |transform, start_line, records: &[Record]| {
        surveyed_of(&config, LONG, journal_of(&config, transform, start_line, records)).unwrap()
    };
    let long = found(mesh(), None, &at(5));
    assert_eq!((long.line, long.start_line), (5, 5));
    assert_eq!(long.transform, mesh());
    let [low, high] = long.z_range.unwrap();
    assert!(low <= Mm(0.9) && high >= Mm(1.3), "{low} {high}");
    // The last of the file: what is behind it says nothing of Z.
    let last = found(mesh(), None, &at(8));
    assert_eq!((last.line, last.start_line), (8, 8));
    let [low, high] = last.z_range.unwrap();
    assert!(low <= Mm(0.9) && high >= Mm(1.3), "{low} {high}");
    // Filament alone is one piece, and so is every line over no mesh.
    assert_eq!(found(mesh(), None, &at(7)).start_line, 8);
    let none = crate::transform::TransformRecord::default();
    assert_eq!(found(none, None, &at(5)).start_line, 6);
    // What was passed over was not made in part.
    assert_eq!(found(mesh(), Some(6), &[]).start_line, 6);
}

#[test]
fn z_may_be_anywhere_that_it_can_have_got_to() {
    // The next lines take longer than anything can have gone on.
    let found = surveyed(journal(None, &at(12))).unwrap();
    assert_eq!((found.z_range, found.reach_line), (Some([Mm(0.4), Mm(0.4)]), 13));
    // The next layer may have begun.
    let found = surveyed(journal(None, &at(6))).unwrap();
    assert_eq!((found.z_range, found.reach_line), (Some([Mm(0.2), Mm(0.4)]), 10));
    // Where the user has doubled the speed, it may have got further.
    let faster = Record::Input { at: Place::default(), input: Input::Speed(2.0) };
    let found = surveyed(journal(None, &[faster, at(6)[0].clone(), at(6)[1].clone()])).unwrap();
    assert_eq!((found.reach_line, found.factors), (11, [2.0, 1.0]));
    // Moved by hand in a pause, and at rest again.
    for (by, range) in [(MovedBy::Others, None), (MovedBy::Nobody, Some([Mm(30.0), Mm(30.0)]))] {
        let mut records = at(12).to_vec();
        records.push(Record::Height(height(30.0, 12_000, by)));
        let found = surveyed(journal(None, &records)).unwrap();
        assert_eq!(found.z_range, range);
        assert_eq!(found.standings.places.is_empty(), range.is_none());
    }
}

#[test]
fn what_does_not_belong_to_it_is_refused() {
    let ended = journal(None, &[Record::Ended]);
    assert_eq!(Survey::new(&config(), ended).err().unwrap().code, ErrorCode::ContinuationRefused);
    let mut other = config();
    other.steppers[2].position_max = Mm(111.0);
    let error = Survey::new(&other, journal(None, &[])).err().unwrap();
    assert_eq!(error.code, ErrorCode::ContinuationRefused);
    let beyond = Record::Progress { line: 99, elapsed: 1.0 };
    assert_eq!(surveyed(journal(None, &[beyond])).unwrap_err().code, ErrorCode::InvalidGcode);
    // One without a word of where it was is at its beginning.
    let target = Record::Input { at: Place::default(), input: Input::Target(HeaterName::Bed, 60.0) };
    let found = surveyed(journal(None, &[target])).unwrap();
    assert_eq!((found.line, found.start_line, found.layer), (0, 1, 1));
    assert!(found.standings.places.is_empty());
}

fn motor() -> MotorConfig {
    config().steppers[2].motor.clone()
}

/// Where a motor stands once it has current again, in mm: it falls to `rest` (microsteps) first.
fn pulled(count: f64, z: f64, rest: f64) -> Vec<f64> {
    let period = rest / 64.0;
    let places = if (period - period.floor() - 0.5).abs() < 1e-9 {
        vec![period.floor(), period.ceil()]
    } else {
        vec![period.round()]
    };
    places.into_iter().map(|place| z + (place * 64.0 - count) * STEP_MM).collect()
}

#[test]
fn every_place_that_the_rotor_may_be_pulled_to_is_told_and_few_others() {
    let mut alone = 0;
    for count in -200..200_i32 {
        let z = 12.34;
        let standings = Standings::new(&motor(), Some(height(z, count, MovedBy::File)), Some([z, z]));
        assert!((standings.pitch.0 - 0.16).abs() < 1e-12 && standings.error.0 < 0.01);
        assert!((1..=2).contains(&standings.places.len()));
        alone += u32::from(standings.places.len() == 1);
        // It stays, or falls to the nearest full step, from up to a sixth of a full step away.
        for lag in [-2.5, 0.0, 2.5] {
            let at = f64::from(count) + lag;
            let detents = [(at / 16.0).floor() * 16.0, (at / 16.0).ceil() * 16.0];
            let near = detents.into_iter().filter(|detent| (detent - at).abs() <= 8.0);
            for place in near.chain([at]).flat_map(|rest| pulled(f64::from(count), z, rest)) {
                let told = standings.places.iter().any(|told| (told.0 - place).abs() < 1e-9);
                assert!(told, "{count} {lag}: {place} is none of {:?}", standings.places);
            }
        }
        let nearest = standings.places.iter().map(|place| (place.0 - z).abs()).fold(1.0, f64::min);
        assert!((standings.places[0].0 - z).abs() <= nearest + 1e-9);
        assert!(standings.places.iter().all(|place| (place.0 - z).abs() <= 2.7 * 16.0 * STEP_MM));
    }
    // In two of three cases there is no doubt.
    assert!((250..300).contains(&alone), "{alone}");
}

#[test]
fn doubt_is_not_hidden() {
    let at = |since_power_up, by, range| {
        let height = Height { z: 1.0, count: 400, since_power_up, by };
        Standings::new(&motor(), Some(height), range)
    };
    for standings in [
        at(false, MovedBy::File, Some([1.0, 1.0])),
        at(true, MovedBy::Others, Some([1.0, 1.0])),
        at(true, MovedBy::File, None),
        at(true, MovedBy::File, Some([1.0, f64::NAN])),
        Standings::new(&motor(), None, Some([1.0, 1.0])),
    ] {
        assert!(standings.places.is_empty());
        assert!((standings.error.0 - 2.7 * 0.04).abs() < 1e-9);
    }
    // Over a hop there are several places, at most the bound.
    let hop = at(true, MovedBy::File, Some([1.0, 1.4]));
    assert!((3..=5).contains(&hop.places.len()), "{hop:?}");
    // Where there are too many, those from the middle are told.
    let far = at(true, MovedBy::File, Some([1.0, 51.0]));
    assert_eq!(far.places.len(), STANDINGS_MAX);
    assert!(far.places.iter().all(|place| (place.0 - 26.0).abs() < 0.16 * 4.5), "{far:?}");
    let on_grid = |place: &Mm| {
        (((place.0 - hop.places[0].0) / 0.16).round() * 0.16 + hop.places[0].0 - place.0).abs() < 1e-9
    };
    assert!(far.places.iter().all(on_grid));
}
