// The heaters' temperatures of the last two hours, one reading a second, kept whether or not anybody looks.
// What is older goes. Times are those of the page's monotonic clock, in s.
import { effect, signal } from '@preact/signals';
import type { HeaterName, HeaterState } from '../machine/protocol';
import { type Celsius, celsius, type Seconds, seconds } from '../units';
import { isReady, snapshot } from './machine';

/** Readings kept of each heater: two hours at one a second. */
export const READINGS_MAX = 7200;
/** Seconds between two readings, at least. */
const READING_S = 1;
/** Numbers of a kept reading: s, measured °C, target °C. */
const NUMBERS = 3;

/** A heater's readings over a span of time. */
export interface Statistics {
  readonly lowest: Celsius;
  readonly highest: Celsius;
  readonly average: Celsius;
}

/** A ring of readings in the order of time. */
class Readings {
  readonly #numbers = new Float64Array(READINGS_MAX * NUMBERS);
  #first = 0;
  #count = 0;

  push(at: Seconds, measured: Celsius, target: Celsius): void {
    const index = (this.#first + this.#count) % READINGS_MAX;
    this.#numbers.set([at, measured, target], index * NUMBERS);
    if (this.#count < READINGS_MAX) this.#count += 1;
    else this.#first = (this.#first + 1) % READINGS_MAX;
  }

  /** The readings after a moment, newest last. */
  *after(moment: Seconds): Generator<readonly [at: Seconds, measured: Celsius, target: Celsius]> {
    let index = this.#count;
    while (index > 0 && this.#number(index - 1, 0) > moment) index -= 1;
    for (; index < this.#count; index += 1) {
      const [at, measured, target] = [0, 1, 2].map((offset) => this.#number(index, offset));
      yield [seconds(at ?? 0), celsius(measured ?? 0), celsius(target ?? 0)];
    }
  }

  #number(index: number, offset: number): number {
    return this.#numbers[((this.#first + index) % READINGS_MAX) * NUMBERS + offset] ?? Number.NaN;
  }
}

/** What all heaters' sensors said. */
export class TemperatureHistory {
  readonly #heaters = new Map<HeaterName, Readings>();
  #last = Number.NEGATIVE_INFINITY;

  /** Keeps the heaters' readings, unless the last ones are younger than a second. True where they are kept. */
  take(now: Seconds, heaters: readonly HeaterState[]): boolean {
    if (heaters.length === 0 || now - this.#last < READING_S) return false;
    this.#last = now;
    for (const { name, temperature, target } of heaters) {
      let readings = this.#heaters.get(name);
      if (!readings) {
        readings = new Readings();
        this.#heaters.set(name, readings);
      }
      readings.push(now, temperature, target);
    }
    return true;
  }

  /** When something was last kept; before all time where nothing was. */
  get last(): Seconds {
    return seconds(this.#last);
  }

  /** All readings after a moment: the heater's place in `names`, s, measured °C, target °C of each. */
  numbersAfter(moment: Seconds, names: readonly HeaterName[]): Float64Array<ArrayBuffer> {
    const numbers: number[] = [];
    for (const [place, name] of names.entries()) {
      for (const reading of this.#heaters.get(name)?.after(moment) ?? []) numbers.push(place, ...reading);
    }
    return Float64Array.from(numbers);
  }

  /** Of the `span` before the last reading; null where there is none. */
  statistics(name: HeaterName, span: Seconds): Statistics | null {
    let [lowest, highest, sum, count] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY, 0, 0];
    for (const [, measured] of this.#heaters.get(name)?.after(seconds(this.#last - span)) ?? []) {
      lowest = Math.min(lowest, measured);
      highest = Math.max(highest, measured);
      sum += measured;
      count += 1;
    }
    if (count === 0) return null;
    return { lowest: celsius(lowest), highest: celsius(highest), average: celsius(sum / count) };
  }
}

export const temperatures = new TemperatureHistory();
/** When the history last grew, for those who follow it; s. */
export const temperaturesAt = signal<Seconds>(temperatures.last);

/** Collects readings from now on, while a board answers. */
export function followTemperatures(): void {
  effect(() => {
    const now = seconds(performance.now() / 1000);
    if (isReady.value && temperatures.take(now, snapshot.value?.heaters ?? [])) temperaturesAt.value = now;
  });
}
