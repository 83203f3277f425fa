// Triangles of the scene's objects: positions and normals, six numbers per vertex, and indices.

/** A grid of (columns + 1) x (rows + 1) vertices; `at(u, v)` gives position and normal. */
function grid(columns, rows, at) {
  const vertices = [];
  const indices = [];
  for (let row = 0; row <= rows; row++) {
    for (let column = 0; column <= columns; column++) {
      vertices.push(...at(column / columns, row / rows));
      if (row === rows || column === columns) continue;
      const a = row * (columns + 1) + column;
      const b = a + columns + 1;
      indices.push(a, b, a + 1, a + 1, b, b + 1);
    }
  }
  return { vertices, indices };
}

function joined(parts) {
  const vertices = [];
  const indices = [];
  for (const part of parts) {
    const first = vertices.length / 6;
    vertices.push(...part.vertices);
    indices.push(...part.indices.map((index) => index + first));
  }
  return { vertices, indices };
}

/** A standing capsule: all points within `radius` of the line from `from` up by `length`; a sphere where that is 0. */
export function capsule(from, length, radius, segments) {
  // An even number of rows: the one in the middle is the equator.
  return grid(segments, segments / 2, (u, v) => {
    const [azimuth, polar] = [2 * Math.PI * u, Math.PI * v];
    const normal = [Math.sin(polar) * Math.cos(azimuth), Math.cos(polar), Math.sin(polar) * Math.sin(azimuth)];
    const lift = v < 0.5 ? length : 0;
    return [...normal.map((part, axis) => from[axis] + radius * part + (axis === 1 ? lift : 0)), ...normal];
  });
}

/** Strips of a box's face: those that bend at either edge, and the flat one between. */
const STRIPS = 9;

/** Coordinates from -1 to 1, with a single strip between the bends of size `bend` at the ends. */
function strip(part, bend) {
  const step = Math.round(part * STRIPS);
  const bent = (STRIPS - 1) / 2;
  return step <= bent ? (bend * step) / bent - 1 : 1 - (bend * (STRIPS - step)) / bent;
}

/** A box about `centre` with rounded edges, rotated about +Y. */
export function roundedBox(centre, half, turn, rounding) {
  const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
  const turned = ([x, y, z]) => [cos * x + sin * z, y, cos * z - sin * x];
  const faces = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      faces.push(grid(STRIPS, STRIPS, (u, v) => {
        const cube = [0, 0, 0];
        cube[axis] = side;
        const [across, along] = [(axis + 1) % 3, (axis + 2) % 3];
        cube[across] = strip(u, rounding / half[across]);
        cube[along] = strip(v, rounding / half[along]);
        const point = cube.map((part, i) => part * half[i]);
        const inner = point.map((part, i) => Math.min(Math.max(part, rounding - half[i]), half[i] - rounding));
        const out = point.map((part, i) => part - inner[i]);
        const size = Math.hypot(...out);
        const normal = out.map((part) => part / size);
        const position = turned(inner.map((part, i) => part + rounding * normal[i]));
        return [...position.map((part, i) => part + centre[i]), ...turned(normal)];
      }));
    }
  }
  return joined(faces);
}

/** The ground at height 0, a disc. */
export function ground(radius) {
  return grid(64, 1, (u, v) => [v * radius * Math.cos(2 * Math.PI * u), 0, v * radius * Math.sin(2 * Math.PI * u), 0, 1, 0]);
}
