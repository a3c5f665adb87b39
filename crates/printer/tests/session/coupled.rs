//! Homing again and again where belts move several axes: however often and from wherever one axis is homed, the others stay
//! where they are, and the head is where the host says.
//!
//! Where the head really is follows from the virtual board's pulses and the gantry of its machine, not from the host.

use std::fmt::Write as _;

use printer::session::{Event, JobOptions, Request};
use virtual_printer::Gantry;

use crate::{
    attach::{die, take_up},
    bench::{Bench, Setup},
    machine,
};

const AXES: [&str; 3] = ["X", "Y", "Z"];
const ROUNDS: u32 = 20;
/// An axis is where its switch closes: the contact bounces, and the carriage runs on until enough samples agree. At the
/// speed of a second approach, and at four times that.
const FOUND_MM: [f64; 2] = [0.06, 0.1];

/// The machine with other belts, homed in one approach or in two, its first motor with steps as long as the others' or not.
fn setup(kinematics: &str, retracts: bool, unequal: bool) -> Setup {
    let mut config = machine::CONFIG.replacen("cartesian", kinematics, 1);
    // Z hangs on a belt where belts move it.
    if kinematics.ends_with("corexz") {
        config = config.replacen("rotation_distance: 8", "rotation_distance: 40", 1);
    }
    if !retracts {
        config = config.replace("second_homing_speed", "homing_retract_dist: 0\nsecond_homing_speed");
        config = config.replacen("homing_retract_dist: 2\n", "", 1);
    }
    if unequal {
        config = config.replacen("microsteps: 16", "microsteps: 10", 1);
    }
    Setup { config, ..Setup::default() }
}

/// How the belts of a bench run.
struct Belts {
    gantry: Gantry,
    /// Where each motor is at power-up, and how long its step is, in mm.
    starts: [f64; 3],
    steps: [f64; 3],
    /// So far homing may leave another axis from where it was, and so often it may be homed: steps of one length can be made
    /// undone, others leave up to half of the longest either way, before what is compared with as well.
    crept_max: f64,
}

impl Belts {
    fn of(setup: &Setup) -> Self {
        let config = machine::config(&setup.config, &setup.board);
        let parts = machine::parts(&config);
        let [a, b, c, _] = printer::machine::step_distances(&config).map(|step| step.0);
        let steps = [a, b, c];
        let is_unequal = config.steppers.iter().any(|axis| axis.motor.microsteps != 16);
        let longest = steps.into_iter().fold(0.0, f64::max);
        Self {
            gantry: machine::gantry(&config),
            starts: core::array::from_fn(|motor| parts.motors[motor].start.0),
            steps,
            crept_max: 1e-9 + if is_unequal { longest } else { 0.0 },
        }
    }

    /// The head really, less where the host has it. What the motors' own rounding hides does not count: each stands on the
    /// step nearest to its place.
    fn off(&self, bench: &mut Bench) -> [f64; 3] {
        let (claimed, homed) = bench.session.position().expect("a position");
        assert_eq!(homed, [true; 3]);
        let state = bench.state();
        let wanted = self.gantry.motors([claimed[0], claimed[1], claimed[2]]);
        let by: [f64; 3] = core::array::from_fn(|motor| {
            assert_eq!(state.motors[motor].lost.0, 0, "{}", state.motors[motor].name);
            let step = self.steps[motor];
            let nearest = (wanted[motor] / step + 0.5).floor() * step;
            self.starts[motor] + state.motors[motor].count.0 as f64 * step - nearest
        });
        self.gantry.head(by)
    }
}

fn stays(kinematics: &str, retracts: bool, unequal: bool) {
    let setup = setup(kinematics, retracts, unequal);
    let name = format!("{kinematics}, retracts {retracts}, unequal {unequal}");
    let belts = Belts::of(&setup);
    let found_max = FOUND_MM[usize::from(!retracts)];
    let mut bench = setup.ready();
    bench.home();
    // Where each axis was when it was last homed.
    let mut found = belts.off(&mut bench);
    let mut now = found;
    for round in 0..ROUNDS {
        let at = f64::from(round);
        let (x, y, z) = (7.0031 + 0.7371 * at, 141.0 - 0.3777 * at, 5.0 + 0.2113 * at);
        bench.gcode(&format!("G1 X{x:.4} Y{y:.4} Z{z:.4} F6000"));
        for (before, now) in belts.off(&mut bench).iter().zip(now) {
            assert!((before - now).abs() <= 1e-9, "{name}: moving there put it off by {}", before - now);
        }
        let axis = (round % 4) as usize;
        let homing = AXES.get(axis).map_or("G28".to_owned(), |axis| format!("G28 {axis}"));
        bench.gcode(&homing);
        assert_eq!(bench.errors(), [], "{name}");
        now = belts.off(&mut bench);
        for (other, now) in now.into_iter().enumerate() {
            if other == axis || axis == AXES.len() {
                found[other] = now;
                assert!(now.abs() <= found_max, "{name}: {} is off by {now} mm", AXES[other]);
            } else {
                let crept = (now - found[other]).abs();
                assert!(crept <= belts.crept_max, "{name}: {homing} moved {} by {crept} mm", AXES[other]);
            }
        }
    }
}

#[test]
fn homing_one_axis_again_and_again_leaves_the_others_where_they_are() {
    for kinematics in ["corexy", "corexz", "hybrid_corexy", "hybrid_corexz"] {
        for (retracts, unequal) in [(true, false), (false, false), (true, true), (false, true)] {
            stays(kinematics, retracts, unequal);
        }
    }
}

/// What whole steps cannot put right is known to the next host, too: else each would leave as much again.
#[test]
fn hosts_that_die_between_homings_leave_the_others_where_they_are() {
    for (kinematics, homing, other) in [("corexy", "X", 1), ("corexz", "X", 2), ("hybrid_corexy", "Y", 0)] {
        let mut setup = setup(kinematics, false, true);
        setup.config = setup.config.replacen("min_extrude_temp: 60", "min_extrude_temp: 0", 1);
        let belts = Belts::of(&setup);
        let mut file = String::from("G1 X5 Y140 Z5 F6000\n");
        for _ in 0..ROUNDS {
            let _ =
                writeln!(file, "G28 {homing}\nG1 X7.0031 Y138.777 Z5.2113 F6000\nG1 X60 F2400\nG1 X5 F6000");
        }
        let mut bench = setup.ready();
        bench.home();
        let found = belts.off(&mut bench)[other];
        bench.start_with(&file, JobOptions { journal: Some(1), ..JobOptions::default() }).unwrap();
        for round in 0..ROUNDS {
            // Behind the homing, on the slow line.
            let begun =
                |event: &Event| matches!(event, Event::Move(it) if it.line == 4 + 4 * round && !it.homing);
            bench.until("the line", 30.0, |bench| bench.events.iter().any(begun));
            bench.run(0.5);
            die(&mut bench, &setup, 1.0);
            take_up(&mut bench, &file);
            bench.ask(Request::Resume);
        }
        bench.job_over();
        bench.job_done();
        bench.settle();
        let crept = belts.off(&mut bench)[other] - found;
        assert!(crept.abs() <= belts.crept_max, "{kinematics}: {crept} mm");
    }
}
