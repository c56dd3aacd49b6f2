"""Training a body is fitting with other names free: the template and everybody's pose at once.

Phi = argmin over Phi of sum_j min over theta_j, beta_j. Six meshes of a tube, each bent otherwise
and thicker or thinner, are all that is known. The template is a block like any other, so the
problem that finds it is a `Problem`, the solver is any, and the diagnosis says what meshes can
never tell.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import workbench as wb
from workbench.lectures.material.tubes import tube

rng = np.random.default_rng(0)
true = tube(rings=9, around=8)
poses = 0.6 * rng.standard_normal((6, 2, 3))  # rad
betas = rng.standard_normal((6, 1))
meshes = true.vertices(poses, betas)
meshes = meshes + 0.001 * rng.standard_normal(meshes.shape)  # 1 mm of noise

dented = true.template + 0.01 * rng.standard_normal(true.template.shape)  # a first guess, 1 cm off
first = replace(true, template=dented)
learning = first.freed("template")
terms, start = [], {"template": dented}
for j, mesh in enumerate(meshes):
    symbols = [block.symbol for block in learning.blocks(f"scan {j}/")]
    terms.append(wb.residuals.vertices(learning.points(*symbols), mesh, sigma=0.001))
    terms.append(wb.residuals.gaussian(symbols[1], name=f"shape {j}"))
    start |= learning.start(f"scan {j}/")
    start[f"scan {j}/trans"] = mesh.mean(axis=0) - dented.mean(axis=0)
problem = wb.Problem(terms, tuple(start))
solution = wb.solve(problem, start)
trained = replace(true, template=solution.values["template"])


def explains(body: wb.SkinnedBody, mesh: np.ndarray) -> float:
    """How far the body stays from a mesh when pose, shape and place are fitted to it, rms m."""
    symbols = [block.symbol for block in body.blocks()]
    terms = [wb.residuals.vertices(body.points(*symbols), mesh, sigma=0.001)]
    terms.append(wb.residuals.gaussian(symbols[1]))
    problem = wb.Problem(terms, free=["pose", "betas", "trans"])
    found = wb.solve(problem, body.start()).values
    return float(np.sqrt(np.mean((body.vertices(**found) - mesh) ** 2)))


# a pose and a thickness that nobody has seen
stranger = true.vertices(0.6 * rng.standard_normal((2, 3)), [1.0])
before, after = explains(first, stranger), explains(trained, stranger)

here = problem.linearize(start | solution.values)
unseen = len(here.gradient) - here.rank
noticed = {}
for axis, along in zip("xyz", np.eye(3), strict=True):
    step = {name: np.zeros_like(value) for name, value in start.items()}
    step["template"] += along
    step |= {f"scan {j}/trans": -along for j in range(len(meshes))}
    packed = problem.free.pack(step)
    change = np.linalg.norm(here.jacobian @ packed) / np.linalg.norm(packed)  # sigmas per unit
    noticed[f"the template moves along {axis}, everybody back"] = change

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    print(
        f"{len(here.gradient)} unknowns, {len(here.residual)} residuals: {solution.status.name} "
        f"after {solution.iterations} iterations"
    )
    print(
        f"an unseen mesh is met to {1e3 * before:.2f} mm at first, {1e3 * after:.2f} mm in the end"
    )
    print(f"{unseen} directions that no mesh tells, among them:")
    for name, change in noticed.items():
        print(f"  {name} ({change:.0e} sigmas per unit)")
    with house_style():
        figure, (ax,) = sheet(8, 3.4)
        for name, body in (("first guess", first), ("trained", trained), ("truth", true)):
            x, y, _ = (body.template - body.template.mean(axis=0)).T
            ax.plot(1e2 * x, 1e2 * y, ".", ms=5, label=name)
        ax.set(xlabel="along the tube (cm)", ylabel="across it (cm)", aspect="equal")
        ax.legend(loc="upper center", ncols=3)
        ax.set_ylim(-9, 12)
    Path(__file__).with_name("training.png").write_bytes(png(figure))
    print("The template from the side: at first, trained on six bent meshes, and true. Trained, it")
    print("has the true rings, turned about the axis, which meshes hardly tell.")
