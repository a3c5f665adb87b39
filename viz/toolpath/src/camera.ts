/**
 * The orbiting camera's maths: pure functions over a small state; z is up.
 *
 * Does: orbit, pan, zoom, fit, and the eye's frame. Does not know: three.js, pointers, time.
 * Units: mm, radians, CSS pixels. Azimuth 0 looks along +y (the printer's front), elevation 0 is level.
 */
import type { CssPx, Mm, Radians } from './units';

export type Vec3 = readonly [number, number, number];

/** An axis-aligned box in mm. */
export interface BoxMm {
  readonly min: Vec3;
  readonly max: Vec3;
}

export type Projection = 'perspective' | 'orthographic';
/** Where one may look from at a press of a button. */
export type CameraPreset = 'top' | 'front' | 'left' | 'right' | 'back' | 'iso';

export interface CameraState {
  /** What the camera looks at and turns around. */
  readonly targetMm: Vec3;
  readonly distanceMm: Mm;
  readonly azimuth: Radians;
  readonly elevation: Radians;
  /** With either, a length in the target's plane looks the same. */
  readonly projection: Projection;
}

export interface ViewSize {
  readonly width: CssPx;
  readonly height: CssPx;
}

/** The camera's axes in the machine's frame, and where it stands. */
export interface EyeFrame {
  readonly eyeMm: Vec3;
  readonly right: Vec3;
  readonly up: Vec3;
  readonly forward: Vec3;
}

/** The full vertical angle of view. */
export const FIELD_OF_VIEW: Radians = (32 * Math.PI) / 180;
/** A turn of the camera for each pixel that the pointer moves. */
const RADIANS_PER_PX = 0.008;
const ELEVATION_MAX: Radians = (89.5 * Math.PI) / 180;
const DISTANCE_MIN_MM = 1;
const DISTANCE_MAX_MM = 20_000;
/** Room left around a fitted box. */
const FIT_MARGIN = 1.08;
/** Beads and markers are wider than the places in the box. */
const ROUND_ABOUT_MM: Mm = 2;
/** How far the near plane may lie before the far one: what 24 bits of depth keep apart. */
const DEPTH_RATIO_MAX = 4000;

export const DEFAULT_CAMERA: CameraState = {
  targetMm: [0, 0, 0],
  distanceMm: 400,
  azimuth: (-28 * Math.PI) / 180,
  elevation: (32 * Math.PI) / 180,
  projection: 'perspective',
};

/** Without perspective the eye stands this far away, so that all lines of sight are nearly parallel. */
export const ORTHOGRAPHIC_EYE_MM: Mm = 10_000;

const QUARTER: Radians = Math.PI / 2;

export const PRESETS: Readonly<Record<CameraPreset, Pick<CameraState, 'azimuth' | 'elevation'>>> = {
  top: { azimuth: 0, elevation: ELEVATION_MAX },
  front: { azimuth: 0, elevation: 0 },
  left: { azimuth: -QUARTER, elevation: 0 },
  right: { azimuth: QUARTER, elevation: 0 },
  back: { azimuth: Math.PI, elevation: 0 },
  iso: { azimuth: -QUARTER / 2, elevation: Math.atan(Math.SQRT1_2) },
};

const clamp = (value: number, min: number, max: number): number => Math.min(Math.max(value, min), max);
const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const along = (from: Vec3, ...terms: readonly (readonly [number, Vec3])[]): Vec3 => {
  const sum: [number, number, number] = [from[0], from[1], from[2]];
  for (const [factor, axis] of terms) {
    sum[0] += factor * axis[0];
    sum[1] += factor * axis[1];
    sum[2] += factor * axis[2];
  }
  return sum;
};

/** From the eye to the target. */
export const eyeDistanceMm = ({ projection, distanceMm }: CameraState): Mm =>
  projection === 'perspective' ? distanceMm : ORTHOGRAPHIC_EYE_MM;

export function eyeFrame(camera: CameraState): EyeFrame {
  const [sinA, cosA] = [Math.sin(camera.azimuth), Math.cos(camera.azimuth)];
  const [sinE, cosE] = [Math.sin(camera.elevation), Math.cos(camera.elevation)];
  const forward: Vec3 = [-sinA * cosE, cosA * cosE, -sinE];
  return {
    forward,
    right: [cosA, sinA, 0],
    up: [-sinA * sinE, cosA * sinE, cosE],
    eyeMm: along(camera.targetMm, [-eyeDistanceMm(camera), forward]),
  };
}

/** Millimetres in the target's plane that one CSS pixel covers. */
export function mmPerPx(camera: CameraState, size: ViewSize): Mm {
  return (2 * camera.distanceMm * Math.tan(FIELD_OF_VIEW / 2)) / Math.max(size.height, 1);
}

/** A line of sight. */
export interface Ray {
  readonly fromMm: Vec3;
  /** Of length 1. */
  readonly way: Vec3;
  /** Millimetres that a CSS pixel covers, for each millimetre of distance. */
  readonly pixelAngle: number;
}

/** What a CSS pixel covers a millimetre away from the eye. */
export const pixelAngle = (camera: CameraState, size: ViewSize): number =>
  mmPerPx(camera, size) / eyeDistanceMm(camera);

/** What a pixel covers of the nearest part of a box, `ratio` of them being a CSS pixel; 0 where the eye is in or beside it. */
export function finestPx(camera: CameraState, size: ViewSize, ratio: number, box: BoxMm): Mm {
  const scale = mmPerPx(camera, size) / ratio;
  if (camera.projection === 'orthographic') return scale;
  const { eyeMm, forward } = eyeFrame(camera);
  const nearest = Math.min(...corners(box).map((corner) => dot(along(corner, [-1, eyeMm]), forward)));
  return (scale * Math.max(nearest, 0)) / eyeDistanceMm(camera);
}

/** Whether both show the same. */
export function isSameCamera(one: CameraState, other: CameraState): boolean {
  const { targetMm: to, ...rest } = other;
  const names = Object.keys(rest) as (keyof typeof rest)[];
  return names.every((name) => one[name] === rest[name]) && one.targetMm.every((mm, axis) => mm === to[axis]);
}

/** The line of sight through a point of the view, from its left top. */
export function rayThrough(camera: CameraState, size: ViewSize, x: CssPx, y: CssPx): Ray {
  const { eyeMm, right, up, forward } = eyeFrame(camera);
  const scale = mmPerPx(camera, size);
  const [dx, dy] = [(x - size.width / 2) * scale, (size.height / 2 - y) * scale];
  const angle = pixelAngle(camera, size);
  if (camera.projection === 'orthographic') {
    return { fromMm: along(eyeMm, [dx, right], [dy, up]), way: forward, pixelAngle: angle };
  }
  const away = along([0, 0, 0], [camera.distanceMm, forward], [dx, right], [dy, up]);
  const length = Math.sqrt(dot(away, away));
  return { fromMm: eyeMm, way: along([0, 0, 0], [1 / length, away]), pixelAngle: angle };
}

/** Turns around the target as if the scene were dragged by (dx, dy) pixels, y downwards. */
export function orbit(camera: CameraState, dx: CssPx, dy: CssPx): CameraState {
  const turned = (camera.azimuth - dx * RADIANS_PER_PX) % (2 * Math.PI);
  const elevation = clamp(camera.elevation + dy * RADIANS_PER_PX, -ELEVATION_MAX, ELEVATION_MAX);
  return { ...camera, azimuth: turned, elevation };
}

/** Moves the scene by (dx, dy) pixels in the target's plane, y downwards. */
export function pan(camera: CameraState, dx: CssPx, dy: CssPx, size: ViewSize): CameraState {
  const { right, up } = eyeFrame(camera);
  const scale = mmPerPx(camera, size);
  return { ...camera, targetMm: along(camera.targetMm, [-dx * scale, right], [dy * scale, up]) };
}

/**
 * Scales the distance by `factor` (below 1: nearer). What is under `at` (pixels from the view's middle, y downwards) stays.
 */
export function zoom(
  camera: CameraState,
  factor: number,
  size: ViewSize,
  at: readonly [CssPx, CssPx] = [0, 0],
): CameraState {
  if (!(factor > 0) || !Number.isFinite(factor)) return camera;
  const distanceMm = clamp(camera.distanceMm * factor, DISTANCE_MIN_MM, DISTANCE_MAX_MM);
  const shift = (1 - distanceMm / camera.distanceMm) * mmPerPx(camera, size);
  const { right, up } = eyeFrame(camera);
  return {
    ...camera,
    distanceMm,
    targetMm: along(camera.targetMm, [at[0] * shift, right], [-at[1] * shift, up]),
  };
}

const corners = ({ min, max }: BoxMm): Vec3[] =>
  [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => [
    bits & 1 ? max[0] : min[0],
    bits & 2 ? max[1] : min[1],
    bits & 4 ? max[2] : min[2],
  ]);

export const centreOf = ({ min, max }: BoxMm): Vec3 => [
  (min[0] + max[0]) / 2,
  (min[1] + max[1]) / 2,
  (min[2] + max[2]) / 2,
];

/** The box around both; either may be missing. */
export function unionOf(a: BoxMm | null, b: BoxMm | null): BoxMm | null {
  if (!a || !b) return a ?? b;
  return {
    min: [Math.min(a.min[0], b.min[0]), Math.min(a.min[1], b.min[1]), Math.min(a.min[2], b.min[2])],
    max: [Math.max(a.max[0], b.max[0]), Math.max(a.max[1], b.max[1]), Math.max(a.max[2], b.max[2])],
  };
}

/** Looks at the whole box from the present direction. */
export function fit(camera: CameraState, box: BoxMm, size: ViewSize): CameraState {
  const targetMm = centreOf(box);
  const { right, up, forward } = eyeFrame(camera);
  const tanV = Math.tan(FIELD_OF_VIEW / 2) / FIT_MARGIN;
  const tanH = tanV * (Math.max(size.width, 1) / Math.max(size.height, 1));
  let distance = DISTANCE_MIN_MM;
  for (const corner of corners(box)) {
    const from = along(corner, [-1, targetMm]);
    const depth = camera.projection === 'perspective' ? dot(from, forward) : 0;
    distance = Math.max(
      distance,
      Math.abs(dot(from, right)) / tanH - depth,
      Math.abs(dot(from, up)) / tanV - depth,
    );
  }
  return { ...camera, targetMm, distanceMm: clamp(distance, DISTANCE_MIN_MM, DISTANCE_MAX_MM) };
}

/** Distances of the near and far planes that hold the box, with a ratio that the depth buffer can bear. */
export function clipPlanes(camera: CameraState, box: BoxMm): { readonly nearMm: Mm; readonly farMm: Mm } {
  const { eyeMm, forward } = eyeFrame(camera);
  const depths = corners(box).map((corner) => dot(along(corner, [-1, eyeMm]), forward));
  if (camera.projection === 'orthographic') {
    // Depth is linear here: a plane behind the eye is as good as one before it.
    return { nearMm: Math.min(...depths) - ROUND_ABOUT_MM, farMm: Math.max(...depths) + ROUND_ABOUT_MM };
  }
  const farMm = Math.max(Math.max(...depths) * 1.01 + ROUND_ABOUT_MM, 1);
  const nearMm = Math.max(Math.min(...depths) * 0.99 - ROUND_ABOUT_MM, farMm / DEPTH_RATIO_MAX);
  return { nearMm, farMm };
}
