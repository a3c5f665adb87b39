// What the profile in use describes, as the planner reads it: limits for fields, the bed for the 3D view.
import { effect } from '@preact/signals';
import { machineSummary } from '../state/mesh';
import { checkConfig } from '../state/preview';
import { activeProfile } from '../state/profiles';

export { machineSummary };

/** Reads the profile again whenever it changes. */
export function followProfile(): void {
  effect(() => {
    const { config } = activeProfile.value;
    void checkConfig(config).then((report) => {
      if (activeProfile.peek().config === config) machineSummary.value = report.machine;
    });
  });
}
