//! What a plan amounts to, and the axes' paths over time.

use super::*;
use crate::{config, preview::Preview};

const TEST_PART: &str = include_str!("../../../../samples/test-part.gcode");
const MACHINE: &str = include_str!("../../../../samples/printer.cfg");

fn machine() -> PrinterConfig {
    config::parse(MACHINE).0.unwrap()
}

/// With pressure advance and input shapers.
fn filtered() -> PrinterConfig {
    let text = MACHINE.replacen("[extruder]", "[extruder]\npressure_advance: 0.05", 1)
        + "\n[input_shaper]\nshaper_freq_x: 45\nshaper_type_x: mzv\nshaper_freq_y: 50\nshaper_type_y: ei\n";
    let config = config::parse(&text).0.unwrap();
    assert!(config.input_shaper[0].shaper().is_some());
    config
}

#[derive(Default)]
struct Kept {
    moves: Vec<MoveEstimate>,
    samples: Vec<TraceSample>,
}

impl PlanSink for Kept {
    fn mv(&mut self, planned: &PlannedMove, estimate: &MoveEstimate) {
        assert_eq!((planned.tag, planned.duration()), (estimate.line, estimate.time.0));
        self.moves.push(*estimate);
    }

    fn sample(&mut self, sample: &TraceSample) {
        self.samples.push(*sample);
    }
}

fn plan(config: &PrinterConfig, text: &str, trace: Option<Seconds>) -> (PlanReport, Kept) {
    let options = PlanOptions { trace, ..PlanOptions::default() };
    let mut stream = PlanStream::with_options(config, options).unwrap();
    let (mut kept, mut blocks) = (Kept::default(), Vec::new());
    for piece in text.as_bytes().chunks(5000) {
        stream.feed_to(piece, &mut blocks, &mut kept).unwrap();
    }
    (stream.finish_to(&mut blocks, &mut kept).unwrap(), kept)
}

fn time_of(report: &PlanReport, name: &str) -> f64 {
    report.features.iter().find(|(feature, _)| *feature == name).map_or(0.0, |(_, total)| total.time.0)
}

#[test]
fn what_features_and_layers_take_is_the_print_time() {
    for config in [machine(), filtered()] {
        let (report, kept) = plan(&config, TEST_PART, None);
        let whole = report.print_time.0;
        let features: f64 = report.features.iter().map(|(_, total)| total.time.0).sum();
        let layers: f64 = report.layers.iter().map(|layer| layer.total.time.0).sum();
        let moves: f64 = kept.moves.iter().map(|one| one.time.0).sum();
        assert!(
            (features - whole).abs() < 1e-6 && (layers - whole).abs() < 1e-6,
            "{features} {layers} {whole}"
        );
        assert!((moves + time_of(&report, "pause") - whole).abs() < 1e-6);
        assert_eq!(kept.moves.len() as u64, report.moves);
        let filament: f64 = kept.moves.iter().map(|one| one.filament.0).sum();
        assert!((filament - report.filament_mm).abs() < 1e-6);
        let laid: f64 = report.features.iter().map(|(_, total)| total.filament.0).sum();
        let in_layers: f64 = report.layers.iter().map(|layer| layer.total.filament.0).sum();
        assert!((laid - in_layers).abs() < 1e-6 && laid > report.filament_mm * 0.99);
        for one in &kept.moves {
            assert!(one.mean_speed <= one.peak_speed * (1.0 + 1e-9) && one.accel.0 >= 0.0);
        }
    }
}

#[test]
fn the_sums_are_those_of_the_preview() {
    let config = machine();
    let (report, _) = plan(&config, TEST_PART, None);
    let mut preview = Preview::new(Some(&config));
    let mut words = Vec::new();
    let mut rest = TEST_PART.as_bytes();
    while !rest.is_empty() {
        let taken = preview.feed(rest);
        rest = &rest[taken..];
        while preview.run(&mut words) {}
    }
    let seen = preview.finish();
    for feature in &seen.features {
        let name = FEATURE_NAMES[usize::from(feature.feature)];
        let found = report.features.iter().find(|(found, _)| *found == name).unwrap().1;
        assert!((found.time.0 - feature.time.0).abs() < 1e-6, "{name}");
        assert!((found.filament.0 - feature.filament.0).abs() < 1e-6, "{name}");
    }
    assert_eq!(report.layers.len(), seen.layers.len());
    for (found, layer) in report.layers.iter().zip(&seen.layers) {
        assert_eq!((found.first_line, found.z), (layer.first_line, layer.z));
    }
}

#[test]
fn pauses_and_the_filament_on_the_spot_are_told_apart() {
    let text = "G28\nM83\n;TYPE:Outer wall\nG1 X50 F6000\nG4 P500\nG1 X60 E0.5\nG1 E-1 F1800\nG4 S3\nG1 E1\nG1 X70\n";
    let (report, _) = plan(&machine(), text, None);
    assert!((time_of(&report, "pause") - 3.5).abs() < 1e-9);
    assert!(time_of(&report, "outer_wall") > 0.05 && time_of(&report, "retraction") > 0.05);
    assert_eq!(
        report.features.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
        ["outer_wall", "travel", "retraction", "pause"]
    );
}

#[test]
fn a_trace_is_the_path_over_all_of_the_print_time() {
    let text = "G28\nM83\nG1 X50 Y20 Z5 F6000\nG1 X60 Y40 E0.5 F3000\nG2 X60 Y40 I8 J0 E2\nG4 S2.5\nG1 X20 E1\nG4 P100\nG1 E-1\nG1 Y0\n";
    for (config, step) in [(machine(), 1e-4), (filtered(), 1e-4), (filtered(), 0.013)] {
        let (report, kept) = plan(&config, text, Some(Seconds(step)));
        let samples = &kept.samples;
        let count = report.print_time.0 / step;
        assert!((samples.len() as f64 - count).abs() <= 1.0, "{} {count}", samples.len());
        for (number, sample) in samples.iter().enumerate() {
            assert_eq!(sample.time.0, number as f64 * step);
        }
        if step > 1e-3 {
            continue;
        }
        let last = samples.last().unwrap();
        for (axis, end) in [20.0, 0.0, 5.0, 2.5].into_iter().enumerate() {
            assert!((last.position[axis] - end).abs() < 1e-3, "{:?}", last.position);
            let mut position = samples[0].position[axis];
            let mut corners = 0;
            for pair in samples.windows(2) {
                let mean = |values: fn(&TraceSample) -> &[f64; 4]| {
                    0.5 * (values(&pair[0])[axis] + values(&pair[1])[axis])
                };
                position += step * mean(|sample| &sample.velocity);
                // At a corner the speed jumps, which no acceleration tells.
                let jump =
                    pair[1].velocity[axis] - pair[0].velocity[axis] - step * mean(|sample| &sample.accel);
                corners += u32::from(jump.abs() > 0.5);
            }
            assert!((position - end).abs() < 5e-3, "axis {axis}: {position} is not {end}");
            // Everywhere else the acceleration is what the speed changes by.
            assert!(corners < 40, "axis {axis}: {corners} of {} jumps", samples.len());
            assert!(last.velocity[axis].abs() < 1.0, "{:?}", last.velocity);
        }
        // The dwell: nothing moves.
        let still = samples.iter().filter(|sample| sample.velocity == [0.0; 4] && sample.accel == [0.0; 4]);
        let dwelt = still.count() as f64 * step;
        assert!(dwelt > 2.5 && dwelt < 3.0, "{dwelt}");
    }
}

#[test]
fn a_short_dwell_counts_for_the_layer_in_which_it_is() {
    let text = "G28\nM83\n;LAYER:0\nG1 Z0.2 F600\nG1 X50 E1 F3000\nG4 P500\nG1 X10 E1\n;LAYER:1\nG1 Z0.4\nG1 X50 E1\n\
        G1 X10 E1\n;LAYER:2\nG1 Z0.6\nG1 X50 E1\nG1 X10 E1\n";
    let (report, _) = plan(&machine(), text, None);
    let times: Vec<f64> = report.layers.iter().map(|layer| layer.total.time.0).collect();
    let [first, second, third] = times[..] else { panic!("{times:?}") };
    assert!(first > second + 0.45 && (second - third).abs() < 0.2, "{times:?}");
    assert!((time_of(&report, "pause") - 0.5).abs() < 1e-9);
    assert!((first + second + third - report.print_time.0).abs() < 1e-9);
}

/// One word's halves.
fn halves(word: u32) -> [f64; 2] {
    [word & 0xffff, word >> 16].map(f64::from)
}

#[test]
fn the_planners_channels_are_those_of_the_vertices() {
    let text = "G28\nM104 S215\nM106 S255\nM83\nG1 X50 F6000\nG1 X80 E1.5 F3000\nG1 E-1\nG0 Y40 F12000\nG3 Y60 J10 E1 F1200\nG1 X0 F9000\n";
    let config = machine();
    let mut preview = Preview::new(Some(&config));
    preview.want_channels();
    let (mut words, mut channels) = (Vec::new(), Vec::new());
    for piece in text.as_bytes().chunks(7) {
        preview.feed(piece);
        while preview.run(&mut words) {}
        channels.extend(preview.take_channels());
        assert!(channels.len() <= words.len() + 4);
    }
    preview.end();
    while preview.run(&mut words) {}
    channels.extend(preview.take_channels());
    assert_eq!(channels.len(), words.len());
    assert!(preview.take_channels().is_empty());
    let (rows, _) = channels.as_chunks::<4>();
    // The first vertex is where the file begins.
    assert_eq!(rows[0], [0; 4]);
    let times: f64 = rows.iter().map(|row| f64::from(f32::from_bits(row[3]))).sum();
    let report = preview.finish();
    let (plan, kept) = plan(&config, text, None);
    let on_the_spot: f64 =
        kept.moves.iter().filter(|one| one.kind == MoveKind::Filament).map(|one| one.time.0).sum();
    assert!((times + on_the_spot - report.print_time.unwrap().0).abs() < 1e-5, "{times} {on_the_spot}");
    assert_eq!(plan.print_time, report.print_time.unwrap());
    let with_vertex = kept.moves.iter().filter(|one| one.kind != MoveKind::Filament);
    for (row, one) in rows[1..].iter().zip(with_vertex) {
        let [peak, mean] = halves(row[0]);
        assert!(
            (peak / 32.0 - one.peak_speed.0).abs() < 0.02 && (mean / 32.0 - one.mean_speed.0).abs() < 0.02
        );
        assert!((halves(row[1])[0] * 2.0 - one.accel.0).abs() <= 1.0);
        assert!((halves(row[2])[0] / 512.0 - one.flow_mm3_s.max(0.0)).abs() < 2e-3);
        assert_eq!((row[2] >> 16 & 511, row[2] >> 25), (215, 100));
    }
    assert_eq!(halves(rows[1][1])[1] / 32.0, 100.0);
}
