// Triangles of the scene's things: positions and normals, six numbers a vertex, and indices.

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
export function capsule(from, length, radius) {
  return grid(64, 48, (u, v) => {
    const [azimuth, polar] = [2 * Math.PI * u, Math.PI * v];
    const normal = [Math.sin(polar) * Math.cos(azimuth), Math.cos(polar), Math.sin(polar) * Math.sin(azimuth)];
    const lift = v <= 0.5 ? length : 0;
    return [...normal.map((part, axis) => from[axis] + radius * part + (axis === 1 ? lift : 0)), ...normal];
  });
}

/** A box about `centre`, turned about +Y, its edges rounded. */
export function roundedBox(centre, half, turn, rounding) {
  const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
  const turned = ([x, y, z]) => [cos * x + sin * z, y, cos * z - sin * x];
  const faces = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      faces.push(grid(32, 32, (u, v) => {
        // Closer together at the edges, where the surface bends.
        const dense = (w) => Math.tan((w - 0.5) * 2.6) / Math.tan(1.3);
        const cube = [0, 0, 0];
        cube[axis] = side;
        cube[(axis + 1) % 3] = dense(u);
        cube[(axis + 2) % 3] = dense(v);
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
