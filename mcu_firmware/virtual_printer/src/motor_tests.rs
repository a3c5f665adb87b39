use super::*;

const CLOCK_HZ: u32 = 12_000_000;
/// 80 steps a millimetre.
const MICROSTEPS: u32 = 16;

fn carriage() -> Mechanics {
    Mechanics::nema17(MICROSTEPS, 40.0, 0.5)
}

fn motor(mechanics: &Mechanics, time_step_us: u32) -> MotorState {
    let mut motor = MotorState::new(mechanics, CLOCK_HZ, 0, time_step_us, Stops::NONE);
    motor.energise(0, true);
    motor
}

/// Clocks of the steps of a trapezoid: from rest to `speed` and back to rest, in steps, steps/s, steps/s².
fn trapezoid(start: u64, steps: u32, speed: f64, accel: f64) -> Vec<u64> {
    let total = f64::from(steps);
    let ramp = (speed * speed / (2.0 * accel)).min(total / 2.0);
    let top = (2.0 * accel * ramp).sqrt();
    let (ramp_s, cruise_s) = (top / accel, (total - 2.0 * ramp) / top);
    let end_s = 2.0 * ramp_s + cruise_s;
    let time = |at: f64| {
        if at < ramp {
            (2.0 * at / accel).sqrt()
        } else if at < total - ramp {
            ramp_s + (at - ramp) / top
        } else {
            end_s - (2.0 * (total - at) / accel).sqrt()
        }
    };
    (0..steps).map(|k| start + (time(f64::from(k) + 0.5) * f64::from(CLOCK_HZ)) as u64).collect()
}

/// Runs a trapezoid and lets the rotor come to rest; gives the rotor's place every 5 ms and the steps lost.
fn run(motor: &mut MotorState, steps: u32, speed: f64, accel: f64) -> (Vec<f64>, i64) {
    let mut places = Vec::new();
    let mut look = 60_000;
    let clocks = trapezoid(1000, steps, speed, accel);
    let end = clocks.last().copied().unwrap_or(0) + 6_000_000;
    for clock in clocks {
        while look <= clock {
            motor.advance(look);
            places.push(motor.rotor());
            look += 60_000;
        }
        motor.step(clock, true);
    }
    motor.advance(end);
    places.push(motor.rotor());
    (places, motor.lost())
}

#[test]
fn the_sine_is_a_sine() {
    for i in -4000..4000 {
        let turns = f64::from(i) / 777.0;
        assert!((sin_turns(turns) - libm::sin(turns * TURN_RAD)).abs() < 1e-6, "{turns}");
    }
}

#[test]
fn no_steps_are_lost_at_sane_speeds() {
    // 300 mm/s at 3000 mm/s² on 80 steps/mm.
    let mut motor = motor(&carriage(), TIME_STEP_US);
    let (_, lost) = run(&mut motor, 16_000, 24_000.0, 240_000.0);
    assert_eq!(lost, 0);
    assert!((motor.rotor() - 16_000.0).abs() < 2.0, "friction leaves a small lag: {}", motor.rotor());
}

#[test]
fn steps_are_lost_when_accelerated_too_hard() {
    // The motor's own limit: 0.4 N·m over 2.6e-5 kg·m² is about 100 000 mm/s².
    let mut motor = motor(&carriage(), TIME_STEP_US);
    let (_, lost) = run(&mut motor, 16_000, 40_000.0, 20_000_000.0);
    assert!(lost > 100, "{lost}");
    assert_eq!(lost % i64::from(4 * MICROSTEPS), 0, "whole electrical periods");
}

#[test]
fn steps_are_lost_beyond_the_pull_out_speed() {
    // A load of half the holding torque: at three times the corner speed the motor no longer carries it.
    let mechanics = Mechanics { load_nm: 0.2, ..carriage() };
    let per_turn = mechanics.microsteps_per_rotation();
    let (_, slow) = run(&mut motor(&mechanics, TIME_STEP_US), 40_000, 6.0 * per_turn, 240_000.0);
    assert_eq!(slow, 0);
    let (_, fast) = run(&mut motor(&mechanics, TIME_STEP_US), 100_000, 24.0 * per_turn, 240_000.0);
    assert!(fast > 0, "{fast}");
}

#[test]
fn halving_the_time_step_changes_no_result() {
    // Turns, turns/s, turns/s².
    let cases = [
        ("sane", 5.0, 7.5, 75.0),
        ("slow", 0.125, 0.1, 75.0),
        ("resonant", 1.0, 3.0, 6.0),
        ("hard", 2.5, 7.5, 1250.0),
        ("stalls", 5.0, 20.0, 60_000.0),
    ];
    for (name, turns, speed, accel) in cases {
        for mechanics in [carriage(), Mechanics::extruder(MICROSTEPS), Mechanics::nema17(2, 8.0, 1.0)] {
            let per_turn = mechanics.microsteps_per_rotation();
            let (steps, speed, accel) = ((turns * per_turn) as u32, speed * per_turn, accel * per_turn);
            let (whole, lost) = run(&mut motor(&mechanics, TIME_STEP_US), steps, speed, accel);
            let (half, lost_half) = run(&mut motor(&mechanics, TIME_STEP_US / 2), steps, speed, accel);
            assert_eq!(lost, lost_half, "{name}, {mechanics:?}");
            let rest = (whole.last().unwrap_or(&0.0) - half.last().unwrap_or(&0.0)).abs();
            assert!(
                rest < 0.15 * f64::from(mechanics.microsteps),
                "{name}: {rest} apart at rest, {mechanics:?}"
            );
            if lost == 0 {
                let pairs = whole.iter().zip(&half);
                let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(
                    apart < 0.15 * f64::from(mechanics.microsteps),
                    "{name}: {apart} apart, {mechanics:?}"
                );
            }
        }
    }
}

#[test]
fn a_disabled_driver_holds_nothing() {
    let mut motor = motor(&carriage(), TIME_STEP_US);
    motor.energise(10, false);
    let (_, lost) = run(&mut motor, 6400, 5000.0, 50_000.0);
    assert_eq!(motor.rotor(), 0.0);
    assert_eq!(lost, 6400);
}

#[test]
fn the_frame_stops_the_carriage() {
    let stops = Stops { min: -100.0, max: 500.0 };
    let mut motor = MotorState::new(&carriage(), CLOCK_HZ, 0, TIME_STEP_US, stops);
    motor.energise(0, true);
    let (places, lost) = run(&mut motor, 4000, 4000.0, 100_000.0);
    assert!(places.iter().all(|&place| place <= 500.0));
    assert!(lost >= 3400, "{lost}");
}

#[test]
fn asking_more_often_changes_nothing() {
    let clocks = trapezoid(1000, 4000, 24_000.0, 240_000.0);
    let (mut seldom, mut often) = (motor(&carriage(), TIME_STEP_US), motor(&carriage(), TIME_STEP_US));
    for (index, &clock) in clocks.iter().enumerate() {
        seldom.step(clock, index % 700 < 400);
        often.advance(clock - 3);
        often.step(clock, index % 700 < 400);
        often.advance(clock + 1);
    }
    let end = clocks.last().copied().unwrap_or(0) + 1_000_000;
    for at in (0..1000).map(|part| end + part * 12_345) {
        often.advance(at);
    }
    seldom.advance(end + 999 * 12_345);
    assert_eq!(seldom.rotor(), often.rotor());
}

#[test]
fn at_rest_it_settles() {
    let mut motor = motor(&carriage(), TIME_STEP_US);
    run(&mut motor, 100, 1000.0, 100_000.0);
    assert!(motor.settled);
    // A year of standing still costs nothing.
    motor.advance(u64::from(CLOCK_HZ) * 3600 * 24 * 365);
}

/// Greatest load, in N·m, that a motor alone carries at a speed that it reaches gently.
fn pull_out_torque(turns_per_s: f64) -> f64 {
    let carries = |load_nm| {
        let mechanics = Mechanics { load_nm, friction_nm: 0.0, ..Mechanics::nema17(MICROSTEPS, 40.0, 0.0) };
        let per_turn = mechanics.microsteps_per_rotation();
        let steps = ((turns_per_s * 0.5 + turns_per_s * turns_per_s / 50.0) * per_turn) as u32;
        run(&mut motor(&mechanics, TIME_STEP_US), steps, turns_per_s * per_turn, 50.0 * per_turn).1 == 0
    };
    (1..50).map(|part| f64::from(part) * 0.01).take_while(|&load| carries(load)).last().unwrap_or(0.0)
}

#[test]
fn torque_falls_with_speed_as_data_sheets_say() {
    // Of usual 42 × 40 mm motors (0.4 N·m holding, 1.5 to 1.7 A, 24 V): about 0.3, 0.2 and 0.1 N·m.
    for (turns_per_s, low, high) in [(1.0, 0.2, 0.32), (10.0, 0.1, 0.22), (20.0, 0.03, 0.12)] {
        let torque = pull_out_torque(turns_per_s);
        assert!((low..high).contains(&torque), "{torque} N·m at {turns_per_s} turns/s");
    }
}

#[test]
fn a_plan_beyond_the_motor_does_not_go_unnoticed() {
    // A carriage of 0.4 kg on 80 steps/mm: speed in mm/s, acceleration in mm/s², whether it can be done.
    let mechanics = Mechanics::nema17(MICROSTEPS, 40.0, 0.4);
    for (speed, accel, can_be) in [
        (300.0, 3_000.0, true),
        (300.0, 10_000.0, true),
        (300.0, 100_000.0, false),
        (1500.0, 10_000.0, false),
        // A corner taken without slowing down.
        (20.0, 1e9, true),
        (300.0, 1e9, false),
    ] {
        let (_, lost) = run(&mut motor(&mechanics, TIME_STEP_US), 16_000, speed * 80.0, accel * 80.0);
        assert_eq!(lost == 0, can_be, "{speed} mm/s, {accel} mm/s²: {lost}");
    }
}

#[test]
fn unsound_mechanics_are_seen() {
    assert!(carriage().is_sound());
    assert!(Mechanics::nema17(256, 2.0, 0.0).is_sound() && Mechanics::extruder(256).is_sound());
    // Swings, damping or drag faster than the step of time: the integration would run away, and hide lost steps.
    assert!(!Mechanics { inertia_kg_m2: 1e-9, ..carriage() }.is_sound());
    assert!(!Mechanics { damping_ratio: 1e3, ..carriage() }.is_sound());
    assert!(!Mechanics { drag_nm_s: 1.0, ..carriage() }.is_sound());
    assert!(!Mechanics { inertia_kg_m2: 0.0, ..carriage() }.is_sound());
    assert!(!Mechanics { microsteps: 0, ..carriage() }.is_sound());
    assert!(!Mechanics { load_nm: f64::NAN, ..carriage() }.is_sound());
}

/// Where a stall ends after hundreds of slipped poles is decided by very little; whether one happens is not, unless
/// one part in a hundred of the torque decides it as well.
#[test]
fn halving_the_time_step_changes_no_verdict() {
    let (mut cases, mut in_step, mut equal, mut close) = (0, 0, 0, 0);
    for mechanics in [carriage(), Mechanics::extruder(MICROSTEPS), Mechanics { load_nm: 0.1, ..carriage() }] {
        let per_turn = mechanics.microsteps_per_rotation();
        for (speed, accel) in (1..16).flat_map(|speed| (0..8).map(move |accel| (speed, accel))) {
            let result = |time_step_us, torque: f64| {
                let speed = f64::from(speed) * 2.0 * per_turn;
                let accel = 100.0 * per_turn * f64::from(1 << accel);
                let holding_torque_nm = mechanics.holding_torque_nm * torque;
                let mechanics = Mechanics { holding_torque_nm, ..mechanics.clone() };
                run(&mut motor(&mechanics, time_step_us), 10 * per_turn as u32, speed, accel).1
            };
            let (whole, half) = (result(TIME_STEP_US, 1.0), result(TIME_STEP_US / 2, 1.0));
            cases += 1;
            if (whole == 0) != (half == 0) {
                let decides = result(TIME_STEP_US, 0.99) != 0 && result(TIME_STEP_US, 1.01) == 0;
                assert!(decides, "speed {speed}, acceleration {accel}: {whole} and {half} steps lost");
                close += 1;
                continue;
            }
            assert!((whole - half).abs() <= 64 + whole.abs() / 100, "{speed}, {accel}: {whole} and {half}");
            in_step += i32::from(whole == 0);
            equal += i32::from(whole == half);
        }
    }
    assert!(in_step > cases / 4 && in_step < cases * 3 / 4, "both verdicts occur: {in_step} of {cases}");
    assert!(close <= cases / 100, "{close} of {cases} too close to call");
    assert!(equal >= cases * 9 / 10, "{equal} of {cases} equal to the step");
}

/// A motor that stands on this many microsteps.
fn standing(mechanics: &Mechanics, microsteps: i64) -> (MotorState, u64) {
    let mut motor = motor(mechanics, TIME_STEP_US);
    let mut clock = 1000;
    for _ in 0..microsteps.abs() {
        motor.step(clock, microsteps > 0);
        clock += 60_000;
    }
    clock += 6_000_000;
    motor.advance(clock);
    (motor, clock)
}

const SECOND: u64 = CLOCK_HZ as u64;

#[test]
fn without_current_a_rotor_falls_to_the_nearest_full_step_unless_friction_holds_it() {
    let loose = Mechanics { friction_nm: 0.0, detent_nm: 0.03, ..carriage() };
    let full_step = i64::from(MICROSTEPS);
    for at in [-21, -9, 0, 3, 7, 9, 16, 30] {
        let (mut motor, clock) = standing(&loose, at);
        motor.energise(clock, false);
        motor.advance(clock + 2 * SECOND);
        let nearest = (at as f64 / full_step as f64).round() * full_step as f64;
        assert!((motor.rotor() - nearest).abs() < 0.5, "{at}: {}", motor.rotor());
        // Its driver has not lost its place: it pulls the rotor back.
        motor.energise(clock + 2 * SECOND, true);
        motor.advance(clock + 3 * SECOND);
        assert!((motor.rotor() - at as f64).abs() < 1.0 && motor.lost() == 0, "{at}: {}", motor.rotor());
    }
    let (mut motor, clock) = standing(&carriage(), 7);
    motor.energise(clock, false);
    motor.advance(clock + SECOND);
    assert!((motor.rotor() - 7.0).abs() < 2.0, "{}", motor.rotor());
}

#[test]
fn a_driver_that_gets_its_power_back_pulls_the_rotor_to_the_nearest_fourth_full_step() {
    let period = 4 * i64::from(MICROSTEPS);
    for friction_nm in [0.0, 0.03] {
        let mechanics = Mechanics { friction_nm, detent_nm: 0.04, ..carriage() };
        for at in [-130, -64, -50, -20, 0, 15, 22, 43, 64, 100] {
            let (mut motor, clock) = standing(&mechanics, at);
            motor.lose_power(clock, 0.0);
            motor.advance(clock + SECOND);
            motor.regain_power(clock + SECOND, true);
            motor.energise(clock + SECOND, true);
            motor.advance(clock + 2 * SECOND);
            let nearest = (at as f64 / period as f64).round() as i64 * period;
            assert_eq!((motor.field(), motor.lost()), (nearest, 0), "{at}");
            // Friction leaves a lag.
            assert!((motor.rotor() - nearest as f64).abs() < 2.0, "{at}: {}", motor.rotor());
        }
    }
}

#[test]
fn a_rotor_between_two_places_goes_either_way_and_a_load_sinks() {
    let mechanics = Mechanics { detent_nm: 0.04, ..carriage() };
    let regained = |sag: f64, upwards: bool| {
        let (mut motor, clock) = standing(&mechanics, 32);
        motor.lose_power(clock, sag);
        motor.advance(clock + SECOND);
        motor.regain_power(clock + SECOND, upwards);
        motor.energise(clock + SECOND, true);
        motor.advance(clock + 2 * SECOND);
        (motor.field(), (motor.rotor() - motor.field() as f64).abs() < 2.0)
    };
    assert_eq!((regained(0.0, true), regained(0.0, false)), ((64, true), (0, true)));
    assert_eq!((regained(8.0, true), regained(-8.0, false)), ((0, true), (64, true)));
    assert_eq!(regained(64.0, false), (-64, true));
}
