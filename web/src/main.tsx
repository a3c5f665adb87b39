// The page's start: the shell first, then the workers, which load the planner, then the rest of the page; in pieces, so
// that no task keeps the page from answering.
import { render } from 'preact';
import './styles/base.css';
import './styles/controls.css';
import './styles/layout.css';
import './styles/job.css';
import './styles/panels.css';
import './styles/viewer.css';
import './styles/range_bars.css';
import './styles/legend.css';
import './styles/segment.css';
import './styles/gcode_text.css';
import './styles/instruments.css';
import { App, PARTS, shownUpTo } from './panel/app';
import { openDialog } from './panel/dialogs';
import { guardPrint } from './panel/guard';
import { followHeld } from './panel/held_dialog';
import { followProfile } from './panel/machine_summary';
import { followTemperatures } from './state/history';
import { followInterrupted, useMachineOf } from './state/interrupted';
import { startMachine } from './state/machine';
import { advisePinning, followForNotifications } from './state/notify';
import { startOffline } from './state/offline';
import { startPreview } from './state/preview';
import { followPrint } from './state/print';
import { loadProfiles } from './state/profiles';
import { followPort } from './state/reconnect';
import { applySettings } from './state/settings';
import { followStart } from './state/start';
import { followStartRequest } from './state/start_request';
import { startWatching } from './state/watched';
import { inTasks } from './tasks';

applySettings();
const root = document.getElementById('app');
inTasks(
  () => {
    if (root) render(<App />, root);
  },
  () => {
    startMachine();
    startPreview();
    startWatching();
    followTemperatures();
    guardPrint();
    followPort();
    followPrint();
    followStart();
    followStartRequest();
    followForNotifications();
    advisePinning();
    followHeld();
    followInterrupted((print) => void useMachineOf(print).then(() => (openDialog.value = 'connect')));
    startOffline();
    void loadProfiles().then(followProfile);
  },
  ...PARTS.map((part) => () => {
    shownUpTo.value = part;
  }),
);
