//! Properties of the transform, over whole volumes and against the surface itself.

use std::sync::Arc;

use proptest::prelude::*;

use gcode::{Action, MeshChange};

use super::{
    Fade, GridAxis, Interpolation, Mesh, MeshError, PIECE_MIN_MM, Skew, Surface, Transform, Z_ERROR_MAX_MM,
};

/// Exact but for rounding.
const DUST_MM: f64 = 1e-9;

fn axis(min: f64, max: f64, count: usize, interpolation: Interpolation) -> GridAxis {
    GridAxis { min, max, count, interpolation }
}

fn surface(interpolation: Interpolation, counts: [usize; 2], heights: Vec<f64>) -> Surface {
    let axes = [axis(20.0, 200.0, counts[0], interpolation), axis(10.0, 190.0, counts[1], interpolation)];
    Surface::new(axes, heights).expect("a grid")
}

fn transform(skew: Skew, surface: Surface, fade: Option<Fade>, target: Option<f64>) -> Transform {
    let mesh = Mesh::new("test".into(), surface, fade, target, 0.025).expect("a mesh");
    Transform { skew, mesh: Some(Arc::new(mesh)) }
}

prop_compose! {
    fn surfaces()(
        kind in 0..3,
        columns in 4_usize..=6,
        rows in 4_usize..=6,
        tension in 0.0..1.0,
        heights in proptest::collection::vec(-0.4..0.4, 36),
    ) -> Surface {
        let interpolation =
            [Interpolation::Linear, Interpolation::Lagrange, Interpolation::Cardinal(tension)][kind as usize];
        let heights = heights[..columns * rows].to_vec();
        surface(interpolation, [columns, rows], heights)
    }
}

prop_compose! {
    fn transforms()(
        surface in surfaces(),
        xy in -0.05..0.05,
        xz in -0.05..0.05,
        yz in -0.05..0.05,
        fades in any::<bool>(),
        is_mean in any::<bool>(),
    ) -> Transform {
        // Polynomials swing far beyond their points.
        let fade = fades.then_some(Fade { start: 1.0, end: 40.0 });
        transform(Skew { xy, xz, yz }, surface, fade, (!is_mean).then_some(0.0))
    }
}

fn place() -> impl Strategy<Value = [f64; 3]> {
    [-10.0..230.0, -10.0..230.0, -2.0..60.0]
}

/// The G-code's path of a piece: it is straight.
fn along(from: [f64; 3], to: [f64; 3], at: f64) -> [f64; 3] {
    core::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * at)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_inverse_leads_back(transform in transforms(), place in place()) {
        let machine = transform.machine_from_gcode(place);
        for (is, was) in transform.gcode_from_machine(machine).into_iter().zip(place) {
            prop_assert!((is - was).abs() < DUST_MM, "{place:?} {machine:?}");
        }
        let gcode = transform.gcode_from_machine(place);
        for (is, was) in transform.machine_from_gcode(gcode).into_iter().zip(place) {
            prop_assert!((is - was).abs() < DUST_MM, "{place:?} {gcode:?}");
        }
    }

    #[test]
    fn pieces_follow_the_surface(transform in transforms(), from in place(), to in place()) {
        let mesh = transform.mesh().expect("there is one");
        prop_assert!(mesh.z_error <= Z_ERROR_MAX_MM);
        let ends = [from, to].map(|[x, y, z]| [x, y, z, 0.0]);
        let filament = 7.0;
        let pieces = transform.pieces(ends[0], [to[0], to[1], to[2], filament]);
        let mut at = transform.machine_from_gcode(from);
        let (mut share, mut count, mut shortest) = (0.0, 0_u32, f64::INFINITY);
        let length = from.iter().zip(to).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        for [x, y, z, e] in pieces {
            count += 1;
            let next = e / filament;
            prop_assert!(next > share);
            shortest = f64::min(shortest, (next - share) * length);
            for sample in 0..=40 {
                let part = f64::from(sample) / 40.0;
                let chord = along(at, [x, y, z], part);
                let true_place =
                    transform.machine_from_gcode(along(from, to, share + (next - share) * part));
                // X and Y are straight anyway.
                let off: [f64; 3] = core::array::from_fn(|axis| (chord[axis] - true_place[axis]).abs());
                prop_assert!(off[0] < DUST_MM && off[1] < DUST_MM, "{off:?}");
                prop_assert!(off[2] <= Z_ERROR_MAX_MM, "{off:?} at {share} + {part} of {}", next - share);
            }
            (at, share) = ([x, y, z], next);
        }
        prop_assert_eq!(share, 1.0);
        prop_assert_eq!(at, transform.machine_from_gcode(to));
        prop_assert!(shortest > 0.9 * PIECE_MIN_MM || count == 1, "{shortest}");
        prop_assert!(f64::from(count) <= length / 0.3 + 30.0, "{count} pieces for {length} mm");
    }

    #[test]
    fn a_fade_keeps_the_order_of_heights(transform in transforms(), [x, y, z] in place(), more in 1e-6..20.0) {
        let [low, high] = [z, z + more].map(|z| transform.machine_from_gcode([x, y, z])[2]);
        // Z also takes X and Y along, and with them the bed's height.
        if transform.skew == Skew::default() {
            prop_assert!(high > low);
        }
        let mesh = transform.mesh().expect("there is one");
        let [low, high] = [z, z + more].map(|z| mesh.machine_from_gcode([x, y, z])[2]);
        prop_assert!(high > low, "{low} {high}");
        let [least, most] = mesh.added();
        let added = low - z;
        prop_assert!((least - DUST_MM..=most + DUST_MM).contains(&added), "{added} {least} {most}");
    }

    #[test]
    fn a_surface_goes_through_its_points_and_is_smooth(surface in surfaces(), x in 20.0..200.0_f64, y in 10.0..190.0_f64) {
        let [columns, rows] = surface.axes;
        for (row, heights) in surface.rows().enumerate() {
            for (column, height) in heights.iter().enumerate() {
                let at = [columns.min + column as f64 * columns.pitch(), rows.min + row as f64 * rows.pitch()];
                prop_assert!((surface.height(at[0], at[1]) - height).abs() < 1e-9);
            }
        }
        if columns.interpolation == Interpolation::Linear {
            return Ok(());
        }
        // The slopes on either side of any place are the same, that of a border above all.
        let near = 1e-5;
        let border = columns.min + ((x - columns.min) / columns.pitch()).round() * columns.pitch();
        for x in [x, border].into_iter().filter(|x| (20.1..199.9).contains(x)) {
            let [before, here, after] = [x - near, x, x + near].map(|x| surface.height(x, y));
            let kink = ((after - here) - (here - before)) / near;
            prop_assert!(kink.abs() < 1e-4, "{kink} at {x} {y}");
        }
    }
}

/// A bed that hangs through, and leans.
fn bowl() -> Vec<f64> {
    let place = |at: usize| [(at % 5) as f64 - 2.0, (at / 5) as f64 - 2.0];
    (0..25).map(place).map(|[x, y]| 0.03 * (x * x + y * y) + 0.02 * x - 0.15).collect()
}

#[test]
fn half_a_tension_follows_planes_and_less_does_not() {
    let plane: Vec<f64> = (0..25).map(|at| 0.1 * f64::from(at % 5) - 0.05 * f64::from(at / 5)).collect();
    let off = |tension: f64| {
        let surface = surface(Interpolation::Cardinal(tension), [5, 5], plane.clone());
        let place = |at: i32| [20.0 + 1.8 * f64::from(at % 100), 10.0 + 1.8 * f64::from(at / 100)];
        let true_height = |[x, y]: [f64; 2]| (x - 20.0) / 45.0 * 0.1 - (y - 10.0) / 45.0 * 0.05;
        let all = (0..10_000).map(place).map(|at| (surface.height(at[0], at[1]) - true_height(at)).abs());
        all.fold(0.0, f64::max)
    };
    assert!(off(0.5) < 1e-12, "{}", off(0.5));
    assert!(off(0.2) > 0.003);
}

#[test]
fn polynomials_of_few_points_are_exact() {
    let surface = surface(Interpolation::Lagrange, [5, 5], bowl());
    let [x, y] = [117.3, 33.1];
    let [u, v] = [(x - 20.0) / 45.0 - 2.0, (y - 10.0) / 45.0 - 2.0];
    let height = 0.03 * (u * u + v * v) + 0.02 * u - 0.15;
    assert!((surface.height(x, y) - height).abs() < 1e-12);
}

#[test]
fn beyond_its_edges_a_surface_goes_on_as_at_the_edge() {
    let surface = surface(Interpolation::Cardinal(0.2), [5, 5], bowl());
    assert_eq!(surface.height(-1e6, 50.0), surface.height(20.0, 50.0));
    assert_eq!(surface.height(1e6, 1e6), surface.height(200.0, 190.0));
    assert_eq!(surface.height(50.0, -5.0), surface.height(50.0, 10.0));
}

#[test]
fn a_bed_that_is_flat_takes_no_pieces() {
    let surface = surface(Interpolation::Cardinal(0.2), [5, 5], vec![0.1; 25]);
    let transform = transform(Skew::default(), surface, None, None);
    let inside: Vec<_> = transform.pieces([30.0, 30.0, 1.0, 0.0], [180.0, 150.0, 1.0, 5.0]).collect();
    assert_eq!(inside, [[180.0, 150.0, 1.1, 5.0]]);
}

#[test]
fn a_usual_bed_takes_few_pieces() {
    let surface = surface(Interpolation::Cardinal(0.2), [5, 5], bowl());
    let transform = transform(Skew::default(), surface, None, None);
    let count = transform.pieces([20.0, 10.0, 0.2, 0.0], [200.0, 190.0, 0.2, 5.0]).count();
    assert!((10..100).contains(&count), "{count}");
    let short = transform.pieces([100.0, 100.0, 0.2, 0.0], [100.4, 100.0, 0.2, 0.1]).count();
    assert_eq!(short, 1);
}

#[test]
fn moves_that_lead_nowhere_far_away_or_straight_up_end() {
    let surface = surface(Interpolation::Cardinal(0.2), [5, 5], bowl());
    let fade = Some(Fade { start: 1.0, end: 10.0 });
    let transform = transform(Skew { xy: 0.01, xz: 0.0, yz: 0.0 }, surface, fade, None);
    let pieces = |from: [f64; 4], to: [f64; 4]| transform.pieces(from, to).collect::<Vec<_>>();
    assert_eq!(pieces([50.0; 4], [50.0; 4]).len(), 1);
    assert_eq!(pieces([50.0, 50.0, 0.0, 0.0], [50.0, 50.0, 60.0, 0.0]).len(), 3);
    let far = pieces([-1e6, -1e6, 0.2, 0.0], [1e6, 1e6, 0.2, 1.0]);
    assert!(far.len() < 100, "{}", far.len());
    // Along an edge of the mesh, and of the whole bed.
    for y in [10.0, 190.0, 55.0] {
        let count = pieces([-50.0, y, 0.2, 0.0], [250.0, y, 0.2, 1.0]).len();
        assert!((3..100).contains(&count), "{count} at {y}");
    }
}

#[test]
fn a_fade_shorter_than_the_bed_is_deep_is_refused() {
    let bed = || surface(Interpolation::Lagrange, [5, 5], bowl());
    let [low, high] = bed().range;
    let mesh = |end: f64, target: Option<f64>| {
        Mesh::new("test".into(), bed(), Some(Fade { start: 1.0, end }), target, 0.025)
    };
    let depth = high - low;
    assert!(matches!(mesh(1.0 + 0.99 * depth, Some(low)), Err(MeshError::FadeTooShort { .. })));
    assert!(mesh(1.0 + 1.01 * depth, Some(low)).is_ok());
    assert!(matches!(mesh(20.0, Some(high + 0.1)), Err(MeshError::TargetOutside { .. })));
    // 0 is where Z was homed, wherever that is.
    assert!(mesh(20.0, Some(0.0)).is_ok());
    // An end below the start is no fade.
    assert_eq!(mesh(0.0, Some(5.0)).map(|mesh| mesh.fade()), Ok(None));
}

/// A machine file with a mesh of 3 by 3 points, of which one is this high.
fn machine_with(options: &str, height: f64) -> crate::config::PrinterConfig {
    let text = format!(
        "{}\n[bed_mesh]\n{options}\n[bed_mesh cold]\npoints:\n  0.0, 0.1, 0.0\n  0.1, {height}, 0.1\n  0.0, 0.1, 0.2\n\
         x_count: 3\ny_count: 3\nmin_x: 10\nmax_x: 90\nmin_y: 10\nmax_y: 90\n",
        crate::config::SMALL_MACHINE
    );
    let (config, remarks) = crate::config::parse(&text);
    config.unwrap_or_else(|| panic!("{remarks:#?}"))
}

#[test]
fn a_saved_mesh_is_worked_out_when_it_is_loaded_and_no_sooner() {
    let config = machine_with("", 0.3);
    let saved = &config.profiles.meshes["cold"];
    assert!(!saved.is_made());
    // What tells machines apart does not change with that, and sees each of the heights.
    let check = crate::journal::machine_check(&config);
    assert!(!saved.is_made());
    let mut transform = Transform::default();
    let load = Action::BedMesh(MeshChange::Load("cold".into()));
    transform.set(&load, &config.profiles).unwrap();
    assert!(saved.is_made());
    assert!(std::sync::Arc::ptr_eq(&saved.mesh().unwrap(), &saved.mesh().unwrap()));
    assert_eq!(crate::journal::machine_check(&config), check);
    assert_eq!(config, machine_with("", 0.3));
    assert_ne!(config, machine_with("", 0.300_001));
    assert_ne!(crate::journal::machine_check(&machine_with("", 0.300_001)), check);
}

#[test]
fn a_mesh_of_which_only_the_surface_shows_that_it_cannot_be_used_is_told_when_it_is_loaded() {
    let config = machine_with("fade_end: 10\nfade_target: 0.9", 0.3);
    let load = Action::BedMesh(MeshChange::Load("cold".into()));
    let problem = Transform::default().set(&load, &config.profiles).unwrap_err();
    assert!(
        problem.contains("[bed_mesh cold] cannot be used: fade_target 0.900 mm is not between"),
        "{problem}"
    );
}
