// SCAPE and BlendSCAPE in plain JavaScript, in double precision, on the arrays that Python wrote.
// The same as workbench.bodies.triangles: X = B D Q for each triangle, then stitching.

class Body {
  constructor(data) {
    Object.assign(this, data);
    this.N = this.template.length / 3;
    this.F = this.faces.length / 3;
    this.K = this.parents.length;
    this.B = this.shapedirs.length / (9 * this.F);
    this.J = this.near.length / this.F;
    this.root = this.regressed(this.template);
    this.corners = Uint32Array.from({ length: 3 * this.F }, (_, i) => i);
  }

  regressed(points) { // the root joint of a surface
    const found = [0, 0, 0];
    for (let i = 0; i < this.N; i++) for (let d = 0; d < 3; d++)
      found[d] += this.root_row[i] * points[3 * i + d];
    return found;
  }

  // the edges X e of each triangle, e_0 to its third corner and e_1 to its second: 6 F numbers
  edges(pose, betas, { weights = true, pose_shapes = true, shape_shapes = true } = {}) {
    const turn = [], found = new Float64Array(6 * this.F), { F, J, B } = this;
    for (let k = 0; k < this.K; k++) {
      const R = rotation(pose[3 * k], pose[3 * k + 1], pose[3 * k + 2]), p = this.parents[k];
      turn.push(p < 0 ? R : times(turn[p], R));
    }
    for (let f = 0; f < F; f++) {
      const [a, b, c] = this.faces.subarray(3 * f, 3 * f + 3), blended = new Array(9).fill(0);
      const first = f ? this.ends[f - 1] : 0;
      let heaviest = first;
      for (let s = first; s < this.ends[f]; s++) if (this.shares[s] > this.shares[heaviest]) heaviest = s;
      for (let s = first; s < this.ends[f]; s++) {
        const share = weights ? this.shares[s] : s === heaviest ? 1 : 0;
        for (let n = 0; n < 9; n++) blended[n] += share * turn[this.carriers[s]][n];
      }
      const D = [1, 0, 0, 0, 1, 0, 0, 0, 1], Q = [1, 0, 0, 0, 1, 0, 0, 0, 1];
      if (shape_shapes) for (let n = 0; n < 9; n++) for (let j = 0; j < B; j++)
        D[n] += this.shapedirs[(9 * f + n) * B + j] * (betas[j] || 0);
      if (pose_shapes) for (let n = 0; n < 9; n++) for (let j = 0; j < 3 * J; j++)
        Q[n] += this.posedirs[(9 * f + n) * 3 * J + j] * pose[3 * this.near[J * f + Math.floor(j / 3)] + j % 3];
      const X = times(blended, times(D, Q));
      [c, b].forEach((end, i) => {
        const edge = [0, 1, 2].map(d => this.template[3 * end + d] - this.template[3 * a + d]);
        applied(X, edge).forEach((value, d) => { found[6 * f + 3 * i + d] = value; });
      });
    }
    return found;
  }

  vertices(pose, betas, keep = {}) {
    const edges = this.edges(pose, betas, keep), pulls = new Float64Array(3 * this.N);
    for (let f = 0; f < this.F; f++) {
      const [a, b, c] = this.faces.subarray(3 * f, 3 * f + 3);
      [c, b].forEach((end, i) => {
        for (let d = 0; d < 3; d++) {
          const value = edges[6 * f + 3 * i + d];
          pulls[3 * end + d] += value;
          pulls[3 * a + d] -= value;
        }
      });
    }
    const found = this.stitched(pulls), root = this.regressed(found);
    return found.map((x, i) => x + this.root[i % 3] - root[i % 3]);
  }

  // A'A V = pulls by the banded Cholesky factor of A'A; the vertex that is not in `order` is at 0
  stitched(pulls) {
    const n = this.order.length, width = this.factor.length / n, L = this.factor;
    const found = new Float64Array(3 * this.N), y = new Float64Array(n);
    for (let d = 0; d < 3; d++) {
      for (let i = 0; i < n; i++) y[i] = pulls[3 * this.order[i] + d];
      for (let j = 0; j < n; j++) { // factor[m, j] is L[j + m, j]
        y[j] /= L[j];
        for (let m = 1; m < width && j + m < n; m++) y[j + m] -= L[m * n + j] * y[j];
      }
      for (let j = n - 1; j >= 0; j--) {
        for (let m = 1; m < width && j + m < n; m++) y[j] -= L[m * n + j] * y[j + m];
        y[j] /= L[j];
      }
      for (let i = 0; i < n; i++) found[3 * this.order[i] + d] = y[i];
    }
    return found;
  }

  // what is painted: without stitching, each triangle about its middle in the stitched surface
  drawn(pose, betas, keep) {
    const points = this.vertices(pose, betas, keep);
    if (keep.stitched) return { points, faces: this.faces };
    const edges = this.edges(pose, betas, keep), apart = new Float64Array(9 * this.F);
    for (let f = 0; f < this.F; f++) for (let d = 0; d < 3; d++) {
      const second = edges[6 * f + 3 + d], third = edges[6 * f + d];
      const sum = [0, 1, 2].reduce((s, i) => s + points[3 * this.faces[3 * f + i] + d], 0);
      const first = (sum - second - third) / 3;
      [first, first + second, first + third].forEach((x, i) => { apart[9 * f + 3 * i + d] = x; });
    }
    return { points: apart, faces: this.corners, of: this.faces };
  }
}
