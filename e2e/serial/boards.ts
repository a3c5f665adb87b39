// What a maker may find at the end of the cable instead of a board with the right firmware. Text as these really send it.
import { ScriptedDevice } from './device.ts';

/** A board that is off, or another device: nothing. */
export const silentBoard = (): ScriptedDevice => new ScriptedDevice();

/** Marlin: a greeting after the reset that opening the port causes, then a complaint about every line. */
export function marlinBoard(): ScriptedDevice {
  return new ScriptedDevice(
    (board) => {
      board.say('start\r\n', 0.8);
      board.say('echo: Last Updated: 2023-05-01 | Author: (none, default config)\r\n', 0.81);
      board.say('echo:Marlin 2.1.2.1\r\necho: Free Memory: 3921  PlannerBufferBytes: 1520\r\n', 0.82);
    },
    (board) => board.say('echo:Unknown command: "~"\r\nok\r\n', 0.005),
  );
}

/** An XMODEM bootloader that asks for its file. */
export function bootloaderBoard(): ScriptedDevice {
  return new ScriptedDevice((board) => {
    for (let second = 0; second < 60; second += 1) board.say('C', second);
  });
}

/** A bootloader for USB that greets. */
export const greetingBootloader = (): ScriptedDevice =>
  new ScriptedDevice((board) => board.say('\r\nKatapult bootloader v0.0.1\r\nready\r\n', 0.1));

/** Some other device: it sends sentences of its own once a second. */
export function gpsReceiver(): ScriptedDevice {
  return new ScriptedDevice((board) => {
    for (let second = 0; second < 60; second += 1)
      board.say('$GPGGA,101502.00,5200.12,N,01312.34,E,1,08,1.1,34.0,M,46.0,M,,*6A\r\n', second);
  });
}
