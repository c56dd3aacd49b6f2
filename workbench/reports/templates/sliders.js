// Sliders to a pose, a pose to two drawings by one camera: what was chosen, and the whole model.

const get = id => document.getElementById(id), DEGREE = Math.PI / 180, AXES = ["x", "y", "z"];
const state = { pose: new Float64Array(3 * body.K), betas: new Float64Array(body.B), turn: 0.5, tilt: 0.1 };
const TOGGLES = [...document.querySelectorAll("input[data-part]")].map(input => input.id);
const PRESETS = {
  "as drawn": {},
  "elbows bent": { left_elbow: [0, -110, 0], right_elbow: [0, 110, 0] },
  "wrists twisted": { left_wrist: [170, 0, 0], right_wrist: [170, 0, 0] },
  "sitting": { left_hip: [-85, 0, 0], right_hip: [-85, 0, 0], left_knee: [90, 0, 0],
    right_knee: [90, 0, 0], left_shoulder: [0, 0, -60], right_shoulder: [0, 0, 60] },
  "reaching": { spine1: [15, 0, 0], spine3: [0, 25, 0], left_shoulder: [0, -50, 35],
    right_shoulder: [0, 30, 60], left_elbow: [0, -40, 0], neck: [0, 30, 0], left_knee: [40, 0, 0] },
};

function row(parent, name, low, high, step, unit, read, write) {
  const line = document.createElement("label"), text = document.createElement("span");
  const input = document.createElement("input"), shown = document.createElement("output");
  text.textContent = name;
  Object.assign(input, { type: "range", min: low, max: high, step });
  const refresh = () => { input.value = read(); shown.textContent = `${(+read()).toFixed(step < 1 ? 1 : 0)} ${unit}`; };
  input.addEventListener("input", () => { write(+input.value); refresh(); draw(); });
  line.append(text, input, shown);
  parent.append(line);
  refresh();
  return refresh;
}

const joint = get("joint"), refreshers = [];
body.joint_names.forEach((name, k) => joint.add(new Option(name.replace(/_/g, " "), k)));
joint.value = Math.max(0, body.joint_names.indexOf("left_elbow"));
AXES.forEach((axis, d) => refreshers.push(row(get("angles"), axis, -180, 180, 1, "°",
  () => state.pose[3 * joint.value + d] / DEGREE,
  value => { state.pose[3 * joint.value + d] = value * DEGREE; })));
for (let b = 0; b < body.B; b++) refreshers.push(row(get("betas"), `betas[${b}]${b || !DIRECTION ? "" : ` ${DIRECTION}`}`, -3, 3, 0.1, "sd",
  () => state.betas[b], value => { state.betas[b] = value; }));
const refresh = () => refreshers.forEach(one => one());
joint.addEventListener("change", refresh);
for (const [name, angles] of Object.entries(PRESETS)) {
  if (!Object.keys(angles).every(j => body.joint_names.includes(j))) continue;
  const button = document.createElement("button");
  button.textContent = name;
  button.addEventListener("click", () => { take({ pose: angles }); draw(); });
  get("presets").append(button);
}
TOGGLES.forEach(id => get(id).addEventListener("change", draw));
get("scale").addEventListener("input", draw);

function take(given) { // degrees by the joint's name, and betas, as in the page's address
  state.pose.fill(0);
  for (const [name, angles] of Object.entries(given.pose || {})) {
    const k = body.joint_names.indexOf(name);
    if (k >= 0) angles.forEach((angle, d) => { state.pose[3 * k + d] = angle * DEGREE; });
  }
  if (given.betas) state.betas.forEach((_, b) => { state.betas[b] = given.betas[b] || 0; });
  for (const id of TOGGLES) if (given[id] !== undefined) get(id).checked = given[id];
  refresh();
}

function paint(canvas, { points, faces }, away, most) {
  const context = canvas.getContext("2d"), { width, height } = canvas, N = points.length / 3;
  const size = height / 2.15, sin = Math.sin(state.turn), cos = Math.cos(state.turn);
  const up = Math.cos(state.tilt), lean = Math.sin(state.tilt), seen = new Float64Array(3 * N);
  for (let i = 0; i < N; i++) {
    const x = points[3 * i], y = points[3 * i + 1] - get.middle, z = points[3 * i + 2];
    const across = cos * x + sin * z, depth = cos * z - sin * x;
    seen[3 * i] = width / 2 + size * across;
    seen[3 * i + 1] = height / 2 - size * (up * y - lean * depth);
    seen[3 * i + 2] = size * (up * depth + lean * y);
  }
  const F = faces.length / 3, order = new Uint32Array(F), depths = new Float64Array(F);
  for (let f = 0; f < F; f++) {
    const [a, b, c] = faces.subarray(3 * f, 3 * f + 3);
    depths[f] = seen[3 * a + 2] + seen[3 * b + 2] + seen[3 * c + 2];
    order[f] = f;
  }
  order.sort((f, g) => depths[f] - depths[g]);
  context.clearRect(0, 0, width, height);
  context.lineWidth = 0.6;
  for (const f of order) {
    const [a, b, c] = faces.subarray(3 * f, 3 * f + 3);
    const p = [a, b, c].map(v => seen.subarray(3 * v, 3 * v + 3));
    const u = [0, 1, 2].map(d => p[1][d] - p[0][d]), w = [0, 1, 2].map(d => p[2][d] - p[0][d]);
    const n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
    const light = Math.abs(0.3 * n[0] + 0.5 * n[1] - 0.8 * n[2]) / (Math.hypot(...n) || 1);
    const flat = away ? cividis((away[a] + away[b] + away[c]) / 3 / most) : [211, 220, 230];
    const fill = `rgb(${flat.map(x => Math.round(x * (0.55 + 0.45 * Math.min(1, light)))).join(",")})`;
    context.fillStyle = context.strokeStyle = fill;
    context.beginPath();
    p.forEach((q, i) => context[i ? "lineTo" : "moveTo"](q[0], q[1]));
    context.closePath();
    context.fill();
    context.stroke();
  }
}

function volume({ points, faces }) {
  let six = 0;
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map(i => points.subarray(3 * faces[f + i], 3 * faces[f + i] + 3));
    six += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return six / 6;
}

function draw() {
  const keep = Object.fromEntries(TOGGLES.map(id => [id, get(id).checked]));
  const chosen = body.drawn(state.pose, state.betas, keep);
  const whole = { points: body.vertices(state.pose, state.betas), faces: body.faces };
  const n = chosen.points.length / 3, away = new Float64Array(n);
  let mean = 0, most = 0;
  for (let i = 0; i < n; i++) {
    const same = chosen.of ? chosen.of[i] : i;
    away[i] = 1000 * Math.hypot(...[0, 1, 2].map(d => chosen.points[3 * i + d] - whole.points[3 * same + d]));
    mean += away[i] / n;
    most = Math.max(most, away[i]);
  }
  get.middle = get.middle ?? (() => {
    let low = Infinity, high = -Infinity;
    for (let i = 1; i < body.template.length; i += 3) { low = Math.min(low, body.template[i]); high = Math.max(high, body.template[i]); }
    return (low + high) / 2;
  })();
  paint(get("chosen"), chosen, away, +get("scale").value);
  paint(get("whole"), whole, null, 1);
  get("measured").textContent = `mean ${mean.toFixed(2)} mm, largest ${most.toFixed(1)} mm; volume ` +
    `${(1000 * volume(chosen)).toFixed(2)} l here, ${(1000 * volume(whole)).toFixed(2)} l of ${body.model}`;
  get("most").textContent = `${get("scale").value} mm`;
  const said = { pose: {}, betas: [...state.betas] };
  body.joint_names.forEach((name, k) => {
    const angles = [0, 1, 2].map(d => Math.round(10 * state.pose[3 * k + d] / DEGREE) / 10);
    if (angles.some(Boolean)) said.pose[name] = angles;
  });
  history.replaceState(null, "", "#" + encodeURIComponent(JSON.stringify({ ...said, ...keep })));
}

for (const canvas of document.querySelectorAll("canvas")) {
  canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    if (!event.buttons) return;
    state.turn += event.movementX / 120;
    state.tilt = Math.max(-1.5, Math.min(1.5, state.tilt + event.movementY / 200));
    draw();
  });
}
function turning() {
  if (get("turntable").checked) { state.turn += 0.02; draw(); requestAnimationFrame(turning); }
}
get("turntable").addEventListener("change", turning);
const bar = get("bar").getContext("2d");
for (let x = 0; x < 200; x++) { bar.fillStyle = `rgb(${cividis(x / 200).map(Math.round).join(",")})`; bar.fillRect(x, 0, 1, 10); }
try { take(location.hash.length > 1 ? JSON.parse(decodeURIComponent(location.hash.slice(1))) : START ?? { pose: PRESETS["elbows bent"], pose_shapes: false }); }
catch { take({}); }
draw();
