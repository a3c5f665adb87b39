//! What a line of G-code asks for, with all modes resolved: absolute machine positions in mm, feeds in mm/s.

use units::{Celsius, Mm, MmPerS, MmPerS2, Seconds};

use crate::{Annotation, Arc, LineNumber};

/// A position of the machine, in mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// Along X.
    pub x: f64,
    /// Along Y.
    pub y: f64,
    /// Along Z.
    pub z: f64,
    /// Filament fed since the start of the file, retractions subtracted. `G92 E` does not touch it.
    pub e: f64,
}

impl Position {
    /// As an array x, y, z, e.
    pub const fn to_array(self) -> [f64; 4] {
        [self.x, self.y, self.z, self.e]
    }
}

/// A straight move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// The line it comes from.
    pub line: LineNumber,
    /// Where it begins: where the move before ended.
    pub from: Position,
    /// Where it ends. A move with only E differs in nothing but `e`; one may be of no length at all.
    pub to: Position,
    /// Speed along the path (along E for a move with only E), with the speed factor.
    pub feed: MmPerS,
    /// `G0`.
    pub rapid: bool,
}

/// What is heated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Heater {
    /// The hot end of a tool, counted from 0.
    Tool(u32),
    /// The bed.
    Bed,
    /// The chamber.
    Chamber,
}

/// What a temperature command waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wait {
    /// For nothing.
    No,
    /// Until it is at least this warm; cooling down is not waited for (`M109 S`).
    UntilHeated,
    /// Until it is reached, from below or from above (`M109 R`).
    UntilReached,
}

/// New limits of the planner; `None` leaves one as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityLimit {
    /// Greatest speed along the path.
    pub velocity: Option<MmPerS>,
    /// Greatest acceleration along the path.
    pub accel: Option<MmPerS2>,
    /// Speed at which a corner of 90° is taken.
    pub square_corner_velocity: Option<MmPerS>,
    /// Least part of a move that cruises, 0 ..< 1.
    pub minimum_cruise_ratio: Option<f64>,
}

/// A value an axis, where given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisValues {
    /// For X.
    pub x: Option<f64>,
    /// For Y.
    pub y: Option<f64>,
    /// For Z.
    pub z: Option<f64>,
    /// For the extruder.
    pub e: Option<f64>,
}

/// The limits of the machine that the slicer reckoned with (`M201`, `M203`, `M205`). The printer's own configuration
/// knows better; Klipper passes over them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MachineLimits {
    /// Greatest speed, mm/s.
    pub velocity_mm_s: AxisValues,
    /// Greatest acceleration, mm/s².
    pub accel_mm_s2: AxisValues,
    /// Change of speed allowed at once, mm/s.
    pub jerk_mm_s: AxisValues,
    /// Marlin's cornering distance.
    pub junction_deviation: Option<Mm>,
}

/// How an object on the bed is named.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum ObjectId {
    /// As `EXCLUDE_OBJECT_*` does.
    Name(String),
    /// As `M486` does.
    Index(u32),
}

/// The bounds of objects, for leaving one out of a running print.
#[derive(Clone, Debug, PartialEq)]
pub enum ObjectAction {
    /// How many objects follow (`M486 T`).
    Count(u32),
    /// An object of the file, with centre and outline (mm, as G-code coordinates) where given.
    Define {
        /// Its name.
        id: ObjectId,
        /// What `M486 A` calls it, where that differs from the id.
        label: Option<String>,
        /// Its middle on the bed.
        centre: Option<[f64; 2]>,
        /// Its outline on the bed.
        polygon: Vec<[f64; 2]>,
    },
    /// What follows belongs to this object.
    Start(ObjectId),
    /// What follows belongs to no object. `None` where the file does not say which one ended.
    End(Option<ObjectId>),
    /// Leave this object out from now on; `None`: the current one.
    Cancel(Option<ObjectId>),
    /// Print this object again; `None`: all of them.
    Restore(Option<ObjectId>),
}

/// Why a file asks for a pause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PauseReason {
    /// `M0`, `M1`, `M25`, `M226`, `M601`, `PAUSE`.
    Requested,
    /// `M600`: the filament is to be changed.
    FilamentChange,
}

/// What is to be done, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// A straight move (`G0`, `G1`, `G10`, `G11`).
    Move(Move),
    /// A circular or helical move (`G2`, `G3`).
    Arc(Arc),
    /// Stand still for this long (`G4`).
    Dwell(Seconds),
    /// Home these axes. The position stays as it was until [`Interpreter::set_axes`](crate::Interpreter::set_axes).
    Home {
        /// Home X.
        x: bool,
        /// Home Y.
        y: bool,
        /// Home Z.
        z: bool,
    },
    /// A new target.
    SetTemperature {
        /// Of which heater.
        heater: Heater,
        /// The target; 0 switches it off.
        target: Celsius,
        /// Whether the file goes on at once.
        wait: Wait,
    },
    /// Wait until a heater's temperature lies within these bounds (`TEMPERATURE_WAIT`).
    WaitForTemperature {
        /// Of which heater.
        heater: Heater,
        /// Not below this.
        minimum: Option<Celsius>,
        /// Not above this.
        maximum: Option<Celsius>,
    },
    /// Every heater off.
    TurnOffHeaters,
    /// A fan's speed.
    Fan {
        /// Which one, counted from 0 (the part fan).
        index: u8,
        /// 0 ..= 1.
        speed: f64,
    },
    /// Motors without current: their positions are lost.
    MotorsOff {
        /// X.
        x: bool,
        /// Y.
        y: bool,
        /// Z.
        z: bool,
        /// The extruder.
        e: bool,
    },
    /// Go on when everything so far has been done (`M400`).
    WaitForMoves,
    /// New limits of the planner (`SET_VELOCITY_LIMIT`, `M204`).
    VelocityLimit(VelocityLimit),
    /// What the slicer takes to be the machine's limits.
    MachineLimits(Box<MachineLimits>),
    /// Pressure advance (`SET_PRESSURE_ADVANCE`, `M900 K`, `M572 S`); `None` leaves one as it is.
    PressureAdvance {
        /// Seconds: mm of filament per mm/s of filament.
        advance: Option<f64>,
        /// Over which it is smoothed.
        smooth_time: Option<Seconds>,
    },
    /// Input shapers (`SET_INPUT_SHAPER`).
    InputShaper(InputShaper),
    /// Axes that are not square (`SET_SKEW`, `SKEW_PROFILE`).
    Skew(SkewChange),
    /// A bed that is not flat (`BED_MESH_PROFILE`, `BED_MESH_CLEAR`).
    BedMesh(MeshChange),
    /// The speed factor is now this (`M220`); moves that follow have it in their feed.
    SpeedFactor(f64),
    /// The flow factor is now this (`M221`); moves that follow have it in their `e`.
    FlowFactor(f64),
    /// A text for the display.
    Message(String),
    /// `M105`.
    ReportTemperatures,
    /// `M114`.
    ReportPosition,
    /// Use this tool from now on.
    SelectTool(u32),
    /// The bounds of objects.
    Object(ObjectAction),
    /// A comment that means something to a viewer.
    Annotation(Annotation),
    /// Stop everything at once (`M112`).
    EmergencyStop,
    /// Wait for the user.
    Pause(PauseReason),
    /// End the print here (`CANCEL_PRINT`).
    Cancel,
}

/// What becomes of the correction for axes that are not square. Lengths are those of a printed square with its corner A
/// towards the origin, in mm: the diagonals AC and BD, and the side AD.
#[derive(Clone, Debug, PartialEq)]
pub enum SkewChange {
    /// None from now on.
    Clear,
    /// That of this name in the machine file.
    Load(String),
    /// As measured in these planes; the others stay as they are.
    Measured {
        /// AB along X, AD along Y.
        xy: Option<[f64; 3]>,
        /// AB along X, AD along Z.
        xz: Option<[f64; 3]>,
        /// AB along Y, AD along Z.
        yz: Option<[f64; 3]>,
    },
    /// Nothing: say what it is.
    Report,
    /// Nothing: say what these lengths would be.
    Calculate([f64; 3]),
}

/// What becomes of the bed's mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshChange {
    /// None from now on.
    Clear,
    /// That of this name in the machine file.
    Load(String),
    /// Nothing: say what it is.
    Report,
}

/// New input shapers of X and Y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputShaper {
    /// X.
    pub x: AxisShaper,
    /// Y.
    pub y: AxisShaper,
}

/// What becomes of one axis' input shaper; `None` leaves one thing as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisShaper {
    /// Which shaper.
    pub kind: Option<ShaperName>,
    /// The resonance's frequency in Hz; 0 is off.
    pub frequency: Option<f64>,
    /// The resonance's damping, as a share of the critical damping.
    pub damping_ratio: Option<f64>,
}

/// The name of an input shaper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShaperName(&'static str);

impl ShaperName {
    const ALL: [&'static str; 6] = ["zv", "mzv", "zvd", "ei", "2hump_ei", "3hump_ei"];

    /// The shaper of that name, in any case.
    pub fn new(name: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|known| known.as_bytes().eq_ignore_ascii_case(name)).map(Self)
    }

    /// The name, in lower case.
    pub const fn name(self) -> &'static str {
        self.0
    }
}
