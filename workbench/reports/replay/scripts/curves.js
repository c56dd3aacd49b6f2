// Curves of numbers along the runs, with a line where the replay stands: on logarithmic axes, or
// against a linear one where the numbers are counts.

class Curves {
  // each curve has a name, a function from a run to its numbers (null leaves a gap), and `counts`
  // if these are counts
  constructor(parent, curves, chosen) {
    this.chosen = chosen; // called with a share of the axis, from 0 to 1, when a curve is dragged
    this.charts = curves.map(([name, numbers, counts = false]) => {
      const figure = document.createElement("figure"), canvas = document.createElement("canvas");
      const caption = document.createElement("figcaption");
      caption.textContent = name;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `${name} along the runs`);
      figure.append(caption, canvas);
      parent.append(figure);
      const drag = event => {
        if (!event.buttons || !canvas.across) return;
        const [left, right] = canvas.across;
        this.chosen(Math.max(0, Math.min(1, (event.offsetX - left) / (right - left))));
      };
      canvas.addEventListener("pointerdown", drag);
      canvas.addEventListener("pointermove", drag);
      return { name, canvas, caption, numbers, figure, counts };
    });
  }

  // runs: { colour, at: [places along the axis], run }; [low, high]: the axis; value: where it stands
  draw(runs, [low, high], value, now) {
    for (const { name, canvas, caption, numbers, figure, counts } of this.charts) {
      const all = runs.flatMap(({ run }) => numbers(run)).filter(y => y > 1e-13 && y < Infinity);
      const flat = all.length && Math.max(...all) === Math.min(...all);
      figure.hidden = all.length < 2 || (!counts && Math.max(...all) < 1.01 * Math.min(...all)); // nothing to see
      canvas.hidden = flat; // a count that never changes is said in words
      caption.textContent = counts && flat ? `${name}: ${all[0]} of ${runs[0].run.unknowns} at every iterate` : name;
      if (figure.hidden || flat) continue;
      const ratio = Math.min(2, devicePixelRatio || 1), g = canvas.getContext("2d");
      const w = canvas.clientWidth, h = canvas.clientHeight;
      Object.assign(canvas, { width: w * ratio, height: h * ratio });
      g.scale(ratio, ratio);
      const style = getComputedStyle(canvas), soft = style.getPropertyValue("--soft"), ink = style.getPropertyValue("--ink");
      const left = 46, right = w - 8, top = 6, bottom = h - 17;
      canvas.across = [left, right];
      const scaled = counts ? y => y : Math.log10, named = counts ? String : tick;
      const first = counts ? Math.min(...all) - 1 : Math.floor(Math.log10(Math.min(...all)));
      const last = counts ? Math.max(...all) + 1 : Math.max(first + 1, Math.ceil(Math.log10(Math.max(...all))));
      const X = x => left + (right - left) * Math.log(Math.max(x, low) / low) / Math.log(high / low);
      const Y = y => bottom - (bottom - top) * (scaled(y) - first) / (last - first);
      Object.assign(g, { font: "11px system-ui, sans-serif", fillStyle: soft, strokeStyle: style.getPropertyValue("--line"), textAlign: "right", textBaseline: "middle" });
      for (let e = first; e <= last; e += Math.ceil((last - first) / 4)) {
        const at = Y(counts ? e : 10 ** e);
        line(g, [[left, at], [right, at]]);
        g.fillText(named(e), left - 4, at);
      }
      Object.assign(g, { textAlign: "center", textBaseline: "top" });
      for (let e = Math.ceil(Math.log10(low)); e <= Math.log10(high); e++) g.fillText(tick(e), X(10 ** e), bottom + 3);
      for (const { run, at, colour } of runs) {
        const y = numbers(run), there = i => y[i] > 1e-13 && y[i] < Infinity;
        Object.assign(g, { strokeStyle: colour, fillStyle: colour, lineWidth: 1.6 });
        let piece = [];
        for (let i = 0; i <= at.length; i++) {
          if (i < at.length && there(i)) { piece.push([X(at[i]), Y(y[i])]); continue; }
          line(g, piece);
          piece = [];
        }
        const i = now(run);
        if (there(i)) { g.beginPath(); g.arc(X(at[i]), Y(y[i]), 3.5, 0, 7); g.fill(); }
      }
      Object.assign(g, { strokeStyle: ink, lineWidth: 1 });
      line(g, [[X(value), top], [X(value), bottom]]);
    }
  }
}

function line(g, points) {
  g.beginPath();
  points.forEach(([x, y], i) => i ? g.lineTo(x, y) : g.moveTo(x, y));
  g.stroke();
}

const tick = e => Math.abs(e) < 3 ? String(+(10 ** e).toPrecision(1)) : `1e${e}`;
