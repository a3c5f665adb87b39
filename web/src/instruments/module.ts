// The instruments' WebAssembly as it is loaded: not part of the page's bundle, for it may be built after the page.
// The shapes are those of viz/instruments/src/web.rs.

export interface Instruments {
  resize(widthPx: number, heightPx: number, pixelsPerPoint: number): void;
  set_dark(isDark: boolean): void;
  push_temperatures(readings: Float64Array): void;
  set_planned_speed(pairs: Float64Array): void;
  show_last(spanS: number): void;
  pointer_moved(x: number, y: number): void;
  pointer_pressed(pressed: boolean): void;
  pointer_left(): void;
  zoom(factor: number): void;
  /** Seconds until it wants to be drawn again. */
  draw(timeS: number): number;
}

interface InstrumentsModule {
  default(): Promise<unknown>;
  Instruments: new (gl: WebGL2RenderingContext, heaters: string[], decimalSign: string) => Instruments;
}

/** Whether the script is there: a server may answer with another page instead of an error. */
async function isThere(url: string): Promise<boolean> {
  const { ok, headers } = await fetch(url, { method: 'HEAD', cache: 'no-cache' });
  return ok && (headers.get('Content-Type') ?? '').includes('javascript');
}

/** Loads the module; undefined where it is not built. */
export async function loadInstruments(url: string): Promise<InstrumentsModule | undefined> {
  if (!(await isThere(url))) return undefined;
  const module = (await import(/* @vite-ignore */ url)) as InstrumentsModule;
  await module.default();
  return module;
}
