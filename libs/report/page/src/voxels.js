// The map: the faces of its cells are stored in a texture, and each instance draws a block of them.
// Faces between two cells are omitted while the whole map is shown. One instanced cube per cell
// would be simpler, but with WebGL in software 20,000 of them take half a second per picture.
import {
  Color, DataTexture, DoubleSide, FloatType, FrontSide, Group, InstancedBufferGeometry, Matrix4, Mesh, RGBAFormat, ShaderMaterial, Uint16BufferAttribute, Vector4,
} from 'three';
import { poseOf, transform } from './kinematics.js';

const BLOCK = 1024;
const WIDTH = 1024;

/** A geometry with the indices of BLOCK squares of 4 corners each. */
function blockOfFaces() {
  const geometry = new InstancedBufferGeometry();
  geometry.setIndex(new Uint16BufferAttribute(Array.from({ length: BLOCK }, (_, i) => [0, 1, 3, 0, 3, 2].map((corner) => 4 * i + corner)).flat(), 1));
  return geometry;
}

// A texel describes a face: the centre of its cell [m] and 8 · level + face. The faces 0 to 5 are
// −x, +x, −y, +y, −z, +z.
const VERTEX = `
uniform highp sampler2D uFaces;
uniform mat4 uPose;
uniform int uCount;
uniform float uHalf;
varying vec3 vLocal;
varying vec3 vWorld;
flat varying vec3 vNormal;
void main() {
  int i = gl_InstanceID * ${BLOCK} + gl_VertexID / 4;
  vec4 texel = texelFetch(uFaces, ivec2(i % ${WIDTH}, i / ${WIDTH}), 0);
  int code = int(texel.w);
  int axis = (code & 7) >> 1;
  float side = float(code & 1) * 2.0 - 1.0;
  vec2 corner = vec2(ivec2(gl_VertexID, gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  corner.x *= side;
  vec3 normal = axis == 0 ? vec3(side, 0.0, 0.0) : axis == 1 ? vec3(0.0, side, 0.0) : vec3(0.0, 0.0, side);
  vec3 square = axis == 0 ? vec3(0.0, corner) : axis == 1 ? vec3(corner.y, 0.0, corner.x) : vec3(corner, 0.0);
  vLocal = vec3(corner, 0.0);
  vec4 world = uPose * vec4(texel.xyz + uHalf * exp2(float(code >> 3)) * (square + normal), 1.0);
  vWorld = world.xyz;
  vNormal = mat3(uPose) * normal;
  gl_Position = i < uCount ? projectionMatrix * viewMatrix * world : vec4(2.0, 2.0, 2.0, 1.0);
}`;

// Light comes from above and slightly from −y. The edges of a cell are darker if the cell is large
// enough on the screen. Where the clip plane cuts a cell, the inner sides of its far faces are
// visible; with a uniform colour they look like the cut surface.
const FRAGMENT = `
varying vec3 vLocal;
varying vec3 vWorld;
flat varying vec3 vNormal;
uniform vec3 uBottom, uTop, uCap;
uniform vec4 uClip;
uniform float uLow, uHigh, uOpacity;
void main() {
  #ifdef CLIP
  if (dot(uClip.xyz, vWorld) + uClip.w < 0.0) discard;
  #endif
  float pixel = max(fwidth(vLocal.x), fwidth(vLocal.y));
  float line = smoothstep(0.94 - 1.5 * pixel, 0.96, max(abs(vLocal.x), abs(vLocal.y))) * (1.0 - smoothstep(0.2, 0.6, pixel));
  float light = 0.7 + 0.28 * vNormal.z + 0.16 * dot(vNormal, vec3(0.4, -0.75, 0.0));
  vec3 color = mix(uBottom, uTop, clamp((vWorld.z - uLow) / max(uHigh - uLow, 1e-6), 0.0, 1.0)) * light * (1.0 - 0.2 * line);
  gl_FragColor = vec4(gl_FrontFacing ? color : uCap, uOpacity);
  #include <colorspace_fragment>
}`;

const MASK = `
varying vec3 vWorld;
uniform vec4 uClip;
void main() {
  #ifdef CLIP
  if (dot(uClip.xyz, vWorld) + uClip.w < 0.0) discard;
  #endif
  gl_FragColor = vec4(1.0);
}`;

/**
 * For each cell, one bit for each face that no cell of the same or a larger size covers that is
 * there at least as long.
 */
function exposedFaces(lo, level, since) {
  const levels = [...new Set(level)].sort((a, b) => a - b);
  // keys are below 2^51 and therefore exact
  const key = (x, y, z) => ((x + 65536) * 131072 + (y + 65536)) * 131072 + (z + 65536);
  const tables = new Map(levels.map((l) => [l, new Map()]));
  for (let i = 0; i < level.length; ++i) tables.get(level[i]).set(key(lo[3 * i], lo[3 * i + 1], lo[3 * i + 2]), since?.[i] ?? 0);
  const bits = new Uint8Array(level.length);
  const at = [0, 0, 0];
  for (let i = 0; i < level.length; ++i) {
    for (let face = 0; face < 6; ++face) {
      for (let a = 0; a < 3; ++a) at[a] = lo[3 * i + a];
      at[face >> 1] += face & 1 ? 2 ** level[i] : -1;
      const covered = levels.some((l) => {
        if (l < level[i]) return false;
        const size = 2 ** l;
        const [x, y, z] = at.map((c) => Math.floor(c / size) * size);
        return tables.get(l).get(key(x, y, z)) <= (since?.[i] ?? 0);
      });
      if (!covered) bits[i] |= 1 << face;
    }
  }
  return bits;
}

export class Voxels {
  /** @param map its cells, in the order of `since` [s], the time from which each is there, if it has that */
  constructor(map) {
    const count = map.level.length;
    this.total = count;
    this.pose = poseOf(map.position_m, map.quaternion_wxyz);
    /** Centre and half edge of each cell [m], map frame. */
    this.cells = new Float32Array(4 * count);
    this.lo = [Infinity, Infinity, Infinity];
    this.hi = [-Infinity, -Infinity, -Infinity];
    const world = [0, 0, 0];
    for (let i = 0; i < count; ++i) {
      const half = 0.5 * map.resolution_m * 2 ** map.level[i];
      for (let a = 0; a < 3; ++a) this.cells[4 * i + a] = map.lo[3 * i + a] * map.resolution_m + half;
      this.cells[4 * i + 3] = half;
      this.center(i, world);
      for (let a = 0; a < 3; ++a) {
        this.lo[a] = Math.min(this.lo[a], world[a] - half);
        this.hi[a] = Math.max(this.hi[a], world[a] + half);
      }
    }
    this.level = map.level;
    this.since = map.since ?? null;
    this.time = Infinity;
    this.exposed = exposedFaces(map.lo, map.level, map.since);
    this.texture = this.textureFor(1);
    const p = this.pose;
    this.uniforms = {
      uFaces: { value: this.texture }, uCount: { value: 0 }, uHalf: { value: 0.5 * map.resolution_m }, uClip: { value: new Vector4(0, 0, 0, 1) }, uOpacity: { value: 1 },
      uPose: { value: new Matrix4().set(p[0], p[1], p[2], p[9], p[3], p[4], p[5], p[10], p[6], p[7], p[8], p[11], 0, 0, 0, 1) },
      uLow: { value: this.lo[2] }, uHigh: { value: this.hi[2] }, uBottom: { value: new Color() }, uTop: { value: new Color() }, uCap: { value: new Color() },
    };
    const pass = (fragmentShader, more) => new ShaderMaterial({ vertexShader: VERTEX, fragmentShader, uniforms: this.uniforms, transparent: true, ...more });
    this.paintPass = pass(FRAGMENT, {});
    // A translucent map is first drawn to the depth buffer: then only its nearest layer is blended,
    // in any order of the cells.
    this.depthPass = pass(MASK, { colorWrite: false });
    this.geometry = blockOfFaces();
    this.mesh = new Mesh(this.geometry, this.paintPass);
    this.mask = new Mesh(this.geometry, this.depthPass);
    this.mesh.renderOrder = 11;
    this.mask.renderOrder = 10;
    this.group = new Group();
    for (const mesh of [this.mask, this.mesh]) {
      mesh.frustumCulled = false;
      this.group.add(mesh);
    }
    this.mapBalls = new Float32Array(0);
    this.showsAll = false;
    this.showAll();
  }

  /** World position of a cell's centre [m]. */
  center(i, out) {
    return transform(this.pose, this.cells.subarray(4 * i, 4 * i + 3), out);
  }

  /** Sets the colours; cells are coloured by height. */
  paint(colors) {
    this.uniforms.uBottom.value.set(colors.voxel);
    this.uniforms.uTop.value.set(colors.voxelTop);
    this.uniforms.uCap.value.set(colors.cap);
  }

  setOpacity(opacity) {
    this.uniforms.uOpacity.value = opacity;
    this.mesh.visible = opacity > 0;
    this.mask.visible = opacity > 0 && opacity < 1;
  }

  /** Shows only the part on one side of a plane across a world axis; null shows all. */
  setClip(clip) {
    const sign = clip?.flip ? 1 : -1;
    if (clip) this.uniforms.uClip.value.set(0, 0, 0, -sign * clip.at).setComponent(clip.axis, sign);
    const side = clip ? DoubleSide : FrontSide;
    if (this.paintPass.side === side) return;
    this.cut = Boolean(clip);
    this.showsAll = false;
    for (const material of [this.paintPass, this.depthPass]) {
      material.side = side;
      // A separate program, because a program with `discard` prevents the early depth test.
      material.defines = clip ? { CLIP: 1 } : {};
      material.needsUpdate = true;
    }
  }

  showAll() {
    if (this.showsAll) return;
    this.showsAll = true;
    this.begin();
    // In a cut map the faces between cells are visible.
    this.facesBefore = new Uint32Array(this.total + 1);
    for (let i = 0; i < this.total; ++i) {
      this.addCell(i, this.cut ? 63 : this.exposed[i]);
      this.facesBefore[i + 1] = this.faces;
    }
    this.publish();
    this.showUntil(this.time);
  }

  /** How many cells are there at a time. */
  countAt(time) {
    if (!this.since) return this.total;
    let [lo, hi] = [0, this.total];
    while (lo < hi) {
      const middle = (lo + hi) >> 1;
      if (this.since[middle] <= time) lo = middle + 1;
      else hi = middle;
    }
    return lo;
  }

  /** Of all cells, shows those that are there at a time. */
  showUntil(time) {
    this.time = time;
    if (!this.since || !this.showsAll) return;
    this.shown = this.countAt(time);
    this.count(this.facesBefore[this.shown]);
  }

  /**
   * Shows only the cells whose box is within `distance` of a ball.
   * @param {Float32Array} balls x, y, z, radius of each [m], world
   */
  showNear(balls, distance) {
    this.showsAll = false;
    const count = balls.length / 4;
    const near = this.toMap(balls);
    const lo = [Infinity, Infinity, Infinity];
    const hi = [-Infinity, -Infinity, -Infinity];
    for (let j = 0; j < count; ++j) {
      near[4 * j + 3] += distance;
      for (let a = 0; a < 3; ++a) {
        lo[a] = Math.min(lo[a], near[4 * j + a] - near[4 * j + 3]);
        hi[a] = Math.max(hi[a], near[4 * j + a] + near[4 * j + 3]);
      }
    }
    const { cells } = this;
    this.begin();
    // Neighbours in the list are neighbours in space: the ball that is near to one cell is tried
    // first for the next cell.
    let last = 0;
    const there = this.countAt(this.time);
    for (let i = 0; i < 4 * there; i += 4) {
      const x = cells[i];
      const y = cells[i + 1];
      const z = cells[i + 2];
      const half = cells[i + 3];
      if (x + half < lo[0] || x - half > hi[0] || y + half < lo[1] || y - half > hi[1] || z + half < lo[2] || z - half > hi[2]) continue;
      for (let step = 0; step < count; ++step) {
        const j = step === 0 ? last : step <= last ? step - 1 : step;
        const dx = Math.max(0, Math.abs(near[4 * j] - x) - half);
        const dy = Math.max(0, Math.abs(near[4 * j + 1] - y) - half);
        const dz = Math.max(0, Math.abs(near[4 * j + 2] - z) - half);
        const r = near[4 * j + 3];
        if (dx * dx + dy * dy + dz * dz <= r * r) {
          last = j;
          this.addCell(i / 4, 63);
          break;
        }
      }
    }
    this.publish();
  }

  /** Balls in the map frame: Rᵀ (p − t). */
  toMap(balls) {
    if (this.mapBalls.length !== balls.length) this.mapBalls = new Float32Array(balls.length);
    const p = this.pose;
    for (let j = 0; j < balls.length; j += 4) {
      const x = balls[j] - p[9];
      const y = balls[j + 1] - p[10];
      const z = balls[j + 2] - p[11];
      for (let a = 0; a < 3; ++a) this.mapBalls[j + a] = p[a] * x + p[3 + a] * y + p[6 + a] * z;
      this.mapBalls[j + 3] = balls[j + 3];
    }
    return this.mapBalls;
  }

  begin() {
    this.shown = 0;
    this.faces = 0;
  }

  /** Adds the faces of a cell whose bits are set. */
  addCell(i, bits) {
    if (4 * (this.faces + 6) > this.texture.image.data.length) this.grow();
    const { data } = this.texture.image;
    for (let face = 0; face < 6; ++face) {
      if (!(bits & (1 << face))) continue;
      const at = 4 * this.faces++;
      data[at] = this.cells[4 * i];
      data[at + 1] = this.cells[4 * i + 1];
      data[at + 2] = this.cells[4 * i + 2];
      data[at + 3] = 8 * this.level[i] + face;
    }
    ++this.shown;
  }

  textureFor(rows) {
    return new DataTexture(new Float32Array(4 * WIDTH * rows), WIDTH, rows, RGBAFormat, FloatType);
  }

  grow() {
    const old = this.texture;
    this.texture = this.textureFor(2 * old.image.height);
    this.texture.image.data.set(old.image.data);
    this.uniforms.uFaces.value = this.texture;
    old.dispose();
  }

  publish() {
    this.count(this.faces);
    this.texture.needsUpdate = true;
  }

  count(faces) {
    this.uniforms.uCount.value = faces;
    this.geometry.instanceCount = Math.ceil(faces / BLOCK);
  }
}
