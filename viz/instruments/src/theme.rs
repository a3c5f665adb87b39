//! Colours and type. The colours are those of `web/src/styles/base.css`, light and dark.

use std::sync::Arc;

use egui::{Color32, Context, CornerRadius, FontData, FontDefinitions, FontFamily, FontId, TextStyle, Theme};

/// The name that the one font has here.
const FONT: &str = "Ubuntu";
/// Size of all text, points.
const TEXT_SIZE: f32 = 12.0;

/// What the instruments are painted with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Palette {
    /// The card that they lie on.
    pub card: Color32,
    /// What floats above it.
    pub raised: Color32,
    /// Grid lines.
    pub line: Color32,
    /// Words.
    pub text: Color32,
    /// Words that matter less.
    pub dim: Color32,
    /// One for each heater; they start over where there are more.
    pub heaters: [Color32; 3],
    /// The planned speed.
    pub speed: Color32,
    /// The line at now.
    pub now: Color32,
}

const LIGHT: Palette = Palette {
    card: Color32::from_rgb(0xff, 0xff, 0xff),
    raised: Color32::from_rgb(0xf3, 0xf5, 0xf7),
    line: Color32::from_rgb(0xdd, 0xe2, 0xe7),
    text: Color32::from_rgb(0x18, 0x20, 0x2a),
    dim: Color32::from_rgb(0x55, 0x60, 0x6c),
    heaters: [
        Color32::from_rgb(0xb3, 0x47, 0x00),
        Color32::from_rgb(0x0d, 0x6a, 0x80),
        Color32::from_rgb(0x1c, 0x73, 0x41),
    ],
    speed: Color32::from_rgb(0x0d, 0x6a, 0x80),
    now: Color32::from_rgb(0x82, 0x8d, 0x98),
};

const DARK: Palette = Palette {
    card: Color32::from_rgb(0x18, 0x1d, 0x23),
    raised: Color32::from_rgb(0x22, 0x29, 0x32),
    line: Color32::from_rgb(0x2b, 0x33, 0x3d),
    text: Color32::from_rgb(0xe8, 0xec, 0xf0),
    dim: Color32::from_rgb(0xa3, 0xae, 0xba),
    heaters: [
        Color32::from_rgb(0xff, 0x9f, 0x5a),
        Color32::from_rgb(0x4f, 0xb9, 0xd3),
        Color32::from_rgb(0x6f, 0xcf, 0x97),
    ],
    speed: Color32::from_rgb(0x4f, 0xb9, 0xd3),
    now: Color32::from_rgb(0x6b, 0x77, 0x84),
};

/// The colours of a theme.
pub fn palette(theme: Theme) -> Palette {
    match theme {
        Theme::Light => LIGHT,
        Theme::Dark => DARK,
    }
}

/// Gives a context its font and both themes.
pub fn set_up(context: &Context) {
    let mut fonts = FontDefinitions::empty();
    let data = FontData::from_static(epaint_default_fonts::UBUNTU_LIGHT);
    fonts.font_data.insert(FONT.to_owned(), Arc::new(data));
    for family in [FontFamily::Proportional, FontFamily::Monospace] {
        fonts.families.insert(family, vec![FONT.to_owned()]);
    }
    context.set_fonts(fonts);
    for theme in [Theme::Light, Theme::Dark] {
        let colours = palette(theme);
        context.style_mut_of(theme, |style| {
            for text in [TextStyle::Body, TextStyle::Small, TextStyle::Button, TextStyle::Heading] {
                style.text_styles.insert(text, FontId::proportional(TEXT_SIZE));
            }
            style.spacing.item_spacing = egui::vec2(8.0, 2.0);
            // Nothing here fades in: a frame more for every change is a frame too much.
            style.animation_time = 0.0;
            let visuals = &mut style.visuals;
            visuals.override_text_color = Some(colours.text);
            visuals.panel_fill = colours.card;
            visuals.extreme_bg_color = colours.card;
            visuals.window_fill = colours.raised;
            visuals.window_stroke = egui::Stroke::new(1.0, colours.line);
            visuals.popup_shadow = egui::Shadow::NONE;
            visuals.menu_corner_radius = CornerRadius::same(6);
        });
    }
}
