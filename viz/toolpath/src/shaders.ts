/**
 * The shaders: each vertex shader pulls what it needs from the texture of vertices by gl_VertexID; nothing else is uploaded.
 *
 * A bead is an elliptic tube of which only the half that faces the eye is drawn: at each end three points of the
 * ellipse (left outline, nearest, right outline), whose normals interpolate to a round look, and for the caps the
 * point opposite and a tip. Where the path bends by less than 120 degrees neighbours share a mitred end, so walls are closed;
 * elsewhere the cap ends the bead. Units: mm; bits as in vertex.ts (docs/vertex.md).
 */
import { LEAD_TEXELS, TEXELS_PER_ROW } from './chunks';
import { COLOUR } from './colour_shader';
import { TEXEL_BITS, TEXEL_MASK } from './segments';
import { EVENTS, FIELDS, FLAGS, featureNumber, SIZE_STEP_MM } from './vertex';

/** Points of one bead: five at each end. */
export const POINTS_PER_BEAD = 10;

const mask = (bits: number): string => `${((1 << bits) - 1) >>> 0}u`;
const WALLS = (['innerWall', 'outerWall', 'overhangWall', 'primeTower', 'support'] as const).reduce(
  (bits, name) => bits | (1 << featureNumber(name)),
  0,
);
const ROW_SHIFT = Math.log2(TEXELS_PER_ROW);

/** What every shader that pulls vertices begins with. */
const PULL = /* glsl */ `
precision highp float;
precision highp int;
precision highp usampler2D;

uniform highp usampler2D uVertices;
uniform uint uBase;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uOrigin;
uniform float uStep;
uniform uint uPrinted;
/** What may be reached. */
uniform vec3 uVolumeMin;
uniform vec3 uVolumeMax;
/** From the box' middle to its sides, where the volume is the cylinder in it; 0: it is the box. */
uniform vec2 uVolumeRadii;
uniform vec3 uWarning;

const uint TRAVEL = ${FLAGS.travel}u;
const uint BREAK = ${FLAGS.break}u;
const uint WIPE = ${FLAGS.wipe}u;
const uint NOT_LAID = TRAVEL | BREAK;

uvec4 vertexAt(int texel) {
  return texelFetch(uVertices, ivec2(texel & ${TEXELS_PER_ROW - 1}, texel >> ${ROW_SHIFT}), 0);
}
vec3 placeOf(uvec4 v) {
  return uOrigin + vec3(v.xyz & ${mask(FIELDS.x.bits)}) * uStep;
}
uint featureOf(uvec4 v) {
  return (v.z >> ${FIELDS.feature.shift}) & ${mask(FIELDS.feature.bits)};
}
/** True if one end lies outside, by more than positions are rounded. */
bool leavesVolume(vec3 from, vec3 to) {
  if (uVolumeRadii.x > 0.0) {
    vec2 middle = 0.5 * (uVolumeMin.xy + uVolumeMax.xy);
    float away = max(length((from.xy - middle) / uVolumeRadii), length((to.xy - middle) / uVolumeRadii));
    if (away > 1.0) return true;
  }
  return any(lessThan(min(from, to), uVolumeMin - 0.01)) || any(greaterThan(max(from, to), uVolumeMax + 0.01));
}
/** A place that is clipped away. */
const vec4 NOWHERE = vec4(0.0, 0.0, -2.0, 1.0);
`;

/** Two lamps that move with the eye. */
const LIGHT = /* glsl */ `
const vec3 KEY = vec3(-0.36, 0.62, 0.70);
const vec3 FILL = vec3(0.78, 0.10, 0.62);
const vec3 GLANCE = vec3(-0.195, 0.336, 0.921);

vec3 lit(vec3 colour, vec3 towards) {
  vec3 n = normalize(towards);
  float key = max(dot(n, KEY), 0.0);
  float fill = max(dot(n, FILL), 0.0);
  float shine = pow(max(dot(n, GLANCE), 0.0), 24.0);
  return colour * (0.43 + 0.52 * key + 0.22 * fill) + 0.04 * shine;
}
`;

/**
 * With `LISTED` defined the beads are those of a list of segments (segments.ts), and the light is computed at the corners alone:
 * cheaper, less round near by.
 */
export const BEAD_VERTEX = /* glsl */ `${PULL}${COLOUR}
uniform vec3 cameraPosition;
uniform uint uFeatures;
uniform int uStride;
uniform float uHeightScale;
uniform float uBedZ;
/** Millimetres that a pixel covers, for each millimetre of distance. */
uniform float uPixelAngle;
uniform vec2 uDefaultSize;
uniform vec3 uRemaining;
/** Bit by object: not drawn. */
uniform uint uHiddenObjects[8];
/** The object that stands out; 0: none does. */
uniform uint uObject;

#ifndef LISTED
out vec3 vNormal;
#endif
out vec3 vColour;
${LIGHT}
const float SIZE_STEP = ${SIZE_STEP_MM};
/** Cosine of the sharpest bend that is mitred. */
const float MITRE_COS_MIN = -0.5;
/** Cosine of the sharpest bend that looks round. */
const float ROUND_COS_MIN = 0.85;
const float TIP = 0.8;
/** A bead that stands for several layers is so much higher, so that no gaps are left between round edges. */
const float OVERLAP = 1.3;
/** Features whose beads lie on top of each other; the others' lie side by side. */
const uint WALLS = ${WALLS}u;

#ifdef LISTED
uniform highp usampler2D uSegments;
uniform int uSegmentCount;
/** Of a segment of the list, the texels where it begins and ends; none at its ends. */
ivec2 segmentAt(int at) {
  if (at < 0 || at >= uSegmentCount) return ivec2(-1);
  uint pair = texelFetch(uSegments, ivec2(at & ${TEXELS_PER_ROW - 1}, at >> ${ROW_SHIFT}), 0).r;
  return ivec2(pair >> ${TEXEL_BITS}, pair & ${TEXEL_MASK}u);
}
#endif

bool shown(uvec4 v) {
  if ((v.z & NOT_LAID) != 0u || ((uFeatures >> featureOf(v)) & 1u) == 0u) return false;
  uint object = objectOf(v);
  return ((uHiddenObjects[object >> 5] >> (object & 31u)) & 1u) == 0u;
}
vec2 sizeOf(uvec4 v) {
  float width = float((v.x >> ${FIELDS.width.shift}) & ${mask(FIELDS.width.bits)}) * SIZE_STEP;
  float height = float((v.y >> ${FIELDS.height.shift}) & ${mask(FIELDS.height.bits)}) * SIZE_STEP;
  return vec2(width > 0.0 ? width : uDefaultSize.x, height > 0.0 ? height : uDefaultSize.y);
}

/** Level and across the way; any such direction where the way is upright. */
vec3 rightOf(vec3 way) {
  float level = length(way.xy);
  return level > 1e-4 ? vec3(way.y, -way.x, 0.0) / level : vec3(1.0, 0.0, 0.0);
}

void main() {
  int bead = gl_VertexID / ${POINTS_PER_BEAD};
  int point = gl_VertexID - bead * ${POINTS_PER_BEAD};
  bool atEnd = point >= 5;
  int part = atEnd ? point - 5 : point;
#ifdef LISTED
  int listed = bead * uStride;
  ivec2 ends = segmentAt(listed);
  int start = ends.x;
  int texel = ends.y;
  // The neighbour at this end goes on from here, or is another run.
  ivec2 beyond = segmentAt(atEnd ? listed + 1 : listed - 1);
  bool goesOn = atEnd ? beyond.x == texel : beyond.y == start;
  int farTexel = !goesOn ? texel : atEnd ? beyond.y : beyond.x;
#else
  int texel = bead * uStride + ${LEAD_TEXELS};
  int start = texel - 1;
  int farTexel = atEnd ? texel + 1 : texel - 2;
  const bool goesOn = true;
  vNormal = vec3(0.0, 0.0, 1.0);
#endif

  uvec4 own = vertexAt(texel);
  vColour = vec3(0.0);
  gl_Position = NOWHERE;
  if (!shown(own)) return;
  uvec4 before = vertexAt(start);
  vec3 from = placeOf(before);
  vec3 to = placeOf(own);
  float len = length(to - from);
  if (len < 1e-6) return;
  vec3 along = (to - from) / len;

  // The neighbour at this end, and whether the bead goes on into it.
  uvec4 far = vertexAt(farTexel);
  uvec4 neighbour = atEnd ? far : before;
  vec3 other = atEnd ? placeOf(far) - to : from - placeOf(far);
  float otherLen = length(other);
  vec2 size = sizeOf(own);
  vec3 tangent = along;
  vec3 lightTangent = along;
  float mitre = 1.0;
  bool joined = false;
  if (goesOn && shown(neighbour) && otherLen > 1e-6) {
    float bend = dot(along, other / otherLen);
    if (bend > MITRE_COS_MIN) {
      joined = true;
      // Round a bend the light turns with it; a corner keeps its edge.
      if (bend > ROUND_COS_MIN) lightTangent = along + other / otherLen;
      tangent = normalize(along + other / otherLen);
      mitre = 1.0 / max(dot(tangent, along), 0.5);
      size = 0.5 * (size + sizeOf(neighbour));
    }
  }

  vec3 here = atEnd ? to : from;
  // A bead that stands for the layers below it reaches down to them, but not through the bed.
  float height = uHeightScale > 1.0 ? min(size.y * uHeightScale * OVERLAP, max(here.z - uBedZ, size.y)) : size.y;
  vec2 half_ = 0.5 * vec2(size.x, height);
  vec3 centre = here - vec3(0.0, 0.0, half_.y);
  vec3 right = rightOf(tangent);
  vec3 up = cross(right, tangent);

  // The ellipse as a unit circle: the outline is where the normal is across the line of sight.
  vec3 sight = cameraPosition - centre;
  vec2 q = vec2(dot(sight, right), dot(sight, up)) / half_;
  q = length(q) > 1e-6 ? normalize(q) : vec2(0.0, 1.0);
  vec2 c = part == 0 ? vec2(-q.y, q.x) : part == 2 ? vec2(q.y, -q.x) : part == 3 ? -q : q;
  vec3 lightRight = rightOf(lightTangent);
  vec3 round_ = normalize(lightRight * (c.x / half_.x) + up * (c.y / half_.y));
  vec3 place = centre + right * (c.x * half_.x * mitre) + up * (c.y * half_.y);
  if (part == 4) {
    vec3 outward = atEnd ? along : -along;
    place = joined ? centre : centre + outward * (half_.x * TIP);
    round_ = outward;
  }

  // Beads about as thin as a pixel would glitter: far away each has the one normal of the surface it is part of.
  float pixel = uPixelAngle * length(sight);
  vec3 lightUp = cross(lightRight, normalize(lightTangent));
  vec2 seen = vec2(dot(sight, lightRight), dot(sight, lightUp)) / length(sight);
  bool wall = ((WALLS >> featureOf(own)) & 1u) == 1u;
  vec2 lean = wall ? vec2(clamp(seen.x * 5.0, -1.0, 1.0), 0.4 * seen.y) : vec2(0.15 * seen.x, clamp(seen.y * 8.0, -1.0, 1.0));
  vec3 surface = normalize(lightRight * lean.x + lightUp * lean.y + 1e-3 * sight / length(sight));
  vec3 normal = mat3(viewMatrix) * mix(round_, surface, uHeightScale > 1.0 ? 0.8 : smoothstep(0.2, 0.6, pixel / min(size.x, height)));
  int vertex = texel - ${LEAD_TEXELS};
  vec3 colour = colourOf(own, vertex, texel);
  if (leavesVolume(from, to)) colour = mix(colour, uWarning, 0.8);
  if (uObject != 0u && objectOf(own) != uObject) colour = mix(colour, uRemaining, 0.7);
  vColour = uBase + uint(vertex) < uPrinted ? colour : mix(colour, uRemaining, 0.84);
#ifdef LISTED
  vColour = lit(vColour, normal);
#else
  vNormal = normal;
#endif
  gl_Position = projectionMatrix * (viewMatrix * vec4(place, 1.0));
}
`;

export const BEAD_FRAGMENT = /* glsl */ `
precision highp float;
#ifndef LISTED
in vec3 vNormal;
#endif
in vec3 vColour;
out vec4 colour;
${LIGHT}
void main() {
#ifdef LISTED
  colour = vec4(vColour, 1.0);
#else
  colour = vec4(lit(vColour, vNormal), 1.0);
#endif
}
`;

export const TRAVEL_VERTEX = /* glsl */ `${PULL}
uniform vec3 uTravel;
uniform vec3 uWipe;
/** Bit 0: travels are shown; bit 1: wipes. */
uniform uint uLines;
out vec3 vColour;

void main() {
  int segment = gl_VertexID >> 1;
  uvec4 own = vertexAt(segment + ${LEAD_TEXELS});
  bool wipe = (own.z & WIPE) != 0u;
  vColour = wipe ? uWipe : uTravel;
  gl_Position = NOWHERE;
  if ((own.z & NOT_LAID) != TRAVEL || (uLines & (wipe ? 2u : 1u)) == 0u) return;
  vec3 to = placeOf(own);
  vec3 from = placeOf(vertexAt(segment + ${LEAD_TEXELS - 1}));
  if (leavesVolume(from, to)) vColour = uWarning;
  gl_Position = projectionMatrix * (viewMatrix * vec4((gl_VertexID & 1) == 1 ? to : from, 1.0));
}
`;

/** Shapes of markers: seams round, retractions pointing down, their ends up, tool changes a diamond, pauses a square. */
const MARKER_SHAPES = { round: 0, down: 1, up: 2, diamond: 3, square: 4 } as const;

export const MARKER_VERTEX = /* glsl */ `${PULL}
uniform uint uMarkers;
uniform bool uToolChanges;
uniform float uMarkerPx;
uniform vec3 uRetract;
uniform vec3 uUnretract;
uniform vec3 uSeam;
uniform vec3 uToolChange;
uniform vec3 uPause;
out vec3 vColour;
flat out int vShape;

void main() {
  uvec4 own = vertexAt(gl_VertexID + ${LEAD_TEXELS});
  uint kind = own.z & uMarkers;
  bool changes = uToolChanges && (own.y & ${EVENTS.toolChange}u) != 0u;
  float size = 1.0;
  if ((kind & ${FLAGS.pause}u) != 0u) { vColour = uPause; vShape = ${MARKER_SHAPES.square}; size = 1.7; }
  else if (changes) { vColour = uToolChange; vShape = ${MARKER_SHAPES.diamond}; size = 2.0; }
  else if ((kind & ${FLAGS.seam}u) != 0u) { vColour = uSeam; vShape = ${MARKER_SHAPES.round}; }
  else if ((kind & ${FLAGS.retract}u) != 0u) { vColour = uRetract; vShape = ${MARKER_SHAPES.down}; size = 1.3; }
  else { vColour = uUnretract; vShape = ${MARKER_SHAPES.up}; size = 1.3; }
  gl_PointSize = uMarkerPx * size;
  gl_Position = NOWHERE;
  if (kind == 0u && !changes) return;
  vec4 eye = viewMatrix * vec4(placeOf(own), 1.0);
  // In front of the bead that it marks.
  eye.xyz *= 1.0 - 0.4 / max(length(eye.xyz), 1.0);
  gl_Position = projectionMatrix * eye;
}
`;

export const MARKER_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
in vec3 vColour;
flat in int vShape;
out vec4 colour;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  bool inside = true;
  if (vShape == ${MARKER_SHAPES.round}) inside = dot(at, at) <= 1.0;
  else if (vShape == ${MARKER_SHAPES.down}) inside = abs(at.x) <= 0.5 * (1.0 - at.y);
  else if (vShape == ${MARKER_SHAPES.up}) inside = abs(at.x) <= 0.5 * (1.0 + at.y);
  else if (vShape == ${MARKER_SHAPES.diamond}) inside = abs(at.x) + abs(at.y) <= 1.0;
  if (!inside) discard;
  colour = vec4(vColour, 1.0);
}
`;

export const FLAT_FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vColour;
out vec4 colour;
void main() { colour = vec4(vColour, 1.0); }
`;

/** Lines and plates with their own corners. */
export const FLAT_VERTEX = /* glsl */ `
precision highp float;
in vec3 position;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uColour;
out vec3 vColour;
void main() {
  vColour = uColour;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}
`;

/** A picture over the whole view. */
export const COPY_VERTEX = /* glsl */ `
precision highp float;
out vec2 vAt;
void main() {
  vAt = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
  gl_Position = vec4(vAt * 2.0 - 1.0, 0.0, 1.0);
}
`;

export const COPY_FRAGMENT = /* glsl */ `
precision highp float;
uniform sampler2D uPicture;
in vec2 vAt;
out vec4 colour;
void main() { colour = vec4(texture(uPicture, vAt).rgb, 1.0); }
`;
