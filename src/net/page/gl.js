// Functions that the two WebGL pictures share.

/**
 * A program of the two shaders, and a function that finds a uniform by its name.
 *
 * @throws {Error} with the compiler's message
 */
export function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  // A lost context cannot link; it is restored later.
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`a shader is refused: ${[gl.getProgramInfoLog(made), ...logs].join("\n")}`);
  }
  const places = new Map();
  const uniform = (name) => {
    if (!places.has(name)) places.set(name, gl.getUniformLocation(made, name));
    return places.get(name);
  };
  return { program: made, uniform };
}

/** Sets the resolution of a canvas to its size on the screen, times `scale`; true when its size changed. */
export function fit(canvas, scale = 1) {
  const ratio = Math.min(devicePixelRatio, 2) * scale;
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width === width && canvas.height === height) return false;
  canvas.width = width;
  canvas.height = height;
  return true;
}

/** Luminance of linear Rec. 709. */
export function luminance([red, green, blue]) {
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}
