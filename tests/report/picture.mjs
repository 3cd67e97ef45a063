// Pictures of a report page: screenshots of the browser, and the pixels that the page draws on its
// canvas.
import assert from 'node:assert/strict';

/** Waits for three frames, after which requested changes are usually drawn and shown. */
export const settle = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));

// ---- Screenshots. They cost many times as much as drawings, so there are few. ----

const shot = async (page) => {
  await settle(page);
  return page.locator('.panels').screenshot();
};

/**
 * A screenshot of the panels, taken until two in a row are equal: a busy machine shows a drawing a
 * little later.
 */
export async function screenshot(page) {
  let last = await shot(page);
  for (let tries = 0; tries < 8; ++tries) {
    const next = await shot(page);
    if (next.equals(last)) return next;
    last = next;
  }
  throw new Error('the picture keeps changing');
}

/**
 * Decodes screenshots in the page `helper`. Returns the number of distinct colours of the first
 * one, and the share of pixels in which the second one differs.
 */
export async function compare(helper, first, second = null) {
  return helper.evaluate(async (pictures) => {
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

/**
 * Whether the page becomes equal to an earlier screenshot, or differs from it in more than a share
 * of the pixels.
 */
export async function becomesEqual(helper, page, other, same, share = 0) {
  for (let tries = 0; tries < 4; ++tries) {
    const { differing } = await compare(helper, other, await screenshot(page));
    if (same ? differing === 0 : differing > share) return true;
  }
  return false;
}

// ---- Drawings. The page must draw by itself: only its own drawings are compared. ----

/** Starts reading the pixels at the end of each drawing, before the browser discards them. */
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
  // The second frame is for drawings that the layout of the first one requests.
  const rest = async () => {
    do {
      await frame();
      await frame();
    } while (view.drawRequested || !last);
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

/** Keeps the present drawing, once the page has stopped drawing, and returns its number. */
export const keepDrawing = (page) => page.evaluate(() => window.drawing.keep());

/** Whether the drawing becomes equal to a kept one, or differs from it. */
export const drawingBecomes = (page, index, same) => page.evaluate(([i, wanted]) => window.drawing.becomes(i, wanted), [index, same]);

/** Fails unless the action changes the drawing and `undo` restores it. */
export async function changes(page, name, act, undo) {
  const start = await keepDrawing(page);
  await act();
  assert.ok(await drawingBecomes(page, start, false), `${name}: the picture does not change`);
  if (!undo) return;
  await undo();
  assert.ok(await drawingBecomes(page, start, true), `${name}: the picture is not restored`);
}
