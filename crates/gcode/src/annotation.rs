//! Comments that mean something: what the slicers tell a viewer about layers, features and time.
//!
//! Knows the dialects of `PrusaSlicer`, Orca (and Bambu Studio), Cura and Simplify3D. Of pictures it knows where they begin
//! and end, not what is in them.

use units::{Mm, Seconds};

use crate::number;

/// The longest text kept from a comment.
const TEXT_BYTES_MAX: usize = 128;
/// Longer than every name of a feature.
const FEATURE_BYTES_MAX: usize = 32;

/// What a stretch of extrusion is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Feature {
    /// A wall that cannot be seen.
    InnerWall,
    /// A wall that can.
    OuterWall,
    /// A wall over air.
    OverhangWall,
    /// Sparse infill.
    Infill,
    /// Solid infill inside.
    SolidInfill,
    /// A surface that looks up; Cura's skin.
    TopSurface,
    /// A surface that looks down.
    BottomSurface,
    /// Ironing.
    Ironing,
    /// Infill over air.
    Bridge,
    /// Filling of gaps too thin for a wall.
    GapFill,
    /// Skirt or brim.
    Skirt,
    /// Support.
    Support,
    /// The part of the support that touches the model.
    SupportInterface,
    /// Wipe or prime tower, ooze shield.
    PrimeTower,
    /// Raft.
    Raft,
    /// The user's own G-code.
    Custom,
    /// Anything else.
    Other,
}

impl Feature {
    fn named(name: &[u8]) -> Self {
        let mut lower = [0; FEATURE_BYTES_MAX];
        let Some(lower) = lower.get_mut(..name.len()) else { return Self::Other };
        lower.copy_from_slice(name);
        lower.make_ascii_lowercase();
        match &*lower {
            b"perimeter" | b"inner wall" | b"wall-inner" | b"inner perimeter" => Self::InnerWall,
            b"external perimeter" | b"outer wall" | b"wall-outer" | b"outer perimeter" => Self::OuterWall,
            b"overhang perimeter" | b"overhang wall" => Self::OverhangWall,
            b"internal infill" | b"sparse infill" | b"fill" | b"infill" => Self::Infill,
            b"solid infill" | b"internal solid infill" | b"solid layer" => Self::SolidInfill,
            b"top solid infill" | b"top surface" | b"skin" => Self::TopSurface,
            b"bottom surface" => Self::BottomSurface,
            b"ironing" => Self::Ironing,
            b"bridge infill" | b"bridge" | b"internal bridge" | b"internal bridge infill" => Self::Bridge,
            b"gap fill" | b"gap infill" | b"internal single extrusion" | b"external single extrusion" => {
                Self::GapFill
            }
            b"skirt/brim" | b"skirt" | b"brim" => Self::Skirt,
            b"support material" | b"support" | b"support transition" => Self::Support,
            b"support material interface"
            | b"support interface"
            | b"support-interface"
            | b"dense support" => Self::SupportInterface,
            b"wipe tower" | b"prime tower" | b"prime-tower" | b"prime pillar" | b"ooze shield" => {
                Self::PrimeTower
            }
            b"raft" => Self::Raft,
            b"custom" => Self::Custom,
            _ => Self::Other,
        }
    }
}

/// What a comment says.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Annotation {
    /// From here on, extrusion is for this.
    Feature(Feature),
    /// A layer begins.
    LayerChange,
    /// The layer of this number begins (Cura counts from 0, rafts below; Simplify3D from 1).
    Layer(i32),
    /// How many layers there are.
    LayerCount(u32),
    /// Height of the layer's top above the bed.
    Z(Mm),
    /// Thickness of the layer.
    Height(Mm),
    /// Width of what is extruded.
    Width(Mm),
    /// The model that is printed from here on (Cura).
    Mesh(String),
    /// How long the slicer thinks that the print takes.
    EstimatedTime(Seconds),
    /// How long the slicer thinks that it took up to here.
    ElapsedTime(Seconds),
    /// The program that wrote the file.
    Generator(String),
    /// A line of a picture of the print; only for those who
    /// [ask for it](crate::Interpreter::show_pictures).
    Picture(PictureLine),
}

/// A line of a picture of the print.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PictureLine {
    /// A picture begins.
    Begin,
    /// Some of its bytes, in base64: what stands in the line, at most [`LINE_BYTES_MAX`](crate::LINE_BYTES_MAX) bytes.
    Text(Box<[u8]>),
    /// It ends.
    End,
}

/// What is carried over from comment to comment.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pictures {
    /// This is one.
    pub(crate) within: bool,
    /// Somebody wants to see them.
    pub(crate) shown: bool,
}

impl Pictures {
    /// A comment within a picture, without the blanks around it.
    fn read(&mut self, text: &[u8], push: &mut impl FnMut(Annotation)) {
        self.within = !(text.starts_with(b"thumbnail") && text.ends_with(b"end"));
        if self.shown {
            push(Annotation::Picture(if self.within {
                PictureLine::Text(text.into())
            } else {
                PictureLine::End
            }));
        }
    }
}

/// Reads a whole-line comment (what follows its `;`).
pub(crate) fn read(comment: &[u8], pictures: &mut Pictures, mut push: impl FnMut(Annotation)) {
    let text = comment.trim_ascii();
    if pictures.within {
        return pictures.read(text, &mut push);
    }
    let Some(&first) = text.first() else { return };
    match first.to_ascii_uppercase() {
        // These begin most comments: the slicer's settings and pictures would otherwise be compared with everything.
        b'A'..=b'Z' => {}
        _ => return,
    }
    if text.starts_with(b"thumbnail") {
        pictures.within = memchr::memmem::find(text, b" begin").is_some();
        if pictures.within && pictures.shown {
            push(Annotation::Picture(PictureLine::Begin));
        }
        return;
    }
    let keyed = text.iter().position(|&b| b == b':').is_some_and(|colon| {
        let annotation = keyed(&text[..colon], text[colon + 1..].trim_ascii());
        annotation.map(&mut push).is_some()
    });
    if !keyed {
        plain(text, &mut push);
    }
}

/// `KEY:value`
fn keyed(key: &[u8], value: &[u8]) -> Option<Annotation> {
    let number = || number::read(value, 0).map(|(value, _)| value).filter(|value| value.abs() <= 1e9);
    Some(match key {
        b"TYPE" | b"FEATURE" => Annotation::Feature(Feature::named(value)),
        b"LAYER" => Annotation::Layer(number()? as i32),
        b"Z" | b"Z_HEIGHT" => Annotation::Z(Mm(number()?)),
        b"HEIGHT" | b"LAYER_HEIGHT" => Annotation::Height(Mm(number()?)),
        b"WIDTH" | b"LINE_WIDTH" => Annotation::Width(Mm(number()?)),
        b"LAYER_COUNT" | b"total layer number" => Annotation::LayerCount(number()? as u32),
        b"MESH" => Annotation::Mesh(text_of(value)),
        b"TIME" => Annotation::EstimatedTime(Seconds(number()?)),
        b"TIME_ELAPSED" => Annotation::ElapsedTime(Seconds(number()?)),
        b"Build time" | b"total estimated time" => Annotation::EstimatedTime(duration(value)?),
        b"model printing time" => {
            let at = memchr::memmem::find(value, b"time:")?;
            Annotation::EstimatedTime(duration(&value[at + 5..])?)
        }
        _ => return None,
    })
}

/// Comments of other forms.
fn plain(text: &[u8], push: &mut impl FnMut(Annotation)) {
    const GENERATORS: [&[u8]; 4] =
        [b"generated by ", b"Generated by ", b"Generated with ", b"G-Code generated by "];
    match text {
        b"LAYER_CHANGE" | b"CHANGE_LAYER" => return push(Annotation::LayerChange),
        _ if text.starts_with(b"feature ") => return push(Annotation::Feature(Feature::named(&text[8..]))),
        _ if text.starts_with(b"layer ") => return simplify3d_layer(&text[6..], push),
        _ if text.starts_with(b"tool H") => return simplify3d_tool(&text[6..], push),
        _ => {}
    }
    if let Some(name) = GENERATORS.iter().find_map(|generator| text.strip_prefix(*generator)) {
        return push(Annotation::Generator(text_of(name)));
    }
    if let Some(rest) = text.strip_prefix(b"estimated printing time (normal mode) =")
        && let Some(time) = duration(rest)
    {
        push(Annotation::EstimatedTime(time));
    }
}

/// `1, Z = 0.200` and, at the end of the file, `end`.
fn simplify3d_layer(text: &[u8], push: &mut impl FnMut(Annotation)) {
    let Some((layer, end)) = number::read(text, 0) else { return };
    push(Annotation::LayerChange);
    push(Annotation::Layer(layer as i32));
    if let Some(rest) = text[end..].strip_prefix(b", Z = ")
        && let Some((z, _)) = number::read(rest, 0).filter(|(z, _)| *z <= 1e9)
    {
        push(Annotation::Z(Mm(z)));
    }
}

/// `0.200 W0.480`
fn simplify3d_tool(text: &[u8], push: &mut impl FnMut(Annotation)) {
    let Some((height, end)) = number::read(text, 0).filter(|(height, _)| *height <= 1e9) else { return };
    push(Annotation::Height(Mm(height)));
    if let Some(rest) = text[end..].strip_prefix(b" W")
        && let Some((width, _)) = number::read(rest, 0).filter(|(width, _)| *width <= 1e9)
    {
        push(Annotation::Width(Mm(width)));
    }
}

/// `1d 2h 3m 4s` or `1 hours 44 minutes`
fn duration(text: &[u8]) -> Option<Seconds> {
    let mut total = 0.0;
    let mut rest = text.trim_ascii();
    let mut found = false;
    while let Some((value, end)) = number::read(rest, 0) {
        rest = rest[end..].trim_ascii_start();
        let unit = match rest.first()? {
            b'd' => 86_400.0,
            b'h' => 3600.0,
            b'm' => 60.0,
            b's' => 1.0,
            _ => return None,
        };
        total += value * unit;
        found = true;
        let word = rest.iter().take_while(|b| b.is_ascii_alphabetic()).count();
        rest = rest[word..].trim_ascii_start();
    }
    (found && total <= 1e9).then_some(Seconds(total))
}

/// A text of bounded length, whatever its bytes are.
pub(crate) fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(&bytes[..bytes.len().min(TEXT_BYTES_MAX)]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn annotations(comments: &[&str]) -> Vec<Annotation> {
        let mut out = Vec::new();
        let mut pictures = Pictures::default();
        for comment in comments {
            read(comment.as_bytes(), &mut pictures, |a| out.push(a));
        }
        out
    }

    #[test]
    fn each_slicers_layers_and_features() {
        use Annotation::{Feature as F, Height, Layer, LayerChange, LayerCount, Width, Z};
        let prusa =
            annotations(&["LAYER_CHANGE", "Z:0.35", "HEIGHT:0.35", "TYPE:External perimeter", "WIDTH:0.7"]);
        assert_eq!(
            prusa,
            [LayerChange, Z(Mm(0.35)), Height(Mm(0.35)), F(Feature::OuterWall), Width(Mm(0.7))]
        );
        let bambu = annotations(&[
            " CHANGE_LAYER",
            " Z_HEIGHT: 0.2",
            " LAYER_HEIGHT: 0.2",
            " FEATURE: Inner wall",
            " LINE_WIDTH: 0.42",
        ]);
        assert_eq!(bambu, [LayerChange, Z(Mm(0.2)), Height(Mm(0.2)), F(Feature::InnerWall), Width(Mm(0.42))]);
        let cura = annotations(&["LAYER_COUNT:50", "LAYER:-1", "TYPE:WALL-OUTER", "MESH:cube.stl"]);
        assert_eq!(
            cura,
            [LayerCount(50), Layer(-1), F(Feature::OuterWall), Annotation::Mesh("cube.stl".into())]
        );
        let simplify =
            annotations(&[" layer 1, Z = 0.200", " feature skirt", " tool H0.200 W0.480", " layer end"]);
        assert_eq!(
            simplify,
            [LayerChange, Layer(1), Z(Mm(0.2)), F(Feature::Skirt), Height(Mm(0.2)), Width(Mm(0.48))]
        );
        assert_eq!(annotations(&["TYPE:Something new"]), [F(Feature::Other)]);
        let absurd = "9".repeat(400);
        assert_eq!(
            annotations(&[&format!(" tool H{absurd}"), &format!(" layer 1, Z = {absurd}")]),
            [LayerChange, Layer(1)]
        );
    }

    #[test]
    fn times_and_programs() {
        let time = |s| Annotation::EstimatedTime(Seconds(s));
        assert_eq!(annotations(&[" estimated printing time (normal mode) = 1h 44m 52s"]), [time(6292.0)]);
        assert_eq!(
            annotations(&["TIME:6666", "TIME_ELAPSED:12.5"]),
            [time(6666.0), Annotation::ElapsedTime(Seconds(12.5))]
        );
        assert_eq!(annotations(&["   Build time: 1 hour 2 minutes"]), [time(3720.0)]);
        assert_eq!(
            annotations(&[" model printing time: 12m 1s; total estimated time: 1d 13m 5s"]),
            [time(87_185.0)]
        );
        assert_eq!(
            annotations(&[
                " generated by PrusaSlicer 2.5.0 on 2026-11-22 at 02:39:35 UTC",
                "Generated with Cura_SteamEngine 5.0"
            ]),
            [
                Annotation::Generator("PrusaSlicer 2.5.0 on 2026-11-22 at 02:39:35 UTC".into()),
                Annotation::Generator("Cura_SteamEngine 5.0".into())
            ]
        );
    }

    #[test]
    fn pictures_and_settings_say_nothing() {
        let picture = [
            " thumbnail begin 16x16 12",
            " LAYER_CHANGE",
            " iVBORw0",
            " thumbnail end",
            " layer_height = 0.2",
        ];
        assert_eq!(annotations(&picture), []);
        assert_eq!(annotations(&[" thumbnail_JPG begin 1x1", " Z:1", " thumbnail_JPG end", "Z:1"]).len(), 1);
    }

    #[test]
    fn pictures_are_shown_to_those_who_ask() {
        let mut pictures = Pictures { shown: true, ..Pictures::default() };
        let mut out = Vec::new();
        for line in [
            " thumbnail begin 16x16 12",
            " iVBORw0",
            " thumbnail end",
            " thumbnails = 16x16/PNG",
            "LAYER_CHANGE",
        ] {
            read(line.as_bytes(), &mut pictures, |a| out.push(a));
        }
        let picture = [PictureLine::Begin, PictureLine::Text((*b"iVBORw0").into()), PictureLine::End];
        let expected = picture.map(Annotation::Picture).into_iter().chain([Annotation::LayerChange]);
        assert_eq!(out, expected.collect::<Vec<_>>());
    }
}
