// Shared geometry: unit shapes, and matrices that place unit shapes.
import {
  BoxGeometry, ConeGeometry, CylinderGeometry, IcosahedronGeometry, Matrix4, NotEqualStencilFunc, Quaternion, ReplaceStencilOp, Vector3,
} from 'three';

export const BALL = new IcosahedronGeometry(1, 4);
export const ROD = new CylinderGeometry(1, 1, 1, 8, 1, true);
export const DRUM = new CylinderGeometry(1, 1, 1, 28, 1);
export const CONE = new ConeGeometry(1, 1, 18, 1);
export const CUBE = new BoxGeometry(1, 1, 1);

const UP = new Vector3(0, 1, 0);
const from = new Vector3();
const along = new Vector3();
const middle = new Vector3();
const size = new Vector3();
const turn = new Quaternion();

/**
 * Matrix that places a unit shape along y (height 1, radius 1, centred) between a and b with a
 * radius.
 */
export function matrixBetween(a, b, radius, out = new Matrix4()) {
  from.fromArray(a);
  along.fromArray(b).sub(from);
  const length = Math.max(along.length(), 1e-9);
  middle.copy(from).addScaledVector(along, 0.5);
  turn.setFromUnitVectors(UP, along.divideScalar(length));
  return out.compose(middle, turn, size.set(radius, length, radius));
}

/** Matrix that centres a unit shape along y at a point and aligns it with an axis. */
export function matrixAt(point, axis, radius, length, out = new Matrix4()) {
  turn.setFromUnitVectors(UP, along.fromArray(axis).normalize());
  return out.compose(middle.fromArray(point), turn, size.set(radius, length, radius));
}

/**
 * Material settings for a translucent body of many overlapping parts. The stencil buffer ensures
 * that each pixel is blended only once. The depth buffer is not written, which keeps objects behind
 * the body visible.
 */
export const translucent = (mark, opacity) => ({
  transparent: true, opacity, depthWrite: false, stencilWrite: true, stencilRef: mark, stencilFunc: NotEqualStencilFunc, stencilZPass: ReplaceStencilOp,
});

/** Makes a mesh use the matrix that is set, without updating it from position and rotation. */
export function fixMatrix(mesh) {
  mesh.matrixAutoUpdate = false;
  mesh.frustumCulled = false;
  return mesh;
}
