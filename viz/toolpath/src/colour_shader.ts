/**
 * The part of the shaders that gives a segment its colour: by feature, by what the vertex says, by the planner's channels.
 *
 * Needs `vertexAt` and `featureOf` (shaders.ts) before it. Modes are told by their number (colours.ts); changing them changes
 * uniforms alone. Bits as in docs/vertex.md.
 */
import { CHANNELS, type ChannelName } from './channels';
import { TEXELS_PER_ROW } from './chunks';
import { CATEGORIES, type ColourMode, modeNumber, RAMP_LENGTH } from './colours';
import { FEATURE_COUNT_MAX, FIELDS, SIZE_STEP_MM } from './vertex';

const mask = (bits: number): string => `${((1 << bits) - 1) >>> 0}u`;
const ROW_SHIFT = Math.log2(TEXELS_PER_ROW);
const LAYER_MASK = mask(FIELDS.layer.bits);

/** GLSL for one channel of the four words `c`. */
const channel = (name: ChannelName): string => {
  const { word, shift, bits, unit } = CHANNELS[name];
  return `float((c.${'xyzw'[word]} >> ${shift}) & ${mask(bits)}) * ${unit.toFixed(9)}`;
};
const mode = (name: ColourMode, value: string): string => `case ${modeNumber(name)}: return ${value};`;
const vertexField = (name: 'width' | 'height'): string => {
  const { word, shift, bits } = FIELDS[name];
  return `sized((v.${'xyzw'[word]} >> ${shift}) & ${mask(bits)})`;
};

/** Where layers' times lie: one float each, in rows. */
export const LAYER_TIMES_PER_ROW = TEXELS_PER_ROW;

export const COLOUR = /* glsl */ `
precision highp sampler2D;
uniform highp usampler2D uChannels;
/** Vertices of this chunk whose channels are there. */
uniform int uChannelCount;
uniform highp sampler2D uLayerTimes;
uniform int uLayerCount;
uniform int uMode;
/** The least value, and one over the range; 0: no range is known. */
uniform vec2 uRange;
uniform vec3 uRamp[${RAMP_LENGTH}];
uniform vec3 uCategories[${CATEGORIES.length}];
/** For what is not known. */
uniform vec3 uNeutral;
uniform vec3 uPalette[${FEATURE_COUNT_MAX}];

const float UNKNOWN = -1.0;

uint layerOf(uvec4 v) { return (v.w >> ${FIELDS.layer.shift}) & ${LAYER_MASK}; }
uint toolOf(uvec4 v) { return (v.w >> ${FIELDS.tool.shift}) & ${mask(FIELDS.tool.bits)}; }
uint objectOf(uvec4 v) { return (v.w >> ${FIELDS.object.shift}) & ${mask(FIELDS.object.bits)}; }

float sized(uint steps) { return steps == 0u ? UNKNOWN : float(steps) * ${SIZE_STEP_MM}; }
float layerTime(int layer) {
  if (layer >= uLayerCount) return UNKNOWN;
  float time = texelFetch(uLayerTimes, ivec2(layer & ${LAYER_TIMES_PER_ROW - 1}, layer >> ${ROW_SHIFT}), 0).r;
  return time > 0.0 ? time : UNKNOWN;
}
float asked(float flow, float feed, float speed) { return speed > 0.0 && flow > 0.0 ? flow * feed / speed : UNKNOWN; }

/** What the planner knows. */
float plannedValue(int vertex, int texel) {
  if (vertex >= uChannelCount) return UNKNOWN;
  uvec4 c = texelFetch(uChannels, ivec2(texel & ${TEXELS_PER_ROW - 1}, texel >> ${ROW_SHIFT}), 0);
  if (c.w == 0u) return UNKNOWN;
  switch (uMode) {
    ${mode('feed', channel('feed'))}
    ${mode('speed', channel('meanSpeed'))}
    ${mode('accel', channel('accel'))}
    ${mode('flow', channel('flow'))}
    ${mode('flowAsked', `asked(${channel('flow')}, ${channel('feed')}, ${channel('meanSpeed')})`)}
    ${mode('temperature', channel('nozzle'))}
    ${mode('fan', channel('fan'))}
  }
  return UNKNOWN;
}

float valueOf(uvec4 v, int vertex, int texel) {
  switch (uMode) {
    ${mode('height', vertexField('height'))}
    ${mode('width', vertexField('width'))}
    ${mode('layerTime', 'layerTime(int(layerOf(v)))')}
  }
  return plannedValue(vertex, texel);
}

vec3 categoryOf(uint number) { return uCategories[number % ${CATEGORIES.length}u]; }

/** The colour of the segment that ends at the vertex \`v\`, number \`vertex\` of its chunk. */
vec3 colourOf(uvec4 v, int vertex, int texel) {
  if (uMode == ${modeNumber('feature')}) return uPalette[featureOf(v)];
  if (uMode == ${modeNumber('tool')}) return categoryOf(toolOf(v));
  if (uMode == ${modeNumber('object')}) return objectOf(v) == 0u ? uNeutral : categoryOf(objectOf(v) - 1u);
  float value = valueOf(v, vertex, texel);
  if (value < 0.0 || uRange.y == 0.0) return uNeutral;
  float at = clamp((value - uRange.x) * uRange.y, 0.0, 1.0) * ${(RAMP_LENGTH - 1).toFixed(1)};
  int below = min(int(at), ${RAMP_LENGTH - 2});
  return mix(uRamp[below], uRamp[below + 1], at - float(below));
}
`;
