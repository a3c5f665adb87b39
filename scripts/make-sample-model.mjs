#!/usr/bin/env node
// Writes samples/test-part.stl: a small test part that gives a planner something to chew on.
//
//   node scripts/make-sample-model.mjs [OUTPUT.stl]
//
// What is on it and why:
//   base plate     rounded corners, a row of sharp teeth, two screw holes: long straights, arcs, hard corners
//   lobed tower    a wall whose five lobes twist with height: thousands of short segments, no two layers alike
//   bridge         two posts and a beam over a gap
//   mushroom       a cone that overhangs at 40 degrees from the vertical
//   two islands    a pin and a block beside the plate: a retraction and a travel on each layer
//
// The shells overlap where they meet; every slicer joins them. Knows nothing of slicing.
// Units: millimetres; z up; the part's middle is at 0, 0. Node's built-ins only.
import { writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const BYTES_HEADER = 80;
const BYTES_PER_TRIANGLE = 50;

/** Triangles as [[x, y, z], [x, y, z], [x, y, z]], seen counter-clockwise from outside. */
const triangles = [];

const circle = (cx, cy, radius, segments) =>
  Array.from({ length: segments }, (_, i) => {
    const angle = (2 * Math.PI * i) / segments;
    return [cx + radius * Math.cos(angle), cy + radius * Math.sin(angle)];
  });

const rectangle = (x0, y0, x1, y1) => [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];

/** An arc's points, both ends included; angles in degrees. */
function arc(cx, cy, radius, from, to, segments) {
  return Array.from({ length: segments + 1 }, (_, i) => {
    const angle = ((from + ((to - from) * i) / segments) * Math.PI) / 180;
    return [cx + radius * Math.cos(angle), cy + radius * Math.sin(angle)];
  });
}

const cross = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);

function inTriangle(p, a, b, c) {
  return cross(a, b, p) >= 0 && cross(b, c, p) >= 0 && cross(c, a, p) >= 0;
}

/** Joins a hole to its outline by a bridge of no width between their two nearest points, so that ears can be clipped. */
function bridge(outline, hole) {
  const reversed = [...hole].reverse();
  const gap = (i, j) => Math.hypot(outline[i][0] - reversed[j][0], outline[i][1] - reversed[j][1]);
  let [at, start] = [0, 0];
  outline.forEach((_, i) => reversed.forEach((_, j) => {
    if (gap(i, j) < gap(at, start)) [at, start] = [i, j];
  }));
  const ring = [...reversed.slice(start), ...reversed.slice(0, start + 1)];
  return [...outline.slice(0, at + 1), ...ring, ...outline.slice(at)];
}

/** Ear clipping of a counter-clockwise outline with holes; a list of triangles of [x, y]. */
function triangulate(outline, holes) {
  const points = holes.reduce(bridge, outline);
  const left = points.map((_, i) => i);
  const found = [];
  while (left.length > 3) {
    const ear = left.findIndex((index, k) => {
      const a = points[left.at(k - 1)];
      const b = points[index];
      const c = points[left[(k + 1) % left.length]];
      if (cross(a, b, c) <= 1e-12) return false;
      return left.every((other) => {
        const p = points[other];
        const corner = [a, b, c].some((q) => q[0] === p[0] && q[1] === p[1]);
        return corner || !inTriangle(p, a, b, c);
      });
    });
    if (ear < 0) throw new Error('the outline crosses itself');
    found.push([points[left.at(ear - 1)], points[left[ear]], points[left[(ear + 1) % left.length]]]);
    left.splice(ear, 1);
  }
  found.push(left.map((i) => points[i]));
  return found;
}

/** The wall between two rings with the same number of points, counter-clockwise seen from above. */
function wall(lower, upper, z0, z1) {
  lower.forEach((a, i) => {
    const j = (i + 1) % lower.length;
    triangles.push([[...a, z0], [...lower[j], z0], [...upper[j], z1]]);
    triangles.push([[...a, z0], [...upper[j], z1], [...upper[i], z1]]);
  });
}

/** A flat face at one height, looking up or down. */
function cap(outline, holes, z, up) {
  for (const [a, b, c] of triangulate(outline, holes)) {
    const face = [[...a, z], [...b, z], [...c, z]];
    triangles.push(up ? face : face.reverse());
  }
}

function prism(outline, z0, z1, holes = []) {
  wall(outline, outline, z0, z1);
  for (const hole of holes) wall([...hole].reverse(), [...hole].reverse(), z0, z1);
  cap(outline, holes, z0, false);
  cap(outline, holes, z1, true);
}

/** A solid of rings stacked on each other: rings are [z, outline], all with the same number of points. */
function loft(rings) {
  for (let i = 1; i < rings.length; i++) wall(rings[i - 1][1], rings[i][1], rings[i - 1][0], rings[i][0]);
  cap(rings[0][1], [], rings[0][0], false);
  cap(rings.at(-1)[1], [], rings.at(-1)[0], true);
}

function basePlate() {
  const teeth = 7;
  const pitch = 3;
  const left = -10.5;
  const sawtooth = [];
  for (let i = 0; i < teeth; i++) sawtooth.push([left + i * pitch, -12], [left + (i + 1) * pitch, -14]);
  const outline = [
    [-11.5, -12],
    ...sawtooth,
    ...arc(10.5 + 2, -8, 4, -90, 0, 16),
    ...arc(11.5, 7, 5, 0, 90, 20),
    ...arc(-11.5, 7, 5, 90, 180, 20),
    ...arc(-12.5, -8, 4, 180, 270, 16).slice(0, -1),
  ];
  prism(outline, 0, 2, [circle(-12, 7.5, 1.7, 40), circle(12, 7.5, 1.7, 40)]);
}

function lobedTower() {
  const at = (turn, grow) =>
    Array.from({ length: 96 }, (_, i) => {
      const angle = (2 * Math.PI * i) / 96;
      const radius = 5.6 + grow + 0.9 * Math.cos(5 * (angle - turn));
      return [-6 + radius * Math.cos(angle), 0.5 + radius * Math.sin(angle)];
    });
  const rings = [];
  for (let i = 0; i <= 28; i++) {
    const height = i / 28;
    rings.push([1.5 + 10.5 * height, at(height * 0.9, -1.2 * height * height)]);
  }
  loft(rings);
}

function bridgeSpan() {
  prism(rectangle(4, 2, 7, 5.5), 1.5, 9);
  prism(rectangle(4, -9, 7, -5.5), 1.5, 9);
  prism(rectangle(4, -9, 7, 5.5), 8, 10);
}

function mushroom() {
  const ring = (radius) => circle(12, -3, radius, 64);
  loft([[1.5, ring(1.8)], [5, ring(1.8)], [8, ring(1.8 + 3 * Math.tan((40 * Math.PI) / 180))], [9, ring(4.32)]]);
}

function islands() {
  loft([[0, circle(-8, 17, 2.2, 48)], [4, circle(-8, 17, 2.2, 48)], [8, circle(-8, 17, 1.2, 48)]]);
  prism(rectangle(5, 15, 9, 18), 0, 6);
}

function binaryStl() {
  const buffer = Buffer.alloc(BYTES_HEADER + 4 + BYTES_PER_TRIANGLE * triangles.length);
  buffer.write('Stepcast test part; written by scripts/make-sample-model.mjs; mm', 'latin1');
  buffer.writeUInt32LE(triangles.length, BYTES_HEADER);
  let at = BYTES_HEADER + 4;
  for (const [a, b, c] of triangles) {
    const u = b.map((value, i) => value - a[i]);
    const v = c.map((value, i) => value - a[i]);
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...normal) || 1;
    const facet = [normal.map((value) => value / length), a, b, c].flat();
    facet.forEach((value, i) => buffer.writeFloatLE(value, at + 4 * i));
    at += BYTES_PER_TRIANGLE;
  }
  return buffer;
}

basePlate();
lobedTower();
bridgeSpan();
mushroom();
islands();
const output = process.argv[2] ?? fileURLToPath(new URL('../samples/test-part.stl', import.meta.url));
writeFileSync(output, binaryStl());
console.log(`${triangles.length} triangles`);
