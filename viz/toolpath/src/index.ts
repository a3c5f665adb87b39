/** The package's face: what a page may use. The view itself (three.js) is reached through the host, or `./view`. */
export type { Bed } from './bed';
export type { BoxMm, CameraState } from './camera';
export { attachControls } from './controls';
export type { FrameReport } from './frames';
export { ToolpathHost, type ToolpathHostOptions } from './host';
export type { Layer } from './layers';
export type { ViewEvent, ViewRequest } from './messages';
export { type HexColour, PALETTES, type Palette, type Theme } from './palette';
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
export type { Shown, ToolpathView, ViewSizePx } from './view';
