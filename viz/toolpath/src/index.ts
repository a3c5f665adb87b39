/** The package's face: what a page may use. The view itself (three.js) is reached through the host, or `./view`. */
export type { Bed } from './bed';
export type { BoxMm, CameraPreset, CameraState, Projection } from './camera';
export { type Channels, decodeChannels, WORDS_PER_CHANNELS } from './channels';
export {
  CATEGORICAL_MODES,
  COLOUR_MODES,
  type ColourMode,
  type ColourRanges,
  categoryColour,
  PLANNED_MODES,
  RAMP,
  RAMPS,
  type ValueRange,
} from './colours';
export { attachControls } from './controls';
export type { FrameReport } from './frames';
export { ToolpathHost, type ToolpathHostOptions } from './host';
export type { Layer } from './layers';
export { type BedMesh, exaggerationOf, heightRange } from './mesh';
export type { Slice, SourcedRequest, ViewEvent, ViewRequest } from './messages';
export { type HexColour, PALETTES, type Palette, type Theme } from './palette';
export type { PictureSizePx } from './picture';
export type { Shown } from './shown';
export { SLICE_MAX } from './slice';
export type { CssPx, LayerIndex, Mm, Ms, Radians, VertexIndex } from './units';
export {
  decodeVertex,
  EVENTS,
  FEATURES,
  type FeatureName,
  FLAGS,
  type Vertex,
  type VertexHeader,
  WORDS_PER_VERTEX,
} from './vertex';
export type { ToolpathView, ViewSizePx } from './view';
