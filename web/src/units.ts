// Physical quantities as branded numbers, so that seconds never pass for millimetres where modules meet.
// Knows no arithmetic: brands vanish at run time.

declare const unit: unique symbol;
type Quantity<Name extends string> = number & { readonly [unit]: Name };

export type Seconds = Quantity<'s'>;
export type Milliseconds = Quantity<'ms'>;
export type Mm = Quantity<'mm'>;
export type Celsius = Quantity<'°C'>;
/** 0 … 1. */
export type Share = Quantity<'share'>;

export const seconds = (value: number): Seconds => value as Seconds;
export const milliseconds = (value: number): Milliseconds => value as Milliseconds;
export const mm = (value: number): Mm => value as Mm;
export const celsius = (value: number): Celsius => value as Celsius;
export const share = (value: number): Share => value as Share;
