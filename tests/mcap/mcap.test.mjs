// Tests files of `hamelin export --format mcap`.
//   HAMELIN_RUNS  folder with NAME.jsonl (the log), NAME.mcap and NAME.html (its report) of the runs
//                 shelf, person, carry, follow, planar and drawing; see run.sh
//   NODE_MODULES  folder of @mcap/core, @foxglove/schemas, ajv and fzstd
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { test } from 'node:test';
import { readData, tipOf } from '../report/report_data.mjs';

const requireModule = createRequire(path.join(path.resolve(process.env.NODE_MODULES), 'x.js'));
const { McapIndexedReader, McapStreamReader } = requireModule('@mcap/core');
const { crc32 } = requireModule('@foxglove/crc');
const { decompress } = requireModule('fzstd');
const published = requireModule('@foxglove/schemas/jsonschema');
const Ajv = requireModule('ajv').default;

const fileOf = (name, kind) => path.join(process.env.HAMELIN_RUNS, `${name}.${kind}`);
const decompressHandlers = { zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))) };

/** Reads a file by its index: the reader checks the CRCs of the summary and of each chunk. */
async function readMcap(name) {
  const bytes = readFileSync(fileOf(name, 'mcap'));
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const { topic, schemaId } = reader.channelsById.get(message.channelId);
    const json = JSON.parse(new TextDecoder().decode(message.data));
    messages.push({ topic, schema: reader.schemasById.get(schemaId).name, channel: message.channelId, sequence: message.sequence, time: message.logTime, json });
  }
  const of = (topic) => messages.filter((message) => message.topic === topic);
  return { bytes, reader, messages, of };
}

const files = Object.fromEntries(await Promise.all(['shelf', 'person', 'carry', 'follow', 'planar', 'drawing'].map(async (name) => [name, await readMcap(name)])));
const logOf = (name) => readFileSync(fileOf(name, 'jsonl'), 'utf8').trim().split('\n').map((line) => JSON.parse(line));
const nanoseconds = ({ sec, nsec }) => BigInt(sec) * 1000000000n + BigInt(nsec);
const timeOf = (seconds) => BigInt(Math.round(seconds * 1e9));

/** A schema without what only people read. */
function bare(schema) {
  if (Array.isArray(schema)) return schema.map(bare);
  if (schema === null || typeof schema !== 'object') return schema;
  const isText = (key, value) => ['description', '$comment'].includes(key) && typeof value === 'string';
  return Object.fromEntries(Object.entries(schema).filter(([key, value]) => !isText(key, value)).map(([key, value]) => [key, bare(value)]));
}

const rotate = ({ x, y, z, w }, [a, b, c]) => {
  const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2], c + w * t[2] + x * t[1] - y * t[0]];
};
const point = ({ x, y, z }) => [x, y, z];
const moved = ({ translation, rotation }, p) => rotate(rotation, p).map((x, i) => x + point(translation)[i]);
const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
const frameIn = (message, frame) => message.json.transforms.find((transform) => transform.child_frame_id === frame);

for (const [name, { bytes, reader, messages }] of Object.entries(files)) {
  test(`${name}: the CRC of the data, the statistics and the sequence numbers are right`, () => {
    const end = Number(reader.dataEndOffset);
    assert.notEqual(reader.dataSectionCrc, 0);
    assert.equal(reader.dataSectionCrc, crc32(new Uint8Array(bytes.subarray(0, end))));
    assert.notEqual(reader.footer.summaryCrc, 0);
    assert.equal(reader.statistics.messageCount, BigInt(messages.length));
    assert.equal(reader.statistics.chunkCount, reader.chunkIndexes.length);
    assert.equal(reader.statistics.schemaCount, reader.schemasById.size);
    assert.equal(reader.statistics.channelCount, reader.channelsById.size);
    assert.equal(reader.statistics.messageStartTime, messages[0].time);
    assert.equal(reader.statistics.messageEndTime, messages.at(-1).time);
    for (const [id, { topic }] of reader.channelsById) {
      const own = messages.filter((message) => message.channel === id);
      assert.equal(reader.statistics.channelMessageCounts.get(id), BigInt(own.length), topic);
      assert.deepEqual(own.map(({ sequence }) => sequence), own.map((_, i) => i), topic);
    }
  });

  test(`${name}: messages are in the order of their times, from start to end of the file`, () => {
    const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
    stream.append(new Uint8Array(bytes));
    let last = 0n;
    let count = 0;
    for (let record = stream.nextRecord(); record; record = stream.nextRecord()) {
      if (record.type !== 'Message') continue;
      assert.ok(record.logTime >= last);
      last = record.logTime;
      ++count;
    }
    assert.ok(stream.done());
    assert.equal(count, messages.length);
  });

  test(`${name}: schemas are those that Foxglove publishes, and all messages are valid`, () => {
    const ajv = new Ajv({ strict: false });
    for (const { name: title, encoding, data } of reader.schemasById.values()) {
      assert.equal(encoding, 'jsonschema');
      const own = JSON.parse(new TextDecoder().decode(data));
      const [owner, kind] = title.split('.');
      if (owner === 'foxglove') assert.deepEqual(own, bare(published[kind]));
      const check = ajv.compile(owner === 'foxglove' ? published[kind] : own);
      for (const message of messages.filter(({ schema }) => schema === title))
        assert.ok(check(message.json), `${message.topic} at ${message.time}: ${ajv.errorsText(check.errors)}`);
    }
    for (const { json, time } of messages) if (json.timestamp) assert.equal(nanoseconds(json.timestamp), time);
  });

  test(`${name}: collision spheres and the tip are where the kinematics of the report puts them`, () => {
    const { robot } = readData(fileOf(name, 'html')).json.worlds[0];
    const entities = files[name].of('/arm')[0].json.entities;
    const joints = files[name].of('/joint_states');
    const transforms = files[name].of('/tf');
    assert.equal(joints.length, transforms.length);
    let spheres = 0;
    for (let k = 0; k < joints.length; k += Math.ceil(joints.length / 20)) {
      const q = joints[k].json.joints.map(({ position }) => position);
      assert.equal(joints[k].time, transforms[k].time);
      assert.ok(distance(point(frameIn(transforms[k], 'tip').translation), tipOf(robot, q)) < 1e-9);
      for (const sphere of robot.spheres) {
        const { name: joint, link } = robot.joints[sphere.link];
        assert.equal(joint, joints[k].json.joints[sphere.link].name);
        const frame = frameIn(transforms[k], `com/${link}`);
        const expected = tipOf({ ...robot, tip_link: sphere.link, skeleton: [sphere.center_m] }, q);
        const drawn = entities.find(({ frame_id: id }) => id === `com/${link}`).spheres;
        const found = drawn.filter(({ pose, size }) => distance(moved(frame, point(pose.position)), expected) < 1e-9 && Math.abs(size.x - 2 * sphere.radius_m) < 1e-12);
        // The report draws a capsule as a row of balls, of which the file has the ends.
        if (found.length) ++spheres;
      }
    }
    const drawn = entities.filter(({ frame_id: id }) => id.startsWith('com/')).reduce((sum, entity) => sum + entity.spheres.length, 0);
    const samples = Math.ceil(joints.length / Math.ceil(joints.length / 20));
    assert.ok(drawn > 0);
    assert.ok(spheres >= drawn * samples, `${spheres} of ${drawn * samples} spheres`);
  });
}

test('without a rate there are a state and a pose per tick, with the numbers of the log', () => {
  const ticks = logOf('shelf').filter(({ type }) => type === 'tick');
  const joints = files.shelf.of('/joint_states');
  const states = files.shelf.of('/state');
  assert.equal(joints.length, ticks.length);
  assert.equal(states.length, ticks.length);
  ticks.forEach((tick, k) => {
    assert.equal(joints[k].time, timeOf(tick.time_s));
    for (const [key, of] of [['q', 'position'], ['v', 'velocity'], ['tau', 'effort']])
      assert.deepEqual(joints[k].json.joints.map((joint) => joint[of]), tick[key]);
    assert.equal(states[k].json.clearance_m, tick.clearance_m ?? undefined);
    assert.equal(states[k].json.goal_index, tick.goal_index);
    assert.equal(states[k].json.certified, tick.certified);
  });
});

test('with a rate samples are evenly spaced, and the last tick is kept', () => {
  for (const [name, rate] of [['person', 50], ['follow', 100]]) {
    const times = files[name].of('/tf').map(({ time }) => Number(time) / 1e9);
    times.slice(0, -1).forEach((time, k) => assert.ok(Math.abs(time - k / rate) < 1e-8));
    const last = logOf(name).findLast(({ type }) => type === 'tick').time_s;
    assert.equal(times.at(-1), last);
  }
});

test('obstacles that move are where the report puts them', () => {
  const { json, unpack } = readData(fileOf('person', 'html'));
  const movers = json.worlds[0].obstacles.filter(({ poses }) => poses);
  assert.ok(movers.length >= 3);
  const transforms = files.person.of('/tf');
  const entities = files.person.of('/obstacles')[0].json.entities;
  assert.equal(entities.length, json.worlds[0].obstacles.length);
  let compared = 0;
  for (const { name, poses } of movers) {
    assert.ok(entities.some(({ id, frame_id: frame }) => id === name && frame === `obstacle/${name}`));
    const position = unpack(poses.position_m);
    unpack(poses.t).forEach((t, k) => {
      const message = transforms.find(({ time }) => time === timeOf(t));
      if (!message) return;
      assert.ok(distance(point(frameIn(message, `obstacle/${name}`).translation), position.slice(3 * k, 3 * k + 3)) < 2e-5);
      ++compared;
    });
  }
  assert.ok(compared > 100);
});

test('all cells of the map that the report shows are in boxes of the map', () => {
  const { json, unpack } = readData(fileOf('shelf', 'html'));
  const { map } = json.worlds[0];
  const [update, ...others] = files.shelf.of('/map');
  assert.equal(others.length, 0);
  const boxes = update.json.entities[0].cubes.map(({ pose, size }) => ({ center: point(pose.position), size: point(size) }));
  const lo = unpack(map.lo);
  const level = unpack(map.level);
  assert.ok(level.length > 0);
  level.forEach((exponent, k) => {
    const center = [0, 1, 2].map((axis) => (lo[3 * k + axis] + 2 ** exponent / 2) * map.resolution_m);
    assert.ok(boxes.some((box) => center.every((x, axis) => Math.abs(x - box.center[axis]) <= box.size[axis] / 2)));
  });
});

test('the map and the arm are sent again when they change', () => {
  const events = logOf('carry').filter(({ type }) => type === 'event');
  const changes = events.filter(({ text }) => text === 'the map changes');
  assert.ok(changes.length > 0);
  assert.equal(files.carry.of('/map').length, 1 + changes.length);
  const loads = events.filter((event) => event.attached || event.detached);
  const updates = files.carry.of('/arm');
  assert.equal(updates.length, 1 + loads.length);
  loads.forEach((load, k) => {
    const entity = updates[k + 1].json.entities.find(({ id }) => id === `load/${load.attached ?? load.detached}`);
    assert.equal(updates[k + 1].time, timeOf(load.time_s));
    assert.equal(entity.frame_id, load.attached ? 'tip' : 'world');
  });
  // What is put down does not jump: its first sphere is where the tip held it.
  const down = loads.findIndex((load) => load.detached);
  const [held, put] = [updates[down], updates[down + 1]].map(({ json }) => json.entities.find(({ id }) => id.startsWith('load/')));
  const tip = frameIn(files.carry.of('/tf').findLast(({ time }) => time <= timeOf(loads[down].time_s)), 'tip');
  assert.ok(distance(moved(tip, point(held.spheres[0].pose.position)), point(put.spheres[0].pose.position)) < 0.01);
});

test('a capsule is a cylinder between the centres of two spheres', () => {
  const entity = files.carry.of('/arm').flatMap(({ json }) => json.entities).find(({ id, cylinders }) => id.startsWith('load/') && cylinders.length);
  assert.equal(entity.spheres.length, 2 * entity.cylinders.length);
  entity.cylinders.forEach(({ pose, size }, k) => {
    const ends = [-1, 1].map((side) => moved({ translation: pose.position, rotation: pose.orientation }, [0, 0, side * size.z / 2]));
    ends.forEach((end, i) => {
      const sphere = entity.spheres[2 * k + i];
      assert.ok(distance(end, point(sphere.pose.position)) < 1e-12);
      assert.equal(sphere.size.x, size.x);
    });
  });
});

test('every drawing of the planner is sent', () => {
  assert.ok(files.drawing.of('/drawing').length > 1);
  for (const [name, file] of Object.entries(files)) {
    const drawn = logOf(name).filter(({ type, paths }) => type === 'tick' && paths);
    const sent = file.of('/drawing');
    assert.deepEqual(sent.map(({ time }) => time), drawn.map((tick) => timeOf(tick.time_s)));
    drawn.forEach(({ paths }, k) => assert.deepEqual(sent[k].json.entities[0].lines.map(({ points }) => points.flatMap(point)), paths));
  }
});

test('goals change as they are reached, and the result is the last entry of the log', () => {
  const reached = new Set(logOf('carry').filter(({ type }) => type === 'tick').map((tick) => tick.goal_index));
  assert.equal(files.carry.of('/goals').length, reached.size);
  const { outcome } = logOf('carry').at(-1);
  assert.match(files.carry.of('/log').at(-1).json.message, new RegExp(`^the run ends: ${outcome}`));
});

test('a target that is followed has a frame', () => {
  const ticks = logOf('follow').filter(({ type, target }) => type === 'tick' && target);
  const transforms = files.follow.of('/tf');
  let compared = 0;
  for (const { time_s: time, target } of ticks) {
    const message = transforms.find((one) => one.time === timeOf(time));
    if (!message) continue;
    assert.ok(distance(point(frameIn(message, 'target').translation), target.position_m) < 1e-12);
    ++compared;
  }
  assert.ok(compared > 10);
});
