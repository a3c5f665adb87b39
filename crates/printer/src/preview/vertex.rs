//! The preview's vertex: 16 bytes, four `u32` words. Its definition is `docs/vertex.md`; `viz/toolpath/src/vertex.ts` reads
//! it. The three change together.
//!
//! Knows bits and the grid that positions lie on, not where vertices come from. Lengths in mm.

use gcode::Feature;

/// Words of a vertex.
pub const WORDS: usize = 4;
/// Steps along each axis.
const STEPS_MAX: u32 = (1 << 20) - 1;
/// One unit of `width` and `height`, in mm.
const SIZE_STEP_MM: f64 = 0.004;
const WIDTH_MAX: u32 = (1 << 10) - 1;
const HEIGHT_MAX: u32 = (1 << 9) - 1;
/// The highest layer that can be told.
pub const LAYER_MAX: u32 = (1 << 20) - 1;
const TOOL_MAX: u32 = (1 << 4) - 1;
const SIZE_SHIFT: u32 = 20;
const FEATURE_SHIFT: u32 = 20;
const FEATURE_MASK: u32 = 31;
const TOOL_SHIFT: u32 = 20;
const OBJECT_SHIFT: u32 = 24;
const EVENT_SHIFT: u32 = 29;
/// The feature before a file names one.
pub const FEATURE_UNNAMED: u8 = 16;
/// How many tools have a number of their own.
pub const TOOLS: usize = TOOL_MAX as usize + 1;
/// How many features have a number.
pub const FEATURES: usize = 17;

/// What may be said of a vertex besides: bits of the third word, and events, which lie in the upper end of the second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(u32);

impl Flags {
    /// The segment lays no filament.
    pub const TRAVEL: Self = Self(1 << 25);
    /// No segment ends here.
    pub const BREAK: Self = Self(1 << 26);
    /// Filament is pulled back.
    pub const RETRACT: Self = Self(1 << 27);
    /// Filament is pushed forward on the spot.
    pub const UNRETRACT: Self = Self(1 << 28);
    /// An outer wall's loop starts and ends here.
    pub const SEAM: Self = Self(1 << 29);
    /// A travel over what was just printed.
    pub const WIPE: Self = Self(1 << 30);
    /// The file waits for the user where the segment ends.
    pub const PAUSE: Self = Self(1 << 31);
    /// Another tool is taken there.
    pub const TOOL_CHANGE: Self = Self(1);
    /// The pause is for a change of filament.
    pub const FILAMENT_CHANGE: Self = Self(1 << 1);
    const OF_SEGMENT: u32 = 127 << 25;
    const EVENTS: u32 = 3;

    /// Both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether all of `other` is said.
    pub const fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// A feature's number in the vertex.
pub const fn feature_number(feature: Feature) -> u8 {
    match feature {
        Feature::InnerWall => 0,
        Feature::OuterWall => 1,
        Feature::OverhangWall => 2,
        Feature::Infill => 3,
        Feature::SolidInfill => 4,
        Feature::TopSurface => 5,
        Feature::BottomSurface => 6,
        Feature::Ironing => 7,
        Feature::Bridge => 8,
        Feature::GapFill => 9,
        Feature::Skirt => 10,
        Feature::Support => 11,
        Feature::SupportInterface => 12,
        Feature::PrimeTower => 13,
        Feature::Raft => 14,
        Feature::Custom => 15,
        _ => 16,
    }
}

/// A place that the nozzle reaches, and what describes the segment that ends there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vertex {
    /// Steps of the [`Grid`], at most 2²⁰ − 1.
    pub steps: [u32; 3],
    /// The bead's width in 4 µm; 0 is unknown.
    pub width: u32,
    /// The bead's height in 4 µm; 0 is unknown.
    pub height: u32,
    /// See [`feature_number`].
    pub feature: u8,
    /// What else there is to say.
    pub flags: Flags,
    /// 0 is the first.
    pub layer: u32,
    /// The extruder.
    pub tool: u32,
    /// The object that it belongs to: 0 none, 255 one beyond those that are told apart.
    pub object: u8,
}

/// A width in the vertex's units.
pub fn width_units(mm: f64) -> u32 {
    size_units(mm, WIDTH_MAX)
}

/// A height in the vertex's units.
pub fn height_units(mm: f64) -> u32 {
    size_units(mm, HEIGHT_MAX)
}

/// The nearest whole number: one instruction where `round`, which is told what to do below 0, takes a dozen.
fn rounded(value: f64) -> f64 {
    (value + 0.5).floor()
}

fn size_units(mm: f64, max: u32) -> u32 {
    // A float's conversion saturates, and takes what is not a number for 0.
    rounded(mm / SIZE_STEP_MM).clamp(0.0, f64::from(max)) as u32
}

impl Vertex {
    /// As four words. What is too large for its field is as large as that can be.
    pub fn pack(&self) -> [u32; WORDS] {
        let [x, y, z] = self.steps.map(|steps| steps.min(STEPS_MAX));
        [
            x | self.width.min(WIDTH_MAX) << SIZE_SHIFT,
            y | self.height.min(HEIGHT_MAX) << SIZE_SHIFT | (self.flags.0 & Flags::EVENTS) << EVENT_SHIFT,
            z | (u32::from(self.feature) & FEATURE_MASK) << FEATURE_SHIFT | self.flags.0 & Flags::OF_SEGMENT,
            self.layer.min(LAYER_MAX)
                | self.tool.min(TOOL_MAX) << TOOL_SHIFT
                | u32::from(self.object) << OBJECT_SHIFT,
        ]
    }

    /// From four words.
    pub const fn unpack(words: [u32; WORDS]) -> Self {
        let [a, b, c, d] = words;
        Self {
            steps: [a & STEPS_MAX, b & STEPS_MAX, c & STEPS_MAX],
            width: a >> SIZE_SHIFT & WIDTH_MAX,
            height: b >> SIZE_SHIFT & HEIGHT_MAX,
            feature: (c >> FEATURE_SHIFT & FEATURE_MASK) as u8,
            flags: Flags(c & Flags::OF_SEGMENT | b >> EVENT_SHIFT & Flags::EVENTS),
            layer: d & LAYER_MAX,
            tool: d >> TOOL_SHIFT & TOOL_MAX,
            object: (d >> OBJECT_SHIFT) as u8,
        }
    }
}

/// The grid that a file's positions lie on: `origin + steps · step`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The place of step 0, 0, 0; a multiple of the step.
    pub origin_mm: [f64; 3],
    /// A power of two.
    pub step_mm: f64,
}

/// The finest step: 511 mm along each axis.
const STEP_MIN_MM: f64 = 1.0 / 2048.0;
/// The step where nothing is known of the machine: 4095 mm along each axis, half of them below 0.
const STEP_UNKNOWN_MM: f64 = 1.0 / 256.0;
/// Places this far outside the machine are still told apart, at least.
const MARGIN_MM: f64 = 10.0;

impl Grid {
    /// A grid in whose middle these boxes lie; `None` where nothing is known.
    pub fn around(machine_mm: Option<[[f64; 3]; 2]>) -> Self {
        let Some([low, high]) = machine_mm else {
            let half = STEP_UNKNOWN_MM * f64::from(1 << 19);
            return Self { origin_mm: [-half; 3], step_mm: STEP_UNKNOWN_MM };
        };
        let span = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max) + 2.0 * MARGIN_MM;
        let mut step_mm = STEP_MIN_MM;
        while step_mm * f64::from(STEPS_MAX) < span && step_mm < span {
            step_mm *= 2.0;
        }
        let half = step_mm * f64::from(1 << 19);
        let origin = |axis: usize| libm::floor((0.5 * (low[axis] + high[axis]) - half) / step_mm) * step_mm;
        Self { origin_mm: [origin(0), origin(1), origin(2)], step_mm }
    }

    /// The nearest steps, and whether the place lies on the grid; the nearest edge is given where it does not.
    pub fn steps(&self, place_mm: [f64; 3]) -> ([u32; 3], bool) {
        let mut inside = true;
        let mut steps = [0; 3];
        for axis in 0..3 {
            let at = rounded((place_mm[axis] - self.origin_mm[axis]) / self.step_mm);
            inside &= (0.0..=f64::from(STEPS_MAX)).contains(&at);
            steps[axis] = at.clamp(0.0, f64::from(STEPS_MAX)) as u32;
        }
        (steps, inside)
    }

    /// The place of these steps, in mm.
    pub fn place(&self, steps: [u32; 3]) -> [f64; 3] {
        let at = |axis: usize| self.origin_mm[axis] + f64::from(steps[axis]) * self.step_mm;
        [at(0), at(1), at(2)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_vector_of_the_definition() {
        let grid = Grid { origin_mm: [-10.0, -20.0, 0.0], step_mm: 1.0 / 1024.0 };
        let (steps, inside) = grid.steps([12.5, 30.25, 0.3]);
        let vertex = Vertex {
            steps,
            width: width_units(0.44),
            height: height_units(0.2),
            feature: feature_number(Feature::OuterWall),
            flags: Flags::SEAM,
            layer: 7,
            tool: 1,
            object: 0,
        };
        assert!(inside);
        assert_eq!(vertex.pack(), [0x06E0_5A00, 0x0320_C900, 0x2010_0133, 0x0010_0007]);
        let events = Flags::TOOL_CHANGE.and(Flags::FILAMENT_CHANGE);
        let vertex = Vertex { flags: vertex.flags.and(events), object: 3, ..vertex };
        assert_eq!(vertex.pack(), [0x06E0_5A00, 0x6320_C900, 0x2010_0133, 0x0310_0007]);
    }

    #[test]
    fn every_flag_has_its_own_bit() {
        let flags = [
            Flags::TRAVEL,
            Flags::BREAK,
            Flags::RETRACT,
            Flags::UNRETRACT,
            Flags::SEAM,
            Flags::WIPE,
            Flags::PAUSE,
        ];
        for (at, flag) in flags.iter().enumerate() {
            assert_eq!(flag.0, 1 << (25 + at));
        }
        assert_eq!(flags.iter().fold(0, |all, flag| all | flag.0), Flags::OF_SEGMENT);
        for (at, event) in [Flags::TOOL_CHANGE, Flags::FILAMENT_CHANGE].into_iter().enumerate() {
            assert_eq!(Vertex { flags: event, ..Vertex::default() }.pack(), [0, 1 << (29 + at), 0, 0]);
        }
    }

    #[test]
    fn what_is_too_large_saturates() {
        let vertex = Vertex {
            steps: [u32::MAX; 3],
            width: width_units(1e9),
            height: height_units(1e9),
            layer: u32::MAX,
            tool: u32::MAX,
            ..Vertex::default()
        };
        let back = Vertex::unpack(vertex.pack());
        assert_eq!((back.steps, back.layer, back.tool), ([STEPS_MAX; 3], LAYER_MAX, TOOL_MAX));
        assert_eq!((back.width, back.height), (WIDTH_MAX, HEIGHT_MAX));
        assert_eq!((width_units(f64::NAN), height_units(-1.0)), (0, 0));
    }

    proptest! {
        #[test]
        fn words_go_there_and_back(words: [u32; WORDS]) {
            let vertex = Vertex::unpack(words);
            prop_assert_eq!(Vertex::unpack(vertex.pack()), vertex);
        }

        #[test]
        fn places_come_back_within_half_a_step(
            low in prop::array::uniform3(-3000.0..1000.0f64),
            size in prop::array::uniform3(1.0..3000.0f64),
            at in prop::array::uniform3(0.0..=1.0f64),
        ) {
            let high = [0, 1, 2].map(|axis| low[axis] + size[axis]);
            let grid = Grid::around(Some([low, high]));
            let place = [0, 1, 2].map(|axis| low[axis] + at[axis] * size[axis]);
            let (steps, inside) = grid.steps(place);
            prop_assert!(inside);
            let back = grid.place(steps);
            for axis in 0..3 {
                prop_assert!((back[axis] - place[axis]).abs() <= 0.5 * grid.step_mm + 1e-9);
            }
            let longest = size.iter().copied().fold(0.0, f64::max);
            prop_assert!(grid.step_mm <= (longest + 2.0 * MARGIN_MM) / 500_000.0 || grid.step_mm == STEP_MIN_MM);
        }
    }

    #[test]
    fn usual_machines_are_told_to_half_a_micrometre_and_unknown_ones_to_four() {
        let grid = Grid::around(Some([[0.0; 3], [250.0, 210.0, 220.0]]));
        assert_eq!(grid.step_mm, 1.0 / 2048.0);
        for place in [[-130.0, -150.0, -140.0], [380.0, 360.0, 365.0]] {
            assert!(grid.steps(place).1, "{place:?}");
        }
        let unknown = Grid::around(None);
        assert!(unknown.steps([-1500.0, 1500.0, 1000.0]).1);
        assert!(!unknown.steps([5000.0, 0.0, 0.0]).1);
    }
}
