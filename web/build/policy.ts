// Puts the Content-Security-Policy into the page as a <meta> element, for hosts that send no headers of ours.
// Headers say the same (scripts/lib/server.mjs): only they bind the workers, and only they may forbid framing.
import type { Plugin } from 'vite';
import { POLICY } from '../../scripts/lib/policy.mjs';

/** Directives that a <meta> element may not hold. */
const HEADER_ONLY = ['frame-ancestors'];

/** A plugin that writes the policy into index.html of the built page. */
export function contentSecurityPolicy(): Plugin {
  const content = Object.entries(POLICY)
    .filter(([name]) => !HEADER_ONLY.includes(name))
    .map(([name, sources]) => `${name} ${sources}`)
    .join('; ');
  return {
    name: 'stepcast-content-security-policy',
    apply: 'build',
    transformIndexHtml: () => [
      { tag: 'meta', attrs: { 'http-equiv': 'Content-Security-Policy', content }, injectTo: 'head-prepend' },
    ],
  };
}
