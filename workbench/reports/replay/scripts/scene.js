// A small scene in WebGL 2: shaded meshes, lines and dots, seen by a camera that turns about a
// middle, or by a calibrated one, whose lens is computed for every vertex.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const size = Math.hypot(...a) || 1; return a.map(x => x / size); };
const FOCAL = 2.4; // of the turning camera, in halves of the picture's height

const VERTEX_SHADER = `#version 300 es
precision highp float;
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 paint;
uniform mat4 world_to_camera;
uniform vec3 shift;
uniform bool calibrated;
uniform vec4 lens; // focal lengths and centre, in px; or the focal length of the turning camera
uniform vec2 size; // of the picture, in px
uniform float k[5]; // k1 k2 p1 p2 k3
uniform float dot_size;
uniform float lift; // m, by which marks are brought towards the eye, along the ray
out vec3 facing;
out vec3 colour;
void main() {
  vec4 p = world_to_camera * vec4(place + shift, 1.0);
  p.xyz *= 1.0 - lift / max(length(p.xyz), 0.1);
  facing = mat3(world_to_camera) * normal;
  colour = paint;
  gl_PointSize = dot_size;
  float near = 0.02, far = 60.0;
  if (calibrated) { // x to the right, y down, z forward
    float x = p.x / p.z, y = p.y / p.z, r = x * x + y * y;
    float s = 1.0 + r * (k[0] + r * (k[1] + r * k[4]));
    float u = lens.x * (x * s + 2.0 * k[2] * x * y + k[3] * (r + 2.0 * x * x)) + lens.z;
    float v = lens.y * (y * s + k[2] * (r + 2.0 * y * y) + 2.0 * k[3] * x * y) + lens.w;
    gl_Position = vec4((2.0 * u / size.x - 1.0) * p.z, (1.0 - 2.0 * v / size.y) * p.z,
                       ((far + near) * p.z - 2.0 * far * near) / (far - near), p.z);
    facing = vec3(facing.x, -facing.y, -facing.z);
  } else { // x to the right, y up, z backward
    gl_Position = vec4(lens.x * p.x * size.y / size.x, lens.x * p.y,
                       (-(far + near) * p.z - 2.0 * far * near) / (far - near), -p.z);
  }
}`;

const FRAGMENT_SHADER = `#version 300 es
precision highp float;
in vec3 facing;
in vec3 colour;
uniform bool lit;
out vec4 shown;
void main() {
  float light = 1.0;
  if (lit) {
    vec3 n = normalize(facing);
    if (n.z < 0.0) n = -n;
    light = 0.35 + 0.65 * max(0.0, dot(n, normalize(vec3(0.35, 0.65, 0.75))));
  }
  shown = vec4(colour * light, 1.0);
}`;

class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("it has no WebGL 2");
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "its WebGL 2 stopped");
    gl.useProgram(program);
    this.uniform = Object.fromEntries(
      ["world_to_camera", "shift", "calibrated", "lens", "size", "k", "dot_size", "lift", "lit"]
        .map(name => [name, gl.getUniformLocation(program, name)]));
    gl.enable(gl.DEPTH_TEST);
    this.buffers = {};
    Object.assign(this, { turn: 0, tilt: 0.08, distance: 3, middle: [0, 0, 0], up: [0, 1, 0] });
  }

  axes() { // right, up, and towards the eye, in the world
    const u = this.up, other = Math.abs(u[1]) > 0.9 ? [0, 0, 1] : [0, 1, 0];
    const first = unit(cross(cross(u, other), u)), second = cross(u, first);
    const c = Math.cos(this.turn), s = Math.sin(this.turn);
    const level = first.map((x, d) => c * x + s * second[d]);
    const back = level.map((x, d) => Math.cos(this.tilt) * x + Math.sin(this.tilt) * u[d]);
    const right = unit(cross(u, back));
    return [right, cross(back, right), back];
  }

  begin(lens) { // clears the picture, and takes the lens of a calibrated camera or the turning one
    const { gl, canvas, uniform } = this, ratio = this.ratio = Math.min(2, devicePixelRatio || 1);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform1i(uniform.calibrated, lens ? 1 : 0);
    if (lens) {
      const { left, top, scale } = this.image(lens), [W, H] = lens.size, R = lens.R;
      gl.viewport(left * ratio, height - (top + scale * H) * ratio, scale * W * ratio, scale * H * ratio);
      gl.uniformMatrix4fv(uniform.world_to_camera, false,
        [R[0], R[3], R[6], 0, R[1], R[4], R[7], 0, R[2], R[5], R[8], 0, ...lens.translation, 1]);
      gl.uniform4f(uniform.lens, ...lens.focal, ...lens.centre);
      gl.uniform2f(uniform.size, W, H);
      gl.uniform1fv(uniform.k, lens.distortion);
      return;
    }
    const [r, u, b] = this.axes(), eye = this.middle.map((x, d) => x + this.distance * b[d]);
    gl.uniformMatrix4fv(uniform.world_to_camera, false,
      [r[0], u[0], b[0], 0, r[1], u[1], b[1], 0, r[2], u[2], b[2], 0, -dot(r, eye), -dot(u, eye), -dot(b, eye), 1]);
    gl.uniform4f(uniform.lens, FOCAL, FOCAL, 0, 0);
    gl.uniform2f(uniform.size, width, height);
    gl.uniform1fv(uniform.k, [0, 0, 0, 0, 0]);
  }

  image(lens) { // where the image of a calibrated camera lies on the canvas, in CSS px
    const [low, under, high, over] = lens.crop, { clientWidth: w, clientHeight: h } = this.canvas;
    const scale = Math.min(w / (high - low), h / (over - under));
    return { left: w / 2 - scale * (low + high) / 2, top: h / 2 - scale * (under + over) / 2, scale };
  }

  place(point) { // where the turning camera shows a point, in CSS px
    const [r, u, b] = this.axes(), { clientWidth: w, clientHeight: h } = this.canvas;
    const p = point.map((x, d) => x - this.middle[d] - this.distance * b[d]), far = -dot(b, p);
    return [w / 2 + h / 2 * FOCAL * dot(r, p) / far, h / 2 - h / 2 * FOCAL * dot(u, p) / far];
  }

  mesh({ points, normals }, faces, paint, shift) { // paint: one colour, or three numbers a vertex
    const { gl } = this;
    this.attribute("points", points, 0);
    this.attribute("normals", normals, 1);
    if (paint.length === 3) this.colour(paint);
    else this.attribute("paint", paint, 2);
    if (this.faces !== faces) {
      this.buffers.faces ??= gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers.faces);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
      this.faces = faces;
    }
    gl.uniform3f(this.uniform.shift, ...shift);
    gl.uniform1i(this.uniform.lit, 1);
    gl.drawElements(gl.TRIANGLES, faces.length, gl.UNSIGNED_INT, 0);
  }

  lines(points, colour, shift) { this.marks(this.gl.LINES, points, colour, shift); }

  dots(points, paint, shift, size, behind) {
    this.gl.uniform1f(this.uniform.dot_size, size * this.ratio);
    this.marks(this.gl.POINTS, points, paint, shift, behind);
  }

  // paint: one colour, or three numbers a point; in front of everything unless marks may also be
  // hidden, by what is more than `behind` m before them
  marks(kind, points, paint, shift, behind = null) {
    const { gl } = this;
    if (!points.length) return;
    this.attribute("marks", points, 0);
    gl.disableVertexAttribArray(1);
    if (paint.length === 3) this.colour(paint);
    else this.attribute("paint", paint, 2);
    gl.uniform3f(this.uniform.shift, ...shift);
    gl.uniform1f(this.uniform.lift, behind ?? 0);
    gl.uniform1i(this.uniform.lit, 0);
    if (behind === null) gl.disable(gl.DEPTH_TEST);
    gl.drawArrays(kind, 0, points.length / 3);
    gl.enable(gl.DEPTH_TEST);
    gl.uniform1f(this.uniform.lift, 0);
  }

  colour(rgb) {
    this.gl.disableVertexAttribArray(2);
    this.gl.vertexAttrib3f(2, ...rgb);
  }

  attribute(name, numbers, location) {
    const { gl } = this;
    this.buffers[name] ??= gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, 3, gl.FLOAT, false, 0, 0);
  }

  handle(draw) { // dragging and the arrow keys turn; a finger moved up or down scrolls the page
    const { canvas } = this;
    canvas.style.touchAction = "pan-y";
    canvas.tabIndex = 0;
    const turned = (across, upward) => {
      this.turn += across;
      this.tilt = Math.max(-1.4, Math.min(1.4, this.tilt + upward));
      draw();
    };
    canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", event => {
      if (event.buttons) turned(-event.movementX / 120, event.pointerType === "touch" ? 0 : event.movementY / 160);
    });
    canvas.addEventListener("keydown", event => {
      const step = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, 0.12], ArrowDown: [0, -0.12] }[event.key];
      if (!step) return;
      event.preventDefault();
      turned(...step);
    });
  }
}

function normalsOf(points, faces) { // not of unit length; the shader scales them
  const found = new Float32Array(points.length);
  for (let f = 0; f < faces.length; f += 3) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const i of [a, b, c]) { found[i] += x; found[i + 1] += y; found[i + 2] += z; }
  }
  return found;
}
