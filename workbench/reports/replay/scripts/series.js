// Bodies that are shown one after the other: frames, stages, hypotheses, ends of solvers.

const SOME = 12; // states whose room is looked at

class Series {
  constructor(replay, data) {
    Object.assign(this, data, { replay, at: data.opens, on: data.columns.map(() => true) });
    this.count = data.labels.length;
    this.colours = coloursOf(data.columns.slice(1));
    this.frames = data.name === "frames"; // of a body that may travel
    this.contacts = new Map();
    if (this.pixels) replay.lenses.forEach((lens, v) => lens.cropTo(this.seenBy(v)));
    if (!this.frames || !this.x) this.trail = null;
  }

  numbers(state, column) { // of a body that the page poses
    const size = this.replay.size, start = (state * this.columns.length + column) * size;
    return this.x.subarray(start, start + size);
  }

  surface(state, column = 0) { // null where there is no body
    const { replay, surfaces } = this;
    if (!surfaces) {
      const x = this.numbers(state, column);
      return Number.isNaN(x[0]) ? null : replay.kept(`${this.name}/${state}/${column}`, () => replay.surface(x));
    }
    return replay.kept(`${this.name}/${state}/${column}`, () => {
      const C = this.columns.length, size = surfaces.length / (this.count * C), start = (state * C + column) * size;
      const points = surfaces.subarray(start, start + size);
      return { points, normals: normalsOf(points, replay.body.faces) };
    });
  }

  get some() { // surfaces of some of the states, each moved to where the first one is
    const found = [], step = Math.max(1, Math.floor(this.count / SOME));
    for (let state = 0; state < this.count; state += step) this.columns.forEach((_, column) => {
      const surface = this.surface(state, column), away = this.travelled(state);
      if (surface) found.push({ points: this.frames ? surface.points.map((x, i) => x - away[i % 3]) : surface.points });
    });
    return found;
  }

  travelled(state) { // m: how far a body that moves through frames is from where it began
    if (!this.frames || !this.x) return [0, 0, 0];
    const { replay } = this, [, , trans] = replay.arguments(this.numbers(state, 0)), [, , here] = replay.arguments(replay.here);
    return [0, 1, 2].map(d => trans[d] - here[d]);
  }

  trail({ joints }) { // the way of the root through all frames, as pieces of a line
    const { replay } = this, places = Array.from({ length: this.count }, (_, t) => {
      const [, , trans] = replay.arguments(this.numbers(t, 0)), [, , now] = replay.arguments(this.numbers(this.at, 0));
      return joints[0].map((x, d) => x - now[d] + trans[d]);
    });
    return Float32Array.from(places.flatMap((place, t) => t ? [...places[t - 1], ...place] : []));
  }

  seenBy(v) { // px, all keypoints of a camera in any state
    const V = this.replay.lenses.length, M = this.confidence.length / (this.count * V), found = [];
    for (let t = 0; t < this.count; t++) for (let m = 0; m < M; m++) {
      const i = (t * V + v) * M + m;
      if (this.confidence[i] > this.replay.least_confidence) found.push([this.pixels[2 * i], this.pixels[2 * i + 1]]);
    }
    return found;
  }

  shown() { // surfaces with their paint and names
    const found = [], several = this.columns.length > 1;
    this.columns.forEach((name, column) => {
      const surface = this.on[column] ? this.surface(this.at, column) : null;
      if (surface) found.push({ surface, name, paint: several && column ? pale(rgb(this.colours[column - 1])) : this.paint });
    });
    return found;
  }

  get paint() { // grey, and orange where the surface is hidden
    if (!this.hidden) return this.columns.length > 1 ? GREY : SKIN;
    this.painted ??= Float32Array.from({ length: 3 * this.hidden.length }, (_, i) =>
      SKIN[i % 3] + this.hidden[Math.floor(i / 3)] * (PALE_ORANGE[i % 3] - SKIN[i % 3]));
    return this.painted;
  }

  get joined() { // [points of the body, points in space] of this state, those that there are
    if (!this.links) return [[], []];
    const size = this.links[0].length / this.count, found = [[], []];
    const [from, to] = this.links.map(all => all.subarray(this.at * size, (this.at + 1) * size));
    for (let i = 0; i < size; i += 3) {
      if (Number.isNaN(from[i]) || Number.isNaN(to[i])) continue;
      found[0].push(from.subarray(i, i + 3));
      found[1].push(to.subarray(i, i + 3));
    }
    return found;
  }

  get scanPaint() { // three numbers for each point of the scan: its distance to the surface
    if (!this.contacts.has(this.at)) {
      const M = this.scan.length / 3, paint = new Float32Array(3 * M);
      for (let i = 0; i < M; i++) {
        const far = this.far[this.at * M + i];
        const colour = far > 1e5 * this.contact ? [150, 155, 162] : cividis(far / (1e5 * this.scale));
        for (let d = 0; d < 3; d++) paint[3 * i + d] = colour[d] / 255;
      }
      this.contacts.set(this.at, paint);
    }
    return this.contacts.get(this.at);
  }

  look() { // what the cameras observed in this state
    if (!this.pixels) return;
    const { lenses } = this.replay, V = lenses.length, M = this.confidence.length / (this.count * V);
    lenses.forEach((lens, v) => {
      const first = (this.at * V + v) * M;
      lens.confidence = this.confidence.subarray(first, first + M);
      lens.observed = Array.from({ length: M }, (_, m) => [...this.pixels.subarray(2 * (first + m), 2 * (first + m) + 2)]);
      lens.rays = lens.observed.map(pixel => lens.ray(pixel));
    });
  }

  get text() {
    const [from, to] = this.joined, said = this.said[this.at];
    if (!from.length || this.scan) return said;
    const sum = from.reduce((all, p, i) => all + Math.hypot(...[0, 1, 2].map(d => p[d] - to[i][d])), 0);
    return `${said} ${from.length} points are ${(1000 * sum / from.length).toFixed(1)} mm on average from where they were observed.`;
  }
}
