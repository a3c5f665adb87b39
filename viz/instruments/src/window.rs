//! Which part of the kept time is shown: a span that follows the newest reading until somebody drags it back.

/// The shortest span that can be looked at, s.
pub const SPAN_MIN_S: f64 = 30.0;
/// The longest: as much as is kept.
pub const SPAN_MAX_S: f64 = 7200.0;
/// What is shown at first.
pub const SPAN_DEFAULT_S: f64 = 600.0;

/// A span of time that ends `back_s` before the newest reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    span_s: f64,
    back_s: f64,
}

impl Default for Window {
    fn default() -> Self {
        Self { span_s: SPAN_DEFAULT_S, back_s: 0.0 }
    }
}

impl Window {
    /// How long it is, s.
    pub fn span_s(&self) -> f64 {
        self.span_s
    }

    /// Start and end, s before the newest reading as negative numbers.
    pub fn range_s(&self) -> (f64, f64) {
        (-self.back_s - self.span_s, -self.back_s)
    }

    /// The last `span_s` seconds.
    pub fn show_last(&mut self, span_s: f64) {
        if span_s.is_finite() {
            *self = Self { span_s: span_s.clamp(SPAN_MIN_S, SPAN_MAX_S), back_s: 0.0 };
        }
    }

    /// Drags what is shown by `by_s` towards the past, within the `kept_s` seconds that there are.
    pub fn drag(&mut self, by_s: f64, kept_s: f64) {
        self.back_s += by_s;
        self.keep_within(kept_s);
    }

    /// Makes the span `factor` times shorter about the moment `at_s` (negative), which stays where it is.
    pub fn zoom(&mut self, factor: f64, at_s: f64, kept_s: f64) {
        if !(factor.is_finite() && factor > 0.0) {
            return;
        }
        let share = ((-self.back_s - at_s) / self.span_s).clamp(0.0, 1.0);
        let span_s = (self.span_s / factor).clamp(SPAN_MIN_S, SPAN_MAX_S);
        self.back_s += share * (self.span_s - span_s);
        self.span_s = span_s;
        self.keep_within(kept_s);
    }

    fn keep_within(&mut self, kept_s: f64) {
        self.back_s = self.back_s.clamp(0.0, (kept_s - self.span_s).max(0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_S: f64 = 3600.0;

    #[test]
    fn it_shows_the_last_ten_minutes_at_first() {
        assert_eq!(Window::default().range_s(), (-600.0, 0.0));
    }

    #[test]
    fn it_cannot_be_dragged_into_the_future_nor_past_what_is_kept() {
        let mut window = Window::default();
        window.drag(-100.0, HOUR_S);
        assert_eq!(window.range_s(), (-600.0, 0.0));
        window.drag(100.0, HOUR_S);
        assert_eq!(window.range_s(), (-700.0, -100.0));
        window.drag(1e6, HOUR_S);
        assert_eq!(window.range_s(), (-HOUR_S, -3000.0));
        let mut young = Window::default();
        young.drag(100.0, 20.0);
        assert_eq!(young.range_s(), (-600.0, 0.0));
    }

    #[test]
    fn zooming_keeps_the_moment_under_the_pointer() {
        let mut window = Window::default();
        window.drag(600.0, HOUR_S);
        window.zoom(2.0, -750.0, HOUR_S);
        assert_eq!(window.range_s(), (-975.0, -675.0));
        let share = |(start, end): (f64, f64)| (end + 750.0) / (end - start);
        assert_eq!(share(window.range_s()), share((-1200.0, -600.0)));
    }

    #[test]
    fn the_span_has_limits_and_nonsense_changes_nothing() {
        let mut window = Window::default();
        window.zoom(1e9, -10.0, HOUR_S);
        assert_eq!(window.span_s(), SPAN_MIN_S);
        window.zoom(1e-9, -10.0, HOUR_S);
        assert_eq!(window.span_s(), SPAN_MAX_S);
        let before = window;
        window.zoom(f64::NAN, 0.0, HOUR_S);
        window.zoom(0.0, 0.0, HOUR_S);
        window.show_last(f64::NAN);
        assert_eq!(window, before);
        window.show_last(1800.0);
        assert_eq!(window.range_s(), (-1800.0, 0.0));
    }
}
