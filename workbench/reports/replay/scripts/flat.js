// Planar figures that answer to the hand: panels with axes, curves, points that are dragged, sliders,
// and a sentence. What is drawn is a script of its own, which calls `new Flat(root, paint)`.

const INKS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]; // Okabe and Ito
const NEAR = 24; // px: how near to a point a press takes hold of it
const compact = x => { // three digits at most
  const size = Math.abs(x);
  return x && (size >= 1e4 || size < 1e-2) ? x.toExponential(1) : String(+x.toPrecision(3));
};

class Flat {
  constructor(root, paint) { // paint: draws all panels and returns the sentence
    const make = (tag, parent, properties = {}) => {
      const made = Object.assign(document.createElement(tag), properties);
      parent.append(made);
      return made;
    };
    this.make = make;
    this.paint = paint;
    this.panels = make("div", root, { className: "flat-panels" });
    this.controls = make("div", root);
    this.sentence = make("p", root, { className: "replay-said" });
    this.sentence.setAttribute("aria-live", "polite");
    addEventListener("resize", () => this.draw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  panel(axes) { return new Panel(this, axes); }

  row(name) {
    const made = this.make("div", this.controls, { className: "replay-row" });
    made.setAttribute("role", "group");
    made.setAttribute("aria-label", name);
    this.make("span", made, { className: "name", textContent: name });
    return made;
  }

  slider(parent, name, { low, high, step }, changed) { // returns a function that sets it
    const input = this.make("input", parent, { type: "range", min: low, max: high, step });
    input.setAttribute("aria-label", name);
    input.addEventListener("input", () => { changed(+input.value); this.draw(); });
    return value => { input.value = value; };
  }

  button(parent, text, press, on) {
    const made = this.make("button", parent, { type: "button", textContent: text });
    if (on !== undefined) made.setAttribute("aria-pressed", on);
    made.addEventListener("click", () => { press(made); this.draw(); });
    return made;
  }

  choice(parent, options, chosen, choose) {
    const made = options.map(([text, value]) => this.button(parent, text, pressed => {
      choose(value);
      made.forEach(one => one.setAttribute("aria-pressed", one === pressed));
    }, value === chosen));
    return made;
  }

  draw() { this.sentence.textContent = this.paint(); }
}

class Panel {
  // x, y: [low, high]; log: whether both axes are logarithmic; equal: whether a unit is as long on both
  constructor(flat, axes) {
    Object.assign(this, { flat, handles: [], held: null, log: false, ...axes });
    const figure = flat.make("figure", flat.panels);
    flat.make("figcaption", figure, { textContent: axes.title });
    this.canvas = flat.make("canvas", figure);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", axes.says);
    this.canvas.style.aspectRatio = axes.ratio ?? 1;
    this.listen();
  }

  get box() { // px: left, right, top, bottom of the axes; with equal units the ranges grow to fit
    const { clientWidth: w, clientHeight: h } = this.canvas;
    return [this.log ? 60 : 52, w - 10, 8, h - 38];
  }

  get ranges() {
    let [[a, b], [c, d]] = [this.x, this.y];
    if (this.log) return [[Math.log10(a), Math.log10(b)], [Math.log10(c), Math.log10(d)]];
    if (this.equal) {
      const [left, right, top, bottom] = this.box, unit = Math.max((b - a) / (right - left), (d - c) / (bottom - top));
      const [wide, tall] = [unit * (right - left) - (b - a), unit * (bottom - top) - (d - c)];
      [a, b, c, d] = [a - wide / 2, b + wide / 2, c - tall / 2, d + tall / 2];
    }
    return [[a, b], [c, d]];
  }

  px([x, y]) {
    const [left, right, top, bottom] = this.box, [[a, b], [c, d]] = this.ranges;
    const [u, v] = this.log ? [Math.log10(x), Math.log10(y)] : [x, y];
    return [left + (right - left) * (u - a) / (b - a), bottom - (bottom - top) * (v - c) / (d - c)];
  }

  at(u, v) { // the place of a point of the canvas
    const [left, right, top, bottom] = this.box, [[a, b], [c, d]] = this.ranges;
    const found = [a + (b - a) * (u - left) / (right - left), c + (d - c) * (bottom - v) / (bottom - top)];
    return this.log ? found.map(x => 10 ** x) : found;
  }

  begin() { // clears the panel, and draws its axes
    const { canvas } = this, ratio = Math.min(2, devicePixelRatio || 1), g = this.g = canvas.getContext("2d");
    Object.assign(canvas, { width: canvas.clientWidth * ratio, height: canvas.clientHeight * ratio });
    g.scale(ratio, ratio);
    const style = getComputedStyle(canvas);
    Object.assign(this, Object.fromEntries(["ink", "soft", "line"].map(name => [name, style.getPropertyValue(`--${name}`)])));
    const [left, right, top, bottom] = this.box, [horizontal, vertical] = this.ranges;
    Object.assign(g, { font: "11px system-ui, sans-serif", fillStyle: this.soft, strokeStyle: this.line, lineWidth: 1 });
    g.strokeRect(left, top, right - left, bottom - top);
    const marks = ([low, high], room) => {
      if (this.log) {
        const step = Math.ceil((high - low) * 34 / room);
        return Array.from({ length: Math.floor(high) - Math.ceil(low) + 1 }, (_, i) => Math.ceil(low) + i).filter(e => e % step === 0);
      }
      const rough = (high - low) * 60 / room, size = 10 ** Math.floor(Math.log10(rough));
      const step = size * [1, 2, 5, 10].find(n => n * size >= rough), first = Math.ceil(low / step);
      return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
    };
    const name = value => this.log ? (Math.abs(value) < 3 ? String(+(10 ** value).toPrecision(1)) : `1e${value}`) : String(+value.toPrecision(6));
    Object.assign(g, { textAlign: "center", textBaseline: "top" });
    for (const value of marks(horizontal, right - left)) {
      const u = left + (right - left) * (value - horizontal[0]) / (horizontal[1] - horizontal[0]);
      this.stroke([[u, bottom], [u, bottom + 3]], this.soft, 1);
      g.fillText(name(value), u, bottom + 5);
    }
    g.fillText(this.xlabel, (left + right) / 2, bottom + 21);
    Object.assign(g, { textAlign: "right", textBaseline: "middle" });
    for (const value of marks(vertical, bottom - top)) {
      const v = bottom - (bottom - top) * (value - vertical[0]) / (vertical[1] - vertical[0]);
      this.stroke([[left - 3, v], [left, v]], this.soft, 1);
      g.fillText(name(value), left - 5, v);
    }
    g.save();
    g.translate(10, (top + bottom) / 2);
    g.rotate(-Math.PI / 2);
    Object.assign(g, { textAlign: "center" });
    g.fillText(this.ylabel, 0, 0);
    g.restore();
    g.save();
    g.beginPath();
    g.rect(left, top, right - left, bottom - top);
    g.clip(); // until `end`
  }

  end() { // the points that can be dragged, in front of everything
    const { g } = this;
    g.restore();
    this.handles.forEach((handle, i) => {
      const [u, v] = this.px(handle.at());
      g.beginPath();
      g.arc(u, v, 9, 0, 7);
      const here = document.activeElement === this.canvas && i === this.chosen;
      Object.assign(g, { strokeStyle: here ? this.ink : this.soft, lineWidth: here ? 2.5 : 1.2 });
      g.stroke();
    });
  }

  stroke(places, colour, width, dash = []) { // px
    const { g } = this;
    g.beginPath();
    places.forEach(([u, v], i) => i ? g.lineTo(u, v) : g.moveTo(u, v));
    Object.assign(g, { strokeStyle: colour, lineWidth: width, lineJoin: "round" });
    g.setLineDash(dash);
    g.stroke();
    g.setLineDash([]);
  }

  curve(points, colour, width = 1.5, dash = []) { this.stroke(points.map(p => this.px(p)), colour, width, dash); }

  dot(point, colour, size = 4) {
    const { g } = this, [u, v] = this.px(point);
    g.beginPath();
    g.arc(u, v, size, 0, 7);
    g.fillStyle = colour;
    g.fill();
  }

  star(point, colour, size = 8) {
    const { g } = this, [u, v] = this.px(point);
    g.beginPath();
    for (let k = 0; k < 10; k++) {
      const r = k % 2 ? 0.4 * size : size, t = Math.PI * (k / 5 - 0.5);
      g.lineTo(u + r * Math.cos(t), v + r * Math.sin(t));
    }
    g.closePath();
    g.fillStyle = colour;
    g.fill();
  }

  words(text, point, colour, [right, down] = [8, -8]) {
    const { g } = this, [u, v] = this.px(point);
    Object.assign(g, { fillStyle: colour, textAlign: right < 0 ? "right" : "left", textBaseline: "middle", font: "12px system-ui, sans-serif" });
    g.fillText(text, u + right, v + down);
  }

  // where a function on the panel is as large as each of the levels: marching squares, n a side
  contours(f, levels, colour, width = 0.8, dash = [], n = 56) {
    const [[a, b], [c, d]] = this.ranges, { g } = this;
    const X = i => a + (b - a) * i / n, Y = j => c + (d - c) * j / n;
    const F = Array.from({ length: n + 1 }, (_, j) => Float64Array.from({ length: n + 1 }, (_, i) => f(X(i), Y(j))));
    g.beginPath();
    for (const level of levels) for (let j = 0; j < n; j++) for (let i = 0; i < n; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]], found = [];
      corners.forEach(([p, q], k) => {
        const [r, s] = corners[(k + 1) % 4], here = F[q][p] - level, next = F[s][r] - level;
        if ((here < 0) !== (next < 0)) { const t = here / (here - next); found.push(this.px([X(p + t * (r - p)), Y(q + t * (s - q))])); }
      });
      for (let k = 0; k + 1 < found.length; k += 2) { g.moveTo(...found[k]); g.lineTo(...found[k + 1]); }
    }
    Object.assign(g, { strokeStyle: colour, lineWidth: width });
    g.setLineDash(dash);
    g.stroke();
    g.setLineDash([]);
  }

  // a point that is dragged, or moved by the arrow keys: at() -> place, move(place)
  handle(name, at, move) {
    this.handles.push({ name, at, move });
    this.chosen ??= 0;
    this.canvas.tabIndex = 0;
    this.canvas.style.cursor = "grab";
    this.canvas.setAttribute("aria-label", `${this.says} Drag ${this.handles.map(one => one.name).join(" or ")}, or use the arrow keys${this.handles.length > 1 ? "; Enter goes on to the next" : ""}.`);
  }

  listen() {
    const { canvas, flat } = this;
    canvas.style.touchAction = "pan-y";
    canvas.addEventListener("pointerdown", event => {
      const away = this.handles.map(one => { const [u, v] = this.px(one.at()); return Math.hypot(u - event.offsetX, v - event.offsetY); });
      const near = away.indexOf(Math.min(...away));
      if (!(away[near] < NEAR)) return;
      this.chosen = this.held = near;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("touchmove", event => { if (this.held !== null) event.preventDefault(); }, { passive: false });
    canvas.addEventListener("pointermove", event => {
      if (this.held === null || !event.buttons) return;
      this.handles[this.held].move(this.at(event.offsetX, event.offsetY));
      flat.draw();
    });
    const release = () => { this.held = null; };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("focus", () => flat.draw());
    canvas.addEventListener("blur", () => flat.draw());
    canvas.addEventListener("keydown", event => {
      if (!this.handles.length) return;
      if (event.key === "Enter") { this.chosen = (this.chosen + 1) % this.handles.length; flat.draw(); return; }
      const by = { ArrowLeft: [-4, 0], ArrowRight: [4, 0], ArrowUp: [0, -4], ArrowDown: [0, 4] }[event.key];
      if (!by) return;
      event.preventDefault();
      const [u, v] = this.px(this.handles[this.chosen].at());
      this.handles[this.chosen].move(this.at(u + by[0], v + by[1]));
      flat.draw();
    });
  }
}
