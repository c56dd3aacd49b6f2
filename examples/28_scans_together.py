"""Scans of two people, registered together: what one scan does not show, others fill in.

Each simulated scan sees a person from two sides, with holes. The people's own shapes are out of
reach of the betas of `small`. Registered one by one, what was hidden rests on the body alone.
Coregistration finds registrations, poses and a template for each person in turn, and lowers one
joint cost. The scans were made here, so that the truth is known.
"""

from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import FreeVertices
from workbench.registration.coregistration import (
    Coregistration,
    CoregistrationPlan,
    Fitted,
    ScansInMemory,
)
from workbench.synthetic import Holes, Joining, Noise, people, scan, scanners

SEED, PEOPLE, EACH = 1, 2, 4
body = wb.load_body("small")
who = people(body, np.zeros((1, 24, 3)), PEOPLE, SEED, own_shape=0.006)
poses = draw_poses(shipped_gaussian(), PEOPLE * EACH, np.random.default_rng(SEED))
subject, noise = np.repeat(np.arange(PEOPLE), EACH), np.random.default_rng(SEED)

scans, apart, truth, seen = [], [], [], []
for j, (s, pose) in enumerate(zip(subject, poses, strict=True)):
    own = replace(body, template=who[s].template)
    surface = own.vertices(pose, who[s].values["betas"], np.zeros(3))
    two = scanners(2, height=0.3, target=surface.mean(axis=0))
    made = scan(
        surface,
        body.faces,
        two,
        seed=j,
        noise=Noise(growth=5e-4),
        holes=Holes(),
        joining=Joining(),
    )
    near = pose + 0.02 * noise.standard_normal(pose.shape)
    start = {"pose": near, "betas": np.zeros(body.n_betas), "trans": np.zeros(3)}
    scans.append(made.scan)
    apart.append(FreeVertices(body, made.scan).register(start))
    truth.append(surface)
    seen.append(made.seen)

fits = [Fitted(*(one.values[name] for name in ("pose", "betas", "trans"))) for one in apart]
joint = Coregistration(body, ScansInMemory(tuple(scans), subject), CoregistrationPlan(rounds=2))
together = joint.run(fits)


def errors(vertices: np.ndarray) -> tuple[float, float]:
    """Mean distances from the truth in mm: of vertices that a scanner saw, and of the others."""
    off, there = 1e3 * np.linalg.norm(vertices - np.stack(truth), axis=2), np.stack(seen)
    return float(off[there].mean()), float(off[~there].mean())


costs = [sum(together.log[0].before.values()), *(sum(e.after.values()) for e in together.log)]
print("joint cost:", " ".join(f"{cost:.0f}" for cost in costs))
found = {
    "apart": errors(np.stack([one.vertices for one in apart])),
    "together": errors(together.vertices),
}
for name, (where_seen, elsewhere) in found.items():
    print(f"{name}: {where_seen:.2f} mm where it was seen, {elsewhere:.2f} mm elsewhere")
