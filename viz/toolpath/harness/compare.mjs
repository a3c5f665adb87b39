// Compares pictures, and takes them when nothing moves any more.

/** A colour's channel may differ by so much. */
const CHANNEL_MAX = 40;

/** Of a thousand pixels, those that differ from all the nine around their place in the other picture; runs in the page. */
async function differing({ first, second, channelMax }) {
  const pixels = async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    return context.getImageData(0, 0, bitmap.width, bitmap.height);
  };
  const [a, b] = [await pixels(first), await pixels(second)];
  if (a.width !== b.width || a.height !== b.height) return 1000;
  const near = (one, other, x, y) => {
    const at = (y * a.width + x) * 4;
    for (let v = Math.max(y - 1, 0); v <= Math.min(y + 1, a.height - 1); v++) {
      for (let u = Math.max(x - 1, 0); u <= Math.min(x + 1, a.width - 1); u++) {
        const to = (v * a.width + u) * 4;
        if ([0, 1, 2].every((c) => Math.abs(one.data[at + c] - other.data[to + c]) <= channelMax))
          return true;
      }
    }
    return false;
  };
  let count = 0;
  for (let y = 0; y < a.height; y++) {
    for (let x = 0; x < a.width; x++) if (!near(a, b, x, y) || !near(b, a, x, y)) count += 1;
  }
  return (1000 * count) / (a.width * a.height);
}

/** Shows a case and takes its picture. */
export async function drawn(page, name, theme) {
  await page.evaluate(
    ([case_, shade]) => {
      window.harness.latest.delete('ranges');
      window.harness.show(case_, shade);
    },
    [name, theme],
  );
  await page.waitForFunction(() => window.harness.latest.get('ranges')?.isWhole, null, { timeout: 60_000 });
  await page.evaluate(() => {
    window.harness.frames.length = 0;
    // Whatever was drawn before, something is drawn now.
    window.harness.host.orbit(0, 0);
  });
  return atRest(page);
}

/** A picture once all that was asked for is drawn; `harness.frames` must have been emptied before it was asked for. */
export async function atRest(page) {
  await page.waitForFunction(() => window.harness.frames.some(({ more }) => !more), null, {
    timeout: 60_000,
  });
  return page.screenshot();
}

/** How many of a thousand pixels differ between two PNGs. */
export const difference = (page, first, second) =>
  page.evaluate(differing, {
    first: first.toString('base64'),
    second: second.toString('base64'),
    channelMax: CHANNEL_MAX,
  });
