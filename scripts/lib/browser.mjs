// The browser for the tests: finds a Chromium on this machine, gets one where that is allowed, and says how to start it.
// Knows nothing of the tests. Plain Node, built-ins only.
//
// In this order: CHROME_PATH, an installed Chrome or Chromium, a Chromium that Playwright installed before. Where there is
// none: Debian's package, only where the environment asks for it (STEPCAST_INSTALL_BROWSER=1), for nobody's computer gets
// a package unasked; else Playwright downloads its own into its folder, if the network lets it.
import { spawnSync } from 'node:child_process';
import { accessSync, constants, existsSync, readdirSync, readFileSync, statSync } from 'node:fs';
import { homedir } from 'node:os';
import { posix, win32 } from 'node:path';

import { root } from './target.mjs';

/** A download or an installation that takes longer has failed, in ms. */
const INSTALL_TIMEOUT_MS = 10 * 60_000;

const PROGRAMS = {
  linux: ['google-chrome', 'google-chrome-stable', 'chromium', 'chromium-browser', 'chrome', 'microsoft-edge'],
  darwin: ['google-chrome', 'chromium'],
  win32: ['chrome.exe', 'chromium.exe', 'msedge.exe'],
};
const MAC_PLACES = [
  'Google Chrome.app/Contents/MacOS/Google Chrome',
  'Chromium.app/Contents/MacOS/Chromium',
  'Microsoft Edge.app/Contents/MacOS/Microsoft Edge',
];
const WINDOWS_PLACES = ['Google\\Chrome\\Application\\chrome.exe', 'Chromium\\Application\\chrome.exe', 'Microsoft\\Edge\\Application\\msedge.exe'];
const LINUX_PLACES = ['/opt/google/chrome/chrome', '/snap/bin/chromium', '/usr/lib/chromium/chromium'];

/** Every place where a browser may be, best first. `env` and `home` are of the machine's user. */
export function browserPlaces(platform, env, home) {
  const join = platform === 'win32' ? win32.join : posix.join;
  const folders = (env.PATH ?? env.Path ?? '').split(platform === 'win32' ? ';' : ':').filter(Boolean);
  const onPath = (PROGRAMS[platform] ?? PROGRAMS.linux).flatMap((name) => folders.map((folder) => join(folder, name)));
  if (platform === 'darwin') {
    return [...['/Applications', join(home, 'Applications')].flatMap((at) => MAC_PLACES.map((app) => join(at, app))), ...onPath];
  }
  if (platform === 'win32') {
    const roots = [env.ProgramFiles, env['ProgramFiles(x86)'], env.LOCALAPPDATA].filter(Boolean);
    return [...WINDOWS_PLACES.flatMap((place) => roots.map((at) => join(at, place))), ...onPath];
  }
  return [...onPath, ...LINUX_PLACES];
}

/** Where Playwright keeps its browsers. */
export function playwrightFolder(platform, env, home) {
  if (env.PLAYWRIGHT_BROWSERS_PATH && env.PLAYWRIGHT_BROWSERS_PATH !== '0') return env.PLAYWRIGHT_BROWSERS_PATH;
  if (platform === 'darwin') return posix.join(home, 'Library', 'Caches', 'ms-playwright');
  if (platform === 'win32') return win32.join(env.LOCALAPPDATA ?? win32.join(home, 'AppData', 'Local'), 'ms-playwright');
  return posix.join(env.XDG_CACHE_HOME ?? posix.join(home, '.cache'), 'ms-playwright');
}

/** Where the program lies in a folder `chromium-1234` of Playwright's, by system and build. */
const PLAYWRIGHT_PROGRAMS = [
  'chrome-linux64/chrome', 'chrome-linux/chrome',
  'chrome-mac-arm64/Google Chrome for Testing.app/Contents/MacOS/Google Chrome for Testing',
  'chrome-mac-x64/Google Chrome for Testing.app/Contents/MacOS/Google Chrome for Testing',
  'chrome-mac/Chromium.app/Contents/MacOS/Chromium',
  'chrome-win64/chrome.exe', 'chrome-win/chrome.exe',
];

/** True for a program that may be run. */
function runs(path) {
  try {
    accessSync(path, constants.X_OK);
    return statSync(path).isFile();
  } catch {
    return false;
  }
}

/** What is asked of the machine; tests answer for one that is not there. */
export const thisMachine = {
  platform: process.platform,
  env: process.env,
  home: homedir(),
  uid: process.getuid?.(),
  runs,
  exists: existsSync,
  list: (folder) => (existsSync(folder) ? readdirSync(folder) : []),
  read: (file) => (existsSync(file) ? readFileSync(file, 'utf8') : ''),
  /** True when the command succeeds; its output goes to the error stream, which is where progress belongs. */
  run: (program, args) =>
    spawnSync(program, args, { cwd: root, stdio: ['ignore', 2, 2], timeout: INSTALL_TIMEOUT_MS }).status === 0,
};

/** Playwright's newest Chromium on this machine. */
function playwrightBrowser(machine) {
  const folder = playwrightFolder(machine.platform, machine.env, machine.home);
  const builds = machine
    .list(folder)
    .filter((name) => /^chromium-\d+$/.test(name))
    .sort((a, b) => Number(b.slice(9)) - Number(a.slice(9)));
  return builds.flatMap((name) => PLAYWRIGHT_PROGRAMS.map((program) => `${folder}/${name}/${program}`)).find(machine.runs);
}

/** A browser that is on this machine already: its path, or undefined. Throws where CHROME_PATH names none. */
export function findBrowser(machine = thisMachine) {
  const wished = machine.env.CHROME_PATH;
  if (wished) {
    if (machine.runs(wished)) return wished;
    throw new Error(`CHROME_PATH is ${wished}, which is no program that can be run.`);
  }
  return browserPlaces(machine.platform, machine.env, machine.home).find(machine.runs) ?? playwrightBrowser(machine);
}

/** Debian's package by apt-get. */
function installDebian(machine) {
  const isDebian = /^ID=debian$/m.test(machine.read('/etc/os-release'));
  if (!isDebian || !machine.exists('/usr/bin/apt-get')) return;
  const apt = (...args) => {
    const command = ['apt-get', '-qq', ...args];
    return machine.uid === 0 ? machine.run(command[0], command.slice(1)) : machine.run('sudo', ['-n', ...command]);
  };
  const install = () => apt('install', '--yes', '--no-install-recommends', 'chromium');
  // The lists of a fresh machine are empty or old.
  if (apt('update')) install();
}

/** A browser, installed where there is none and the way is open: its path, or undefined. */
export function obtainBrowser(machine = thisMachine) {
  const found = findBrowser(machine);
  if (found) return found;
  if (machine.env.STEPCAST_INSTALL_BROWSER === '1') {
    console.error('No browser on this machine; installing Chromium with apt-get.');
    installDebian(machine);
    const installed = findBrowser(machine);
    if (installed) return installed;
  }
  console.error('No browser on this machine; asking Playwright for its own.');
  machine.run(process.execPath, ['node_modules/@playwright/test/cli.js', 'install', '--no-shell', 'chromium']);
  return findBrowser(machine);
}

export const BROWSER_ADVICE =
  'a Chrome or Chromium for the browser tests: install one, set CHROME_PATH to one, or run `npx playwright install chromium`';

/** Chromium's arguments on this machine. */
export function browserArguments(machine = thisMachine) {
  const args = ['--disable-quic', '--no-first-run', '--disable-background-networking'];
  // A user's sandbox stays on; root has none, and Chromium refuses to start without being told.
  if (machine.uid === 0) args.push('--no-sandbox');
  const hasGpu = machine.platform !== 'linux' || machine.exists('/dev/dri/renderD128');
  if (!hasGpu) args.push('--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader');
  return args;
}
