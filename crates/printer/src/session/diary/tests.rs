use super::*;

fn diary() -> Diary {
    let job = Job {
        place: Place::default(),
        runs: 0,
        id: 1,
        told: Seconds::ZERO,
        seen: None,
        waiting: None,
        made: None,
        told_z: f64::NAN,
        height: None,
        off_mm: [0.0; 3],
        since_power_up: true,
        parked: None,
    };
    Diary { writer: Writer::default(), job: Some(job) }
}

/// What is written in ten seconds of a print that is at `z(second)` then, looked at 50 times a second.
fn records_in_ten_seconds(z: impl Fn(f64) -> f64) -> usize {
    let mut diary = diary();
    for tick in 1..=500_u32 {
        let now = Seconds(f64::from(tick) / 50.0);
        diary.progress(Progress { line: tick, elapsed: now, z: z(now.0) });
        diary.heard(now);
        diary.tell_progress(now);
    }
    diary.take().lines().count()
}

#[test]
fn a_bed_that_is_not_flat_is_no_new_height() {
    let flat = records_in_ten_seconds(|_| 0.2);
    assert!((9..=11).contains(&flat), "{flat}");
    // Every piece of a line over a mesh ends a little higher or lower than the one before.
    let waves = records_in_ten_seconds(|second| 0.2 + 0.02 * libm::sin(7.0 * second));
    assert!((9..=11).contains(&waves), "{waves}");
}

#[test]
fn another_layer_is_told_soon() {
    let layers = records_in_ten_seconds(|second| 0.2 * (1.0 + libm::floor(2.0 * second)));
    assert!((19..=22).contains(&layers), "{layers}");
    let hops = records_in_ten_seconds(|second| if second % 0.5 < 0.25 { 0.2 } else { 0.6 });
    assert!(hops >= 19, "{hops}");
}
