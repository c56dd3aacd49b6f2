// Colours of magnitudes.

function cividis(share) { // coarsely: dark blue, grey, yellow; three numbers from 0 to 255
  const stops = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 182, 102], [254, 232, 56]];
  const x = Math.min(0.9999, Math.max(0, share)) * 5, i = Math.floor(x), t = x - i;
  return stops[i].map((low, c) => low + t * (stops[i + 1][c] - low));
}
