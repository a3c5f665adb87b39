// The page's start: the shell first, then the workers, which load the planner.
import { render } from 'preact';
import './styles/base.css';
import './styles/controls.css';
import './styles/layout.css';
import './styles/job.css';
import './styles/panels.css';
import './styles/instruments.css';
import { App } from './panel/app';
import { guardPrint } from './panel/guard';
import { followProfile } from './panel/machine_summary';
import { followTemperatures } from './state/history';
import { startMachine } from './state/machine';
import { startPreview } from './state/preview';
import { followPrint } from './state/print';
import { loadProfiles } from './state/profiles';
import { applySettings } from './state/settings';
import { startWatching } from './state/watched';

applySettings();
const root = document.getElementById('app');
if (root) render(<App />, root);
startMachine();
startPreview();
startWatching();
followTemperatures();
guardPrint();
followPrint();
void loadProfiles().then(followProfile);
