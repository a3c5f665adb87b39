// The origin's private file system, as much of it as the page uses, in memory. Files that are being written are locked;
// the disk has a size.
import type { SyncFile } from '../src/machine/storage';

export class FakeDisk {
  bytesMax = Number.POSITIVE_INFINITY;
  readonly root = new FakeFolder(this);
  #clock = 0;

  get used(): number {
    return this.root.bytes;
  }
  tick(): number {
    this.#clock += 1;
    return this.#clock;
  }
  handle(): Promise<FileSystemDirectoryHandle> {
    return Promise.resolve(this.root as unknown as FileSystemDirectoryHandle);
  }
}

const missing = (): DOMException => new DOMException('not there', 'NotFoundError');

export class FakeFile {
  readonly kind = 'file';
  bytes = new Uint8Array();
  changed = 0;
  isOpen = false;
  readonly #disk: FakeDisk;

  constructor(disk: FakeDisk) {
    this.#disk = disk;
  }

  async getFile(): Promise<File> {
    return new File([this.bytes.slice()], 'file', { lastModified: this.changed });
  }

  async createSyncAccessHandle(): Promise<SyncFile> {
    if (this.isOpen) throw new DOMException('open', 'NoModificationAllowedError');
    this.isOpen = true;
    return {
      getSize: () => this.bytes.length,
      write: (bytes, { at }) => this.#write(bytes, at),
      truncate: (size) => {
        this.bytes = this.bytes.slice(0, size);
      },
      flush: () => undefined,
      close: () => {
        this.isOpen = false;
      },
    };
  }

  /** A disk that gets full takes a part of the bytes, then none. */
  #write(bytes: Uint8Array, at: number): number {
    const room = this.#disk.bytesMax - this.#disk.used;
    if (room <= 0) throw new DOMException('full', 'QuotaExceededError');
    const piece = bytes.subarray(0, Math.min(bytes.length, room));
    const grown = new Uint8Array(Math.max(this.bytes.length, at + piece.length));
    grown.set(this.bytes);
    grown.set(piece, at);
    this.bytes = grown;
    this.changed = this.#disk.tick();
    return piece.length;
  }
}

export class FakeFolder {
  readonly kind = 'directory';
  readonly #entries = new Map<string, FakeFile | FakeFolder>();
  readonly #disk: FakeDisk;

  constructor(disk: FakeDisk) {
    this.#disk = disk;
  }

  get bytes(): number {
    return [...this.#entries.values()].reduce(
      (sum, entry) => sum + (entry instanceof FakeFile ? entry.bytes.length : entry.bytes),
      0,
    );
  }
  get isOpen(): boolean {
    return [...this.#entries.values()].some((entry) => entry.isOpen);
  }
  async getDirectoryHandle(name: string, { create = false } = {}): Promise<FakeFolder> {
    if (create && !this.#entries.has(name)) this.#entries.set(name, new FakeFolder(this.#disk));
    const entry = this.#entries.get(name);
    if (!(entry instanceof FakeFolder)) throw missing();
    return entry;
  }
  async getFileHandle(name: string, { create = false } = {}): Promise<FakeFile> {
    if (create && !this.#entries.has(name)) this.#entries.set(name, new FakeFile(this.#disk));
    const entry = this.#entries.get(name);
    if (!(entry instanceof FakeFile)) throw missing();
    return entry;
  }
  async removeEntry(name: string): Promise<void> {
    const entry = this.#entries.get(name);
    if (!entry) throw missing();
    if (entry.isOpen) throw new DOMException('open', 'NoModificationAllowedError');
    this.#entries.delete(name);
  }
  async *entries(): AsyncGenerator<[string, FakeFile | FakeFolder]> {
    yield* this.#entries;
  }
}
