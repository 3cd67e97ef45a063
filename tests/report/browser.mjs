// Starts the Chromium that the tests and the screenshots use.
//   CHROMIUM      the browser's file; else the first of the usual places
//   NODE_MODULES  the folder that holds playwright-core (and axe-core); else Node looks for it itself
import { existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';

const PLACES = ['/usr/bin/chromium', '/usr/bin/chromium-headless-shell', '/usr/bin/google-chrome'];
const FLAGS = [
  '--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-gpu-sandbox', '--no-first-run',
  '--disable-background-networking', '--disable-component-update', '--disable-sync', '--disable-quic',
];

export const lookUp = process.env.NODE_MODULES ? createRequire(path.join(path.resolve(process.env.NODE_MODULES), 'x.js')) : createRequire(import.meta.url);

/** Launches the browser; throws with one line if there is none. */
export async function launch() {
  const executablePath = process.env.CHROMIUM || PLACES.find((place) => existsSync(place));
  if (!executablePath) throw new Error(`no browser: set CHROMIUM, or install one of ${PLACES.join(', ')}`);
  let playwright;
  try {
    playwright = lookUp('playwright-core');
  } catch {
    throw new Error('playwright-core is not installed: run "npm ci" for libs/report/page and set NODE_MODULES to its node_modules');
  }
  return playwright.chromium.launch({ executablePath, args: FLAGS });
}
