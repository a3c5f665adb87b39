use core::fmt::Write;

use proptest::prelude::*;

use super::*;
use crate::{LINE_BYTES_MAX, Lines};

/// Pieces that are likely to meet in wrong places.
fn fragment() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        "[GMTNXYZEFIJKRSP][-+.0-9]{0,8}",
        "[ \t]{1,2}",
        "[*;()=\"'%#_:,\\[\\]]",
        "(G1|G2|G3|G10|G11|G28|G92|M82|M83|G90|G91|G20|G21|G18|M220 S|M221 S|M207 S|M486|M117|M110) ?",
        "(EXCLUDE_OBJECT_DEFINE|SET_VELOCITY_LIMIT|SET_PRESSURE_ADVANCE|TEMPERATURE_WAIT|START_PRINT) ",
        "(NAME|ACCEL|ADVANCE|SENSOR|POLYGON|CENTER)=[-0-9a-z.,\\[\\]\"]{0,12} ",
        "(nan|inf|1e300|999999999999999999999999|0x10|--5)",
        ";(TYPE|LAYER|Z|HEIGHT|TIME|thumbnail begin|layer |tool H)[:,0-9. ]{0,6}",
    ]
    .prop_map(String::into_bytes)
    .boxed()
    .prop_union(proptest::collection::vec(any::<u8>(), 0..4).boxed())
}

fn line() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(fragment(), 0..8).prop_map(|fragments| fragments.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_text_panics_and_every_result_is_finite(lines in proptest::collection::vec(line(), 1..12)) {
        let mut interpreter = Interpreter::new(Settings::default());
        let mut last = interpreter.position();
        for (index, line) in lines.iter().enumerate() {
            let (mut actions, mut diagnostics) = (Vec::new(), Vec::new());
            interpreter.line(LineNumber(index as u32 + 1), line, &mut actions, &mut diagnostics);
            prop_assert!(actions.len() <= 8 && diagnostics.len() <= 4, "{:?}", (actions, diagnostics));
            for action in &actions {
                let (from, to, feed) = match action {
                    Action::Move(m) => (m.from, m.to, m.feed),
                    Action::Arc(arc) => {
                        prop_assert!(arc.angle.is_finite() && arc.length().0.is_finite());
                        for chord in arc.chords(crate::CHORD_TOLERANCE).take(50) {
                            prop_assert!(chord.to.to_array().iter().all(|v| v.is_finite()));
                        }
                        (arc.from, arc.to, arc.feed)
                    }
                    _ => continue,
                };
                // Moves join up, and none is ever lost or made up.
                prop_assert_eq!(from, last);
                prop_assert!(to.to_array().iter().all(|v| v.is_finite()));
                prop_assert!(feed.0.is_finite() && feed.0 > 0.0);
                last = to;
            }
            prop_assert_eq!(interpreter.position(), last);
            for diagnostic in &diagnostics {
                prop_assert!(diagnostic.columns.start < diagnostic.columns.end);
                prop_assert!(diagnostic.columns.end as usize <= line.len(), "{:?} {:?}", diagnostic, line);
            }
        }
    }

    #[test]
    fn any_bytes_in_any_chunks_are_read(bytes in proptest::collection::vec(any::<u8>(), 0..2000), cut in 1usize..100) {
        let mut lines = Lines::new();
        let mut interpreter = Interpreter::new(Settings::default());
        let (mut actions, mut diagnostics) = (Vec::new(), Vec::new());
        let mut each = |number: LineNumber, _: u64, line: &[u8]| {
            interpreter.line(number, line, &mut actions, &mut diagnostics);
        };
        for chunk in bytes.chunks(cut) {
            lines.push(chunk, &mut each);
        }
        lines.finish(&mut each);
    }

    #[test]
    fn absolute_and_relative_extrusion_feed_the_same_filament(steps in proptest::collection::vec(-2.0f64..5.0, 1..40), reset in 2usize..9) {
        let steps: Vec<f64> = steps.iter().map(|s| (s * 1e5).round() / 1e5).collect();
        let mut absolute = String::from("M82\n");
        let mut relative = String::from("M83\n");
        let mut e = 0.0;
        for (index, step) in steps.iter().enumerate() {
            if index % reset == 0 {
                absolute += "G92 E0\n";
                relative += "G92 E0\n";
                e = 0.0;
            }
            e += step;
            writeln!(absolute, "G1 X{index} E{e:.5}").unwrap();
            writeln!(relative, "G1 X{index} E{step:.5}").unwrap();
        }
        let (a, r) = (clean(&absolute).interpreter.position().e, clean(&relative).interpreter.position().e);
        let total: f64 = steps.iter().sum();
        prop_assert!((a - total).abs() < 1e-9 && (r - total).abs() < 1e-9, "{a} {r} {total}");
    }
}

#[test]
fn a_line_too_long_is_an_error_unless_it_is_a_comment() {
    let long = "X1 ".repeat(LINE_BYTES_MAX);
    let read_long = read(&format!("G1 {long}"));
    assert_eq!((read_long.said().len(), read_long.diagnostics[0].code), (1, DiagnosticCode::LineTooLong));
    clean(&format!(" ; {long}"));
}

#[test]
fn columns_of_the_longest_line_fit() {
    let mut line = "G1 ".to_owned() + &" ".repeat(LINE_BYTES_MAX - 8) + "X1 X2";
    assert_eq!(
        read(&line).said(),
        [format!("1:{}-{} error duplicate-word", LINE_BYTES_MAX - 2, LINE_BYTES_MAX - 1)]
    );
    line.truncate(LINE_BYTES_MAX - 3);
    assert_eq!(clean(&line).moves().len(), 1);
}

#[test]
fn a_second_command_in_a_line_is_never_passed_over() {
    for line in [
        "G90 G1 X10",
        "G21G90",
        "G53 G0 X1",
        "M83 G1 E5",
        "G1 X5 M104 S200",
        "G28 G1 Z5",
        "m400 g91",
        "G92.1 G1 X2",
    ] {
        let read = read(line);
        assert!(read.actions.is_empty(), "{line}");
        assert_eq!(read.diagnostics.len(), 1, "{line}");
        assert_eq!(read.diagnostics[0].code, DiagnosticCode::SeveralCommands, "{line}");
        assert_eq!(read.diagnostics[0].severity, Severity::Error);
    }
    assert_eq!(clean("(first) G1 X10 (then)").moves(), [[10.0, 0.0, 0.0, 0.0]]);
}

#[test]
fn commands_without_words_say_so_and_heed_checksums() {
    assert_eq!(read("G90 X5").said(), ["1:4-5 warning unused-word"]);
    assert_eq!(read("M82 E").said(), ["1:4-5 error missing-value"]);
    let damaged = read("G91*1\nG1 X1\nG1 X1");
    assert_eq!(damaged.said(), ["1:3-5 error checksum-mismatch"]);
    assert_eq!(damaged.interpreter.position().x, 1.0, "the damaged line had no effect");
}

#[test]
fn any_number_of_byte_order_marks_is_no_deep_recursion() {
    let line = b"\xef\xbb\xbf".repeat(LINE_BYTES_MAX / 3);
    let (mut actions, mut diagnostics) = (Vec::new(), Vec::new());
    Interpreter::new(Settings::default()).line(LineNumber(1), &line, &mut actions, &mut diagnostics);
    assert_eq!((actions.len(), diagnostics.len()), (0, 1));
    assert_eq!((diagnostics[0].code, diagnostics[0].columns.clone()), (DiagnosticCode::NotText, 3..4));
}

#[test]
fn a_message_quotes_no_more_of_a_line_than_can_be_read() {
    let read = read(&format!("G1 {}", "=".repeat(10_000)));
    assert!(read.diagnostics[0].message.len() < 300);
}
