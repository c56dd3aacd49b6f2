"""Four body models, each fitted to some points of itself: skinned and triangle bodies compared.

The observed points are those of the fitted model, with noise, so that the models differ in their
equations and not in how well they explain the data. All data are synthetic.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument, check_known
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_people import (
    MADE_OF_THE_MODEL,
    bent_person,
    random_start,
    start_text,
    with_refined_answer,
)
from workbench.fitting.body_priors import shape_prior
from workbench.fitting.setup import GRADED, Measure, Setup, distances, rms
from workbench.problem import Problem
from workbench.residuals import vertices


def _linear_blend_skinning(body: SkinnedBody) -> SkinnedBody:
    return replace(body, posedirs=np.zeros_like(body.posedirs), name=f"{body.name}, LBS")


MODELS: Mapping[str, Callable[[SkinnedBody], SkinnedBody | TriangleBody]] = {
    "lbs": _linear_blend_skinning,
    "smpl": lambda body: body,
    "scape": scape,
    "blend-scape": blend_scape,
}
TURN = 1.5  # how much more the root is turned than other joints


def body_points(
    model: str = "smpl",
    body: str = "small",
    seed: int = 0,
    start: int = 0,
    every: int = 7,
    noise: float = 0.005,
    pose_sigma: float = 0.4,
) -> Setup:
    """Fit one of MODELS to every `every`-th of its own vertices; noise in m, pose_sigma in rad.

    The triangle models have the template, tree, shape space and J_regressor of `body`, and no
    learned posedirs. Raises UnknownName for another model.
    """
    check_known("model", model, MODELS)
    if every < 1:
        raise BadArgument(f"every says that each such vertex is observed, 1 or more, not {every}")
    fitted, rng = MODELS[model](load_skinned(body)), np.random.default_rng(seed)
    truth = bent_person(fitted, rng, pose_sigma)
    pose, betas, trans = fitted.blocks()
    truth[pose.name][0] *= TURN
    surface = fitted.vertices(**truth)
    seen = np.arange(0, fitted.n_vertices, every)
    observed = surface[seen] + noise * rng.standard_normal((len(seen), 3))
    points = fitted.points(pose.symbol, betas.symbol, trans.symbol, vertices=seen)
    data = vertices(points, observed, sigma=noise or 1e-3)

    def measures(values: Values) -> tuple[Measure, ...]:
        found = fitted.vertices(*(values[block.name] for block in fitted.blocks()))
        return (
            rms("observed points", distances(found[seen], observed)),
            rms("vertex to synthetic truth", distances(found, surface)),
        )

    setup = Setup(
        problem=Problem((data, shape_prior(fitted)), (pose.name, betas.name, trans.name)),
        start=random_start(fitted, seed, start),
        question=f"{len(seen)} vertices of a synthetic person (seed {seed}) of the model {model} "
        f"are known to {1e3 * noise:g} mm. Does a fit of this model find the person"
        f"{start_text(start)}?",
        body=fitted,
        truth=surface,
        measures=measures,
        priors=("shape prior",),
        compared=GRADED,
        synthetic=MADE_OF_THE_MODEL,
    )
    return with_refined_answer(setup, truth)


MODEL_FITS = tuple(
    Experiment(f"body-points-{model}", body_points, f"53 points, {text}", {"model": model})
    for model, text in (
        ("lbs", "linear blend skinning"),
        ("smpl", "SMPL"),
        ("scape", "SCAPE"),
        ("blend-scape", "BlendSCAPE"),
    )
)
