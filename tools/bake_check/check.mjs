// Bakes scenes and gives the files to others: Khronos' validator of glTF, and three.js in headless
// Chromium, whose picture is compared with that of `lumel render` from the same camera.
//
//     cd tools/bake_check && npm install && node check.mjs [--out DIR] [SCENE.gltf ...]
//
// Writes pictures into DIR (out/bake_check) and a table to standard output; fails when the validator
// finds an error or a picture is off by more than LIMIT.
import { execFileSync } from 'node:child_process';
import { createServer } from 'node:http';
import fs from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { PNG } from 'pngjs';
import validator from 'gltf-validator';

const here = path.dirname(fileURLToPath(import.meta.url));
const project = path.resolve(here, '../..');
const lumel = path.join(project, 'target/release/lumel');

// Samples along each side of a pixel, in both pictures.
const SAMPLES = 3;
// Longer side of the pictures, pixels.
const SIDE = 480;
// Largest mean difference of two pictures, in levels of 255: a level is the rounding of the
// 8 bits that are shown, another one the tolerance of 1 %.
const LIMIT = 2.0;

const VARIANTS = [
  { name: 'lightmap', options: ['--size', '1024'] },
  { name: 'coarse', options: ['--size', '256'] },
  { name: 'vertices', options: ['--to', 'vertices'] },
  { name: 'three-exr', options: ['--target', 'three', '--size', '1024', '--half'] },
  { name: 'three-hdr', options: ['--target', 'three', '--size', '1024', '--format', 'hdr'] },
  { name: 'three-png', options: ['--target', 'three', '--size', '1024', '--format', 'png'] },
  { name: 'files', extension: 'gltf', options: ['--size', '1024', '--layers'] },
  { name: 'bevy', options: ['--target', 'bevy', '--size', '256'], lit: true },
  { name: 'blender', options: ['--target', 'blender', '--size', '256'], lit: true },
];

const typed = process.argv.slice(2);
let out = path.join(project, 'out/bake_check');
if (typed[0] === '--out') out = path.resolve(typed.splice(0, 2)[1]);
const scenes = typed.length ? typed.map((s) => path.resolve(s))
  : ['cornell.gltf', 'room.gltf'].map((s) => path.join(project, 'scenes', s));
fs.mkdirSync(out, { recursive: true });

const TYPES = { '.js': 'text/javascript', '.html': 'text/html', '.json': 'application/json' };
const server = createServer((request, response) => {
  const name = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
  const file = name.startsWith('/three/') ? path.join(here, 'node_modules/three', name.slice(7))
    : name.startsWith('/out/') ? path.join(out, name.slice(5)) : path.join(here, 'page.html');
  fs.readFile(file, (error, bytes) => {
    response.writeHead(error ? 404 : 200, {
      'Content-Type': TYPES[path.extname(file)] ?? 'application/octet-stream',
    });
    response.end(bytes);
  });
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const site = `http://127.0.0.1:${server.address().port}/`;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync',
    '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});

async function validated(file) {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    externalResourceFunction: async (uri) =>
      new Uint8Array(fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri)))),
  });
  const { numErrors, numWarnings, messages } = report.issues;
  const codes = new Map();
  for (const m of messages) codes.set(m.code, (codes.get(m.code) ?? 0) + 1);
  const words = [...codes].map(([code, count]) => `${code} ${count}`).join(', ');
  return { errors: numErrors, warnings: numWarnings, words };
}

const decoded = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const encoded = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);

// Means of SAMPLES x SAMPLES pixels, as light.
function reduced(png) {
  const [w, h] = [png.width / SAMPLES, png.height / SAMPLES];
  const small = new PNG({ width: w, height: h });
  for (let y = 0; y < h; y++) for (let x = 0; x < w; x++) for (let c = 0; c < 3; c++) {
    let sum = 0;
    for (let j = 0; j < SAMPLES; j++) for (let i = 0; i < SAMPLES; i++) {
      sum += decoded(png.data[4 * ((y * SAMPLES + j) * png.width + x * SAMPLES + i) + c] / 255);
    }
    small.data[4 * (y * w + x) + c] = Math.round(255 * encoded(sum / SAMPLES ** 2));
    small.data[4 * (y * w + x) + 3] = 255;
  }
  return small;
}

async function drawn(url, width, height, stops) {
  const page = await browser.newPage();
  page.on('console', (m) => ['error', 'warning'].includes(m.type()) && !/GPU stall|404/.test(m.text())
    && console.error(`  page: ${m.text()}`));
  await page.goto(site);
  await page.waitForFunction('window.ready === true');
  const data = await page.evaluate((o) => window.draw(o),
    { url, width: width * SAMPLES, height: height * SAMPLES, stops, camera: 0 });
  await page.close();
  return reduced(PNG.sync.read(Buffer.from(data.split(',')[1], 'base64')));
}

// Mean and share of pixels that are off by more than 8 levels; a picture of the differences, times 8.
function difference(a, b) {
  const map = new PNG({ width: a.width, height: a.height });
  let [sum, many] = [0, 0];
  for (let i = 0; i < a.width * a.height; i++) {
    let worst = 0;
    for (let c = 0; c < 3; c++) {
      const off = Math.abs(a.data[4 * i + c] - b.data[4 * i + c]);
      sum += off / 3;
      worst = Math.max(worst, off);
      map.data[4 * i + c] = Math.min(255, 8 * off);
    }
    map.data[4 * i + 3] = 255;
    many += worst > 8 ? 1 : 0;
  }
  const count = a.width * a.height;
  return { mean: sum / count, many: many / count, map };
}

let failed = false;
console.log('| scene | bake | errors | warnings | mean difference, levels of 255 | off by more than 8 levels |');
console.log('|---|---|---|---|---|---|');
for (const scene of scenes) {
  const stem = path.basename(scene).replace(/\.[^.]*$/, '');
  for (const variant of VARIANTS) {
    const name = `${stem}-${variant.name}`;
    const file = path.join(out, `${name}.${variant.extension ?? 'glb'}`);
    execFileSync(lumel, ['bake', scene, '-o', file, '--quiet', ...variant.options],
      { stdio: ['ignore', 'inherit', 'inherit'] });
    const issues = await validated(file);
    let row = `| ${path.basename(scene)} | \`${variant.options.join(' ')}\` | ${issues.errors} | ${issues.warnings}`;
    failed ||= issues.errors > 0;
    const sidecar = JSON.parse(fs.readFileSync(path.join(out, `${name}-bake.json`)));
    const json = variant.extension === 'gltf' ? JSON.parse(fs.readFileSync(file))
      : JSON.parse(fs.readFileSync(file).subarray(20, 20 + fs.readFileSync(file).readUInt32LE(12)));
    if (variant.lit || !json.cameras) {
      console.log(`${row} | | |`);
      continue;
    }
    const stops = sidecar.shown?.exposure_ev ?? 0;
    const aspect = json.cameras[0].perspective?.aspectRatio ?? 16 / 9;
    const width = Math.round(aspect >= 1 ? SIDE : SIDE * aspect);
    const height = Math.round(aspect >= 1 ? SIDE / aspect : SIDE);
    const expected = path.join(out, `${name}-expected.png`);
    execFileSync(lumel, ['render', scene, '-o', expected, '--quiet', '--size', `${width}x${height}`,
      '--samples', `${SAMPLES}`, '--exposure', `${stops}`], { stdio: ['ignore', 'inherit', 'inherit'] });
    const want = PNG.sync.read(fs.readFileSync(expected));
    const got = await drawn(`/out/${path.basename(file)}`, width, height, sidecar.shown ? null : stops);
    fs.writeFileSync(path.join(out, `${name}-three.png`), PNG.sync.write(got));
    const { mean, many, map } = difference(want, got);
    fs.writeFileSync(path.join(out, `${name}-difference.png`), PNG.sync.write(map));
    failed ||= !(mean <= LIMIT);
    row += ` | ${mean.toFixed(2)} | ${(100 * many).toFixed(2)} % |`;
    console.log(row);
    if (issues.words) console.error(`  ${name}: ${issues.words}`);
  }
}
await browser.close();
server.close();
process.exit(failed ? 1 : 0);
