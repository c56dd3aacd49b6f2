"""Soft tissue as unknowns: coefficients of dynamic blend shapes, fitted with pose and shape.

One frame of a heavy person in motion, whose surface is seen. The coefficients are a block like any
other, and the person's own gain is part of the graph: a power of the body mass index, a function of
the betas that are fitted too. A fit without tissue puts what it cannot explain into pose and shape.
How well the coefficients are known depends on how much of the surface is seen. (The tissue of the
embedded body is simulated. DMPL's coefficients are fitted likewise: they are the last betas of
`with_dmpls`, so that a block of them is put below the others, `cs.vertcat(betas, dmpls)`.)
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as cs
import numpy as np

import workbench as wb
from workbench.motions import load_tissue
from workbench.motions.soft_tissue import with_tissue
from workbench.synthetic.made_up import made_up_motion

NOISE, MARKERS = 0.002, 350  # m; vertices, as many as the markers of Park and Hodgins (2006)
rng = np.random.default_rng(0)
body, tissue = wb.load_body("default"), load_tissue()

# What is true: the frame of a motion in which the tissue is displaced most.
person = np.array([0, 0, 2.0, 0, 0, 0, 0, 0, 0, 0])
motion = replace(made_up_motion(body, seconds=1.5, seed=3), betas=person)
phi = tissue.coefficients(body, motion)
t = int(np.linalg.norm(phi, axis=1).argmax())
truth = {"pose": motion.pose[t], "betas": person, "trans": motion.trans[t], "tissue": phi[t]}
surface = tissue.surface(body, motion, phi)[t]
displaced = 1e3 * np.linalg.norm(surface - motion.vertices(body)[t], axis=1)
print(f"tissue is displaced by up to {displaced.max():.0f} mm, {displaced.mean():.0f} on average")

# In symbols.
pose, betas, trans = (block.symbol for block in body.blocks())
block = wb.Block("tissue", (tissue.n_coefficients,))
moved = tissue.gain_of(body, betas) * block.symbol
points = with_tissue(body, tissue).points(pose, cs.vertcat(betas, moved), trans)


def seen(vertices: Sequence[int], places: np.ndarray) -> wb.Problem:
    """Some vertices of the surface at known places (N, 3) m, with everything free."""
    off = cs.vec(points.symbol[:, vertices] - places[vertices].T)
    residual = wb.Residual("surface", off, NOISE, "m", points=[points], rows_per_point=3)
    return wb.Problem([residual], ("pose", "betas", "trans", "tissue"), blocks=[block])


every = range(body.n_vertices)
start = body.start() | {"tissue": np.zeros(tissue.n_coefficients)}
whole = seen(every, surface)
errors = {}
for name, problem in (("without", whole.freeing("pose", "betas", "trans")), ("with", whole)):
    solution = wb.solve(problem, start)
    values = start | solution.values
    errors[name] = {key: float(np.abs(values[key] - truth[key]).max()) for key in truth}
    print(
        f"{name} tissue: betas are off by {errors[name]['betas']:.0e} sd, "
        f"angles by {np.rad2deg(errors[name]['pose']):.0e} degrees"
    )
print(f"coefficients are off by {errors['with']['tissue']:.0e}")
gain = tissue.gain(body, values["betas"])
print(f"the person's tissue moves {gain:.3f} times as far as that of the mean person")
diagnosis = wb.diagnose(whole, values)
print(f"rank {diagnosis.rank} of {whole.free.size}")

# With noise, and with fewer points: standard deviations of the coefficients, and their errors.
noisy = surface + NOISE * rng.standard_normal(surface.shape)
markers = np.sort(rng.permutation(body.n_vertices)[:MARKERS]).tolist()
deviations, rms = {}, {}
typical = float(np.sqrt(np.square(phi[t]).mean()))
for name, vertices in (("the whole surface", every), (f"{MARKERS} of its vertices", markers)):
    problem = seen(vertices, noisy)
    solution = wb.solve(problem, start)
    covariance = problem.linearize(solution.values).covariance
    sd = np.sqrt(np.diag(covariance)[-tissue.n_coefficients :])
    deviations[name] = float(np.sqrt(np.square(sd).mean()))
    rms[name] = float(np.sqrt(np.square(solution.values["tissue"] - truth["tissue"]).mean()))
    print(
        f"{name}, 2 mm of noise: coefficients of {typical:.1f} (rms) are off by {rms[name]:.2f}, "
        f"with a standard deviation of {deviations[name]:.2f}"
    )
