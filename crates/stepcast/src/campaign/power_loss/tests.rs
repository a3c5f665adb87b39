use std::sync::Arc;

use super::*;

/// Two layers of a square, and a way across between them.
const FILE: &str = "M140 S50\nM104 S200\nG28\nM109 S200\nG90\nM83\nG1 Z0.2 F600\nG1 X50 Y50 F9000\nG1 X90 E2 F1800\n\
    G1 Y90 E2\nG1 X50 E2\nG1 Y50 E2\nG1 E-1 F1800\nG1 Z0.4 F600\nG1 X90 Y90 F9000\nG1 Z0.36\nG1 E1 F1800\n\
    G1 X50 E2 F1800\nG1 Y50 E2\nG1 X90 E2\nG1 Y90 E2\nG1 E-1 F1800\nM107\nM104 S0\nM140 S0\nM84\n";

fn judged(loss: &Loss) -> Finding {
    let config = printer::config::parse(demo_machine::USUAL_MACHINE).0.unwrap();
    let gcode: Arc<[u8]> = FILE.as_bytes().into();
    let window = Window { name: "a square".to_owned(), gcode: gcode.clone(), fast: false };
    let board = BoardProfile::rp2040();
    let mut clean = Rig::new(config.clone(), &board, gcode, None, 3).unwrap();
    clean.print().unwrap();
    let clean = Clean { filament: clean.filament(), laid: Laid::of(&clean.way()) };
    interrupted(&config, &window, &board, 3, loss, &clean).unwrap()
}

/// In the second layer, five seconds before the end of the print.
fn loss() -> Loss {
    let config = printer::config::parse(demo_machine::USUAL_MACHINE).0.unwrap();
    let mut clean = Rig::new(config, &BoardProfile::rp2040(), FILE.as_bytes().into(), None, 3).unwrap();
    clean.print().unwrap();
    Loss {
        at: clean.age() - Seconds(4.0),
        lasts: Seconds(30.0),
        sag: Mm(0.0),
        detent_nm: 0.05,
        host_dies: false,
        user_comes: Seconds(1.0),
        measured_off: Mm(0.02),
        claim_off: Mm(0.0),
    }
}

#[test]
fn filament_that_is_missing_is_found() {
    let filament = BTreeMap::from([(7, 100), (8, -50), (9, 200)]);
    let clean = Clean { laid: Laid::of(&[]), filament: filament.clone() };
    let with = |changes: &[(u32, i64)]| {
        let mut again = filament.clone();
        again.extend(changes.iter().copied());
        clean.misfed(&again, 8)
    };
    assert_eq!(with(&[]), None);
    // Before the line that it begins with, and where a step falls to the next line.
    assert_eq!(with(&[(7, 0), (8, -51), (9, 201)]), None);
    assert!(with(&[(9, 204)]).is_some());
    assert!(with(&[(10, 5)]).is_some());
    assert!(clean.misfed(&BTreeMap::new(), 8).is_some());
}

#[test]
fn a_print_that_is_gone_on_with_rightly_is_found_right_and_a_wrong_height_is_not() {
    let right = judged(&loss());
    assert_eq!(right.broken, Vec::<String>::new());
    assert!(right.z_error_mm.is_some_and(|z| z < 0.02), "{right:?}");
    // Two full steps.
    let wrong = judged(&Loss { claim_off: Mm(0.08), ..loss() });
    assert!(wrong.broken.iter().any(|what| what.contains("is off")), "{wrong:?}");
    assert!((wrong.z_error_mm.unwrap() - 0.08).abs() < 0.02, "{wrong:?}");
}
