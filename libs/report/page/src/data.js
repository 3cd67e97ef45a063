// Reads the container that hamelin inserts into a page.

/**
 * @typedef {{at: number, n: number, type: string,
 *   scale?: number, offset?: number, none?: number}} Packed
 * @typedef {{t: Float64Array, q: Float64Array, goalIndex: Float64Array,
 *   clearance: Float64Array | null, influence: number,
 *   contacts: {count: Float64Array, first: Uint32Array, points: Float64Array} | null,
 *   forces: {channel: string, f: Float64Array}[]}} Frames
 */

const TYPES = {
  f64: Float64Array,
  f32: Float32Array,
  i32: Int32Array,
  u32: Uint32Array,
  i16: Int16Array,
  u16: Uint16Array,
  u8: Uint8Array,
};

/** Bytes of a base64 text. */
function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function gunzip(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/**
 * The JSON of a container, with every packed array unpacked to doubles. A value is
 * offset + scale · raw, and the raw value "none" becomes NaN.
 * @param {Uint8Array} bytes
 */
export function unpack(bytes) {
  const length = new DataView(bytes.buffer, bytes.byteOffset, 4).getUint32(0, true);
  const text = new TextDecoder().decode(bytes.subarray(4, 4 + length));
  const blob = bytes.byteOffset + Math.ceil((4 + length) / 8) * 8;
  /** @param {Packed} a */
  const array = (a) => {
    const Type = TYPES[a.type];
    if (!Type) throw new Error(`array type "${a.type}" is unknown`);
    const raw = new Type(bytes.buffer, blob + a.at, a.n);
    const scale = a.scale ?? 1;
    const offset = a.offset ?? 0;
    const none = a.none ?? null;
    const out = new Float64Array(a.n);
    for (let i = 0; i < a.n; ++i) out[i] = raw[i] === none ? NaN : offset + scale * raw[i];
    return out;
  };
  return JSON.parse(text, (key, value) =>
    value && typeof value === 'object' && typeof value.at === 'number' && typeof value.n === 'number' && value.type in TYPES
      ? array(value)
      : value,
  );
}

/** Converts the data to the names and forms that the rest of the page uses. */
function prepare(report) {
  report.worlds ??= [];
  report.runs ??= [];
  for (const run of report.runs) {
    const frames = run.frames;
    const n = report.worlds[run.world].robot.joints.length;
    if (frames.q.length !== frames.t.length * n) throw new Error(`run "${run.name}": ${frames.q.length} joint values for ${frames.t.length} frames`);
    run.frames = {
      t: frames.t,
      q: frames.q,
      goalIndex: frames.goal_index ?? new Float64Array(frames.t.length),
      clearance: frames.clearance ?? null,
      influence: frames.influence_m ?? 0,
      target: frames.target ?? null,
      contacts: null,
      forces: (frames.forces ?? []).filter((force) => force.f.length === 3 * frames.t.length),
    };
    if (frames.contacts) {
      const { count, points } = frames.contacts;
      const first = new Uint32Array(count.length + 1);
      for (let k = 0; k < count.length; ++k) first[k + 1] = first[k] + count[k];
      run.frames.contacts = { count, first, points };
    }
    run.events ??= [];
    run.stops ??= [];
    run.acts ??= [];
    run.loads ??= [];
    run.seen ??= null;
    run.drawings ??= null;
    run.plots ??= [];
    run.notes ??= [];
  }
  return report;
}

/** Reads the page's data; throws an error if it is missing or has another format. */
export async function readData(format) {
  const text = document.getElementById('hamelin-data').textContent.trim();
  if (text.startsWith('_')) throw new Error('This is an empty template: hamelin inserts the data into it.');
  const data = unpack(await gunzip(bytesOf(text)));
  if (data.format !== format) throw new Error(`format "${data.format}" found, ${format} expected`);
  return data;
}

/** Reads the runs of a report. */
export const readReport = async () => prepare(await readData('hamelin.report/1'));

/** Index k of the last t[k] ≤ x; 0 if there is none. */
export function indexAt(t, x) {
  let lo = 0;
  let hi = t.length - 1;
  while (lo < hi) {
    const mid = (lo + hi + 1) >> 1;
    if (t[mid] <= x) lo = mid;
    else hi = mid - 1;
  }
  return lo;
}

/**
 * Value of a sampled line at x, interpolated linearly; NaN outside of the samples or next to a gap.
 */
export function valueAt(t, y, x) {
  const last = t.length - 1;
  if (last < 0 || x < t[0] || x > t[last]) return NaN;
  const k = indexAt(t, x);
  if (k === last || t[k] === x) return y[k];
  const a = (x - t[k]) / (t[k + 1] - t[k]);
  return y[k] + a * (y[k + 1] - y[k]);
}
