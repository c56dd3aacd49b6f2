// An arm of two bones in its plane, and the step that its linear model asks for: lecture 7.

function figure(root, { upper, lower, inReach, beyond, opens, slowest }) {
  const GREY = "#8a949e", ORANGE = "#D55E00", GREEN = "#009E73";
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const state = { x: [...opens.angles], star: [...opens.star], damping: opens.damping, growth: 2, told: "" };

  const wrist = ([a, b]) => [upper * Math.cos(a) + lower * Math.cos(a + b), upper * Math.sin(a) + lower * Math.sin(a + b)];
  const elbow = ([a]) => [upper * Math.cos(a), upper * Math.sin(a)];
  const residual = x => wrist(x).map((place, d) => place - state.star[d]);
  const cost = x => 0.5 * residual(x).reduce((sum, e) => sum + e * e, 0);
  const moved = (x, p) => x.map((angle, i) => angle + p[i]);
  const length = p => Math.hypot(...p);

  function linear(x) { // e, J'J, J'e, and the cost of the linear model
    const [a, b] = x, e = residual(x), far = [-lower * Math.sin(a + b), lower * Math.cos(a + b)];
    const J = [[-upper * Math.sin(a) + far[0], far[0]], [upper * Math.cos(a) + far[1], far[1]]]; // m/rad
    const A = [0, 1].map(i => [0, 1].map(j => J[0][i] * J[0][j] + J[1][i] * J[1][j]));
    const g = [0, 1].map(i => J[0][i] * e[0] + J[1][i] * e[1]);
    const model = p => 0.5 * J.reduce((sum, row, k) => sum + (e[k] + row[0] * p[0] + row[1] * p[1]) ** 2, 0);
    return { e, J, A, g, model };
  }

  function step({ A, g }, damping) { // (J'J + damping I) p = -J'e
    const [[a, b], [, d]] = A, p = a + damping, q = d + damping, det = p * q - b * b;
    return [(-g[0] * q + g[1] * b) / det, (-g[1] * p + g[0] * b) / det];
  }

  function dogleg({ A, g }, newton, radius) { // the two legs, cut off at the radius
    const bent = g[0] * (A[0][0] * g[0] + A[0][1] * g[1]) + g[1] * (A[1][0] * g[0] + A[1][1] * g[1]);
    const size = g[0] * g[0] + g[1] * g[1], cauchy = g.map(one => -one * size / bent);
    if (length(cauchy) >= radius) return [cauchy, cauchy.map(one => one * radius / length(cauchy))];
    const leg = newton.map((one, i) => one - cauchy[i]);
    const [a, b, c] = [length(leg) ** 2, 2 * (leg[0] * cauchy[0] + leg[1] * cauchy[1]), length(cauchy) ** 2 - radius ** 2];
    const t = a ? Math.min(1, (-b + Math.sqrt(Math.max(0, b * b - 4 * a * c))) / (2 * a)) : 1;
    return [cauchy, cauchy.map((one, i) => one + t * leg[i])];
  }

  function judged() { // the step with the damping, what was promised, what came of it
    const here = linear(state.x), p = step(here, state.damping), before = cost(state.x);
    const promised = before - here.model(p), fell = before - cost(moved(state.x, p));
    return { here, p, before, promised, fell, gain: fell / promised };
  }

  function take() { // one iteration of Levenberg and Marquardt's method, with Nielsen's rule
    const { p, fell, gain } = judged();
    if (fell > 0) {
      state.x = moved(state.x, p);
      state.damping *= Math.max(slowest, 1 - (2 * gain - 1) ** 3);
      state.growth = 2;
      state.told = "The step was taken. ";
    } else {
      state.damping *= state.growth;
      state.growth *= 2;
      state.told = "The step was refused. ";
    }
    setDamping(Math.log10(state.damping));
  }

  const flat = new Flat(root, () => {
    const { here, p, before, promised, fell, gain } = judged(), newton = step(here, 0), radius = length(p);
    const legs = dogleg(here, newton, radius), after = moved(state.x, p);
    const BLUE = dark.matches ? "#56B4E9" : "#0072B2";
    plane.begin();
    const drawn = (x, colour, width, dash) => plane.curve([[0, 0], elbow(x), wrist(x)], colour, width, dash);
    drawn(after, ORANGE, 2, [6, 4]);
    drawn(state.x, plane.ink, 3);
    plane.curve([wrist(state.x), wrist(state.x).map((place, d) => place + here.J[d][0] * p[0] + here.J[d][1] * p[1])], BLUE, 1.5, [2, 3]);
    for (const place of [[0, 0], elbow(state.x), wrist(state.x)]) plane.dot(place, plane.ink, 4);
    plane.dot(wrist(after), ORANGE, 4);
    plane.star(state.star, GREEN);
    plane.end();

    const reach = Math.max(0.25, Math.min(2.4, 1.25 * length(newton), 3 * radius));
    if (!steps.held && steps.held !== 0) Object.assign(steps, { x: [-reach, reach], y: [-reach, reach] });
    steps.begin();
    const levels = [0.03, 0.1, 0.3, 0.6, 1, 1.5, 2.5].map(share => share * before);
    steps.contours((s, t) => cost(moved(state.x, [s, t])), levels, GREY);
    steps.contours((s, t) => here.model([s, t]), levels, BLUE, 0.9, [2, 3]);
    steps.curve(Array.from({ length: 121 }, (_, i) => [radius * Math.cos(i * Math.PI / 60), radius * Math.sin(i * Math.PI / 60)]), steps.soft, 1);
    steps.curve([[0, 0], legs[0], newton], GREEN, 1.5, [6, 4]);
    steps.dot(legs[1], GREEN, 4);
    steps.curve([newton, ...Array.from({ length: 141 }, (_, i) => step(here, 10 ** (-9 + i / 12))), [0, 0]], ORANGE, 2);
    steps.star(newton, steps.ink);
    steps.dot(p, ORANGE, 5);
    steps.end();

    const worth = fell > 0 ? "it is taken" : "it is refused, and the damping grows";
    return `${state.told}The cost is ${compact(before)} m². With the damping λ = ${compact(state.damping)} the step is ` +
      `${compact(radius)} rad long (Gauss-Newton's: ${compact(length(newton))}). The linear model promises that the cost falls by ` +
      `${compact(promised)} m², and it ${fell < 0 ? "rises" : "falls"} by ${compact(Math.abs(fell))} m²: a gain of ${gain.toFixed(2)}, so ${worth}.`;
  });
  const reach = 1.15 * (upper + lower);
  const plane = flat.panel({ title: "The arm, and in orange after the step",
    says: "An arm of two bones and a star that it reaches for.", x: [-0.5 * reach, 1.1 * reach], y: [-0.35 * reach, 1.15 * reach], equal: true, xlabel: "x (m)", ylabel: "y (m)" });
  const steps = flat.panel({ title: "The step: p(λ) orange, the dogleg green",
    says: "The steps that are possible from here, with lines of equal cost.", x: [-1, 1], y: [-1, 1], equal: true, xlabel: "change of the shoulder (rad)", ylabel: "change of the elbow (rad)" });
  plane.handle("the wrist", () => wrist(state.x), ([x, y]) => { // the two angles that bring it there, elbow as it is
    const r = Math.min(upper + lower - 1e-4, Math.max(Math.abs(upper - lower) + 1e-4, Math.hypot(x, y)));
    const side = Math.sin(state.x[1]) < 0 ? -1 : 1;
    const b = side * Math.acos((r * r - upper * upper - lower * lower) / (2 * upper * lower));
    state.x = [Math.atan2(y, x) - Math.atan2(lower * Math.sin(b), upper + lower * Math.cos(b)), b];
    state.told = "";
  });
  plane.handle("the star", () => state.star, place => { state.star = place; state.told = ""; });
  steps.handle("the step along its curve", () => judged().p, place => { // the damping whose step is so long
    const here = linear(state.x), wanted = length(place);
    let [low, high] = [-9, 3];
    for (let n = 0; n < 50; n++) { const middle = (low + high) / 2; if (length(step(here, 10 ** middle)) > wanted) low = middle; else high = middle; }
    state.damping = 10 ** ((low + high) / 2);
    state.told = "";
    setDamping(Math.log10(state.damping));
  });

  const row = flat.row("damping λ");
  const setDamping = flat.slider(row, "damping, on a logarithmic scale", { low: -7, high: 1, step: 0.02 },
    value => { state.damping = 10 ** value; state.told = ""; });
  const go = flat.row("iterate");
  flat.button(go, "next iteration", take);
  flat.button(go, "put the star in reach", () => { state.star = [...inReach]; state.told = ""; });
  flat.button(go, "put it beyond", () => { state.star = [...beyond]; state.told = ""; });
  flat.button(go, "begin again", () => {
    Object.assign(state, { x: [...opens.angles], damping: opens.damping, growth: 2, told: "" });
    setDamping(Math.log10(state.damping));
  });
  setDamping(Math.log10(state.damping));
  return Object.assign(flat, { state, judged, take, dogleg, step, linear });
}
