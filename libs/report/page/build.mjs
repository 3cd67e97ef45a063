// Makes the templates of the pages, each one HTML file that contains its script and style.
//   node build.mjs --modules DIR/node_modules --out FOLDER
// Imports are resolved in --modules, so this folder needs no node_modules of its own.
import { readFile, writeFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';

/** Each entry becomes FOLDER/NAME.html. */
const PAGES = [
  { name: 'page', title: 'hamelin report', script: 'src/main.js', style: 'src/style.css' },
  { name: 'sweep', title: 'hamelin sweep', script: 'src/sweep.js', style: 'src/document.css' },
  { name: 'accuracy', title: 'hamelin accuracy', script: 'src/accuracy.js', style: 'src/document.css' },
];

/** The placeholder of the data; it must occur exactly once in a template. */
const TOKEN = '__HAMELIN_REPORT_DATA__';

function fail(message) {
  process.stderr.write(`build.mjs: ${message}\n`);
  process.exit(1);
}

const here = path.dirname(fileURLToPath(import.meta.url));
let args;
try {
  args = parseArgs({ options: { modules: { type: 'string' }, out: { type: 'string' } } }).values;
} catch (error) {
  fail(error.message);
}
if (!args.modules || !args.out) fail('expected --modules DIR/node_modules --out FOLDER');
const modules = path.resolve(args.modules);

let esbuild;
try {
  esbuild = createRequire(path.join(modules, 'x.js'))('esbuild');
} catch (error) {
  fail(`${modules}: esbuild cannot be loaded, expected the result of "npm ci": ${error.message.split('\n')[0]}`);
}

// The library three contains the shaders of all its materials as strings, which esbuild cannot
// minify. This removes blanks, comments, and the parts for materials and features that the pages do
// not use (physical and toon light, shadows, maps, morphs, skins, probes).
const UNUSED = new RegExp(
  `^((?:var|const) (?:${[
    'lights_physical_\\w+', 'lights_toon_\\w+', 'transmission_\\w+', 'iridescence_\\w+', 'clearcoat_\\w+', 'envmap_\\w+', 'cube_uv_\\w+',
    'shadowmap_\\w+', 'shadowmask_\\w+', 'lightprobes_\\w+', 'batching_\\w+', 'morph\\w+', 'skin\\w+', 'bumpmap_\\w+', 'normalmap_\\w+', 'alphahash_\\w+',
    'displacementmap_\\w+', 'gradientmap_\\w+', 'roughnessmap_\\w+', 'metalnessmap_\\w+', 'packing', 'tonemapping_\\w+',
  ].join('|')}) = )"(?:[^"\\\\\\n]|\\\\.)*";`,
  'gm',
);
const shortShaders = {
  name: 'short-shaders',
  setup(build) {
    build.onLoad({ filter: /three[\\/]build[\\/]three\.module\.js$/ }, async ({ path: file }) => ({
      contents: (await readFile(file, 'utf8')).replace(UNUSED, '$1"";').replace(/"(?:[^"\\\n]|\\.)*\\n(?:[^"\\\n]|\\.)*"/g, shorten),
      loader: 'js',
    }));
  },
};

/**
 * Removes blanks and comments from a string literal with GLSL. Preprocessor lines keep their
 * blanks.
 */
function shorten(literal) {
  const code = literal.slice(1, -1).replace(/\/\*.*?\*\//g, '');
  const lines = code.split('\\n').map((line) => {
    const bare = line.replaceAll('\\t', ' ').replace(/\/\/.*$/, '').trim();
    return bare.startsWith('#') ? bare : bare.replace(/ *([{}()[\],;=*<>?:&|]) */g, '$1');
  });
  return `"${lines.filter((line) => line).join('\\n')}"`;
}

/** Bundles one entry point and returns its text. */
async function bundle(entry) {
  const result = await esbuild.build({
    entryPoints: [path.join(here, entry)],
    absWorkingDir: here,
    nodePaths: [modules],
    plugins: [shortShaders],
    bundle: true,
    minify: true,
    write: false,
    format: 'iife',
    target: ['es2022', 'chrome109', 'firefox115', 'safari16.4'],
    legalComments: 'none',
    charset: 'utf8',
    logLevel: 'error',
  });
  return result.outputFiles[0].text.trim();
}

// Inside of <script>, these three sequences would end or nest the element. In the bundle they occur
// only in strings.
const forScript = (code) => code.replace(/<(?=\/script|script|!--)/gi, '\\x3C');

const skeleton = await readFile(path.join(here, 'index.html'), 'utf8');

async function makePage({ name, title, script, style }) {
  const [code, looks] = await Promise.all([bundle(script), bundle(style)]);
  if (/<\/style/i.test(looks)) throw new Error(`${style}: contains "</style", which would end the element`);
  const page = skeleton.replace('/* TITLE */', () => title).replace('/* STYLE */', () => looks).replace('/* SCRIPT */', () => forScript(code));
  const places = page.split(TOKEN).length - 1;
  if (places !== 1) throw new Error(`${name}.html: the token ${TOKEN} occurs ${places} times, expected once`);
  await writeFile(path.join(args.out, `${name}.html`), page);
}

await Promise.all(PAGES.map(makePage)).catch((error) => fail(error.message));
