// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

declare const unit: unique symbol;
export type MmPerS2 = number & { readonly [unit]?: 'mm/s²' };
export type MmPerS = number & { readonly [unit]?: 'mm/s' };
export type Mm = number & { readonly [unit]?: 'mm' };
export type Hertz = number & { readonly [unit]?: 'Hz' };
export type Bytes = number & { readonly [unit]?: 'bytes' };
export type Seconds = number & { readonly [unit]?: 's' };
export type Celsius = number & { readonly [unit]?: '°C' };
