//! Prints with speed profiles and filters of every kind, which their files change on the way: a host that dies in one is
//! followed by one that goes on with the very next step.

use printer::session::{JobStatus, Request};
use virtual_printer::BoardProfile;

use crate::{
    attach::{clean, die, file, setup, started, steps, take_up},
    bench::Setup,
};

/// The machine with more in its file: in its section of the extruder, and behind all.
fn with(extruder: &str, more: &str) -> Setup {
    let mut setup = setup(BoardProfile::rp2040());
    let options = format!("{extruder}\nmax_extrude_cross_section: 10");
    setup.config = setup.config.replacen("max_extrude_cross_section: 10", &options, 1);
    setup.config += more;
    setup
}

fn shaped(kind: &str) -> String {
    format!("[input_shaper]\nshaper_freq_x: 47\nshaper_freq_y: 39.5\nshaper_type: {kind}\n")
}

/// The file, with other advances within a run and other filters between runs.
fn changing() -> String {
    let mut changed = String::new();
    for (index, line) in file().lines().enumerate() {
        changed += line;
        changed += match index % 11 {
            3 => "\nM900 K0.02",
            5 => "\nSET_PRESSURE_ADVANCE ADVANCE=0.08",
            8 => "\nSET_INPUT_SHAPER SHAPER_FREQ_X=55 SHAPER_TYPE_X=zvd",
            10 => "\nSET_PRESSURE_ADVANCE SMOOTH_TIME=0.02 ADVANCE=0.01",
            _ => "",
        };
        changed += "\n";
    }
    changed
}

/// Lets hosts die at moments `apart` seconds from each other, over the whole print. Gives the whole print's steps.
fn goes_on(name: &str, setup: &Setup, file: &str, apart: f64) -> Vec<Vec<bool>> {
    let (expected, _) = clean(setup, file);
    for death in 0.. {
        let (mut bench, from) = started(setup, file);
        bench.run(0.05 + apart * f64::from(death));
        if bench.session.job_status() == JobStatus::None {
            assert!(death > 2, "{name}: the print is too short");
            break;
        }
        die(&mut bench, setup, 0.1 * f64::from(death % 7));
        take_up(&mut bench, file);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        assert!(steps(&mut bench, from) == expected, "{name}: after death {death}");
    }
    expected
}

const ADVANCE: &str = "pressure_advance: 0.045\npressure_advance_smooth_time: 0.03";

#[test]
fn the_next_step_follows_under_filters_that_change() {
    let expected = goes_on("filters", &with(ADVANCE, &shaped("2hump_ei")), &changing(), 0.93);
    let (plain, _) = clean(&setup(BoardProfile::rp2040()), &file());
    assert!(expected[3].len() > plain[3].len(), "pressure advance takes steps of its own");
}

#[test]
fn the_next_step_follows_under_every_shaper() {
    for kind in ["zv", "mzv", "zvd", "ei", "3hump_ei"] {
        goes_on(kind, &with(ADVANCE, &shaped(kind)), &file(), 2.7);
    }
}

const TORQUE: &str = "
[motor_torque stepper_x]
pull_out_torque: 0: 0.4, 500: 0.35, 1500: 0.15, 3000: 0.05
inertia: 150
load_torque: 0.01
resonances: 60-90
[motor_torque stepper_y]
pull_out_torque: 0: 0.4, 500: 0.35, 1500: 0.15, 3000: 0.05
inertia: 300
[motor_torque extruder]
pull_out_torque: 0: 0.4, 1000: 0.2
inertia: 80
";

#[test]
fn the_next_step_follows_under_every_profile() {
    let jerk = |mut setup: Setup| {
        setup.config = setup.config.replacen("[printer]\n", "[printer]\nmax_jerk: 50000\n", 1);
        setup
    };
    let own = |mut setup: Setup| {
        let limits = "[printer]\nmax_x_velocity: 150\nmax_y_accel: 900\njunction_deviation: 0.02\n";
        setup.config = setup.config.replacen("[printer]\n", limits, 1);
        setup
    };
    goes_on("jerk", &jerk(with(ADVANCE, &shaped("mzv"))), &file(), 2.7);
    goes_on("torque", &with(ADVANCE, &(TORQUE.to_owned() + &shaped("ei"))), &file(), 2.7);
    goes_on("axes of their own", &own(with("", "")), &file(), 2.7);
}
