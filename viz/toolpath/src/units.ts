/** Numbers that must not be mixed up: lengths in millimetres, places in the list of vertices. */

declare const unit: unique symbol;

/** Millimetres. */
export type Mm = number & { readonly [unit]?: 'mm' };
/** The index of a vertex in its file. */
export type VertexIndex = number & { readonly [unit]?: 'vertex' };
/** The index of a layer, 0 is the first. */
export type LayerIndex = number & { readonly [unit]?: 'layer' };
/** Pixels of the drawing buffer's style size (CSS pixels). */
export type CssPx = number & { readonly [unit]?: 'css px' };
/** Radians. */
export type Radians = number & { readonly [unit]?: 'rad' };
/** Milliseconds of the host's monotonic clock. */
export type Ms = number & { readonly [unit]?: 'ms' };
