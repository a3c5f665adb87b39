// Runs steps one after the other: a heading and a duration each, their output as it comes, a summary at the end.
// Knows nothing of what the steps do.
import { spawn } from 'node:child_process';

/** What a step came to. `counts` are of single tests, where the step runs tests. */
export const PASSED = 'passed';
export const FAILED = 'failed';
export const NOT_RUN = 'not run';

const bold = (text) => (process.stdout.isTTY ? `\x1b[1m${text}\x1b[0m` : text);
const seconds = (ms) => `${(ms / 1000).toFixed(1)} s`;

// What Rust's, Node's, vitest's and Playwright's test runners write when they are done.
const RUST_RESULT = /^test result: \w+\. (\d+) passed; (\d+) failed; (\d+) ignored/gm;
const NODE_RESULT = /^ℹ (pass|fail|skipped) (\d+)/gm;
const VITEST_RESULT = /^\s+Tests\s.*\(\d+\)$/gm;
const PLAYWRIGHT_RESULT = /^ {2}(\d+) (passed|failed|skipped)(?: \([\d.]+\w+\))?$/gm;

/** How many tests the output of `cargo test`, `node --test`, `vitest run` or `playwright test` tells of. */
export function countTests(output) {
  const plain = output.replace(/\x1b\[[0-9;]*m/g, '');
  const counts = { passed: 0, failed: 0, skipped: 0 };
  for (const [, passed, failed, ignored] of plain.matchAll(RUST_RESULT)) {
    counts.passed += Number(passed);
    counts.failed += Number(failed);
    counts.skipped += Number(ignored);
  }
  const key = { pass: 'passed', fail: 'failed', skipped: 'skipped' };
  for (const [, what, number] of plain.matchAll(NODE_RESULT)) counts[key[what]] += Number(number);
  for (const [line] of plain.matchAll(VITEST_RESULT)) {
    for (const [, number, what] of line.matchAll(/(\d+) (passed|failed|skipped)/g)) counts[what] += Number(number);
  }
  for (const [, number, what] of plain.matchAll(PLAYWRIGHT_RESULT)) counts[what] += Number(number);
  return counts;
}

/**
 * Runs a command, its error stream and input being ours, its output copied to ours and also returned.
 * Progress is written to the error stream, so a terminal still shows it live.
 */
function run([program, ...args], { cwd, env }) {
  return new Promise((resolve) => {
    const shell = process.platform === 'win32' && program === 'npm';
    const child = spawn(program, args, { cwd, env, shell, stdio: ['inherit', 'pipe', 'inherit'] });
    const output = [];
    child.stdout.on('data', (chunk) => {
      process.stdout.write(chunk);
      output.push(chunk);
    });
    child.on('error', (error) => resolve({ ok: false, output: '', why: error.message }));
    child.on('close', (code, signal) => {
      const why = signal ? `ended by ${signal}` : `exit status ${code}`;
      resolve({ ok: code === 0, output: Buffer.concat(output).toString(), why });
    });
  });
}

/**
 * Runs one step: { name, commands: [[program, ...args], ...], needs: [names], absent: () => reason or undefined }.
 * `results` holds the steps before it, by name.
 */
async function runStep(step, results, options) {
  const lacking = (step.needs ?? []).find((name) => results.has(name) && results.get(name).outcome !== PASSED);
  const reason = lacking ? `"${lacking}" did not pass` : step.absent?.();
  if (reason) {
    console.log(`not run: ${reason}`);
    return { outcome: NOT_RUN, why: reason, counts: { passed: 0, failed: 0, skipped: 1 } };
  }
  const counts = { passed: 0, failed: 0, skipped: 0 };
  for (const command of step.commands) {
    console.log(`$ ${command.join(' ')}`);
    const { ok, output, why } = await run(command, options);
    const told = countTests(output);
    for (const key of Object.keys(counts)) counts[key] += told[key];
    if (!ok) {
      counts.failed ||= 1;
      return { outcome: FAILED, why, counts };
    }
  }
  if (counts.passed + counts.failed + counts.skipped === 0) counts.passed = 1;
  return { outcome: PASSED, why: '', counts };
}

/** Runs all steps, whatever comes of each, and writes the summary. True when none failed. */
export async function runSteps(steps, options) {
  const results = new Map();
  for (const [index, step] of steps.entries()) {
    console.log(`\n${bold(`[${index + 1}/${steps.length}] ${step.name}`)}`);
    const start = performance.now();
    const result = await runStep(step, results, options);
    result.ms = performance.now() - start;
    results.set(step.name, result);
    console.log(`${result.outcome}: ${step.name}, ${seconds(result.ms)}`);
  }
  return summarise(results);
}

function summarise(results) {
  const total = { passed: 0, failed: 0, skipped: 0 };
  const width = Math.max(...[...results.keys()].map((name) => name.length));
  console.log(`\n${bold('Summary')}`);
  for (const [name, { outcome, why, counts, ms }] of results) {
    for (const key of Object.keys(total)) total[key] += counts[key];
    const tests = counts.passed + counts.failed > 1 ? `, ${counts.passed} of ${counts.passed + counts.failed} tests` : '';
    const reason = why ? `: ${why}` : '';
    console.log(`  ${name.padEnd(width)}  ${outcome.padEnd(7)} ${seconds(ms).padStart(8)}${tests}${reason}`);
  }
  const skipped = total.skipped ? `, ${total.skipped} skipped` : '';
  console.log(`\n${total.passed} passed, ${total.failed} failed${skipped}`);
  return total.failed === 0;
}
