// Who has which print open, among all tabs, as the archive asks for it.
import type { PrintLocks } from '../src/machine/archive';

export class FakeLocks implements PrintLocks {
  readonly names = new Set<string>();

  async hold(id: string): Promise<(() => void) | null> {
    if (this.names.has(id)) return null;
    this.names.add(id);
    return () => void this.names.delete(id);
  }
  async held(): Promise<ReadonlySet<string>> {
    return new Set(this.names);
  }
}
