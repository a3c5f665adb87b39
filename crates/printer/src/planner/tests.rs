//! What comes out of a plan, and when.

use gcode::{Heater, Wait};
use steps::StepCommandKind;
use units::Celsius;

use super::*;
use crate::{config, machine::MOTORS};

pub(super) const CLOCK: Hertz = Hertz(12_000_000);

pub(super) fn machine_file() -> PrinterConfig {
    let text = include_str!("../../../../samples/printer.cfg");
    config::parse(text).0.expect("the sample machine")
}

/// A planner that is homed and hot.
pub(super) fn planner() -> (Planner, Source) {
    let mut planner = Planner::new(&machine_file(), CLOCK).unwrap();
    (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
    planner.guard.extrusion = ExtrusionPermit::Allowed;
    let mut source = Source::default();
    planner.begin_job(&mut source);
    (planner, source)
}

pub(super) fn feed(source: &mut Source, text: &str) {
    source.feed(text.as_bytes());
    source.end();
}

/// Everything but steps, up to the end or the first error.
pub(super) fn items(planner: &mut Planner, source: &mut Source) -> Vec<Planned> {
    let mut items = Vec::new();
    loop {
        match planner.next(source).unwrap() {
            Planned::Steps(_) => {}
            end @ (Planned::EndOfSource | Planned::NeedsInput) => {
                items.push(end);
                return items;
            }
            item => items.push(item),
        }
    }
}

pub(super) fn plan(text: &str) -> Vec<Planned> {
    let (mut planner, mut source) = planner();
    feed(&mut source, text);
    items(&mut planner, &mut source)
}

pub(super) fn moves(items: &[Planned]) -> Vec<PlannedMove> {
    items
        .iter()
        .filter_map(|item| if let Planned::Move(mv, _) = item { Some(mv.clone()) } else { None })
        .collect()
}

fn timed(items: &[Planned]) -> Vec<(f64, u32, TimedAction)> {
    let timed = |item: &Planned| match item {
        Planned::Timed { at, line, action } => Some((at.0, line.0, action.clone())),
        _ => None,
    };
    items.iter().filter_map(timed).collect()
}

fn fan(speed: f64) -> TimedAction {
    TimedAction::Fan { index: 0, speed }
}

#[test]
fn what_happens_on_the_way_happens_at_the_end_of_the_move_before() {
    let items = plan("M106 S255\nG1 X10 F600\nM107\nG1 X20\nG1 X20\nM104 S5\nG1 X30\nM106 S51\n");
    let made = moves(&items);
    let ends: Vec<f64> = made.iter().map(PlannedMove::end_time).collect();
    let heat = TimedAction::SetTemperature { heater: Heater::Tool(0), target: Celsius(5.0) };
    assert_eq!(
        timed(&items),
        [(0.0, 1, fan(1.0)), (ends[0], 3, fan(0.0)), (ends[1], 6, heat), (ends[2], 8, fan(0.2))]
    );
    // The moves go on through all of it.
    assert!(made[1].start_velocity > 9.0);
    assert_eq!(items.iter().filter(|item| matches!(item, Planned::RunStarted(_))).count(), 1);
}

#[test]
fn what_comes_after_a_dwell_happens_after_it() {
    let items = plan("G1 X10 F600\nG4 P500\nM106\nG1 X20\nM107\nG4 S1\n");
    let made = moves(&items);
    assert!((made[1].start_time - made[0].end_time() - 0.5).abs() < 1e-9);
    assert_eq!(timed(&items), [(made[1].start_time, 3, fan(1.0)), (made[1].end_time(), 5, fan(0.0))]);
    let Some(Planned::RunEnded(end)) = items.get(items.len() - 2) else { panic!("{items:?}") };
    assert!((end.0 - made[1].end_time() - 1.0).abs() < 1e-9);
}

#[test]
fn a_long_dwell_and_one_at_rest_are_barriers() {
    for text in ["G4 P500\n", "G1 X1 F600\nG4 S3\nG1 X2\n"] {
        let items = plan(text);
        let at = items.iter().position(|item| matches!(item, Planned::Barrier { .. })).unwrap();
        assert!(matches!(items[at], Planned::Barrier { barrier: Barrier::Dwell(_), .. }));
        assert!(at == 0 || matches!(items[at - 1], Planned::RunEnded(_)));
    }
}

#[test]
fn barriers_come_at_rest_and_before_what_follows() {
    for (line, barrier) in [
        ("G28 X", Barrier::Home([true, false, false])),
        ("M400", Barrier::WaitForMoves),
        ("M84 X", Barrier::MotorsOff([true, false, false, false])),
        ("M112", Barrier::EmergencyStop),
        (
            "M109 S50",
            Barrier::WaitTemperature {
                heater: Heater::Tool(0),
                target: Celsius(50.0),
                wait: Wait::UntilHeated,
            },
        ),
    ] {
        let items = plan(&format!("G1 X10 F6000\n{line}\nG1 X20\n"));
        let kinds: Vec<&Planned> = items.iter().filter(|item| !matches!(item, Planned::Move(..))).collect();
        let [
            Planned::RunStarted(_),
            Planned::RunEnded(_),
            Planned::Barrier { line: at, barrier: found },
            Planned::RunStarted(from),
            Planned::RunEnded(_),
            Planned::EndOfSource,
        ] = kinds[..]
        else {
            panic!("{items:#?}")
        };
        assert_eq!((at.0, found, from[0]), (2, &barrier, 10.0));
        assert_eq!(moves(&items)[0].end_velocity, 0.0);
    }
}

#[test]
fn a_file_may_ask_for_less_than_the_machine_allows_but_not_for_more() {
    let accel = |text: &str| {
        let (mut planner, mut source) = planner();
        feed(&mut source, &format!("{text}\nG1 X100 F6000\n"));
        moves(&items(&mut planner, &mut source))[0].accel
    };
    assert_eq!(accel("M204 S500"), 500.0);
    assert_eq!(accel("M204 S50000"), 3000.0);
    assert_eq!(accel("SET_VELOCITY_LIMIT ACCEL=700\nM204 S800"), 800.0);
    let speed = |text: &str| {
        let (mut planner, mut source) = planner();
        feed(&mut source, &format!("{text}\nG1 X250 F60000\n"));
        moves(&items(&mut planner, &mut source))[0].cruise_velocity
    };
    assert_eq!(speed("SET_VELOCITY_LIMIT VELOCITY=50"), 50.0);
    assert_eq!(speed("SET_VELOCITY_LIMIT VELOCITY=5000"), 300.0);
    // The next job begins with the machine file's limits.
    let (mut planner, mut source) = planner();
    feed(&mut source, "M204 S100\nG1 X1\n");
    items(&mut planner, &mut source);
    let mut next = Source::default();
    planner.begin_job(&mut next);
    feed(&mut next, "G1 X100 F6000\n");
    assert_eq!(moves(&items(&mut planner, &mut next))[0].accel, 3000.0);
}

#[test]
fn a_refused_move_is_not_where_the_next_one_starts() {
    let (mut planner, mut source) = planner();
    source.feed(b"G1 X10 F600\nG1 X1000\nG1 Y10\n");
    let error = loop {
        match planner.next(&mut source) {
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert_eq!((error.code, error.line), (ErrorCode::MoveOutOfRange, Some(2)));
    // Even where nobody corrects the source, the way there is judged from where the machine is.
    let error = planner.next(&mut source).unwrap_err();
    assert_eq!((error.code, error.line), (ErrorCode::MoveOutOfRange, Some(3)));
    planner.correct(&mut source);
    source.feed(b"G1 Y20\n");
    source.end();
    items(&mut planner, &mut source);
    assert_eq!(planner.position(), [10.0, 20.0, 0.0, 0.0]);
}

#[test]
fn other_fans_are_said_once_and_pressure_advance_is_applied_without_a_word() {
    let items = plan("M106 P1 S255\nM106 P2\nM900 K0.04\nM900 K0.05\nSET_PRESSURE_ADVANCE ADVANCE=0.1\n");
    let notices: Vec<u32> = items
        .iter()
        .filter_map(|item| if let Planned::Notice(said) = item { Some(said.line.0) } else { None })
        .collect();
    assert_eq!(notices, [1]);
    assert_eq!(timed(&items), []);
}

/// Where the extruder's motor has been pushed farthest and where it ends, in steps; and how many runs there were.
fn filament(gcode: &str) -> (i64, i64, usize) {
    let (mut planner, mut source) = planner();
    feed(&mut source, gcode);
    let (mut at, mut most, mut sign, mut runs) = (0, 0, 1, 0);
    loop {
        match planner.next(&mut source).unwrap() {
            Planned::Steps(command) if command.motor == EXTRUDER => match command.kind {
                StepCommandKind::SetDir { forward } => sign = if forward { 1 } else { -1 },
                StepCommandKind::QueueStep { count, .. } => at += sign * i64::from(count),
            },
            Planned::RunEnded(_) => runs += 1,
            Planned::EndOfSource => return (most, at, runs),
            _ => {}
        }
        most = most.max(at);
    }
}

#[test]
fn pressure_advance_holds_from_its_line_on_and_begins_and_ends_at_rest() {
    // 1 mm of filament on 20 mm at 100 mm/s: 5 mm/s of filament.
    let draw = "G1 X20 E1 F6000\nG1 X40 E2\nG1 X60 E3\n";
    let (plain, end, runs) = filament(draw);
    assert_eq!((plain, runs), (end, 1));
    let (ahead, advanced_end, runs) = filament(&format!("M900 K0.04\n{draw}"));
    assert_eq!((advanced_end, runs), (end, 1));
    assert!(ahead > end + 5, "it must come back from {ahead} to {end}");
    // From one advance to another nothing stops; to none and back, or to another smooth time, it does.
    let changed =
        |line: &str| filament(&format!("M900 K0.01\nG1 X20 E1 F6000\n{line}\nG1 X40 E2\nG1 X60 E3\n"));
    let (more, changed_end, runs) = changed("SET_PRESSURE_ADVANCE ADVANCE=0.04");
    assert_eq!((more, changed_end, runs), (ahead, end, 1));
    assert_eq!(changed("M900 K0"), (end, end, 2));
    assert_eq!(changed("SET_PRESSURE_ADVANCE SMOOTH_TIME=0.02").2, 2);
    assert_eq!(changed("SET_INPUT_SHAPER SHAPER_FREQ_X=50 SHAPER_TYPE=ei").2, 2);
}

#[test]
fn every_step_of_a_run_comes_before_its_end() {
    let (mut planner, mut source) = planner();
    feed(&mut source, "G1 X10 Y5 F3000\nG1 X0 Y0\n");
    let (mut steps, mut ended) = ([0_i64; MOTORS], false);
    let mut forward = [true; MOTORS];
    loop {
        match planner.next(&mut source).unwrap() {
            Planned::Steps(command) => {
                assert!(!ended);
                match command.kind {
                    StepCommandKind::SetDir { forward: way } => forward[command.motor] = way,
                    StepCommandKind::QueueStep { count, .. } => {
                        steps[command.motor] +=
                            i64::from(count) * if forward[command.motor] { 1 } else { -1 };
                    }
                }
            }
            Planned::RunEnded(_) => ended = true,
            Planned::EndOfSource => break,
            _ => {}
        }
    }
    assert!(ended);
    assert_eq!(steps, [0; MOTORS]);
    assert_eq!(planner.generator().stats()[0].steps, 2 * 800);
}

#[test]
fn a_plan_retracts_as_the_machine_file_says() {
    let filament_mm = |length: f64| {
        let mut config = machine_file();
        config.firmware_retraction.as_mut().expect("the sample has it").retract_length = units::Mm(length);
        let mut plan = PlanStream::new(&config).unwrap();
        let mut blocks = Vec::new();
        plan.feed(b"G28\nG10\nG1 X10 F3000\n", &mut blocks, |_| {}).unwrap();
        plan.finish(&mut blocks, |_| {}).unwrap().filament_mm
    };
    assert!((filament_mm(0.8) + 0.8).abs() < 0.01);
    assert!((filament_mm(2.0) + 2.0).abs() < 0.01);
}

#[test]
fn what_a_factor_makes_too_fast_for_a_motor_is_slowed_down_and_what_the_file_asks_is_refused() {
    // 2257 steps/mm of filament: with pulses of 2 µs 110 mm/s are the most.
    let text = include_str!("../../../../samples/printer.cfg");
    let fine = text.replacen("rotation_distance: 22.6789511", "rotation_distance: 1.41743444", 1);
    assert_ne!(fine, text, "the sample machine's extruder");
    let config = config::parse(&fine).0.unwrap();
    let slowest = StepRates::new(&config, CLOCK).slowed([0.0; 4], [0.0, 0.0, 0.0, 1.0], MmPerS(1e9));
    let plan = |factors: &str, feed_mm_min: u32| {
        let mut planner = Planner::new(&config, CLOCK).unwrap();
        (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
        planner.guard.extrusion = ExtrusionPermit::Allowed;
        let mut source = Source::default();
        planner.begin_job(&mut source);
        feed(&mut source, &format!("M83\n{factors}\nG1 X100 E75 F{feed_mm_min}\n"));
        let mut items = Vec::new();
        loop {
            match planner.next(&mut source) {
                Ok(Planned::EndOfSource) => return Ok(items),
                Ok(item) => items.push(item),
                Err(error) => return Err(error.code),
            }
        }
    };
    assert_eq!(plan("M220 S100", 12_000), Err(ErrorCode::StepRateTooHigh));
    for factors in ["M220 S300", "M220 S200\nM221 S102"] {
        let items = plan(factors, 7200).unwrap();
        let filament = &moves(&items)[0];
        let speed = filament.cruise_velocity * filament.direction[EXTRUDER].abs();
        assert!((speed - slowest.0).abs() < 1e-6 * slowest.0, "{speed} mm/s of {slowest:?}");
        let said =
            |item: &&Planned| matches!(item, Planned::Notice(notice) if notice.message.contains("slower"));
        assert_eq!(items.iter().filter(said).count(), 1);
    }
}

/// The sample machine whose motor of X lasts up to 200 mm/s.
fn weak_machine(policy: &str) -> (Planner, Source) {
    let text =
        include_str!("../../../../samples/printer.cfg").replace("[printer]", &format!("[printer]\n{policy}"));
    let torque = "\n[motor_torque stepper_x]\npull_out_torque: 0: 0.4, 1000: 0.2\ninertia: 100\n";
    let (config, diagnostics) = config::parse(&format!("{text}{torque}"));
    let mut planner = Planner::new(&config.unwrap_or_else(|| panic!("{diagnostics:?}")), CLOCK).unwrap();
    (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
    let mut source = Source::default();
    planner.begin_job(&mut source);
    (planner, source)
}

#[test]
fn what_a_motor_s_torque_does_not_last_for_is_slowed_down_and_told_once() {
    let (mut planner, mut source) = weak_machine("");
    let top = planner.step_rates.out_of_torque([0.0; 4], [9.0, 0.0, 0.0, 0.0], MmPerS(1e6), &planner.limits);
    let top = top.unwrap().2.0;
    feed(&mut source, "G1 X50 F3000\nG1 X150 F18000\nG1 X0\n");
    let items = items(&mut planner, &mut source);
    let notices: Vec<_> = items
        .iter()
        .filter_map(|item| if let Planned::Notice(it) = item { Some(it) } else { None })
        .collect();
    assert_eq!(notices.len(), 1, "{notices:?}");
    assert!(notices[0].line == LineNumber(2) && notices[0].message.contains("stepper_x"), "{notices:?}");
    let speeds: Vec<f64> = moves(&items).iter().map(|mv| mv.cruise_velocity).collect();
    assert!((speeds[0] - 50.0).abs() < 1e-9 && speeds[1] <= top && speeds[1] > 0.5 * top, "{speeds:?} {top}");
}

#[test]
fn it_is_refused_where_the_machine_file_says_so() {
    let (mut planner, mut source) = weak_machine("unreachable_speed: reject");
    feed(&mut source, "G1 X50 F3000\nG1 X150 F18000\n");
    let error = loop {
        match planner.next(&mut source) {
            Ok(Planned::EndOfSource) => panic!("it was made"),
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert_eq!(error.code, ErrorCode::StepRateTooHigh);
    assert!(error.to_string().contains("stepper_x"), "{error}");
}
