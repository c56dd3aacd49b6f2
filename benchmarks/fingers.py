"""What fingers cost: a body of 24 joints beside the same body with hands, of 52.

Both are timed on all of their vertices, and on fits of a real person in one frame of four cameras.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import workbench as wb
from benchmarks import ours
from benchmarks.timing import Timings, side_by_side
from workbench.bodies import SkinnedBody, pose_space
from workbench.bodies.catalogue import load_skinned
from workbench.experiments.balance import balance, observations
from workbench.fitting import Setup
from workbench.fitting.keypoints import WITH_HANDS, keypoint_fit
from workbench.fitting.observations import Observations

PLAIN, HANDS = "full", "full-hands"
FRAMES = (0, 10, 20, 30, 40, 50, 60)
NOISE, COMPONENTS = 2.0, 6  # px; of the pose space of each hand, in which fingers are drawn
JACOBIAN, STEP, FRAME, FINGERS = "Jacobian", "Gauss-Newton step", "frame", "frame with fingers"


def measure(rounds: int, frames: tuple[int, ...] = FRAMES) -> dict[str, Any]:
    """Seconds by way of computing, kind and body, and the sizes of both."""
    made = {name: ours.cases(name, load_skinned(name)) for name in (PLAIN, HANDS)}
    seconds: dict[str, Any] = {}
    for way in made[PLAIN]:
        cases = {name: ways[way] for name, ways in made.items()}
        people = {name: case.people(4) for name, case in cases.items()}
        for kind in (JACOBIAN, STEP):
            candidates = {
                n: ours.as_built(way, partial(_of, kind, case, people[n]))
                for n, case in cases.items()
            }
            seconds[f"{way}: {kind}"] = side_by_side(candidates, range(4), rounds)
    fits = {name: [balance(frame, name) for frame in frames] for name in made}
    seconds[FRAME] = _of_frames(fits, rounds)
    both = zip(fits[HANDS], frames, strict=True)
    seconds[FINGERS] = _of_frames(fits | {HANDS: [with_fingers(*one) for one in both]}, rounds)
    sizes = {
        name: {"vertices": case.body.n_vertices, "unknowns": case.problem.free.size}
        for name, ways in made.items()
        for case in [ways[ours.NUMPY]]
    }
    return {"sizes": sizes, "seconds": seconds}


def with_fingers(setup: Setup, frame: int) -> Setup:
    """The same frame, in which all 65 keypoints are seen: those of a fit whose fingers are drawn.

    They are simulated, with normally distributed noise.
    """
    body = setup.body
    assert isinstance(body, SkinnedBody)
    rng, space = np.random.default_rng(frame), pose_space(body, COMPONENTS)
    values = {**setup.start, **wb.solve(setup.problem, setup.start).values}
    drawn = space.poses(body, space.deviations * rng.standard_normal(space.n_components))
    pose = np.where(drawn.any(axis=1, keepdims=True), drawn, values["pose"])
    points = body.landmark(WITH_HANDS, pose, values["betas"], values["trans"])
    observed, _ = observations(frame)
    photographs = []
    for view, photo in zip(setup.views, observed.photographs, strict=True):
        pixels = view.camera.pixels(points, values) + NOISE * rng.standard_normal((len(points), 2))
        photographs.append(replace(photo, pixels=pixels, confidence=np.ones(len(points))))
    seen = Observations(body.landmark_names(WITH_HANDS), tuple(photographs))
    return keypoint_fit(seen, body, "Simulated keypoints of body and fingers.")


def _of(kind: str, case: Any, people: list[Any], which: int) -> object:
    here = case.problem.linearize_at(people[which], case.fixed)
    return here.jacobian if kind == JACOBIAN else here.step()


def _of_frames(fits: Mapping[str, list[Setup]], rounds: int) -> Timings:
    """Seconds a frame: one problem of each body is solved for the observations of every frame."""

    def solve(setups: list[Setup], _: object) -> None:
        for setup in setups:
            wb.solve(setups[0].problem, setup.start)

    timings = side_by_side({n: partial(solve, some) for n, some in fits.items()}, [None], rounds)
    return {n: [t / len(fits[n]) for t in taken] for n, taken in timings.items()}
