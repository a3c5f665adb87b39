//! The instruments for JavaScript: a WebGL context, what is shown, and what the pointer does, in; pictures out.
//!
//! Draws only when told, so whoever calls decides how often, and a picture that did not change costs nothing. Works on
//! a page as in a worker: it touches no DOM. Positions are CSS pixels from the canvas's upper left corner.

use std::sync::Arc;

use egui::{Context, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, Theme, Vec2, ViewportId};
use egui_glow::{Painter, glow};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};
use web_sys::WebGl2RenderingContext;

use crate::history::Reading;
use crate::theme::{palette, set_up};
use crate::view::View;

/// Numbers of a reading: the heater's place among the names, s, measured °C, target °C.
const READING_NUMBERS: usize = 4;
/// What happens between two frames beyond this is left out.
const EVENTS_MAX: usize = 256;

/// The graphs on one canvas.
#[wasm_bindgen]
pub struct Instruments {
    context: Context,
    painter: Painter,
    view: View,
    events: Vec<Event>,
    pointer: Pos2,
    size_px: [u32; 2],
    pixels_per_point: f32,
}

#[wasm_bindgen]
impl Instruments {
    /// Graphs on a WebGL 2 context, of heaters with these names; numbers get this decimal sign.
    #[wasm_bindgen(constructor)]
    pub fn new(
        gl: WebGl2RenderingContext,
        heaters: Vec<String>,
        decimal_sign: char,
    ) -> Result<Instruments, JsError> {
        // Shared with callbacks that nothing here uses; there are no threads.
        #[allow(clippy::arc_with_non_send_sync)]
        let gl = Arc::new(glow::Context::from_webgl2_context(gl));
        let painter = Painter::new(gl, "", None, false).map_err(|error| JsError::new(&error.to_string()))?;
        let context = Context::default();
        set_up(&context);
        let view = View::new(heaters, decimal_sign);
        let size_px = [1, 1];
        Ok(Self {
            context,
            painter,
            view,
            events: Vec::new(),
            pointer: Pos2::ZERO,
            size_px,
            pixels_per_point: 1.0,
        })
    }

    /// The canvas's size, and how many of its pixels are a CSS pixel.
    pub fn resize(&mut self, width_px: u32, height_px: u32, pixels_per_point: f32) {
        self.size_px = [width_px.max(1), height_px.max(1)];
        self.pixels_per_point = if pixels_per_point > 0.0 { pixels_per_point } else { 1.0 };
    }

    /// Dark or light.
    pub fn set_dark(&mut self, is_dark: bool) {
        self.context.set_theme(if is_dark { Theme::Dark } else { Theme::Light });
    }

    /// Adds readings, four numbers each: the heater's place among the names, when in s, measured °C, target °C (0 is
    /// off). A reading that is not later than that heater's last is left out.
    pub fn push_temperatures(&mut self, readings: &[f64]) {
        for reading in readings.chunks_exact(READING_NUMBERS) {
            let [heater, t_s, measured_c, target_c] = [reading[0], reading[1], reading[2], reading[3]];
            self.view.push_temperature(heater as usize, Reading { t_s, measured_c, target_c });
        }
    }

    /// Puts the planned speed in place of what was: pairs of s from now and mm/s, in the order of time.
    pub fn set_planned_speed(&mut self, pairs: &[f64]) {
        self.view.set_planned_speed(pairs);
    }

    /// Shows the last `span_s` seconds of temperatures.
    pub fn show_last(&mut self, span_s: f64) {
        self.view.show_last(span_s);
    }

    /// The pointer is there.
    pub fn pointer_moved(&mut self, x: f32, y: f32) {
        self.pointer = Pos2::new(x, y);
        self.happened(Event::PointerMoved(self.pointer));
    }

    /// The pointer's main button went down or up, where the pointer was last.
    pub fn pointer_pressed(&mut self, pressed: bool) {
        let (pos, modifiers) = (self.pointer, Modifiers::NONE);
        self.happened(Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers });
    }

    /// The pointer left the canvas.
    pub fn pointer_left(&mut self) {
        self.happened(Event::PointerGone);
    }

    /// A pinch or its like at the pointer: above 1 shows a shorter time.
    pub fn zoom(&mut self, factor: f32) {
        self.happened(Event::Zoom(factor));
    }

    /// Draws. `time_s` is any clock that does not go back. Returns after how many seconds it wants to be drawn again,
    /// though nothing else should change; infinite where that is never.
    pub fn draw(&mut self, time_s: f64) -> f64 {
        let input = self.input(time_s);
        let output = self.context.run_ui(input, |ui| self.view.ui(ui));
        let mut textures = output.textures_delta;
        let primitives = self.context.tessellate(output.shapes, output.pixels_per_point);
        let card = palette(self.context.theme()).card.to_normalized_gamma_f32();
        self.painter.clear(self.size_px, card);
        self.painter.paint_and_update_textures(
            self.size_px,
            output.pixels_per_point,
            &primitives,
            &mut textures,
        );
        let delay = output.viewport_output.get(&ViewportId::ROOT).map(|viewport| viewport.repaint_delay);
        delay
            .filter(|delay| *delay < std::time::Duration::MAX)
            .map_or(f64::INFINITY, |delay| delay.as_secs_f64())
    }

    fn happened(&mut self, event: Event) {
        if self.events.len() < EVENTS_MAX {
            self.events.push(event);
        }
    }

    fn input(&mut self, time_s: f64) -> RawInput {
        let [width, height] = self.size_px.map(|pixels| pixels as f32 / self.pixels_per_point);
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, Vec2::new(width, height))),
            max_texture_side: Some(self.painter.max_texture_side()),
            time: Some(time_s),
            events: std::mem::take(&mut self.events),
            focused: true,
            ..RawInput::default()
        };
        input.viewports.entry(ViewportId::ROOT).or_default().native_pixels_per_point =
            Some(self.pixels_per_point);
        input
    }
}

impl Drop for Instruments {
    fn drop(&mut self) {
        self.painter.destroy();
    }
}
