// Starts the Chromium that the tests and the screenshots use.
//   CHROMIUM      file of the browser; by default the first one found in PLACES
//   NODE_MODULES  folder of playwright-core (and axe-core); by default Node's own search
import { existsSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';

const PLACES = ['/usr/bin/chromium', '/usr/bin/chromium-headless-shell', '/usr/bin/google-chrome'];
const FLAGS = [
  '--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-gpu-sandbox', '--no-first-run',
  '--disable-background-networking', '--disable-component-update', '--disable-sync', '--disable-quic',
];

export const requireModule = process.env.NODE_MODULES ? createRequire(path.join(path.resolve(process.env.NODE_MODULES), 'x.js')) : createRequire(import.meta.url);

/** Launches the browser; throws an error of one line if there is none. */
export async function launch() {
  const executablePath = process.env.CHROMIUM || PLACES.find((place) => existsSync(place));
  if (!executablePath) throw new Error(`no browser: set CHROMIUM, or install one of ${PLACES.join(', ')}`);
  let playwright;
  try {
    playwright = requireModule('playwright-core');
  } catch {
    throw new Error('playwright-core is not installed: run "npm ci" for libs/report/page and set NODE_MODULES to its node_modules');
  }
  return playwright.chromium.launch({ executablePath, args: FLAGS });
}

/**
 * Violations that axe-core finds in a page with all its details open, one line each; null if
 * axe-core is missing.
 */
export async function violations(page) {
  let axe;
  try {
    axe = readFileSync(requireModule.resolve('axe-core/axe.min.js'), 'utf8');
  } catch {
    return null;
  }
  await page.evaluate(() => document.querySelectorAll('details').forEach((details) => { details.open = true; }));
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
  return found.violations.map(({ id, nodes }) => `${id}: ${nodes.length}× ${nodes[0].html.slice(0, 140)} ${nodes[0].failureSummary.slice(0, 200)}`);
}
