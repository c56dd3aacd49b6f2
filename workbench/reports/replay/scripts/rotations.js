// Rotations in plain JavaScript.

function rotation(x, y, z) { // exp of a rotation vector in radians, row by row
  const t = Math.hypot(x, y, z);
  const a = t < 1e-4 ? 1 - t * t / 6 : Math.sin(t) / t;
  const s = t < 1e-4 ? 0.5 - t * t / 48 : Math.sin(t / 2) / t, b = 2 * s * s, c = 1 - b * t * t;
  return [c + b * x * x, b * x * y - a * z, b * x * z + a * y,
          b * x * y + a * z, c + b * y * y, b * y * z - a * x,
          b * x * z - a * y, b * y * z + a * x, c + b * z * z];
}

function times(A, B) {
  const C = new Array(9);
  for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++)
    C[3 * r + c] = A[3 * r] * B[c] + A[3 * r + 1] * B[3 + c] + A[3 * r + 2] * B[6 + c];
  return C;
}

function applied(A, v) {
  return [A[0] * v[0] + A[1] * v[1] + A[2] * v[2], A[3] * v[0] + A[4] * v[1] + A[5] * v[2],
          A[6] * v[0] + A[7] * v[1] + A[8] * v[2]];
}
