// What kind of thing is on the other end of a line that does not speak Klipper's protocol, judged by its first bytes.
// Pure: bytes in, a guess out. Knows nothing of ports.

export type AnswerKind = 'silent' | 'klipper' | 'text' | 'marlin' | 'bootloader' | 'noise';

/** So much of what came is looked at. */
export const ANSWER_BYTES_MAX = 4096;
/** A block of Klipper's ends with this byte. */
const SYNC = 0x7e;
const BLOCK_MIN = 5;
const BLOCK_MAX = 64;
/** Above this share of printable bytes it is text. */
const TEXT_SHARE = 0.9;

const MARLIN =
  /\b(Marlin|echo:|FIRMWARE_NAME|RepRap|Repetier|Smoothie|Prusa|start\r?\n|ok\b|wait\b|Error:|busy:)/;
const BOOTLOADER = /(^CCC+|bootloader|DFU|Katapult|CanBoot|HID Boot|Press.*to.*(flash|update))/i;

const isPrintable = (byte: number): boolean =>
  (byte >= 0x20 && byte < 0x7f) || byte === 9 || byte === 10 || byte === 13;

/** Whether the bytes hold something with the length and the end of a block. */
function hasBlock(bytes: Uint8Array): boolean {
  for (let start = 0; start < bytes.length; start += 1) {
    const length = bytes[start] ?? 0;
    if (length < BLOCK_MIN || length > BLOCK_MAX || ((bytes[start + 1] ?? 0) & 0xf0) !== 0x10) continue;
    if (bytes[start + length - 1] === SYNC) return true;
  }
  return false;
}

/** Judges what came from a board that was asked to identify itself. */
export function classify(bytes: Uint8Array): AnswerKind {
  if (bytes.length === 0) return 'silent';
  const printable = bytes.reduce((count, byte) => count + (isPrintable(byte) ? 1 : 0), 0);
  if (printable / bytes.length >= TEXT_SHARE) {
    const text = new TextDecoder('latin1').decode(bytes);
    if (BOOTLOADER.test(text)) return 'bootloader';
    return MARLIN.test(text) ? 'marlin' : 'text';
  }
  return hasBlock(bytes) ? 'klipper' : 'noise';
}
