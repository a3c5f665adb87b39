import type { Server } from 'node:http';

export declare function fileFor(folder: string, url: string): string | undefined;
export declare function fileServer(folder: string): Server;
export declare function listen(
  server: Server,
  options?: { readonly port?: number; readonly host?: string },
): Promise<string>;
