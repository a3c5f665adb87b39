// Numbers as people write and read them. Decimal comma and point are both understood, whatever the language.

const formats = new Map<string, Intl.NumberFormat>();

/** A number in the user's language with so many decimals. */
export function formatNumber(value: number, decimals = 0, minimum = decimals): string {
  const key = `${decimals}/${minimum}`;
  let format = formats.get(key);
  if (!format) {
    format = new Intl.NumberFormat(undefined, {
      maximumFractionDigits: decimals,
      minimumFractionDigits: minimum,
    });
    formats.set(key, format);
  }
  // No minus before a zero.
  const rounded = Number(value.toFixed(decimals));
  return format.format(rounded === 0 ? 0 : rounded);
}

/** A number as it stands in a field: without groups, which a lone one could not be told from decimals in. */
export function formatPlain(value: number, decimals = 0): string {
  const rounded = Number(value.toFixed(decimals));
  return new Intl.NumberFormat(undefined, {
    useGrouping: false,
    numberingSystem: 'latn',
    maximumFractionDigits: decimals,
  }).format(rounded === 0 ? 0 : rounded);
}

/** The decimal sign of the user's language. */
export function decimalSign(): string {
  const parts = new Intl.NumberFormat().formatToParts(0.5);
  return parts.find(({ type }) => type === 'decimal')?.value ?? '.';
}

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)$/;

/**
 * The number in a text, or undefined where it is none. A lone comma or point is the decimal one; where both occur the
 * last is, and the others group thousands, as spaces and apostrophes do.
 */
export function parseNumber(text: string): number | undefined {
  let plain = text
    .trim()
    .replaceAll('\u2212', '-')
    .replace(/[\s\u00a0\u202f'’]/g, '');
  const comma = plain.lastIndexOf(',');
  const point = plain.lastIndexOf('.');
  if (comma > point && point >= 0) plain = plain.replaceAll('.', '').replace(',', '.');
  else if (point > comma && comma >= 0) plain = plain.replaceAll(',', '');
  else plain = plain.replace(',', '.');
  return NUMBER.test(plain) ? Number(plain) : undefined;
}

const pad = (value: number): string => String(value).padStart(2, '0');

/** `1:05:09`, `5:09`: hours, minutes, seconds. */
export function formatDuration(totalSeconds: number): string {
  const total = Math.max(0, Math.round(totalSeconds));
  const [hours, minutes, rest] = [Math.floor(total / 3600), Math.floor(total / 60) % 60, total % 60];
  return hours > 0 ? `${hours}:${pad(minutes)}:${pad(rest)}` : `${minutes}:${pad(rest)}`;
}

export function formatBytes(bytes: number): string {
  if (bytes < 1000) return `${formatNumber(bytes)} B`;
  if (bytes < 1e6) return `${formatNumber(bytes / 1000)} kB`;
  return `${formatNumber(bytes / 1e6, 1)} MB`;
}
