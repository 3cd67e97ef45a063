// Takes a screenshot of a report page.
//   node shot.mjs PAGE.html OUT.png [--time T] [--size WxH] [--scale N] [--dark] [--full]
//     [--run "JavaScript in the page"]
import path from 'node:path';
import { pathToFileURL } from 'node:url';
import { parseArgs } from 'node:util';
import { launch } from './browser.mjs';

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { time: { type: 'string' }, size: { type: 'string', default: '1440x900' }, scale: { type: 'string', default: '1' }, dark: { type: 'boolean' }, full: { type: 'boolean' }, run: { type: 'string' } },
});
const [file, out] = positionals;
if (!out) {
  process.stderr.write('shot.mjs: expected PAGE.html OUT.png [--time T] [--size WxH] [--scale N] [--dark] [--full] [--run SCRIPT]\n');
  process.exit(1);
}
const [width, height] = values.size.split('x').map(Number);
const browser = await launch();
try {
  const page = await browser.newPage({ viewport: { width, height }, deviceScaleFactor: Number(values.scale), colorScheme: values.dark ? 'dark' : 'light' });
  page.on('pageerror', (error) => process.stderr.write(`page error: ${error.message}\n`));
  page.on('console', (message) => message.type() === 'error' && process.stderr.write(`console: ${message.text()}\n`));
  await page.goto(pathToFileURL(path.resolve(file)).href);
  await page.evaluate(() => window.hamelin.ready);
  if (values.time !== undefined) await page.evaluate((t) => window.hamelin.setTime(t), Number(values.time));
  if (values.run) await page.evaluate(values.run);
  // Plots and picture are updated within two frames.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));
  // Software rendering on a busy machine takes long.
  await page.screenshot({ path: out, fullPage: values.full ?? false, timeout: 180000 });
} finally {
  await browser.close();
}
