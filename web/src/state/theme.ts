// Whether the page is dark: the user's choice, or the system's.
import { computed, signal } from '@preact/signals';
import { settings } from './settings';

const dark = window.matchMedia('(prefers-color-scheme: dark)');
const systemIsDark = signal(dark.matches);
dark.addEventListener('change', (event) => {
  systemIsDark.value = event.matches;
});

export const isDark = computed(() => {
  const { theme } = settings.value;
  return theme === 'system' ? systemIsDark.value : theme === 'dark';
});
