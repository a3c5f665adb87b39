// What has to be on a machine before anything can be built, and how to get it. Knows nothing of the build itself.
//
// Only the Rust toolchain that rust-toolchain.toml names is installed; everything else is named, with the command
// that installs it.
import { spawnSync } from 'node:child_process';
import { existsSync, readFileSync } from 'node:fs';

/** What the page's build (Vite) runs on: the first version of each line; every later line will do. */
export const NODE_MIN = [[20, 19], [22, 12]];

/** True when a program is there and answers. */
export function has(program, args = ['--version']) {
  return spawnSync(program, args, { stdio: 'ignore', shell: process.platform === 'win32' }).status === 0;
}

/** `version` as "20.19.1"; true from `minimum` (major, minor) on. */
export function atLeast(version, minimum) {
  const [major, minor] = version.replace(/^v/, '').split('.').map(Number);
  return major > minimum[0] || (major === minimum[0] && minor >= minimum[1]);
}

/** Whether the page can be built with this Node: 20.19 or a later 20, or 22.12 and everything after it. */
export function isNodeGood(version) {
  const [old, current] = NODE_MIN;
  return atLeast(version, current) || (atLeast(version, old) && !atLeast(version, [old[0] + 1, 0]));
}

/** The [toolchain] table of rust-toolchain.toml: strings and lists of strings, which is all that it may hold. */
export function readToolchain(text) {
  const string = (key) => new RegExp(`^${key}\\s*=\\s*"([^"]+)"`, 'm').exec(text)?.[1];
  const list = (key) => {
    const inside = new RegExp(`^${key}\\s*=\\s*\\[([^\\]]*)\\]`, 'm').exec(text)?.[1] ?? '';
    return [...inside.matchAll(/"([^"]+)"/g)].map((match) => match[1]);
  };
  const channel = string('channel');
  if (!channel) throw new Error('rust-toolchain.toml has no channel');
  return { channel, profile: string('profile') ?? 'minimal', components: list('components'), targets: list('targets') };
}

/** The arguments for rustup that install it; a no-op of a second when it is there. */
export function installArguments({ channel, profile, components, targets }) {
  const each = (option, values) => values.flatMap((value) => [option, value]);
  return [
    'toolchain', 'install', channel, '--no-self-update', '--profile', profile,
    ...each('--component', components), ...each('--target', targets),
  ];
}

/** True when every part of the toolchain is on this machine, so that nothing has to be fetched. */
export function isInstalled({ channel, components, targets }) {
  const installed = (what) => {
    const { status, stdout } = spawnSync('rustup', [what, 'list', '--toolchain', channel, '--installed'], { encoding: 'utf8' });
    return status === 0 ? stdout.split('\n') : [];
  };
  const includes = (list, part) => list.some((line) => line === part || line.startsWith(`${part}-`));
  const [parts, systems] = [installed('component'), installed('target')];
  return components.every((part) => includes(parts, part)) && targets.every((target) => systems.includes(target));
}

function linuxInstall(packages) {
  const managers = [
    ['/usr/bin/apt-get', `sudo apt-get install ${packages.apt}`],
    ['/usr/bin/dnf', `sudo dnf install ${packages.dnf}`],
    ['/usr/bin/pacman', `sudo pacman -S ${packages.pacman}`],
    ['/usr/bin/zypper', `sudo zypper install ${packages.zypper}`],
    ['/sbin/apk', `sudo apk add ${packages.apk}`],
  ];
  const found = managers.find(([path]) => existsSync(path));
  return found ? found[1] : `install ${packages.apt} with your distribution's package manager`;
}

const RUSTUP_UNIX = "curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh";

/** How to install what is missing, by operating system. */
export function advice(what, platform = process.platform) {
  const table = {
    node: {
      win32: 'winget install OpenJS.NodeJS.LTS',
      darwin: 'brew install node',
      linux: 'https://nodejs.org/en/download (distributions often have older ones)',
    },
    rustup: { win32: 'winget install Rustlang.Rustup', darwin: RUSTUP_UNIX, linux: RUSTUP_UNIX },
    linker: {
      win32: 'winget install Microsoft.VisualStudio.2022.BuildTools --override "--add Microsoft.VisualStudio.Workload.VCTools --passive"',
      darwin: 'xcode-select --install',
      linux: linuxInstall({ apt: 'gcc libc6-dev', dnf: 'gcc', pacman: 'gcc', zypper: 'gcc', apk: 'gcc musl-dev' }),
    },
    valgrind: {
      win32: 'it does not run on Windows',
      darwin: 'it does not run on current macOS',
      linux: linuxInstall({ apt: 'valgrind', dnf: 'valgrind', pacman: 'valgrind', zypper: 'valgrind', apk: 'valgrind' }),
    },
    'cargo-deny': { linux: 'cargo install --locked cargo-deny' },
  };
  return table[what][platform] ?? table[what].linux;
}

/** True when programs can be linked. On Windows rustc finds Visual Studio's linker itself; ask for its install record. */
function hasLinker() {
  if (process.platform !== 'win32') return has('cc');
  const programs = process.env['ProgramFiles(x86)'] ?? 'C:\\Program Files (x86)';
  return has('link', ['/?']) || existsSync(`${programs}\\Microsoft Visual Studio\\Installer\\vswhere.exe`);
}

/** One line for each thing that is missing, with the command that installs it. */
export function missing() {
  const lines = [];
  if (!isNodeGood(process.versions.node)) {
    const [old, current] = NODE_MIN.map((version) => version.join('.'));
    lines.push(`Node ${old} or a later 20, or ${current} or newer (this is ${process.versions.node}): ${advice('node')}`);
  }
  if (!has('rustup')) lines.push(`rustup, which brings Rust: ${advice('rustup')}`);
  if (!hasLinker()) lines.push(`a C compiler (cc), which Rust links with: ${advice('linker')}`);
  return lines;
}
