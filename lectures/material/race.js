// A race of solvers in the plane of two unknowns, on a clock of effort: lecture 11.

function figure(root, { problems }) {
  const state = { problem: 0, share: 1, playing: 0, on: new Set(problems[0].runs.map(run => run.solver)) };
  const DASHES = [[], [7, 4], [8, 3, 2, 3], [2, 3], [12, 3], [4, 2]];
  const LEAST = 1e-16;
  problems.forEach(problem => { problem.longest = Math.max(...problem.runs.map(run => run.effort.at(-1)), 2); });
  const dark = matchMedia("(prefers-color-scheme: dark)"), colourOf = k => k || !dark.matches ? INKS[k] : "#56B4E9";
  const now = () => problems[state.problem].longest ** state.share; // the effort on the clock
  const last = run => { // the iterate that a run has reached
    let i = 0;
    while (i + 1 < run.effort.length && run.effort[i + 1] <= now() * (1 + 1e-9)) i++;
    return i;
  };

  const flat = new Flat(root, () => {
    const problem = problems[state.problem], { x, y, values, n } = problem, told = [];
    Object.assign(plane, { x, y });
    Object.assign(curves, { x: [1, problem.longest], y: [LEAST, 10] });
    plane.begin();
    const grid = (u, v) => values[n * Math.round((v - y[0]) / (y[1] - y[0]) * (n - 1)) + Math.round((u - x[0]) / (x[1] - x[0]) * (n - 1))];
    plane.contours(grid, problem.levels, plane.soft, 0.6, [], n - 1);
    curves.begin();
    curves.curve([[now(), LEAST], [now(), 10]], curves.ink, 1);
    curves.curve([[1, problem.target], [problem.longest, problem.target]], curves.soft, 1, [2, 3]);
    problem.runs.forEach((run, k) => {
      if (!state.on.has(run.solver)) return;
      const i = last(run), colour = colourOf(k), left = run.left.map(share => Math.max(share, LEAST));
      plane.curve(run.x.slice(0, i + 1), colour, 1.6, DASHES[k]);
      plane.dot(run.x[i], colour, 4.5);
      curves.curve(run.effort.map((e, j) => [Math.max(e, 1), left[j]]), colour, 1.6, DASHES[k]);
      curves.dot([Math.max(run.effort[i], 1), left[i]], colour, 4);
      told.push(`${run.solver} ${run.left[i] < LEAST ? "0" : compact(run.left[i])}${i === run.effort.length - 1 ? " (ended)" : ""}`);
    });
    plane.star(problem.best, plane.ink);
    plane.end();
    curves.end();
    return `${problem.name} after an effort of ${Math.round(now())} residuals, share of the way that is left: ${told.join(", ") || "no solver is chosen"}.`;
  });
  const plane = flat.panel({ title: "The ways, and the lowest end (star)", says: "The plane of the two unknowns with the ways of the solvers.", x: [0, 1], y: [0, 1], xlabel: "first unknown", ylabel: "second unknown" });
  const curves = flat.panel({ title: "What is left of the way; dotted: the target", says: "How much is left, by effort.", x: [1, 10], y: [LEAST, 10], log: true, xlabel: "effort (residuals)", ylabel: "share of the way that is left" });

  const stop = () => { cancelAnimationFrame(state.playing); state.playing = 0; player.textContent = "▶"; player.setAttribute("aria-label", "play"); flat.sentence.setAttribute("aria-live", "polite"); };
  const time = flat.row("effort");
  const player = flat.button(time, "▶", () => {
    if (state.playing) { stop(); return; }
    const begun = performance.now(), from = state.share >= 1 ? 0 : state.share;
    player.textContent = "❚❚";
    player.setAttribute("aria-label", "stop");
    flat.sentence.setAttribute("aria-live", "off"); // not every frame is read out
    const tick = at => {
      state.playing = requestAnimationFrame(tick);
      state.share = Math.min(1, from + (at - begun) / 8000);
      setShare(state.share);
      if (state.share >= 1) stop();
      flat.draw();
    };
    state.playing = requestAnimationFrame(tick);
  });
  player.setAttribute("aria-label", "play");
  const setShare = flat.slider(time, "effort, on a logarithmic scale", { low: 0, high: 1, step: 0.002 }, value => { stop(); state.share = value; });
  setShare(1);
  const solvers = flat.row("solvers");
  problems[0].runs.forEach((run, k) => {
    const chip = flat.button(solvers, run.solver, () => {
      if (!state.on.delete(run.solver)) state.on.add(run.solver);
      chip.setAttribute("aria-pressed", state.on.has(run.solver));
    }, true);
    chip.style.setProperty("--colour", colourOf(k));
  });
  if (problems.length > 1) flat.choice(flat.row("problem"), problems.map((one, i) => [one.name, i]), 0, i => { stop(); state.problem = i; state.share = 1; setShare(1); });
  return Object.assign(flat, { state, last });
}
