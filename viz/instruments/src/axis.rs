//! Where an axis has its marks, and what stands there.

/// Steps of a time axis, s.
const TIME_STEPS_S: [f64; 12] = [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0];
/// More marks than this are never drawn.
const MARKS_MAX: usize = 64;

/// The distance between marks of a time axis with at most so many of them, s.
pub fn time_step_s(span_s: f64, marks: f64) -> f64 {
    let least_s = span_s / marks;
    TIME_STEPS_S.into_iter().find(|&step_s| step_s >= least_s).unwrap_or(TIME_STEPS_S[11])
}

/// The smallest of 1, 2, 5, 10, 20, 50 … that is at least `least`.
pub fn round_up(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let mut power = 1.0;
    while power * 10.0 <= least {
        power *= 10.0;
    }
    while power > least {
        power /= 10.0;
    }
    [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|&step| step >= least).unwrap_or(10.0 * power)
}

/// The distance between marks of an axis that begins at 0, and its end: a whole number of steps above `peak`.
pub fn scale(peak: f64, steps: f64) -> (f64, f64) {
    let step = round_up(peak / steps);
    (step, (peak / step).ceil().max(1.0) * step)
}

/// All multiples of `step` within a range.
pub fn marks((from, to): (f64, f64), step: f64) -> Vec<f64> {
    let (first, last) = ((from / step).ceil(), (to / step).floor());
    let count = if last < first { 0 } else { ((last - first) as usize + 1).min(MARKS_MAX) };
    (0..count).map(|i| (first + i as f64) * step).collect()
}

/// A time before or after now: `−5 min`, `now`, `2 s`, `−1:30 h`.
pub fn time_label(t_s: f64, step_s: f64) -> String {
    let sign = if t_s < 0.0 { "−" } else { "" };
    let total_s = t_s.abs().round() as u64;
    if total_s == 0 {
        return "now".to_owned();
    }
    if total_s >= 3600 {
        return match (total_s / 60) % 60 {
            0 => format!("{sign}{} h", total_s / 3600),
            minutes => format!("{sign}{}:{minutes:02} h", total_s / 3600),
        };
    }
    if step_s >= 60.0 && total_s.is_multiple_of(60) {
        return format!("{sign}{} min", total_s / 60);
    }
    if total_s >= 60 {
        return format!("{sign}{}:{:02}", total_s / 60, total_s % 60);
    }
    format!("{sign}{total_s} s")
}

/// A number with `decimals` decimals after the user's decimal sign, no minus before a zero.
pub fn number(value: f64, decimals: usize, decimal_sign: char) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    let plain = if is_zero { text.trim_start_matches('-') } else { &text };
    plain.replace('.', decimal_sign.encode_utf8(&mut [0; 4])).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_numbers() {
        for (least, step) in [
            (0.03, 0.05),
            (0.7, 1.0),
            (1.0, 1.0),
            (1.1, 2.0),
            (3.0, 5.0),
            (70.0, 100.0),
            (100.0, 100.0),
            (101.0, 200.0),
        ] {
            assert!((round_up(least) - step).abs() < 1e-12, "{least}: {}", round_up(least));
        }
        assert_eq!(round_up(0.0), 1.0);
        assert_eq!(round_up(f64::NAN), 1.0);
    }

    #[test]
    fn a_scale_reaches_above_the_peak() {
        assert_eq!(scale(205.0, 4.0), (100.0, 300.0));
        assert_eq!(scale(240.0, 5.0), (50.0, 250.0));
        assert_eq!(scale(0.0, 4.0), (1.0, 1.0));
    }

    #[test]
    fn marks_are_multiples_within_the_range_and_bounded() {
        assert_eq!(marks((-10.5, 10.0), 5.0), [-10.0, -5.0, 0.0, 5.0, 10.0]);
        assert!(marks((1.0, 4.0), 5.0).is_empty());
        assert_eq!(marks((0.0, 1e9), 1.0).len(), MARKS_MAX);
    }

    #[test]
    fn time_steps_are_those_of_a_clock() {
        assert_eq!(time_step_s(600.0, 5.0), 120.0);
        assert_eq!(time_step_s(7200.0, 5.0), 1800.0);
        assert_eq!(time_step_s(1e9, 5.0), 3600.0);
    }

    #[test]
    fn times_read_as_people_say_them() {
        let labels: Vec<String> = [
            (-600.0, 120.0),
            (-90.0, 30.0),
            (-30.0, 10.0),
            (0.0, 60.0),
            (2.0, 1.0),
            (-5400.0, 1800.0),
            (-7200.0, 1800.0),
        ]
        .into_iter()
        .map(|(t_s, step_s)| time_label(t_s, step_s))
        .collect();
        assert_eq!(labels, ["−10 min", "−1:30", "−30 s", "now", "2 s", "−1:30 h", "−2 h"]);
    }

    #[test]
    fn numbers_have_the_users_decimal_sign() {
        assert_eq!(number(205.04, 1, ','), "205,0");
        assert_eq!(number(-0.01, 1, '.'), "0.0");
        assert_eq!(number(-2.5, 1, '.'), "−2.5");
        assert_eq!(number(60.0, 0, ','), "60");
    }
}
