//! The graphs are drawn into an egui context without a window, and judged by the shapes that come out.

use egui::epaint::ClippedShape;
use egui::{Context, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, Shape, Theme, ViewportId, vec2};

use super::*;
use crate::history::READINGS_MAX;
use crate::theme::set_up;

const SIZE: Vec2 = vec2(360.0, 340.0);

struct Bench {
    context: Context,
    view: View,
    time_s: f64,
    size: Vec2,
}

impl Bench {
    fn new(theme: Theme) -> Self {
        let context = Context::default();
        set_up(&context);
        context.set_theme(theme);
        let view = View::new(["Nozzle", "Bed"].map(String::from), ',');
        Self { context, view, time_s: 0.0, size: SIZE }
    }

    /// Ten minutes of a hot nozzle and a warm bed, and a plan.
    fn busy(theme: Theme) -> Self {
        let mut bench = Self::new(theme);
        for second in 0..600 {
            bench.read(0, f64::from(second), 205.2, 210.0);
            bench.read(1, f64::from(second), 60.0, 60.0);
        }
        bench.view.set_planned_speed(&[-1.0, 0.0, 0.0, 80.0, 2.0, 80.0, 3.0, 0.0]);
        bench
    }

    fn read(&mut self, heater: usize, t_s: f64, measured_c: f64, target_c: f64) {
        self.view.push_temperature(heater, Reading { t_s, measured_c, target_c });
    }

    fn draw(&mut self, events: Vec<Event>) -> Drawn {
        self.time_s += 0.1;
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, self.size)),
            time: Some(self.time_s),
            events,
            ..RawInput::default()
        };
        let mut output = self.context.run_ui(input, |ui| self.view.ui(ui));
        // Nothing here has textures.
        output.textures_delta.clear();
        let delay = output.viewport_output[&ViewportId::ROOT].repaint_delay;
        Drawn { shapes: output.shapes, is_at_rest: delay == std::time::Duration::MAX }
    }

    /// Draws until nothing more is asked for.
    fn settle(&mut self) -> Drawn {
        for _ in 0..8 {
            let drawn = self.draw(Vec::new());
            if drawn.is_at_rest {
                return drawn;
            }
        }
        panic!("a picture that does not change is drawn over and over");
    }
}

struct Drawn {
    shapes: Vec<ClippedShape>,
    is_at_rest: bool,
}

fn each<'a>(shape: &'a Shape, visit: &mut impl FnMut(&'a Shape)) {
    match shape {
        Shape::Vec(shapes) => shapes.iter().for_each(|inner| each(inner, visit)),
        single => visit(single),
    }
}

impl Drawn {
    fn for_each<'a>(&'a self, mut visit: impl FnMut(&'a Shape)) {
        self.shapes.iter().for_each(|clipped| each(&clipped.shape, &mut visit));
    }

    fn texts(&self) -> Vec<&str> {
        let mut texts = Vec::new();
        self.for_each(|shape| {
            if let Shape::Text(text) = shape {
                texts.push(text.galley.text());
            }
        });
        texts
    }

    fn says(&self, wanted: &str) -> bool {
        self.texts().iter().any(|text| text.contains(wanted))
    }

    /// Points of all lines of a colour.
    fn points(&self, colour: Color32) -> usize {
        let mut points = 0;
        self.for_each(|shape| match shape {
            Shape::Path(path) if path.stroke.color == egui::epaint::ColorMode::Solid(colour) => {
                points += path.points.len();
            }
            Shape::LineSegment { stroke, .. } if stroke.color == colour => points += 2,
            _ => (),
        });
        points
    }
}

#[test]
fn both_graphs_have_their_names_scales_and_keys() {
    let drawn = Bench::busy(Theme::Light).settle();
    for text in
        ["Temperature, °C", "Nozzle", "Bed", "Planned speed, mm/s", "250", "100", "now", "−2 min", "2 s"]
    {
        assert!(drawn.says(text), "{text} is missing among {:?}", drawn.texts());
    }
    assert!(!drawn.says("No temperatures yet"));
    assert!(!drawn.says("No motion is planned"));
}

#[test]
fn without_data_it_says_so() {
    let drawn = Bench::new(Theme::Dark).settle();
    assert!(drawn.says("No temperatures yet"));
    assert!(drawn.says("No motion is planned"));
}

#[test]
fn lines_have_the_colours_of_the_theme() {
    for (theme, other) in [(Theme::Light, Theme::Dark), (Theme::Dark, Theme::Light)] {
        let drawn = Bench::busy(theme).settle();
        for index in 0..2 {
            assert!(drawn.points(palette(theme).heaters[index]) > 100, "{theme:?}, heater {index}");
            assert_eq!(drawn.points(palette(other).heaters[index]), 0, "{theme:?}, heater {index}");
        }
    }
}

#[test]
fn what_does_not_change_is_not_drawn_again() {
    let mut bench = Bench::busy(Theme::Light);
    bench.settle();
    bench.view.set_planned_speed(&[0.0, 10.0, 1.0, 20.0]);
    bench.settle();
    bench.draw(vec![Event::PointerMoved(Pos2::new(200.0, 100.0))]);
    bench.settle();
}

#[test]
fn two_hours_of_readings_take_no_more_points_than_there_are_pixels_for() {
    let mut bench = Bench::new(Theme::Light);
    for second in 0..READINGS_MAX {
        bench.read(0, second as f64, 200.0 + f64::from(second as u32 % 7), 0.0);
    }
    bench.view.show_last(READINGS_MAX as f64);
    let points = bench.settle().points(palette(Theme::Light).heaters[0]);
    assert!((500..1500).contains(&points), "{points} points");
}

#[test]
fn the_pointer_is_told_what_was_read_there() {
    let mut bench = Bench::busy(Theme::Light);
    bench.settle();
    bench.draw(vec![Event::PointerMoved(Pos2::new(200.0, 100.0))]);
    let drawn = bench.settle();
    assert!(drawn.says("Nozzle 205,2 of 210 °C"), "{:?}", drawn.texts());
    bench.draw(vec![Event::PointerMoved(Pos2::new(140.0, 280.0))]);
    let drawn = bench.settle();
    assert!(drawn.says("mm/s"), "{:?}", drawn.texts());
    assert!(!drawn.says("of 210 °C"));
    bench.draw(vec![Event::PointerGone]);
    assert_eq!(bench.settle().texts().iter().filter(|text| text.ends_with("mm/s")).count(), 1);
}

fn press(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

#[test]
fn dragging_goes_back_in_time_and_a_double_click_returns() {
    let mut bench = Bench::new(Theme::Light);
    for second in 0..3600 {
        bench.read(0, f64::from(second), 205.0, 0.0);
    }
    bench.settle();
    let (from, to) = (Pos2::new(100.0, 100.0), Pos2::new(250.0, 100.0));
    for events in [
        vec![Event::PointerMoved(from)],
        vec![press(from, true)],
        vec![Event::PointerMoved(to)],
        vec![press(to, false)],
    ] {
        bench.draw(events);
    }
    let drawn = bench.settle();
    let (_, end_s) = bench.view.window.range_s();
    assert!((-320.0..-270.0).contains(&end_s), "dragged to {end_s} s");
    assert!(drawn.says("−6 min"), "{:?}", drawn.texts());
    for _ in 0..2 {
        bench.draw(vec![press(to, true)]);
        bench.draw(vec![press(to, false)]);
    }
    bench.settle();
    assert_eq!(bench.view.window, Window::default());
}

#[test]
fn a_pinch_shortens_the_time_shown() {
    let mut bench = Bench::busy(Theme::Light);
    bench.settle();
    bench.draw(vec![Event::PointerMoved(Pos2::new(300.0, 100.0))]);
    bench.draw(vec![Event::Zoom(2.0)]);
    bench.settle();
    assert_eq!(bench.view.window.span_s(), 300.0);
}

#[test]
fn hardly_any_room_is_no_reason_to_panic() {
    for size in [vec2(1.0, 1.0), vec2(40.0, 30.0), vec2(2000.0, 60.0)] {
        let mut bench = Bench::busy(Theme::Light);
        bench.size = size;
        bench.settle();
    }
}
