// Which dialog is open.
import { signal } from '@preact/signals';

export const openDialog = signal<'connect' | 'settings' | 'machine' | null>(null);
