// A browser is looked for where browsers are, got only where that is allowed, and started with what the machine needs.
import assert from 'node:assert/strict';
import { test } from 'node:test';

import { browserArguments, browserPlaces, findBrowser, obtainBrowser, playwrightFolder } from '../lib/browser.mjs';

/** A machine with these programs; `ran` collects what is run, `afterRun` may put programs there. */
function machine({ programs = [], env = {}, afterRun = () => undefined, ...rest } = {}) {
  const there = new Set(programs);
  const ran = [];
  return {
    platform: 'linux',
    env: { PATH: '/usr/local/bin:/usr/bin', ...env },
    home: '/home/ada',
    uid: 1000,
    runs: (path) => there.has(path),
    exists: (path) => path === '/usr/bin/apt-get',
    list: (folder) => (folder === '/home/ada/.cache/ms-playwright' ? ['chromium-900', 'chromium-1255', 'ffmpeg-1013'] : []),
    read: (file) => (file === '/etc/os-release' ? 'NAME="Debian"\nID=debian\n' : ''),
    run: (program, args) => {
      ran.push([program, ...args].join(' '));
      afterRun(there, program, args);
      return true;
    },
    ran,
    ...rest,
  };
}

/** What apt-get does, run by root or through sudo. */
const apt = (there, program, args) => {
  if ([program, ...args].includes('apt-get') && args.includes('install')) there.add('/usr/bin/chromium');
};

test('CHROME_PATH comes first, and one that is wrong is said', () => {
  const programs = ['/opt/mine', '/usr/bin/chromium'];
  assert.equal(findBrowser(machine({ programs, env: { CHROME_PATH: '/opt/mine' } })), '/opt/mine');
  assert.throws(() => findBrowser(machine({ programs, env: { CHROME_PATH: '/opt/none' } })), /CHROME_PATH is \/opt\/none/);
});

test('an installed browser is taken before Playwright’s', () => {
  const own = '/home/ada/.cache/ms-playwright/chromium-1255/chrome-linux64/chrome';
  assert.equal(findBrowser(machine({ programs: [own, '/usr/bin/chromium'] })), '/usr/bin/chromium');
  assert.equal(findBrowser(machine({ programs: [own] })), own);
  assert.equal(findBrowser(machine()), undefined);
});

test('the newest of Playwright’s browsers', () => {
  const at = (build) => `/home/ada/.cache/ms-playwright/chromium-${build}/chrome-linux64/chrome`;
  assert.equal(findBrowser(machine({ programs: [at(900), at(1255)] })), at(1255));
});

test('the usual places of each system', () => {
  const mac = browserPlaces('darwin', { PATH: '' }, '/Users/ada');
  assert.ok(mac.includes('/Applications/Google Chrome.app/Contents/MacOS/Google Chrome'));
  assert.ok(mac.includes('/Users/ada/Applications/Chromium.app/Contents/MacOS/Chromium'));
  const windows = browserPlaces('win32', { ProgramFiles: 'C:\\Program Files', Path: 'D:\\tools;E:\\bin' }, 'C:\\Users\\ada');
  assert.ok(windows.includes('C:\\Program Files\\Google\\Chrome\\Application\\chrome.exe'));
  assert.ok(windows.includes('E:\\bin\\chrome.exe'));
  assert.equal(playwrightFolder('linux', { PLAYWRIGHT_BROWSERS_PATH: '/srv/browsers' }, '/home/ada'), '/srv/browsers');
});

test('no package is installed unasked: Playwright’s download is tried instead', () => {
  const bare = machine({ afterRun: apt });
  assert.equal(obtainBrowser(bare), undefined);
  assert.equal(bare.ran.length, 1);
  assert.match(bare.ran[0], /playwright\/test\/cli\.js install .*chromium$/);
});

test('asked, Debian’s package is installed: by root as it is, by a user through sudo without a question', () => {
  const env = { STEPCAST_INSTALL_BROWSER: '1' };
  const root = machine({ env, uid: 0, afterRun: apt });
  assert.equal(obtainBrowser(root), '/usr/bin/chromium');
  assert.ok(root.ran.every((command) => command.startsWith('apt-get ')), root.ran.join('\n'));
  const user = machine({ env, afterRun: apt });
  assert.equal(obtainBrowser(user), '/usr/bin/chromium');
  assert.ok(user.ran.every((command) => command.startsWith('sudo -n apt-get ')), user.ran.join('\n'));
});

test('asked on another system than Debian, no package is touched', () => {
  const ubuntu = machine({ env: { STEPCAST_INSTALL_BROWSER: '1' }, read: () => 'ID=ubuntu\n' });
  obtainBrowser(ubuntu);
  assert.ok(ubuntu.ran.every((command) => !command.includes('apt-get')), ubuntu.ran.join('\n'));
});

test('nothing is run where there is a browser', () => {
  const ready = machine({ programs: ['/usr/bin/chromium'], env: { STEPCAST_INSTALL_BROWSER: '1' } });
  assert.equal(obtainBrowser(ready), '/usr/bin/chromium');
  assert.deepEqual(ready.ran, []);
});

test('the sandbox is given up by root alone, and software GL is asked for where there is no GPU', () => {
  assert.ok(browserArguments(machine({ uid: 0 })).includes('--no-sandbox'));
  assert.ok(!browserArguments(machine()).includes('--no-sandbox'));
  assert.ok(browserArguments(machine()).includes('--use-angle=swiftshader'));
  assert.ok(!browserArguments(machine({ exists: () => true })).includes('--use-angle=swiftshader'));
  assert.ok(!browserArguments(machine({ platform: 'win32', uid: undefined })).some((arg) => /sandbox|swiftshader/.test(arg)));
});
