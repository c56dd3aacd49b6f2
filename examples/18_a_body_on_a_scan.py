"""A body on a scan that nobody labelled: many starts, then free vertices.

Four simulated depth cameras see a synthetic person, whose own shape no betas of `small` can
express, with 2 mm of noise, holes, and clutter in the room. The scan knows neither where the
person stands nor which way it faces. First pose, betas and place are found from many starts;
then the vertices themselves are free, coupled to the model by the edges of the mesh. The scan was
made here, so the truth is known, and so is what was not seen.
"""

import numpy as np

import workbench as wb
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import VERTEX_STAGES, FreeVertices, doubts, fit_model, support
from workbench.synthetic import Clutter, Holes, Noise, people, scan, scanners

SEED = 4
body = wb.load_body("small")
poses = draw_poses(shipped_gaussian(), 1, np.random.default_rng(SEED))
(person,) = people(body, poses, 1, SEED, own_shape=0.005)
simulated = scan(
    person.vertices,
    body.faces,
    scanners(4),
    seed=SEED,
    noise=Noise(growth=0.0, floor=0.002),
    holes=Holes(),
    clutter=Clutter(0.2),
)
print(f"{simulated.scan.n_points} points, {100 * simulated.clutter.mean():.0f} % of them clutter")

fit = fit_model(body, simulated.scan)
warnings = doubts(fit, support(fit))


def errors(vertices: np.ndarray) -> tuple[float, float]:
    """Mean distances from the truth in mm: of vertices that a camera saw, and of the others."""
    off = 1e3 * np.linalg.norm(vertices - person.vertices, axis=1)
    return float(off[simulated.seen].mean()), float(off[~simulated.seen].mean())


model = errors(fit.vertices())
print(f"model: {model[0]:.1f} mm where it was seen, {model[1]:.1f} mm elsewhere")
for warning in warnings:
    print("warning:", warning)

registered = FreeVertices(body, simulated.scan).register(fit.values, VERTEX_STAGES[2:])
free = errors(registered.vertices)
print(f"free vertices: {free[0]:.1f} mm where it was seen, {free[1]:.1f} mm elsewhere")
