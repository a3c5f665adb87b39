// CRC-32 as in Ethernet, zip and PNG (polynomial 0x04c11db7, reflected), over pieces.

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let rest = byte;
  for (let bit = 0; bit < 8; bit += 1) rest = rest & 1 ? (rest >>> 1) ^ 0xedb8_8320 : rest >>> 1;
  return rest;
});

export class Crc32 {
  #rest = 0xffff_ffff;

  add(bytes: Uint8Array): void {
    let rest = this.#rest;
    for (const byte of bytes) rest = (rest >>> 8) ^ (TABLE[(rest ^ byte) & 0xff] ?? 0);
    this.#rest = rest;
  }

  /** Eight hexadecimal digits. */
  get text(): string {
    return ((this.#rest ^ 0xffff_ffff) >>> 0).toString(16).padStart(8, '0');
  }
}
