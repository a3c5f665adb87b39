// Puts the double in the place of navigator.serial, in a window or a dedicated worker, before any of the page's code.
// The machine worker also gets the clock that the bridge may share with it.
import { WorkerClock } from './clock.ts';
import { SerialPortDouble } from './port.ts';
import { SerialDouble } from './serial.ts';

/** The worker that owns the port, by the name that the page gives it. */
const MACHINE_WORKER = 'machine';

const isWorker = typeof document === 'undefined';

function install(): void {
  const hasClock = isWorker && self.name === MACHINE_WORKER;
  const clock = hasClock ? new WorkerClock() : undefined;
  clock?.install();
  // A worker finds ports but cannot ask for them.
  if (isWorker) Reflect.deleteProperty(SerialDouble.prototype, 'requestPort');
  Object.defineProperty(SerialDouble, 'name', { value: 'Serial' });
  Object.defineProperty(SerialPortDouble, 'name', { value: 'SerialPort' });
  Object.assign(self, { Serial: SerialDouble, SerialPort: SerialPortDouble });
  Object.defineProperty(navigator, 'serial', { configurable: true, value: new SerialDouble(clock) });
}

install();
