// A calibrated camera with Brown's distortion, as workbench.geometry.camera computes it.

class Lens {
  constructor(view) {
    Object.assign(this, view); // name, size, focal, centre, distortion, rotation, translation
    this.R = rotation(...view.rotation);
    const [a, b, c, d, e, f, g, h, i] = this.R;
    this.back = [a, d, g, b, e, h, c, f, i];
    this.eye = applied(this.back, view.translation).map(x => -x);
    this.up = applied(this.back, [0, -1, 0]);
  }

  cropTo(pixels) { // what is shown of the image: the surroundings of these, or all of it
    const [W, H] = this.size, us = pixels.map(([u]) => u), vs = pixels.map(([, v]) => v);
    if (!pixels.length) { this.crop = [0, 0, W, H]; return; }
    const [low, high, under, over] = [Math.min(...us), Math.max(...us), Math.min(...vs), Math.max(...vs)];
    const room = 0.35 * Math.max(high - low, over - under);
    this.crop = [Math.max(0, low - room), Math.max(0, under - room), Math.min(W, high + room), Math.min(H, over + room)];
  }

  distorted(x, y) {
    const [k1, k2, p1, p2, k3] = this.distortion, r = x * x + y * y;
    const s = 1 + r * (k1 + r * (k2 + r * k3));
    return [x * s + 2 * p1 * x * y + p2 * (r + 2 * x * x),
            y * s + p1 * (r + 2 * y * y) + 2 * p2 * x * y];
  }

  pixel(point) { // a point of the world in m -> px
    const q = applied(this.R, point).map((x, d) => x + this.translation[d]);
    const [x, y] = this.distorted(q[0] / q[2], q[1] / q[2]);
    return [this.focal[0] * x + this.centre[0], this.focal[1] * y + this.centre[1]];
  }

  ray([u, v]) { // px -> the unit vector, in the world, along which the camera sees it
    const wanted = [(u - this.centre[0]) / this.focal[0], (v - this.centre[1]) / this.focal[1]];
    let [x, y] = wanted;
    for (let n = 0; n < 30; n++) { // a fixed point, as lenses distort little
      const [a, b] = this.distorted(x, y);
      x += wanted[0] - a;
      y += wanted[1] - b;
    }
    return unit(applied(this.back, [x, y, 1]));
  }

  nearestOnRay(point, direction) {
    const s = dot(point.map((x, d) => x - this.eye[d]), direction);
    return this.eye.map((x, d) => x + s * direction[d]);
  }
}
