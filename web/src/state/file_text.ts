// The text of the file that is shown, in blocks of lines that are fetched when they are looked at. Keeps the few that were
// looked at last; the whole is never here.
import { effect, signal } from '@preact/signals';
import { file, linesRead, textOf } from './preview';

export const LINES_PER_BLOCK = 64;
/** Blocks kept: 16 384 lines. */
const BLOCKS_MAX = 256;

/** Counts what has come, so that those who show it look again. */
export const textVersion = signal(0);

const blocks = new Map<number, readonly string[]>();
let wanted: readonly number[] = [];
let isAsking = false;
/** Counts files: an answer about the one before is dropped. */
let generation = 0;

const blockOf = (line: number): number => Math.floor((line - 1) / LINES_PER_BLOCK);

/** A line's text, counted from 1; undefined where it has not come yet. */
export function lineText(line: number): string | undefined {
  return blocks.get(blockOf(line))?.[(line - 1) % LINES_PER_BLOCK];
}

/** These lines are looked at; what was before is not any more. */
export function wantLines(first: number, last: number): void {
  const [from, to] = [blockOf(Math.max(first, 1)), blockOf(Math.max(last, 1))];
  wanted = Array.from({ length: Math.min(to - from + 1, BLOCKS_MAX / 2) }, (_, at) => from + at);
  for (const block of wanted) {
    const texts = blocks.get(block);
    if (!texts) continue;
    // The last of the map was looked at last.
    blocks.delete(block);
    blocks.set(block, texts);
  }
  if (!isAsking) void ask();
}

/** A block of which more lines may have come since. */
function isShort(block: number): boolean {
  const texts = blocks.get(block);
  if (!texts) return true;
  const there = Math.min(LINES_PER_BLOCK, linesRead.peek() - block * LINES_PER_BLOCK);
  return texts.length < there;
}

async function ask(): Promise<void> {
  isAsking = true;
  const tried = new Set<number>();
  for (;;) {
    const block = wanted.find((one) => !tried.has(one) && isShort(one));
    if (block === undefined) break;
    tried.add(block);
    const asked = generation;
    const first = block * LINES_PER_BLOCK + 1;
    const texts = await textOf(first, first + LINES_PER_BLOCK - 1);
    if (asked !== generation || texts.length === 0) continue;
    blocks.delete(block);
    blocks.set(block, texts);
    const [oldest] = blocks.keys();
    if (blocks.size > BLOCKS_MAX && oldest !== undefined) blocks.delete(oldest);
    textVersion.value += 1;
  }
  isAsking = false;
}

/** Forgets the text of a file that is not shown any more. */
export function followText(): void {
  effect(() => {
    file.value;
    generation += 1;
    blocks.clear();
    wanted = [];
    textVersion.value += 1;
  });
}
