export interface Machine {
  readonly platform: NodeJS.Platform;
  readonly env: Readonly<Record<string, string | undefined>>;
  readonly home: string;
  readonly uid: number | undefined;
  runs(path: string): boolean;
  exists(path: string): boolean;
  list(folder: string): string[];
  read(file: string): string;
  run(program: string, args: readonly string[]): boolean;
}
export declare const thisMachine: Machine;
export declare const BROWSER_ADVICE: string;
export declare function browserPlaces(
  platform: NodeJS.Platform,
  env: Machine['env'],
  home: string,
): readonly string[];
export declare function playwrightFolder(platform: NodeJS.Platform, env: Machine['env'], home: string): string;
export declare function findBrowser(machine?: Machine): string | undefined;
export declare function obtainBrowser(machine?: Machine): string | undefined;
export declare function browserArguments(machine?: Machine): string[];
