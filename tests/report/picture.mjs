// Pictures of a report page: what the browser shows of it, and what the page draws in its canvas.
import assert from 'node:assert/strict';

/** Three frames: what was asked for is drawn and shown by then, unless the machine is busy. */
export const settle = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));

// ---- What the browser shows. A screenshot costs many times what a drawing costs, so there are few. ----

const shot = async (page) => {
  await settle(page);
  return page.locator('.panels').screenshot();
};

/** The panels as shown, once two screenshots in a row are the same: on a busy machine what was drawn is shown a little later. */
export async function screenshot(page) {
  let last = await shot(page);
  for (let tries = 0; tries < 8; ++tries) {
    const next = await shot(page);
    if (next.equals(last)) return next;
    last = next;
  }
  throw new Error('the picture does not come to rest');
}

/** Screenshots decoded in the page `lab`: distinct colours of the first, and the share of pixels in which a second one differs. */
export async function compare(lab, first, second = null) {
  return lab.evaluate(async (pictures) => {
    const decode = async (base64) => {
      const image = new Image();
      image.src = `data:image/png;base64,${base64}`;
      await image.decode();
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext('2d');
      context.drawImage(image, 0, 0);
      return new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
    };
    const [a, b] = await Promise.all(pictures.map(decode));
    const differing = !b ? 0 : a.length === b.length ? a.filter((pixel, i) => pixel !== b[i]).length / a.length : 1;
    return { colors: new Set(a).size, differing };
  }, [first, second].filter(Boolean).map((buffer) => buffer.toString('base64')));
}

/** Whether what is shown becomes the same as an earlier screenshot, or differs from it in more than a share of its pixels. */
export async function showsAgain(lab, page, other, same, share = 0) {
  for (let tries = 0; tries < 4; ++tries) {
    const { differing } = await compare(lab, other, await screenshot(page));
    if (same ? differing === 0 : differing > share) return true;
  }
  return false;
}

// ---- What the page draws. It must draw by itself: only the pixels of its own drawings are looked at. ----

/** From now on the pixels of each drawing are read at its end, before the browser takes them away. */
export const watchDrawing = (page) => page.evaluate(() => {
  const { view } = window.hamelin;
  const gl = view.renderer.getContext();
  const { draw } = view;
  const kept = [];
  let last = null;
  view.draw = () => {
    draw.call(view);
    last = new Uint32Array(gl.drawingBufferWidth * gl.drawingBufferHeight);
    gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(last.buffer));
  };
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  // The second frame is for what the layout of the first one asks for.
  const rest = async () => {
    do {
      await frame();
      await frame();
    } while (view.wanted || !last);
  };
  const same = (a, b) => a.length === b.length && a.every((pixel, i) => pixel === b[i]);
  window.drawing = {
    keep: async () => {
      await rest();
      return kept.push(last) - 1;
    },
    becomes: async (index, wanted) => {
      for (let tries = 0; tries < 40; ++tries) {
        await rest();
        if (same(kept[index], last) === wanted) return true;
      }
      return false;
    },
  };
  view.request();
});

/** Keeps the present drawing, once the page draws no more, and returns its number. */
export const keepDrawing = (page) => page.evaluate(() => window.drawing.keep());

/** Whether the drawing becomes the same as a kept one, or differs from it. */
export const drawsAgain = (page, index, same) => page.evaluate(([i, wanted]) => window.drawing.becomes(i, wanted), [index, same]);

/** Fails unless the drawing changes by the action, and comes back by the undoing. */
export async function changes(page, what, act, undo) {
  const start = await keepDrawing(page);
  await act();
  assert.ok(await drawsAgain(page, start, false), `${what}: the picture does not change`);
  if (!undo) return;
  await undo();
  assert.ok(await drawsAgain(page, start, true), `${what}: the picture does not come back`);
}
