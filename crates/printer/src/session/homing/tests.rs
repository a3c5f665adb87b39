//! One axis on its way home, with a board that is played by hand.

use super::*;
use crate::{config, link::Lane};

const ENDSTOP: u8 = 0;
const TRIGGER: u8 = 1;

struct Table {
    board: Board,
    homing: AxisHoming,
    now: Seconds,
}

impl Table {
    fn new(retract: &str) -> Self {
        let text = include_str!("../../../../../samples/printer.cfg");
        let text = text.replacen("homing_retract_dist: 5", &format!("homing_retract_dist: {retract}"), 1);
        let config = config::parse(&text).0.expect("a machine");
        let board = Board::for_tests(&config);
        let homing = AxisHoming::new(0, &config, &board, Standing::default()).expect("an axis");
        Self { board, homing, now: Seconds::ZERO }
    }

    fn poll(&mut self, at_rest: bool) -> Result<Wish, PrinterError> {
        self.homing.poll(&mut self.board, self.now, at_rest)
    }

    fn position(&mut self, steps: i32) -> Result<(), PrinterError> {
        assert_eq!(self.poll(true), Ok(Wish::Wait));
        self.homing.on_position(self.homing.movers[0].oid, steps, self.now)
    }

    fn trigger(&mut self, can_trigger: bool, reason: u8) -> Result<(), PrinterError> {
        self.homing.on_trigger(TRIGGER, can_trigger, reason, self.now, &mut self.board)
    }

    fn endstop(&mut self, homing: bool, pin: bool) -> Result<(), PrinterError> {
        self.homing.on_endstop(ENDSTOP, homing, pin, self.now, &mut self.board)
    }

    /// From the question for the position to the middle of an approach.
    fn approach(&mut self, steps: i32) -> HomingMove {
        self.position(steps).unwrap();
        let Ok(Wish::Move(wanted)) = self.poll(true) else { panic!() };
        let start = self.board.clock_at(self.now);
        self.homing.run_started(start, &mut self.board, self.now);
        assert_eq!(self.poll(false), Ok(Wish::Wait));
        wanted
    }

    /// The switch closes here.
    fn found(&mut self, steps: i32) -> Result<(), PrinterError> {
        self.trigger(false, REASON_ENDSTOP)?;
        assert_eq!(self.poll(false), Ok(Wish::Abandon));
        self.position(steps)
    }

    /// The board stops here, for it has heard nothing.
    fn expired(&mut self, steps: i32) {
        self.trigger(false, REASON_EXPIRED).unwrap();
        assert_eq!(self.poll(false), Ok(Wish::Abandon));
        self.position(steps).unwrap();
    }

    /// To the middle of an approach that goes on.
    fn go_on(&mut self) -> HomingMove {
        assert_eq!(self.poll(true), Ok(Wish::GoesOn));
        let Ok(Wish::Move(wanted)) = self.poll(true) else { panic!() };
        let start = self.board.clock_at(self.now);
        self.homing.run_started(start, &mut self.board, self.now);
        assert_eq!(self.poll(false), Ok(Wish::Wait));
        wanted
    }

    fn back_off(&mut self) -> HomingMove {
        let Ok(Wish::Move(wanted)) = self.poll(true) else { panic!() };
        self.homing.run_started(Ticks(0), &mut self.board, self.now);
        assert_eq!(self.poll(false), Ok(Wish::Wait));
        assert_eq!(self.poll(true), Ok(Wish::Wait));
        assert_eq!(self.poll(true), Ok(Wish::Wait));
        wanted
    }

    fn asked(&self) -> usize {
        self.board.link.waiting(Lane::Control)
    }
}

#[test]
fn it_comes_twice_the_second_time_from_near_and_slowly() {
    let mut table = Table::new("5");
    let first = table.approach(100);
    assert_eq!((first.from_mm, first.to_mm, first.speed.0), (450.0, 0.0, 50.0));
    table.found(-3100).unwrap();
    let back = table.back_off();
    assert_eq!((back.from_mm, back.to_mm), (0.0, 5.0));
    table.endstop(false, false).unwrap();
    let second = table.approach(-2700);
    assert_eq!((second.from_mm, second.to_mm, second.speed.0), (10.0, 0.0, 10.0));
    table.found(-3101).unwrap();
    assert_eq!(table.poll(true), Ok(Wish::Done));
    assert_eq!((table.homing.steps()[0], table.homing.position_mm()), (3200 + 401, 0.0));
}

#[test]
fn without_a_way_back_once_is_enough() {
    let mut table = Table::new("0");
    table.approach(0);
    table.found(0).unwrap();
    assert_eq!(table.poll(true), Ok(Wish::Done));
}

#[test]
fn a_switch_that_stays_closed_or_closes_without_a_step_is_none() {
    let mut table = Table::new("5");
    table.approach(0);
    table.found(-1).unwrap();
    table.back_off();
    assert_eq!(table.endstop(false, true).unwrap_err().code, ErrorCode::EndstopStillTriggered);
    table.endstop(false, false).unwrap();
    table.approach(400);
    assert_eq!(table.found(400).unwrap_err().code, ErrorCode::EndstopBeforeMove);
}

#[test]
fn why_an_approach_ended_decides() {
    for reason in [REASON_HOST, 99] {
        let mut table = Table::new("5");
        table.approach(0);
        table.trigger(true, 0).unwrap();
        assert_eq!(table.trigger(false, reason).unwrap_err().code, ErrorCode::EndstopNotReached);
    }
}

#[test]
fn an_approach_that_the_time_out_ends_goes_on_from_there() {
    let mut table = Table::new("5");
    assert_eq!(table.approach(100).from_mm, 450.0);
    table.expired(-3100);
    // What was made, at 80 steps a mm, is not made again.
    let second_try = table.go_on();
    assert_eq!((second_try.from_mm, second_try.to_mm, second_try.speed.0), (410.0, 0.0, 50.0));
    table.found(-3900).unwrap();
    table.back_off();
    table.endstop(false, false).unwrap();
    assert_eq!(table.approach(-3500).from_mm, 10.0);
    table.expired(-3740);
    let slow = table.go_on();
    assert_eq!((slow.from_mm, slow.to_mm, slow.speed.0), (7.0, 0.0, 10.0));
    // The switch is closed without a further step, but there were some.
    table.found(-3740).unwrap();
    assert_eq!((table.poll(true), table.homing.steps()[0]), (Ok(Wish::Done), 4000 + 240));
}

#[test]
fn an_approach_is_begun_a_few_times_and_goes_no_further_than_one() {
    let mut table = Table::new("5");
    table.approach(0);
    for tries in 1..TRIES_MAX {
        table.expired(-i32::from(tries));
        table.go_on();
    }
    assert_eq!(table.trigger(false, REASON_EXPIRED).unwrap_err().code, ErrorCode::HomingTimeout);

    let mut table = Table::new("5");
    table.approach(0);
    table.trigger(false, REASON_EXPIRED).unwrap();
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    assert_eq!(table.position(-36_000).unwrap_err().code, ErrorCode::EndstopNotReached);
}

#[test]
fn what_was_apart_for_long_does_not_go_on() {
    for is_called in [false, true] {
        let mut table = Table::new("5");
        table.approach(0);
        table.trigger(true, 0).unwrap();
        while is_called && table.now < Seconds(2.1) {
            table.now += Seconds(0.1);
            assert_eq!(table.poll(false), Ok(Wish::Wait));
        }
        table.now = Seconds(2.1);
        // What had been on the way all that time comes in one go.
        table.trigger(true, 0).unwrap();
        assert_eq!(table.trigger(false, REASON_EXPIRED).unwrap_err().code, ErrorCode::HomingTimeout);
    }

    // Nor does it when the answer where the motor stands took so long.
    let mut table = Table::new("5");
    table.approach(0);
    table.trigger(false, REASON_EXPIRED).unwrap();
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    assert_eq!(table.poll(true), Ok(Wish::Wait));
    table.now = Seconds(2.1);
    assert_eq!(table.position(-10).unwrap_err().code, ErrorCode::HomingTimeout);
}

#[test]
fn an_approach_that_is_to_go_on_can_be_cancelled() {
    for polls in 0..3 {
        let mut table = Table::new("5");
        table.approach(0);
        table.trigger(false, REASON_EXPIRED).unwrap();
        for _ in 0..polls {
            table.poll(true).unwrap();
        }
        table.homing.cancel();
        if polls == 0 {
            assert_eq!(table.poll(true), Ok(Wish::Abandon));
        }
        assert_eq!(table.poll(true), Ok(Wish::Cancelled));
    }
}

#[test]
fn answers_for_others_and_at_other_times_change_nothing() {
    let mut table = Table::new("5");
    table.trigger(false, REASON_ENDSTOP).unwrap();
    table.endstop(false, true).unwrap();
    table.approach(0);
    table.homing.on_trigger(77, false, REASON_ENDSTOP, table.now, &mut table.board).unwrap();
    table.homing.on_endstop(77, false, true, table.now, &mut table.board).unwrap();
    table.homing.on_position(77, 5, table.now).unwrap();
    table.homing.on_position(table.homing.movers[0].oid, 5, table.now).unwrap();
    assert!(matches!(table.homing.stage, Stage::Approach { .. }));
}

#[test]
fn a_lost_report_is_asked_for() {
    let mut table = Table::new("5");
    table.approach(0);
    table.now = Seconds(0.36);
    let before = table.asked();
    assert_eq!(table.poll(false), Ok(Wish::Wait));
    // It says that it is there, and asks whether the approach is still on.
    assert_eq!(table.asked(), before + 2);
    table.endstop(false, true).unwrap();
    assert_eq!(table.asked(), before + 3);
    table.trigger(false, REASON_ENDSTOP).unwrap();
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
}

#[test]
fn nobody_who_answers_is_not_waited_for_without_end() {
    let mut table = Table::new("5");
    let mut polls = 0;
    let error = loop {
        table.now += Seconds(0.05);
        polls += 1;
        if let Err(error) = table.poll(true) {
            break error;
        }
    };
    assert_eq!(error.code, ErrorCode::HomingTimeout);
    assert!(table.now.0 < 3.2 && table.asked() < polls / 2);
}

#[test]
fn a_cancelled_approach_is_stopped_once_it_moves() {
    let mut table = Table::new("5");
    table.approach(0);
    table.homing.cancel();
    let before = table.asked();
    assert_eq!(table.poll(false), Ok(Wish::Wait));
    assert_eq!(table.asked(), before);
    table.now = Seconds(0.15);
    assert_eq!(table.poll(false), Ok(Wish::Wait));
    assert_eq!(table.asked(), before + 2);
    table.trigger(false, REASON_HOST).unwrap();
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    assert_eq!(table.poll(true), Ok(Wish::Cancelled));
}

/// A delta on its way up.
fn towers() -> Table {
    let config = config::parse(config::SMALL_DELTA).0.expect("a delta");
    let board = Board::for_tests(&config);
    let homing = AxisHoming::new(0, &config, &board, Standing::default()).expect("towers");
    Table { board, homing, now: Seconds::ZERO }
}

impl Table {
    fn positions(&mut self, steps: [i32; 3]) -> Result<(), PrinterError> {
        assert_eq!(self.poll(true), Ok(Wish::Wait));
        let oids: Vec<u8> = self.homing.movers.iter().map(|mover| mover.oid).collect();
        oids.into_iter().zip(steps).try_for_each(|(oid, at)| self.homing.on_position(oid, at, self.now))
    }

    fn tower(&mut self, tower: u8, reason: u8) -> Result<(), PrinterError> {
        self.homing.on_trigger(TRIGGER + 2 * tower, false, reason, self.now, &mut self.board)
    }

    fn towers_approach(&mut self, steps: [i32; 3]) -> HomingMove {
        self.positions(steps).unwrap();
        let Ok(Wish::Move(wanted)) = self.poll(true) else { panic!() };
        let start = self.board.clock_at(self.now);
        self.homing.run_started(start, &mut self.board, self.now);
        wanted
    }
}

#[test]
fn towers_run_up_together_and_each_stops_at_its_own_switch() {
    let mut table = towers();
    let up = table.towers_approach([10, 20, 30]);
    assert_eq!(table.homing.axes, [true; 3]);
    assert!(up.to_mm == 300.0 && up.from_mm < -300.0, "{up:?}");
    for tower in [2, 0] {
        table.tower(tower, REASON_ENDSTOP).unwrap();
        // What is heard of it once more changes nothing, and the last one is still on its way.
        table.tower(tower, REASON_HOST).unwrap();
        assert_eq!(table.poll(false), Ok(Wish::Wait));
    }
    table.tower(1, REASON_ENDSTOP).unwrap();
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    table.positions([3210, 4020, 2030]).unwrap();
    table.back_off();
    for (tower, left) in [(0, true), (1, true), (2, false)] {
        table.homing.on_endstop(ENDSTOP + 2 * tower, false, false, table.now, &mut table.board).unwrap();
        assert_eq!(table.homing.second, !left);
    }
    table.towers_approach([2810, 3620, 1630]);
    for tower in [0, 1, 2] {
        table.tower(tower, REASON_ENDSTOP).unwrap();
    }
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    table.positions([3211, 4021, 2031]).unwrap();
    assert_eq!(table.poll(true), Ok(Wish::Done));
    assert_eq!(table.homing.steps(), [3200 + 401, 4000 + 401, 2000 + 401, 0]);
}

#[test]
fn a_tower_that_does_not_move_or_find_its_switch_is_an_error() {
    let mut table = towers();
    table.towers_approach([0; 3]);
    table.tower(0, REASON_ENDSTOP).unwrap();
    assert_eq!(table.tower(1, REASON_HOST).unwrap_err().code, ErrorCode::EndstopNotReached);
    let mut table = towers();
    table.homing.second = true;
    table.towers_approach([0; 3]);
    for tower in [0, 1, 2] {
        table.tower(tower, REASON_ENDSTOP).unwrap();
    }
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    assert_eq!(table.positions([400, 0, 400]).unwrap_err().code, ErrorCode::EndstopBeforeMove);
}

#[test]
fn motors_that_move_an_axis_together_stop_together() {
    let text = include_str!("../../../../../samples/corexy.cfg");
    let config = config::parse(text).0.expect("a machine");
    let board = Board::for_tests(&config);
    for (axis, motors) in [(0, vec![0, 1]), (1, vec![0, 1]), (2, vec![2])] {
        let homing = AxisHoming::new(axis, &config, &board, Standing::default()).expect("an axis");
        assert_eq!(homing.stops.len(), 1);
        assert_eq!(homing.movers.iter().map(|mover| mover.motor).collect::<Vec<_>>(), motors);
        assert!(homing.movers.iter().all(|mover| mover.stop == 0));
    }
}

#[test]
fn no_tower_goes_on_where_another_has_stopped() {
    let mut table = towers();
    table.towers_approach([0; 3]);
    table.now = Seconds(0.6);
    assert_eq!(table.poll(false), Ok(Wish::Wait));
    table.tower(0, REASON_EXPIRED).unwrap();
    let before = table.asked();
    assert_eq!(table.poll(false), Ok(Wish::Wait));
    assert_eq!(table.asked(), before + 2);
    // That they are on their way still is no answer.
    table.homing.on_trigger(TRIGGER + 2, true, 0, table.now, &mut table.board).unwrap();
    assert_eq!(table.poll(false), Ok(Wish::Wait));
    assert_eq!(table.asked(), before + 2);
    for tower in [1, 2] {
        table.tower(tower, REASON_HOST).unwrap();
    }
    assert_eq!(table.poll(false), Ok(Wish::Abandon));
    table.positions([100, 110, 110]).unwrap();
    assert_eq!(table.poll(true), Ok(Wish::GoesOn));

    // Where homing fails, whatever moves is stopped at once.
    let mut table = towers();
    table.towers_approach([0; 3]);
    table.tower(0, REASON_ENDSTOP).unwrap();
    table.tower(1, REASON_HOST).unwrap_err();
    let before = table.asked();
    table.homing.stop_all(&mut table.board);
    assert_eq!(table.asked(), before + 2);
}

/// Where the planner has axes, and where motors have been stopped by an endstop again and again, are not the same.
#[test]
fn homing_again_and_again_leaves_other_axes_where_they_are() {
    let sample = include_str!("../../../../../samples/corexy.cfg");
    for (kinematics, axis, other) in [
        ("corexy", 0, 1),
        ("corexy", 1, 0),
        ("corexz", 0, 2),
        ("corexz", 2, 0),
        ("hybrid_corexy", 1, 0),
        ("hybrid_corexz", 2, 0),
    ] {
        for unequal in [false, true] {
            let text = sample.replace("kinematics: corexy", &format!("kinematics: {kinematics}"));
            let text = text
                .replace("retract_dist: 5", "retract_dist: 0")
                .replace("retract_dist: 3", "retract_dist: 0");
            let text = if unequal { text.replacen("microsteps: 16", "microsteps: 10", 1) } else { text };
            let config = config::parse(&text).0.expect("a machine");
            stays(&config, axis, other);
        }
    }
}

fn stays(config: &PrinterConfig, axis: usize, other: usize) {
    let motors = Motors::new(config);
    let steps_mm = machine::step_distances(config).map(|step| step.0);
    let home = config.steppers[axis].position_endstop.0;
    // Where the motors really are is so many steps from the planner's step: nothing at first.
    let mut apart = [0.0; MOTORS];
    let mut off_mm = [0.0; 3];
    for round in 0..40 {
        let mut position = [100.004; MOTORS];
        position[axis] = 50.0 + 0.337 * f64::from(round);
        let board = Board::for_tests(config);
        let standing = Standing { position, homed: [true; 3], off_mm };
        let homing = AxisHoming::new(axis, config, &board, standing).expect("an axis");
        let mut table = Table { board, homing, now: Seconds::ZERO };
        let movers: Vec<(usize, bool)> =
            table.homing.movers.iter().map(|mover| (mover.motor, mover.invert_dir)).collect();
        let mut at_home = position;
        at_home[axis] = home;
        let (from, to) = (motors.counts(&position), motors.counts(&at_home));
        // The motors go as the axis does, exactly so far, but for a step that one of them misses at times.
        let went: Vec<f64> = movers
            .iter()
            .map(|&(motor, _)| {
                let share =
                    motors.geometry().motor_positions(&core::array::from_fn(|it| f64::from(it == axis)));
                let way = share[motor] * (home - position[axis]) / steps_mm[motor];
                way.round() + f64::from(u8::from(round % 3 == 0 && motor == movers[0].0))
            })
            .collect();
        let told = |index: usize| if movers[index].1 { -went[index] as i32 } else { went[index] as i32 };
        let ends: Vec<i32> = (0..movers.len()).map(told).collect();
        table.towers_approach([0; 3]);
        let oid = table.homing.stops[0].oids.trsync.0;
        table.homing.on_trigger(oid, false, REASON_ENDSTOP, table.now, &mut table.board).unwrap();
        assert_eq!(table.poll(false), Ok(Wish::Abandon));
        table.positions([ends[0], ends.get(1).copied().unwrap_or(0), 0]).unwrap();
        let more = match table.poll(true) {
            Ok(Wish::Done) => [0; MOTORS],
            Ok(Wish::Straighten(missing)) => missing,
            wish => panic!("{wish:?}"),
        };
        let step = steps_mm[movers[0].0].max(steps_mm[movers[movers.len() - 1].0]);
        let is_little = |motor: usize| f64::from(more[motor]).abs() * steps_mm[motor] <= 2.0 * step;
        assert!((0..MOTORS).all(is_little), "{more:?}");
        off_mm = table.homing.off_mm();
        for (index, &(motor, _)) in movers.iter().enumerate() {
            apart[motor] += went[index] + f64::from(more[motor]) - (to[motor] - from[motor]);
        }
        let real = core::array::from_fn(|motor| apart[motor] * steps_mm[motor]);
        let off = motors.geometry().position(&real).expect("a place")[other];
        assert!(off.abs() <= step, "{:?} {axis} {round}: {off}", config.printer.kinematics);
    }
}

#[test]
fn what_motors_that_stopped_apart_have_moved_goes_back() {
    let text =
        include_str!("../../../../../samples/corexy.cfg").replacen("retract_dist: 5", "retract_dist: 0", 1);
    let config = config::parse(&text).0.expect("a machine");
    // The second motor's direction pin is inverted: it counts down where it goes forward.
    // An odd step is made by either of them, for X is known to half a step only.
    for (ends, by) in [([-800, 800], 0), ([-801, 800], 1), ([-800, 803], -3)] {
        let board = Board::for_tests(&config);
        let standing = Standing { homed: [true; 3], ..Standing::default() };
        let homing = AxisHoming::new(0, &config, &board, standing).expect("an axis");
        let mut table = Table { board, homing, now: Seconds::ZERO };
        table.towers_approach([0; 3]);
        table.trigger(false, REASON_ENDSTOP).unwrap();
        assert_eq!(table.poll(false), Ok(Wish::Abandon));
        table.positions([ends[0], ends[1], 0]).unwrap();
        if by == 0 {
            assert_eq!(table.poll(true), Ok(Wish::Done));
            continue;
        }
        let Ok(Wish::Straighten(missing)) = table.poll(true) else { panic!("{:?}", table.poll(true)) };
        assert_eq!((missing[0] - missing[1], missing[2], missing[3]), (by, 0, 0));
        table.homing.run_started(Ticks(0), &mut table.board, table.now);
        assert_eq!(table.poll(false), Ok(Wish::Wait));
        assert_eq!(table.poll(true), Ok(Wish::Wait));
        assert_eq!(table.poll(true), Ok(Wish::Done));
    }
}
