"""A made-up run: a made-up body seen by two made-up cameras, with names that are hard to write."""

from functools import cache

import numpy as np

from tests.bodies_made_up import smpl_like_body
from workbench import Block, Camera, Problem, Values, residuals
from workbench.experiments import Experiment, Outcome, Setup, run
from workbench.fitting.setup import Measure, View

NAMES = ("left/camera", "<b>right</b> & $x$ 左")
SIZE = (640, 480)


@cache
def outcome_made_up() -> Outcome:
    """Solved by Levenberg-Marquardt, compared with Gauss-Newton and LBFGS."""
    return run(Experiment("made <i>up</i>", setup_made_up, "for tests"))


def setup_made_up() -> Setup:
    """The pose, betas and trans of a body from its joints in two images, the second held out."""
    body = smpl_like_body()
    rng = np.random.default_rng(0)
    pose, betas, trans = body.blocks()
    points = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    truth = {
        pose.name: rng.normal(scale=0.2, size=(24, 3)),
        betas.name: rng.normal(size=4),
        trans.name: np.array([0.1, 0.0, 0.2]),
    }
    start = body.start()
    views = []
    for i, name in enumerate(NAMES):
        camera = Camera(f"{name}/")
        start |= camera.values(
            K=[[500, 0, 320], [0, 500, 240], [0, 0, 1]], t=[0.2 * i, 0.0, 5.0], distortion=[0.01]
        )
        pixels = camera.pixels(body.joints(*truth.values()), start) + rng.normal(size=(24, 2))
        confidence = np.linspace(0, 1, 24)
        views.append(View(name, camera, SIZE, "joints", pixels, confidence, held_out=i == 1))
    seen = Block("scan 3/observed", (24, 2), "px")
    sure = Block("file", (24,))  # a name that NumPy's own savez cannot take
    terms = [
        residuals.keypoints(points, views[0].camera, seen.symbol, sure.symbol**2, sigma=1.0),
        residuals.gaussian(betas.symbol, name="shape <prior>"),
        residuals.gaussian(trans.symbol, name="place"),
    ]
    return Setup(
        problem=Problem(terms, ("pose", "betas", "trans"), blocks=views[0].camera.blocks),
        start=start | {seen.name: views[0].observed, sure.name: views[0].confidence},
        question="Where is <script>alert(1)</script>?",
        body=body,
        views=tuple(views),
        truth=body.vertices(*truth.values()),
        measures=_measures,
        compared=("gauss-newton", "nlopt-lbfgs"),
    )


def _measures(values: Values) -> tuple[Measure, ...]:
    size = float(np.abs(values["betas"]).max())
    return Measure("largest |beta|", size, "sd"), Measure("unknown", float("nan"), "mm")
