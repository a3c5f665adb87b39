// The planner and its virtual printer as WebAssembly in the test process: the same code as in the page, used as the
// judge of what the page did. Knows no browser.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { root, targetFolder } from '../../scripts/lib/target.mjs';
import type { VirtualState } from '../../web/src/bindings/VirtualState.ts';

interface Plan {
  readonly print_time_s: number;
  readonly steps: BigUint64Array;
  free(): void;
}

interface PlanStream {
  wants(): number;
  feed(gcode: Uint8Array): Uint8Array;
  finish(): Plan;
}

export interface VirtualPrinter {
  now_s(): number;
  write(bytes: Uint8Array): void;
  run_until_s(untilS: number): Uint8Array;
  state(): string;
}

interface Bindings {
  readonly PlanStream: new (config: string) => PlanStream;
  readonly VirtualPrinter: new (
    config: string,
    board: string | undefined,
    seed: number,
    faults: string,
  ) => VirtualPrinter;
}

let loaded: Bindings | undefined;

/** The bindings for Node that `cargo xtask wasm` makes. */
export function bindings(): Bindings {
  const file = join(targetFolder(), 'wasm-bindings', 'node', 'planner_wasm.js');
  loaded ??= createRequire(import.meta.url)(file) as Bindings;
  return loaded;
}

/** The machine that the page ships with. */
export const sampleConfig = (): string => readFileSync(join(root, 'samples', 'printer.cfg'), 'utf8');

export interface Planned {
  /** X, Y, Z, extruder: steps in both directions. */
  readonly steps: readonly number[];
  readonly printTimeS: number;
}

/** What a file takes, after the planner itself. */
export function planned(gcode: string, config = sampleConfig()): Planned {
  const stream = new (bindings().PlanStream)(config);
  const bytes = Buffer.from(gcode);
  for (let at = 0; at < bytes.length; ) {
    const wants = stream.wants();
    if (wants === 0) throw new Error('the planner takes no more of the file');
    stream.feed(bytes.subarray(at, at + wants));
    at += wants;
  }
  const plan = stream.finish();
  const result = { steps: [...plan.steps].map(Number), printTimeS: plan.print_time_s };
  plan.free();
  return result;
}

export type { VirtualState };
