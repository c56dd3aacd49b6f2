// The controls of a live page: a start set by hand, solvers to press, and iterates that stream in.

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
      slider.said = make("output", label);
      slider.addEventListener("input", () => {
        replay.hand[3 * this.joint.value + d] = slider.value * Math.PI / 180;
        this.refresh();
        this.show();
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
    replay.live = this; // it was true so far
    this.said = make("p", root, { className: "replay-said" });
    this.said.setAttribute("aria-live", "polite");
    this.refresh();
  }

  button(parent, text, press) {
    const made = Object.assign(document.createElement("button"), { type: "button", textContent: text });
    made.addEventListener("click", press);
    parent.append(made);
    return made;
  }

  refresh() {
    this.angles.forEach((slider, d) => {
      slider.value = this.replay.hand[3 * this.joint.value + d] * 180 / Math.PI;
      slider.said.textContent = ` ${slider.value}°`;
    });
  }

  take(numbers) {
    this.replay.hand.set(numbers);
    this.refresh();
    this.show();
  }

  show() {
    if (this.replay.mode !== "runs") {
      this.replay.mode = "runs";
      this.replay.sync();
    }
    this.replay.paint();
  }

  async solve(solver) {
    if (this.running) {
      this.said.textContent = `${this.running.name} is running; stop it first.`;
      return;
    }
    const name = `${solver} ${++this.count}`;
    this.show();
    const run = this.running = { name, status: "running", iterations: 0, iterates: [], x: new Float32Array(0),
      cost: [], optimality: [], damping: [], condition: [], seconds: [], evaluations: [] };
    this.key = `${name}/${crypto.getRandomValues(new Uint32Array(2)).join("")}`;
    this.said.textContent = `${name} begins.`;
    try {
      const response = await fetch("solve?" + new URLSearchParams({ solver, start: encoded(this.replay.hand), run: this.key }));
      if (!response.ok) throw new Error(await response.text());
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (let part = await reader.read(); !part.done; part = await reader.read()) {
        const events = (text + part.value).split("\n\n");
        text = events.pop();
        events.forEach(event => this.event(run, event));
      }
    } catch (error) { this.said.textContent = `${name}: ${error.message}`; }
    this.running = null;
  }

  event(run, text) {
    const [, name, data] = /^event: (.*)\ndata: (.*)$/.exec(text), one = JSON.parse(data), { replay } = this;
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

function encoded(numbers) { // as the server reads them
  const bytes = new Uint8Array(Float64Array.from(numbers).buffer);
  return btoa(String.fromCharCode(...bytes)).replace(/\+/g, "-").replace(/\//g, "_");
}

for (const root of document.querySelectorAll("[data-live]"))
  root.live = new Live(document.querySelector("[data-replay]").replay, root, JSON.parse(root.dataset.live));
