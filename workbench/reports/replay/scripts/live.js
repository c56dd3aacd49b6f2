// The controls of a live page: a start set by hand, solvers to press, and iterates that stream in.

const REACH = 16; // px: how near to a joint a press takes hold of it
const SPREADS = [0.3, 0.6, 1.2]; // rad
const MOST_SHOWN = 8; // ends
const COUNTS = [8, 16, 32]; // starts

class Basins { // the ends of many starts, the ends of one minimum in one colour
  constructor(replay, parent) {
    Object.assign(this, { replay, ends: [], found: [], on: new Set(), of: 0, parent });
  }

  clear() {
    Object.assign(this, { ends: [], found: [], of: 0 });
    this.on.clear();
    this.list();
  }

  take({ start, of, x, cost, status, basins }) {
    const before = this.found;
    this.ends[start] = { x: Float64Array.from(x), cost, status };
    Object.assign(this, { of, found: basins });
    this.on = new Set(basins.map(one => one.ends[0]).filter(first => // hidden ones stay hidden
      !before.some(one => one.ends.includes(first)) || before.some(one => this.on.has(one.ends[0]) && one.ends.includes(first))));
    this.list();
  }

  list() { // a button for each minimum
    this.parent.replaceChildren();
    this.parent.style.display = this.found.length ? "" : "none";
    Object.assign(this.parent.appendChild(document.createElement("span")), { className: "name", textContent: "ends" });
    this.found.forEach(({ cost, ends }, i) => {
      const chip = this.parent.appendChild(document.createElement("button")), first = ends[0];
      Object.assign(chip, { type: "button", textContent: `cost ${short(cost)}: ${ends.length} of ${this.of}` });
      chip.style.setProperty("--colour", COLOURS[i % COLOURS.length]);
      chip.setAttribute("aria-pressed", this.on.has(first));
      chip.addEventListener("click", () => {
        if (!this.on.delete(first)) this.on.add(first);
        chip.setAttribute("aria-pressed", this.on.has(first));
        this.replay.live.show("ends");
      });
    });
  }

  shown() {
    return this.found.map(({ cost, ends }, i) => ({ first: ends[0], name: `${short(cost)} (${ends.length} of ${this.of})`, paint: pale(rgb(COLOURS[i % COLOURS.length])) }))
      .filter(({ first }) => this.on.has(first)).slice(0, MOST_SHOWN)
      .map(one => ({ ...one, surface: this.replay.kept(`end/${this.ends[one.first].x.join()}`, () => this.replay.surface(this.ends[one.first].x)) }));
  }

  get text() {
    const known = this.ends.filter(end => end).length, { found } = this;
    if (!found.length) return "No start has ended yet.";
    const lowest = found[0], more = found.length > 1 ? `; ${found.length - 1} other end${found.length > 2 ? "s" : ""}` : "";
    return `${known} of ${this.of} starts have ended: ${lowest.ends.length} at the lowest cost, ${short(lowest.cost)}${more}. Ends whose residuals cannot be told apart have one colour; one of them is shown.`;
  }
}

class Live {
  constructor(replay, root, solvers) {
    Object.assign(this, { replay, count: 0, running: null });
    const make = (tag, parent, properties = {}) => {
      const made = Object.assign(document.createElement(tag), properties);
      parent.append(made);
      return made;
    };
    const row = name => {
      const made = make("div", root, { className: "replay-row" });
      make("span", made, { className: "name", textContent: name });
      return made;
    };
    const { body } = replay, start = row("start");
    this.joint = make("select", start);
    this.joint.setAttribute("aria-label", "joint");
    body.joint_names.forEach((name, k) => this.joint.add(new Option(name.replace(/_/g, " "), k)));
    this.joint.value = Math.max(0, body.joint_names.indexOf("left_shoulder"));
    this.joint.addEventListener("change", () => this.refresh());
    this.angles = [0, 1, 2].map(d => {
      const label = make("label", start, { textContent: "xyz"[d] + " " });
      const slider = make("input", label, { type: "range", min: -180, max: 180, step: 1 });
      slider.setAttribute("aria-label", `rotation vector, ${"xyz"[d]}, in degrees`);
      slider.addEventListener("input", () => {
        replay.hand[3 * this.joint.value + d] = slider.value * Math.PI / 180;
        this.show("runs");
      });
      return slider;
    });
    this.button(start, "the problem's start", () => this.take(replay.here));
    this.button(start, "the last result", () => {
      const run = replay.runs.at(-1), size = replay.here.length;
      if (run) this.take(run.x.subarray(run.x.length - size));
    });
    const solve = row("solve");
    solvers.forEach(name => this.button(solve, name, () => this.solve(name)));
    this.stopper = this.button(solve, "stop", () => this.stop());
    const many = row("basins"), choose = (name, options, chosen, said) => {
      const select = make("select", many);
      select.setAttribute("aria-label", name);
      options.forEach(one => select.add(new Option(said(one), one)));
      select.value = chosen;
      return select;
    };
    const by = choose("solver", solvers, solvers[0], name => name), count = choose("how many starts", COUNTS, 16, n => `${n} starts`);
    const spread = choose("how far apart", SPREADS, 0.6, s => `spread by ${s} rad`);
    this.button(many, "find basins", () => this.many(by.value, count.value, spread.value));
    replay.live = this; // it was true so far
    this.basins = new Basins(replay, make("div", root, { className: "replay-row" }));
    this.basins.list();
    this.said = make("p", root, { className: "replay-said" });
    this.said.setAttribute("aria-live", "polite");
    this.refresh();
    this.listen();
  }

  listen() { // a joint of the start is dragged
    const { replay } = this, { scene } = replay;
    scene.grab = event => {
      const { byHand } = replay;
      if (!byHand) return null;
      const places = byHand.joints.map(joint => joint.map((x, d) => x + byHand.shift[d]));
      const away = places.map(place => { const [u, v] = scene.place(place); return Math.hypot(u - event.offsetX, v - event.offsetY); });
      const k = away.indexOf(Math.min(...away));
      if (!(away[k] < REACH)) return null;
      this.joint.value = Math.max(0, replay.body.parents[k]); // what turns is above it
      this.refresh();
      const from = byHand.joints[k], { offsetX, offsetY } = event, start = Float64Array.from(replay.hand);
      this.pull = null;
      return moved => {
        const shifted = scene.pulled(places[k], moved.offsetX - offsetX, moved.offsetY - offsetY);
        this.pull = { k, start, place: from.map((x, d) => x + shifted[d] - places[k][d]) };
        this.drag();
      };
    };
  }

  async drag() { // one request at a time; of the moves meanwhile, the last one counts
    if (this.dragging) return;
    this.dragging = true;
    while (this.pull) {
      const { k, start, place: [x, y, z] } = this.pull;
      this.pull = null;
      try {
        const response = await fetch("drag?" + new URLSearchParams({ start: encoded(start), joint: k, x, y, z }));
        if (!response.ok) throw new Error(await response.text());
        this.take((await response.json()).x);
      } catch (error) { this.said.textContent = error.message; }
    }
    this.dragging = false;
  }

  button(parent, text, press) {
    const made = Object.assign(document.createElement("button"), { type: "button", textContent: text });
    made.addEventListener("click", press);
    parent.append(made);
    return made;
  }

  refresh() {
    this.angles.forEach((slider, d) => { slider.value = this.replay.hand[3 * this.joint.value + d] * 180 / Math.PI; });
  }

  take(numbers) {
    this.replay.hand.set(numbers);
    this.refresh();
    this.show("runs");
  }

  show(mode) { // the start and the runs, or the ends of many starts
    const { replay } = this;
    if (replay.mode !== mode) {
      replay.mode = mode;
      if (mode === "ends") replay.anywhere?.click();
      replay.sync();
    }
    replay.paint();
  }

  async solve(solver) {
    if (this.busy) return;
    const { replay } = this, name = `${solver} ${++this.count}`;
    this.show("runs");
    const run = this.running = { name, status: "running", iterations: 0, iterates: [], x: new Float32Array(0),
      cost: [], optimality: [], damping: [], condition: [], seconds: [], evaluations: [] };
    await this.stream("solve", name, { solver }, event => this.event(run, event));
  }

  async many(solver, count, spread) { // from many starts
    if (this.busy) return;
    const name = `${solver} from ${count} starts`;
    this.running = { name };
    this.basins.clear();
    this.show("ends");
    await this.stream("ends", name, { solver, count, spread }, text => {
      const [event, data] = parsed(text);
      if (event === "ended") { this.said.textContent = `${name}, ${data.status}: ${data.message}.`; return; }
      this.basins.take(data);
      this.show("ends");
    });
  }

  get busy() {
    if (this.running) this.said.textContent = `${this.running.name} is running; stop it first.`;
    return this.running !== null;
  }

  async stream(what, name, asked, take) { // take: is called with each event
    this.key = `${name}/${crypto.getRandomValues(new Uint32Array(2)).join("")}`;
    this.said.textContent = `${name} begins.`;
    try {
      const response = await fetch(`${what}?` + new URLSearchParams({ ...asked, start: encoded(this.replay.hand), run: this.key }));
      if (!response.ok) throw new Error(await response.text());
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (let part = await reader.read(); !part.done; part = await reader.read()) {
        const events = (text + part.value).split("\n\n");
        text = events.pop();
        events.forEach(take);
      }
    } catch (error) { this.said.textContent = `${name}: ${error.message}`; }
    this.running = null;
  }

  event(run, text) {
    const [name, one] = parsed(text), { replay } = this;
    if (name === "ended") {
      run.status = one.status;
      this.said.textContent = `${run.name} ${one.status}: ${one.message}.`;
      return;
    }
    const x = new Float32Array(run.x.length + one.x.length);
    x.set(run.x);
    x.set(one.x, run.x.length);
    run.x = x;
    run.iterates.push(one.iterate);
    run.iterations = one.iterate;
    for (const key of ["cost", "optimality", "damping", "seconds", "evaluations"]) run[key].push(one[key]);
    run.condition.push(null);
    if (run.iterates.length === 1) {
      replay.runs.push(run);
      replay.focus = replay.runs.length - 1;
      replay.add(run);
    }
    replay.share = 1;
    replay.sync();
    replay.paint();
  }

  stop() {
    if (this.running) fetch("stop?" + new URLSearchParams({ run: this.key }));
  }
}

function parsed(text) { // an event's name and its data
  const [, name, data] = /^event: (.*)\ndata: (.*)$/.exec(text);
  return [name, JSON.parse(data)];
}

function encoded(numbers) { // as the server reads them
  const bytes = new Uint8Array(Float64Array.from(numbers).buffer);
  return btoa(String.fromCharCode(...bytes)).replace(/\+/g, "-").replace(/\//g, "_");
}

for (const root of document.querySelectorAll("[data-live]"))
  root.live = new Live(document.querySelector("[data-replay]").replay, root, JSON.parse(root.dataset.live));
