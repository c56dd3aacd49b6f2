// The SMPL function in plain JavaScript, in double precision, on the arrays that Python wrote.
// The same as workbench.bodies.forward.surface: rest surface, joints, chain, skinning.

function dualQuaternion(R, t) { // Shepperd's choice of the largest of four, then 1/2 (0, t) q
  const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = R;
  const d = [1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz];
  const q = [[d[0], zy - yz, xz - zx, yx - xy], [zy - yz, d[1], xy + yx, xz + zx],
             [xz - zx, xy + yx, d[2], yz + zy], [yx - xy, xz + zx, yz + zy, d[3]]];
  let k = 0;
  for (let i = 1; i < 4; i++) if (d[i] > d[k]) k = i;
  const [w, x, y, z] = q[k].map(part => part / (2 * Math.sqrt(d[k])));
  return [w, x, y, z, -(t[0] * x + t[1] * y + t[2] * z) / 2,
          (w * t[0] + t[1] * z - t[2] * y) / 2, (w * t[1] + t[2] * x - t[0] * z) / 2,
          (w * t[2] + t[0] * y - t[1] * x) / 2];
}

class Body {
  constructor(data) {
    Object.assign(this, data);
    this.N = this.template.length / 3;
    this.K = this.parents.length;
    this.B = this.N ? this.shapedirs.length / (3 * this.N) : 0;
    this.heaviest = new Uint16Array(this.N);
    for (let i = 0; i < this.N; i++) {
      let k = 0;
      for (let j = 1; j < 4; j++) if (this.weights[4 * i + j] > this.weights[4 * i + k]) k = j;
      this.heaviest[i] = this.carriers[4 * i + k];
    }
  }

  // pose: 3 K radians, betas: B; keep: which parts of SMPL are on, and how it is skinned
  vertices(pose, betas, keep = {}) {
    const { weights = true, pose_shapes = true, shape_shapes = true, dual = false } = keep;
    const { N, K, B } = this, rest = Float64Array.from(this.template);
    const J = Float64Array.from(this.joints_mean);
    if (shape_shapes) for (let b = 0; b < B; b++) {
      const beta = betas[b] || 0;
      if (!beta) continue;
      for (let i = 0; i < 3 * N; i++) rest[i] += beta * this.shapedirs[b * 3 * N + i];
      for (let i = 0; i < 3 * K; i++) J[i] += beta * this.joints_move[b * 3 * K + i];
    }
    const R = [];
    for (let k = 0; k < K; k++) R.push(rotation(pose[3 * k], pose[3 * k + 1], pose[3 * k + 2]));
    if (pose_shapes) for (const { joint, vertices, shapes } of this.bulges) {
      const f = R[joint].map((entry, n) => entry - (n % 4 === 0 ? 1 : 0));
      for (let v = 0; v < vertices.length; v++) for (let d = 0; d < 3; d++) {
        let sum = 0;
        for (let n = 0; n < 9; n++) sum += shapes[27 * v + 9 * d + n] * f[n];
        rest[3 * vertices[v] + d] += sum;
      }
    }
    const turn = [], place = [], shift = [];
    for (let k = 0; k < K; k++) {
      const p = this.parents[k], at = J.subarray(3 * k, 3 * k + 3);
      if (p < 0) { turn.push(R[k]); place.push([...at]); }
      else {
        const bone = [0, 1, 2].map(d => at[d] - J[3 * p + d]), up = applied(turn[p], bone);
        turn.push(times(turn[p], R[k]));
        place.push([0, 1, 2].map(d => place[p][d] + up[d]));
      }
      const back = applied(turn[k], at);
      shift.push([0, 1, 2].map(d => place[k][d] - back[d]));
    }
    this.posedJoints = place;
    return dual && weights ? this.dual(rest, turn, shift) : this.linear(rest, turn, shift, weights);
  }

  drawn(pose, betas, keep) {
    return { points: this.vertices(pose, betas, keep), faces: this.faces };
  }

  linear(rest, turn, shift, weights) {
    const posed = new Float64Array(3 * this.N);
    for (let i = 0; i < this.N; i++) {
      const v = rest.subarray(3 * i, 3 * i + 3);
      for (let j = 0; j < (weights ? 4 : 1); j++) {
        const w = weights ? this.weights[4 * i + j] : 1;
        if (!w) continue;
        const k = weights ? this.carriers[4 * i + j] : this.heaviest[i];
        const moved = applied(turn[k], v);
        for (let d = 0; d < 3; d++) posed[3 * i + d] += w * (moved[d] + shift[k][d]);
      }
    }
    return posed;
  }

  dual(rest, turn, shift) {
    const Q = turn.map((R, k) => dualQuaternion(R, shift[k])), posed = new Float64Array(3 * this.N);
    for (let i = 0; i < this.N; i++) {
      const q = [0, 0, 0, 0, 0, 0, 0, 0], first = Q[this.heaviest[i]];
      for (let j = 0; j < 4; j++) {
        const w = this.weights[4 * i + j], other = Q[this.carriers[4 * i + j]];
        if (!w) continue;
        let same = 0;
        for (let n = 0; n < 4; n++) same += first[n] * other[n];
        for (let n = 0; n < 8; n++) q[n] += (same < 0 ? -w : w) * other[n];
      }
      const size = Math.hypot(q[0], q[1], q[2], q[3]);
      const [w, x, y, z, e, f, g, h] = q.map(part => part / size);
      const [a, b, c] = rest.subarray(3 * i, 3 * i + 3);
      const u = [y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c];
      posed[3 * i] = a + 2 * (y * u[2] - z * u[1]) + 2 * (w * f - e * x + y * h - z * g);
      posed[3 * i + 1] = b + 2 * (z * u[0] - x * u[2]) + 2 * (w * g - e * y + z * f - x * h);
      posed[3 * i + 2] = c + 2 * (x * u[1] - y * u[0]) + 2 * (w * h - e * z + x * g - y * f);
    }
    return posed;
  }
}
