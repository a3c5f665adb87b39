//! A print with pressure advance and input shapers, which its file changes on the way: a host that dies in it is followed
//! by one that goes on with the very next step.

use printer::session::{JobStatus, Request};
use virtual_printer::BoardProfile;

use crate::{
    attach::{clean, die, file, setup, started, steps, take_up},
    bench::Setup,
};

fn filtered(board: BoardProfile) -> Setup {
    let mut setup = setup(board);
    setup.config += "[input_shaper]\nshaper_freq_x: 47\nshaper_freq_y: 39.5\nshaper_type_y: 2hump_ei\n";
    let options =
        "pressure_advance: 0.045\npressure_advance_smooth_time: 0.03\nmax_extrude_cross_section: 10";
    setup.config = setup.config.replacen("max_extrude_cross_section: 10", options, 1);
    setup
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

#[test]
fn the_next_step_follows_under_filters() {
    let setup = filtered(BoardProfile::rp2040());
    let file = changing();
    let (expected, _) = clean(&setup, &file);
    let (plain, _) = clean(&self::setup(BoardProfile::rp2040()), &self::file());
    assert!(expected[3].len() > plain[3].len(), "pressure advance takes steps of its own");
    for tenth in 0..12 {
        let (mut bench, from) = started(&setup, &file);
        bench.run(0.05 + 0.93 * f64::from(tenth));
        if bench.session.job_status() == JobStatus::None {
            assert!(tenth > 8, "the print is too short");
            break;
        }
        die(&mut bench, &setup, 0.1 * f64::from(tenth % 7));
        take_up(&mut bench, &file);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        assert!(steps(&mut bench, from) == expected, "after {tenth}");
    }
}
