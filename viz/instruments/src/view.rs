//! The two graphs, one above the other. Draws what it was given last, and asks for a further frame only where a
//! pointer does something.

use std::sync::Arc;

use egui::{Color32, CursorIcon, RichText, Sense, Stroke, Ui, Vec2};
use egui_plot::{AxisHints, GridMark, HoverPosition, Line, LineStyle, Plot, PlotBounds, PlotPoints, VLine};

use crate::axis;
use crate::history::{Heater, Reading};
use crate::speed::{AHEAD_S, BEHIND_S, PlannedSpeed};
use crate::theme::{Palette, palette};
use crate::thin::Point;
use crate::window::{SPAN_DEFAULT_S, Window};

/// A temperature scale reaches to this at least, °C.
const SCALE_MIN_C: f64 = 50.0;
/// Marks of a temperature scale.
const SCALE_STEPS: f64 = 5.0;
/// Points between two marks of a time axis, at least.
const TIME_MARK_POINTS: f64 = 64.0;
/// Room for the numbers left of a graph, so that both begin at the same place; points.
const SCALE_WIDTH: f32 = 30.0;
/// Room right of a graph, for half of the last mark's words; points.
const MARGIN_RIGHT: f32 = 14.0;
/// A mark nearer to the start than this share of the axis has no words: the scale's zero stands there.
const START_SHARE: f64 = 0.08;
/// How much of the height the temperatures get.
const TEMPERATURE_SHARE: f32 = 0.56;
/// Height of a graph's heading with the space below it, points.
const HEADING_HEIGHT: f32 = 20.0;
/// Between the two graphs, points.
const GAP: f32 = 8.0;

/// What is shown, and how.
pub struct View {
    heaters: Vec<Heater>,
    speed: PlannedSpeed,
    window: Window,
    decimal_sign: char,
}

impl View {
    /// Graphs of heaters with these names. Numbers get this decimal sign.
    pub fn new(heaters: impl IntoIterator<Item = String>, decimal_sign: char) -> Self {
        Self {
            heaters: heaters.into_iter().map(Heater::new).collect(),
            speed: PlannedSpeed::default(),
            window: Window::default(),
            decimal_sign,
        }
    }

    /// Takes a reading of a heater, by its place among the names.
    pub fn push_temperature(&mut self, heater: usize, reading: Reading) {
        if let Some(heater) = self.heaters.get_mut(heater) {
            heater.push(reading);
        }
    }

    /// The planned speed as it is now: pairs of s from now and mm/s.
    pub fn set_planned_speed(&mut self, pairs: &[f64]) {
        self.speed.set(pairs);
    }

    /// Shows the last `span_s` seconds of temperatures.
    pub fn show_last(&mut self, span_s: f64) {
        self.window.show_last(span_s);
    }

    /// Draws both graphs into all the room that there is.
    pub fn ui(&mut self, ui: &mut Ui) {
        let colours = palette(ui.theme());
        let height = ui.available_height();
        ui.spacing_mut().item_spacing.y = 0.0;
        let upper = (height * TEMPERATURE_SHARE).floor();
        self.temperatures(ui, &colours, upper - HEADING_HEIGHT);
        ui.add_space(GAP);
        self.planned_speed(ui, &colours, height - upper - GAP - HEADING_HEIGHT);
    }

    /// First and last moment of which a temperature is known, s.
    fn kept_s(&self) -> Option<(f64, f64)> {
        let ends = self.heaters.iter().filter_map(Heater::kept_s);
        ends.reduce(|(first, last), (start, end)| (first.min(start), last.max(end)))
    }

    fn temperatures(&mut self, ui: &mut Ui, colours: &Palette, height: f32) {
        heading(ui, colours, "Temperature, °C", |ui| {
            for (index, heater) in self.heaters.iter().enumerate().rev() {
                key(ui, &heater.label, heater_colour(colours, index));
            }
        });
        let (first_s, now_s) = self.kept_s().unwrap_or((0.0, 0.0));
        let (start_s, end_s) = self.window.range_s();
        let absolute_s = (now_s + start_s, now_s + end_s);
        let column_s = self.window.span_s() / f64::from(ui.available_width().max(1.0));
        let peak_c =
            self.heaters.iter().filter_map(|heater| heater.peak_c(absolute_s)).fold(SCALE_MIN_C, f64::max);
        let (step_c, top_c) = axis::scale(peak_c, SCALE_STEPS);
        let lines = self.temperature_lines(colours, absolute_s, column_s);
        let readout = temperature_readout(&self.heaters, self.decimal_sign, now_s);
        let plot = graph("temperature", ui, height, (start_s, end_s), step_c).label_formatter(readout);
        let response = plot.show(ui, |plot| {
            plot.set_plot_bounds(PlotBounds::from_min_max([start_s, 0.0], [end_s, top_c]));
            for (line, stroke, style) in lines {
                let points: Vec<Point> = line.iter().map(|point| [point[0] - now_s, point[1]]).collect();
                plot.line(quiet_line(points, stroke).style(style));
            }
        });
        if self.kept_s().is_none() {
            centred(ui, colours, response.response.rect, "No temperatures yet");
        }
        let pointed_s = response.response.hover_pos().map(|at| response.transform.value_from_position(at).x);
        self.follow_pointer(&response.response, pointed_s, now_s - first_s);
    }

    /// Dragging moves the window, pinching or Ctrl with the wheel makes it shorter or longer, a double click resets it.
    fn follow_pointer(&mut self, response: &egui::Response, pointed_s: Option<f64>, kept_s: f64) {
        let before = self.window;
        if response.dragged() {
            let points = f64::from(response.drag_delta().x);
            self.window
                .drag(points * self.window.span_s() / f64::from(response.rect.width().max(1.0)), kept_s);
        }
        let factor = response.ctx.input(egui::InputState::zoom_delta);
        if let Some(at_s) = pointed_s.filter(|_| factor != 1.0) {
            self.window.zoom(f64::from(factor), at_s, kept_s);
        }
        if response.double_clicked() {
            self.window.show_last(SPAN_DEFAULT_S);
        }
        if self.window != before {
            response.ctx.request_repaint();
        }
        response.clone().on_hover_cursor(CursorIcon::Crosshair);
    }

    fn temperature_lines(
        &self,
        colours: &Palette,
        span_s: (f64, f64),
        column_s: f64,
    ) -> Vec<(Vec<Point>, Stroke, LineStyle)> {
        let mut lines = Vec::new();
        for (index, heater) in self.heaters.iter().enumerate() {
            let colour = heater_colour(colours, index);
            let target = Stroke::new(1.0, colour.gamma_multiply(0.8));
            lines.extend(
                heater.target(span_s).into_iter().map(|line| (line, target, LineStyle::dashed_dense())),
            );
            let measured = Stroke::new(1.8, colour);
            let drawn = heater.measured(span_s, column_s).into_iter();
            lines.extend(drawn.map(|line| (line, measured, LineStyle::Solid)));
        }
        lines
    }

    fn planned_speed(&self, ui: &mut Ui, colours: &Palette, height: f32) {
        heading(ui, colours, "Planned speed, mm/s", |_| ());
        let top_mm_s = self.speed.scale_mm_s();
        let (step_mm_s, _) = axis::scale(top_mm_s, SCALE_STEPS);
        let range_s = (-BEHIND_S, AHEAD_S);
        let column_s = (AHEAD_S + BEHIND_S) / f64::from(ui.available_width().max(1.0));
        let (made, ahead) = self.speed.lines(column_s);
        let readout = |hover: &HoverPosition<'_>| {
            let t_s = position(hover)[0];
            let speed_mm_s = axis::number(self.speed.at(t_s)?, 0, self.decimal_sign);
            Some(format!("{} s\n{speed_mm_s} mm/s", axis::number(t_s, 1, self.decimal_sign)))
        };
        let plot = graph("speed", ui, height, range_s, step_mm_s).label_formatter(readout);
        let response = plot.show(ui, |plot| {
            plot.set_plot_bounds(PlotBounds::from_min_max([range_s.0, 0.0], [range_s.1, top_mm_s * 1.06]));
            for (line, colour) in [(made, colours.now), (ahead, colours.speed)] {
                plot.line(quiet_line(line, Stroke::new(1.6, colour)).fill(0.0).fill_alpha(0.14));
            }
            plot.vline(VLine::new("", 0.0).stroke(Stroke::new(1.0, colours.text)).allow_hover(false));
        });
        if self.speed.is_empty() {
            centred(ui, colours, response.response.rect, "No motion is planned");
        }
    }
}

/// A line that the pointer does not catch. The points are thinned already: a band in their place would hide the dips.
fn quiet_line(points: Vec<Point>, stroke: Stroke) -> Line<'static> {
    Line::new("", PlotPoints::from(points)).stroke(stroke).allow_band(false).allow_hover(false)
}

fn position(hover: &HoverPosition<'_>) -> Point {
    let (HoverPosition::NearDataPoint { position, .. } | HoverPosition::Elsewhere { position }) = hover;
    [position.x, position.y]
}

/// What is said of the moment under the pointer, where something was read then.
fn temperature_readout(
    heaters: &[Heater],
    decimal_sign: char,
    now_s: f64,
) -> impl Fn(&HoverPosition<'_>) -> Option<String> + use<'_> {
    move |hover| {
        let t_s = position(hover)[0];
        let mut lines = vec![axis::time_label(t_s.min(0.0), 1.0)];
        for heater in heaters {
            let Some(reading) = heater.at(now_s + t_s) else { continue };
            let measured = axis::number(reading.measured_c, 1, decimal_sign);
            let target = if reading.target_c > 0.0 {
                format!(" of {} °C", axis::number(reading.target_c, 0, decimal_sign))
            } else {
                " °C".to_owned()
            };
            lines.push(format!("{} {measured}{target}", heater.label));
        }
        (lines.len() > 1).then(|| lines.join("\n"))
    }
}

fn heater_colour(colours: &Palette, index: usize) -> Color32 {
    colours.heaters[index % colours.heaters.len()]
}

/// A graph's name on the left and its key on the right.
fn heading(ui: &mut Ui, colours: &Palette, text: &str, keys: impl FnOnce(&mut Ui)) {
    let size = Vec2::new(ui.available_width(), HEADING_HEIGHT);
    ui.allocate_ui_with_layout(size, egui::Layout::left_to_right(egui::Align::Center), |ui| {
        ui.set_min_size(size);
        ui.label(RichText::new(text).color(colours.dim));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), keys);
    });
}

/// A line's name after a stroke of its colour; for layouts from right to left.
fn key(ui: &mut Ui, label: &str, colour: Color32) {
    ui.label(label);
    let (rect, _) = ui.allocate_exact_size(Vec2::new(14.0, HEADING_HEIGHT), Sense::hover());
    ui.painter().hline(rect.x_range(), rect.center().y, Stroke::new(2.0, colour));
}

fn centred(ui: &Ui, colours: &Palette, rect: egui::Rect, text: &str) {
    let font = egui::TextStyle::Body.resolve(ui.style());
    ui.painter().text(rect.center(), egui::Align2::CENTER_CENTER, text, font, colours.dim);
}

/// An empty graph over a range of time, whose value axis has a mark every `step`. It moves only as it is told.
fn graph<'a>(name: &str, ui: &Ui, height: f32, range_s: (f64, f64), step: f64) -> Plot<'a> {
    let colours = palette(ui.theme());
    let count = (f64::from(ui.available_width() - SCALE_WIDTH) / TIME_MARK_POINTS).max(1.0);
    let time_step_s = axis::time_step_s(range_s.1 - range_s.0, count);
    let marks = |step: f64| {
        move |input: egui_plot::GridInput| -> Vec<GridMark> {
            let values = axis::marks(input.bounds, step);
            values.into_iter().map(|value| GridMark { value, step_size: step }).collect()
        }
    };
    let times = AxisHints::new_x()
        .formatter(move |mark, range| {
            let from_start = (mark.value - range.start()) / (range.end() - range.start());
            if from_start < START_SHARE { String::new() } else { axis::time_label(mark.value, time_step_s) }
        })
        .label_spacing(4.0..=8.0)
        .tick_label_color(colours.dim);
    let values = AxisHints::new_y()
        .formatter(|mark, _| axis::number(mark.value, 0, '.'))
        .label_spacing(4.0..=8.0)
        .min_thickness(SCALE_WIDTH)
        .tick_label_color(colours.dim);
    Plot::new(Arc::<str>::from(name))
        .width((ui.available_width() - MARGIN_RIGHT).max(1.0))
        .height(height.max(1.0))
        .sense(Sense::click_and_drag())
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_axis_zoom_drag(false)
        .allow_double_click_reset(false)
        .show_y(false)
        .show_background(false)
        .grid_color(colours.line)
        .grid_fade(0.0)
        .cursor_color(colours.now)
        .x_grid_spacer(marks(time_step_s))
        .y_grid_spacer(marks(step))
        .custom_x_axes(vec![times])
        .custom_y_axes(vec![values])
}

#[cfg(test)]
mod tests;
