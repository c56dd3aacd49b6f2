// A replay: bodies along the runs of several solvers, moved along directions, drawn from a
// posterior, or shown one after the other. It is computed here from the numbers that Python wrote.

// Okabe and Ito's colours; SOLVER_COLOURS, from plots/palette.py, has that of each known solver
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8c6bb1", "#6b7280"];
const GREY = [0.72, 0.77, 0.82], ORANGE = [0.84, 0.37, 0.0], RED = [0.8, 0.1, 0.1], SKIN = [0.83, 0.86, 0.9];
const PATH = [0.45, 0.55, 0.65];
const PALE_ORANGE = [0.95, 0.66, 0.42];
const BEHIND = 0.02; // m: points of a scan are seen through as much of a body
const FAR = 0.05; // m from the solution: fully orange
const CACHED = 600; // surfaces of small bodies; fewer of large ones
const FEW = 8; // states that have a button each
const SLOWLY = 0.8; // states a second, where they are no frames
const CLOCKS = {
  evaluations: [run => run.evaluations.map(n => Math.max(n, 1)), n => `${n} evaluation${n === 1 ? "" : "s"}`],
  iterations: [run => run.iterates.map(i => i + 1), n => `${n - 1} iteration${n === 2 ? "" : "s"}`],
  seconds: [run => run.seconds.map(s => Math.max(s, 1e-3)), s => `${short(s)} s`],
};

const rgb = colour => [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16) / 255);
const pale = colour => colour.map(x => 0.3 + 0.7 * x);

function coloursOf(names) { // of solvers as in the figures; others get colours that are free
  const own = names.map(name => SOLVER_COLOURS[name]);
  const give = choose => names.forEach((name, i) => { own[i] ??= choose(name, i); });
  give(name => {
    const last = SOLVER_COLOURS[name.split(" ").at(-1)]; // of a solver in stages, or from several starts
    return own.includes(last) ? undefined : last;
  });
  give((_, i) => COLOURS.find(one => !own.includes(one)) ?? COLOURS[i % COLOURS.length]);
  return own;
}

function short(x) { // four digits at most
  if (x === null || x === undefined) return "–";
  const size = Math.abs(x);
  return size >= 1e4 || (x && size < 1e-2) ? x.toExponential(1) : String(+x.toPrecision(4));
}

function listed(texts) {
  return texts.length < 2 ? texts.join("") : `${texts.slice(0, -1).join(", ")} and ${texts.at(-1)}`;
}

class Replay {
  constructor(root, data, body) {
    Object.assign(this, data, { body });
    this.lenses = data.views.map(view => new Lens(view));
    this.lenses.forEach(lens => {
      lens.rays = lens.observed.map(pixel => lens.ray(pixel));
      lens.cropTo(lens.observed.filter((_, m) => lens.confidence[m] > this.least_confidence));
    });
    this.hand = Float64Array.from(this.here ?? []); // a start that is set by hand, on a live page
    this.size = this.hand.length;
    this.surfaces = new Map();
    this.series = data.series.map(one => new Series(this, one));
    this.whole = this.here ? this.surface(this.here) : this.series[0].surface(this.series[0].count - 1);
    this.mode = this.runs.length || this.live ? "runs" : this.directions.length ? "directions" : this.draws.count ? "draws" : "series0";
    Object.assign(this, { clock: "evaluations", share: 1, lens: null, focus: 0, rays: true, direction: 0, amount: 0, draw: 0, zoom: 1, playing: 0, milliseconds: [] });
    this.build(root);
    this.setUp();
    this.scene.handle(() => this.paint());
    addEventListener("resize", () => this.paint());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paint());
    this.paint();
  }

  // Numbers.

  arguments(x) { // pose, betas and trans of a row of numbers
    const { K, B } = this.body;
    return [x.subarray(0, 3 * K), x.subarray(3 * K, 3 * K + B), x.subarray(3 * K + B)];
  }

  surface(x) { // points and normals (3 N), in m
    const [pose, betas, trans] = this.arguments(x), points = Float32Array.from(this.body.vertices(pose, betas));
    for (let i = 0; i < points.length; i++) points[i] += trans[i % 3];
    const joints = this.body.posedJoints.map(place => place.map((y, d) => y + trans[d]));
    return { points, normals: normalsOf(points, this.body.faces), joints };
  }

  kept(key, make) { // what was computed before under this key, or is computed now
    if (!this.surfaces.has(key)) {
      if (this.surfaces.size * this.body.faces.length > CACHED * 12000) this.surfaces.clear();
      this.surfaces.set(key, make());
    }
    return this.surfaces.get(key);
  }

  iterate(run, i) {
    return this.kept(`${run.name}/${i}`, () => this.surface(run.x.subarray(i * this.size, (i + 1) * this.size)));
  }

  places(surface) { // (3 M) m
    if (this.landmarks.joints) return Float32Array.from(surface.joints.flat());
    return means(this.landmarks, this.landmarks.names.length, surface);
  }

  get one() { return this.mode.startsWith("series") ? this.series[this.mode.slice(6)] : null; }

  times(run) { return CLOCKS[this.clock][0](run); }

  get lowest() { return Math.min(...this.runs.flatMap(run => run.cost)); }

  get axis() {
    if (!this.runs.some(run => run.cost.length)) return [1, 2];
    const all = this.runs.flatMap(run => this.times(run)), low = Math.min(...all);
    return [low, Math.max(...all, low * 1.001)];
  }

  get time() { // where the replay stands on the axis
    const [low, high] = this.axis;
    return low * (high / low) ** this.share;
  }

  now(run) { // the last iterate that a run has reached
    const times = this.times(run), time = this.time * (1 + 1e-9);
    let i = 0;
    while (i + 1 < times.length && times[i + 1] <= time) i++;
    return i;
  }

  moved() { // the numbers of the body that is shown along a direction, or of a draw
    const x = Float64Array.from(this.here), size = x.length;
    if (this.mode === "draws") return this.draws.x.subarray(this.draw * size, (this.draw + 1) * size);
    const { step, reach } = this.directions[this.direction];
    for (let i = 0; i < size; i++) x[i] += this.amount * reach * step[i];
    return x;
  }

  get chosen() { // the runs that are shown
    const runs = this.lens ? [this.runs[this.focus]] : this.runs.filter(run => run.on);
    return runs.filter(run => run?.cost.length);
  }

  // What is drawn.

  shown() { // surfaces with their paint, and the runs they belong to
    if (this.one) return this.one.shown();
    if (this.mode === "runs") {
      const found = this.chosen.map(run => ({ name: run.name, surface: this.iterate(run, this.now(run)), paint: pale(rgb(run.colour)) }));
      if (!this.live || (this.lens && found.length)) return found;
      return [{ name: "start", surface: this.surface(this.hand), paint: GREY }, ...found];
    }
    const surface = this.surface(this.moved()), paint = new Float32Array(surface.points.length);
    for (let i = 0; i < paint.length; i += 3) {
      const away = Math.hypot(...[0, 1, 2].map(d => surface.points[i + d] - this.whole.points[i + d]));
      const share = Math.min(1, away / FAR);
      for (let d = 0; d < 3; d++) paint[i + d] = GREY[d] + share * (ORANGE[d] - GREY[d]);
    }
    return [{ surface, paint }];
  }

  setUp() { // the camera stands in front of the body, and every body has the room that it needs
    const { scene, whole: { points }, lenses } = this, middle = [0, 0, 0];
    if (lenses.length) scene.up = unit([0, 1, 2].map(d => lenses.reduce((sum, lens) => sum + lens.up[d], 0)));
    for (let i = 0; i < points.length; i++) middle[i % 3] += 3 * points[i] / points.length;
    scene.middle = middle;
    const R = this.here ? rotation(...this.here.subarray(0, 3)) : null, front = R ? [R[2], R[5], R[8]] : this.front;
    let best = -2;
    for (let k = 0; k < 72; k++) {
      const before = scene.turn;
      scene.turn = k * Math.PI / 36;
      const seen = dot(scene.axes()[2], front);
      if (seen > best) best = seen; else scene.turn = before;
    }
    scene.turn += 0.35;
    const extent = surface => { // m: the lowest and highest, and how far out, upwards of the middle
      const { points } = surface, found = [Infinity, -Infinity, 0, 0];
      for (let i = 0; i < points.length; i += 3) {
        const p = [0, 1, 2].map(d => points[i + d] - middle[d]), up = dot(p, scene.up);
        const out = Math.hypot(...p.map((x, d) => x - up * scene.up[d])), near = out / FOCAL; // as seen from nearby
        [up - near, up + near, out].forEach((x, k) => { found[k] = k ? Math.max(found[k], x) : Math.min(found[k], x); });
      }
      return found;
    };
    let [low, high, out] = extent(this.whole);
    const together = this.series.some(one => one.surfaces && one.columns.length > 1); // none has run away
    const most = together ? Infinity : 0.8 * (high - low); // what has run away does not make the others small
    for (const other of this.series.flatMap(one => one.some)) {
      const [under, over, beside] = extent(other);
      low = Math.max(Math.min(low, under), Math.min(low, -most));
      high = Math.min(Math.max(high, over), Math.max(high, most));
      out = Math.min(Math.max(out, beside), Math.max(out, most));
    }
    this.middle = middle.map((x, d) => x + (low + high) / 2 * scene.up[d]);
    this.room = [(together ? 2.3 : 1.9) * out, (together ? 1.2 : 1.05) * (high - low)]; // m, across and upwards
  }

  paint() {
    const begun = performance.now(), { scene, room: [wide, tall] } = this, all = this.shown();
    const ratio = scene.canvas.clientHeight / scene.canvas.clientWidth;
    let columns = 1, most = 0; // as many columns as show the bodies largest
    for (let n = 1; n <= all.length; n++) {
      const size = Math.min(1 / (n * wide * ratio), 1 / (Math.ceil(all.length / n) * tall));
      if (size > most) { most = size; columns = n; }
    }
    const rows = Math.ceil(all.length / columns);
    scene.distance = this.zoom * FOCAL / 2 * Math.max(columns * wide * ratio, rows * tall);
    scene.middle = this.middle.map((x, d) => x + (this.one?.travelled(this.one.at)[d] ?? 0));
    scene.begin(this.lens);
    const [right, up] = scene.axes(), labels = [];
    all.forEach(({ surface, paint, name }, i) => {
      const row = Math.floor(i / columns), inRow = Math.min(columns, all.length - row * columns);
      const across = (i % columns - (inRow - 1) / 2) * wide, above = ((rows - 1) / 2 - row) * tall;
      const shift = right.map((x, d) => x * across + up[d] * above);
      scene.mesh(surface, this.body.faces, paint, shift);
      if (!this.lens) this.paintObserved(surface, shift);
      if (name) labels.push([name, scene.middle.map((x, d) => x + shift[d] + up[d] * tall * 0.5)]);
    });
    this.paintOver(all, labels);
    if (this.mode === "runs") this.curves.draw(
      this.runs.filter(run => run.on && run.cost.length).map(run => ({ run, at: this.times(run), colour: run.colour })),
      this.axis, this.time, run => this.now(run));
    this.sentence.textContent = this.said();
    this.milliseconds.push(performance.now() - begun);
  }

  paintObserved(surface, shift) { // points in space, and lines to them from those of the body
    const { scene, one } = this, lines = [], dots = [];
    if (one?.trail) scene.lines(one.trail(surface), PATH, shift);
    if (one?.scan) scene.dots(one.scan, one.scanPaint, shift, 2.5, BEHIND);
    if (!this.rays) return;
    this.rayLines(surface, lines);
    const join = (place, found) => {
      if (Number.isNaN(place[0])) return;
      lines.push(...place, ...found);
      if (!one?.scan) dots.push(...place);
    };
    if (one?.links) {
      const [from, to] = one.joined;
      to.forEach((place, i) => join(place, from[i]));
    }
    scene.lines(Float32Array.from(lines), RED, shift);
    scene.dots(Float32Array.from(dots), RED, shift, 4);
  }

  rayLines(surface, lines) { // from each landmark to the ray of every camera that observed it
    const places = this.places(surface);
    for (const lens of this.lenses) lens.rays.forEach((ray, m) => {
      if (!(lens.confidence[m] > this.least_confidence)) return;
      const place = places.subarray(3 * m, 3 * m + 3);
      lines.push(...place, ...lens.nearestOnRay([...place], ray));
    });
  }

  paintOver(all, labels) { // names above the bodies, or keypoints in the image of a camera
    const { scene, over, lens } = this, g = over.getContext("2d"), style = getComputedStyle(over);
    Object.assign(over, { width: scene.canvas.width, height: scene.canvas.height });
    g.scale(scene.ratio, scene.ratio);
    const ink = style.getPropertyValue("--ink");
    Object.assign(g, { font: "12px system-ui, sans-serif", textAlign: "center", textBaseline: "top", fillStyle: ink });
    if (!lens) {
      for (const [name, point] of labels.length > 1 ? labels : []) {
        const [x, y] = scene.place(point), [next] = scene.place(point.map((p, d) => p + this.room[0] * scene.axes()[0][d]));
        g.fillText(name, x, Math.max(2, y), 0.95 * (next - x)); // condensed to the room of a body
      }
      return;
    }
    const { left, top, scale } = scene.image(lens), place = ([u, v]) => [left + scale * u, top + scale * v];
    g.strokeStyle = style.getPropertyValue("--line");
    g.strokeRect(left, top, scale * lens.size[0], scale * lens.size[1]);
    const places = this.places(all[0].surface);
    let sum = 0, count = 0;
    lens.observed.forEach((pixel, m) => {
      if (!(lens.confidence[m] > this.least_confidence)) return;
      const found = lens.pixel([...places.subarray(3 * m, 3 * m + 3)]), a = place(found), b = place(pixel);
      sum += Math.hypot(found[0] - pixel[0], found[1] - pixel[1]);
      count++;
      Object.assign(g, { globalAlpha: Math.min(1, lens.confidence[m]), strokeStyle: ink, lineWidth: 1.3 });
      line(g, [a, b]);
      g.beginPath();
      g.arc(...b, 3, 0, 7);
      g.stroke();
      g.strokeStyle = "#D55E00";
      line(g, [[a[0] - 3, a[1] - 3], [a[0] + 3, a[1] + 3]]);
      line(g, [[a[0] - 3, a[1] + 3], [a[0] + 3, a[1] - 3]]);
    });
    g.globalAlpha = 1;
    this.error = [sum / count, count];
  }

  get offInImage() { // a sentence on the keypoints in the image that is looked at
    if (!this.lens) return "";
    const [mean, count] = this.error;
    return count ? ` In ${this.lens.name} its ${count} keypoints are ${mean.toFixed(1)} px off on average.` : ` In ${this.lens.name} no keypoint was observed.`;
  }

  said() {
    if (this.one) return this.one.text + this.offInImage;
    if (this.mode === "draws")
      return `Draw ${this.draw + 1} of ${this.draws.count} from ${this.draws.by}. The farther a point is from the solution, the more orange it is, up to 5 cm.`;
    if (this.mode === "directions") {
      const { name, kind, change, reach, exact } = this.directions[this.direction];
      const units = this.amount * reach, place = (this.amount + 1) / 2 * (exact.length - 1);
      const i = Math.min(exact.length - 2, Math.floor(place)), t = place - i;
      const truly = exact[i] + t * (exact[i + 1] - exact[i]);
      return `Along “${name}”, which is ${kind}: moved by ${units.toFixed(2)}, the whitened residuals change by ${short(change * Math.abs(units))} sigma altogether to first order, and truly by ${short(truly)} sigma.`;
    }
    const runs = this.chosen;
    if (!runs.length) return this.runs.length ? "No solver is chosen." : "Nothing was solved yet.";
    const costs = listed(runs.map(run => `${run.name} ${short(run.cost[this.now(run)])}`));
    const time = this.clock === "seconds" ? this.time : Math.floor(this.time * (1 + 1e-9));
    return `Costs after ${CLOCKS[this.clock][1](time)}: ${costs}.${this.offInImage}`;
  }

  // Controls.

  build(root) {
    const make = (tag, parent, properties = {}) => {
      const made = Object.assign(document.createElement(tag), properties);
      parent.append(made);
      return made;
    };
    const row = (parent, name) => {
      const made = make("div", parent, { className: "replay-row" });
      if (name) make("span", made, { className: "name", textContent: name });
      made.setAttribute("role", "group");
      if (name) made.setAttribute("aria-label", name);
      return made;
    };
    const button = (parent, text, press, on) => {
      const made = make("button", parent, { type: "button", textContent: text });
      if (on !== undefined) made.setAttribute("aria-pressed", on);
      made.addEventListener("click", () => { press(made); this.paint(); });
      return made;
    };
    const choice = (parent, options, chosen, choose) => options.forEach(([text, value]) =>
      button(parent, text, pressed => {
        choose(value);
        parent.querySelectorAll("button").forEach(one => one.setAttribute("aria-pressed", one === pressed));
      }, value === chosen));
    const top = make("div", root);
    const modes = [["the solvers' way", "runs", this.runs.length],
                   ["directions hardly seen", "directions", this.directions.length],
                   [this.draws.name, "draws", this.draws.count],
                   ...this.series.map(({ name, count }, i) => [name, `series${i}`, count])].filter(([, , some]) => some);
    if (modes.length > 1) choice(row(top, "show"), modes, this.mode, mode => {
      this.stop();
      this.mode = mode;
      this.anywhere?.click();
      this.sync();
    });
    const columns = this.columns = make("div", top, { className: "replay-columns" });
    const main = make("div", columns), scene = make("div", main), left = make("div", main);
    const stage = make("div", scene, { className: "replay-stage" });
    const canvas = make("canvas", stage);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The body in 3D. Drag it or use the arrow keys to turn it.");
    this.scene = new Scene(canvas);
    this.over = make("canvas", stage, { className: "over" });
    const time = this.sliding = row(scene);
    this.player = button(time, "▶", () => this.playing ? this.stop() : this.play());
    this.slider = make("input", time, { type: "range", min: 0, max: 1000, value: 1000 });
    this.slider.addEventListener("input", () => { this.stop(); this.take(this.slider.value / 1000); });
    this.rows = { runs: [], directions: [], draws: [] };
    const which = row(left);
    const select = make("select", which);
    select.setAttribute("aria-label", "direction");
    this.directions.forEach(({ name, kind }, i) => select.add(new Option(`${name} (${kind})`, i)));
    select.addEventListener("change", () => { this.direction = +select.value; this.paint(); });
    const solvers = row(left, "solvers");
    this.chips = solvers;
    this.add = run => { // a run, with a button that shows or hides it
      const i = this.chips.querySelectorAll("button").length;
      Object.assign(run, { on: true, colour: coloursOf(this.runs.map(one => one.name))[i] });
      const chip = button(solvers, run.name, () => {
        if (this.lens) this.focus = i;
        else run.on = !run.on;
        this.sync();
      }, true);
      chip.style.setProperty("--colour", run.colour);
      chip.title = `${run.status}, ${run.iterations} iterations, cost ${short(run.cost.at(-1))}`;
    };
    this.runs.forEach(this.add);
    this.rows.directions.push(which);
    this.rows.runs.push(solvers);
    this.series.forEach((one, i) => { this.rows[`series${i}`] = this.chooseState(one, row, button, left); });
    if (this.lenses.length) {
      const cameras = row(left, "seen from");
      choice(cameras, [["anywhere", null], ...this.lenses.map(lens => [lens.name, lens])], null, lens => { this.lens = lens; this.sync(); });
      this.rows.runs.push(cameras);
      this.series.forEach((one, i) => { if (one.columns.length === 1) this.rows[`series${i}`].push(cameras); });
      this.anywhere = cameras.querySelector("button");
    }
    if (this.lenses.length || this.series.some(one => one.links)) {
      const label = make("label", row(left));
      const box = make("input", label, { type: "checkbox", checked: true });
      label.append(" lines from the body to what was observed");
      box.addEventListener("change", () => { this.rays = box.checked; this.paint(); });
    }
    this.series.forEach((one, i) => { if (one.scan) this.rows[`series${i}`].push(this.key(one, row(left, "distance"), make)); });
    this.sentence = make("p", left, { className: "replay-said" });
    this.sentence.setAttribute("aria-live", "polite");
    this.caption = root.parentElement.querySelector("figcaption");
    this.captioned = this.mode;
    left.append(this.caption); // beside the body, where there is room
    this.side = make("div", columns);
    if (this.runs.length || this.live) {
      choice(row(this.side, "clock"), Object.keys(CLOCKS).map(name => [name, name]), "evaluations", clock => { this.clock = clock; });
      const charts = make("div", this.side, { className: "replay-curves" });
      this.curves = new Curves(charts, [
        ["cost above the lowest", run => run.cost.map(cost => cost - this.lowest)],
        ["optimality", run => run.optimality],
        ["damping", run => run.damping],
        ["condition number of the Jacobian", run => run.condition],
        ["rank of the data alone", run => run.rank ?? [], true],
      ], share => { this.stop(); this.take(share); });
    }
    this.sync();
  }

  chooseState(series, row, button, left) { // rows of buttons: for each of a few states, for each column
    const rows = [], make = (name, labels, press) => {
      const made = row(left, name);
      rows.push(made);
      return labels.map((label, i) => button(made, label, () => { this.stop(); press(i); this.sync(); }, false));
    };
    series.states = series.frames || series.count > FEW || series.count < 2 ? [] : make(series.columns.length > 1 ? "from" : series.name, series.labels, i => { series.at = i; });
    series.chips = series.columns.length < 2 ? [] : make("bodies", series.columns, i => { series.on[i] = !series.on[i]; });
    series.chips.forEach((chip, i) => chip.style.setProperty("--colour", i ? series.colours[i - 1] : "var(--soft)"));
    return rows;
  }

  key(series, parent, make) { // which colour stands for which distance of a point to the surface
    make("span", parent, { textContent: "0" });
    const bar = make("canvas", parent, { width: 120, height: 10 }), g = bar.getContext("2d");
    for (let x = 0; x < 120; x++) { g.fillStyle = `rgb(${cividis(x / 120).map(Math.round).join(",")})`; g.fillRect(x, 0, 1, 10); }
    make("span", parent, { textContent: `${+(1000 * series.scale).toPrecision(2)} mm or more` });
    return parent;
  }

  sync() { // what belongs to the mode is shown, and the slider stands where it should
    const own = new Set(this.rows[this.mode]), { one } = this;
    for (const made of Object.values(this.rows).flat()) { made.hidden = !own.has(made); made.style.display = made.hidden ? "none" : ""; }
    one?.look();
    const series = [this.mode, this.captioned].every(mode => mode.startsWith("series"));
    this.caption.hidden = this.mode !== this.captioned && !series; // it is about what the page opens with
    one?.states.forEach((state, i) => state.setAttribute("aria-pressed", i === one.at));
    one?.chips.forEach((chip, i) => chip.setAttribute("aria-pressed", one.on[i]));
    this.sliding.style.display = one && one.count < 2 ? "none" : "";
    this.slider.step = one && one.count > 1 ? 1000 / (one.count - 1) : 1;
    this.side.hidden = this.mode !== "runs";
    this.columns.classList.toggle("alone", this.side.hidden);
    this.chips.querySelectorAll("button").forEach((chip, i) =>
      chip.setAttribute("aria-pressed", this.lens ? i === this.focus : this.runs[i].on));
    const name = { runs: "time along the runs", directions: "how far along the direction", draws: "which draw" };
    this.slider.setAttribute("aria-label", one ? `which of the ${one.name}` : name[this.mode]);
    this.slider.value = 1000 * this.given;
  }

  get given() { // the slider's place, from 0 to 1
    if (this.mode === "runs") return this.share;
    if (this.mode === "directions") return (this.amount + 1) / 2;
    if (this.one) return this.one.count > 1 ? this.one.at / (this.one.count - 1) : 0;
    return this.draws.count > 1 ? this.draw / (this.draws.count - 1) : 0;
  }

  take(place) {
    if (this.mode === "runs") this.share = place;
    else if (this.mode === "directions") this.amount = 2 * place - 1;
    else if (this.one) this.one.at = Math.round(place * (this.one.count - 1));
    else this.draw = Math.round(place * (this.draws.count - 1));
    if (this.one) this.sync();
    else this.slider.value = 1000 * place;
    this.paint();
  }

  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.player.textContent = "▶";
    this.player.setAttribute("aria-label", "play");
    this.sentence.setAttribute("aria-live", "polite");
  }

  play() {
    const begun = performance.now(), from = this.given >= 1 ? 0 : this.given;
    this.player.textContent = "❚❚";
    this.player.setAttribute("aria-label", "stop");
    this.sentence.setAttribute("aria-live", "off"); // not every frame is read out
    const tick = at => {
      const seconds = (at - begun) / 1000;
      this.playing = requestAnimationFrame(tick);
      if (this.mode === "runs") {
        this.take(Math.min(1, from + seconds / 6));
        if (this.share >= 1) this.stop();
      } else if (this.mode === "directions") this.take((1 + Math.sin(2 * seconds)) / 2);
      else if (this.one) {
        this.take(Math.min(1, from + Math.floor(seconds * (this.one.fps ?? SLOWLY)) / (this.one.count - 1)));
        if (this.one.at === this.one.count - 1) this.stop();
      }
      else this.take((Math.floor(2.5 * seconds) % this.draws.count) / Math.max(1, this.draws.count - 1));
    };
    this.playing = requestAnimationFrame(tick);
  }
}

function means({ rows, columns, weights }, M, { points }) { // means of the points of a surface, (3 M) m
  const found = new Float32Array(3 * M);
  rows.forEach((row, n) => { for (let d = 0; d < 3; d++) found[3 * row + d] += weights[n] * points[3 * columns[n] + d]; });
  return found;
}

const read = element => unpacked(JSON.parse(element.textContent));
const bodies = new Map(); // each once for all replays of a page

async function bodyOf(key) { // one that can be posed, or the faces of surfaces alone
  if (!bodies.has(key)) {
    const data = await read(document.querySelector(`[data-replay-body="${key}"]`));
    bodies.set(key, data.template ? new Body(data) : data);
  }
  return bodies.get(key);
}

for (const root of document.querySelectorAll("[data-replay]")) {
  const begun = performance.now(), place = document.createElement("div");
  try {
    root.prepend(place);
    root.replay = new Replay(place, await read(root.querySelector("script")), await bodyOf(root.dataset.body));
    root.dataset.ready = Math.round(performance.now() - begun);
    document.querySelector("[data-without-replay]")?.remove();
    root.dispatchEvent(new Event("ready", { bubbles: true }));
  } catch (error) { // an old browser; the page's figures say the same
    place.remove();
    root.hidden = true;
    console.warn(`no replay: ${error.message}`);
  }
}
