"""A video as one problem: an iteration of Levenberg and Marquardt, and the memory that it takes.

Every frame has a pose and a place of its own, 75 unknowns, four cameras see its joints or its
keypoints, and all frames share ten betas and the cameras, which are known. Pose and place change
little from frame to frame. What is seen is a smooth motion of the body, made up, to one pixel.
"""

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spsolve

import workbench as wb
from benchmarks.scaling import peak
from benchmarks.timing import side_by_side
from workbench.arrays import Array
from workbench.geometry.rotation import matrix_from_vector
from workbench.problem import frames as frame_chains
from workbench.problem.storage import by_nonzeros

BODY = "default"
JOINTS, COCO = "24 joints", "COCO landmarks"
FRAMES, FEW, LENGTHS = 200, 6, (200, 500, 1000, 2000)
APART, WHOLE, STEP, DIRECT = "frames one by one", "linearize", "step", "step by hand, spsolve"
ITERATION = "LM iteration"
SIGMA, DAMPING = 1.0, 1e-3  # px; of the steps that are compared
ITERATIONS = 6  # of a solve that is timed
SAME = 1e-9  # by how much the solution of a few frames may differ from the dense one


@dataclass(frozen=True, eq=False)
class Film:
    """A sequence of so many frames, where a fit begins, and the same frames apart."""

    frame: wb.Problem
    video: wb.Problem
    values: wb.Values

    @cached_property
    def split(self) -> tuple[Array, Array]:
        """The free and the fixed numbers."""
        return self.video.split(self.values)

    @cached_property
    def apart(self) -> list[tuple[Array, Array]]:
        """Those of every frame."""
        own = {name for name, block in self.video.known.items() if block.framed}
        count = len(self.values["trans"])
        return [
            self.frame.split({n: v[t] if n in own else v for n, v in self.values.items()})
            for t in range(count)
        ]


def film(frames: int, seen: str = JOINTS) -> Film:
    """A body that bends and turns slowly (synthetic)."""
    body, rng = wb.load_body(BODY), np.random.default_rng(0)
    pose, betas, trans = (block.symbol for block in body.blocks())
    of_joints = seen == JOINTS
    points = (
        body.joint_points(pose, betas, trans)
        if of_joints
        else body.landmark_points("coco", pose, betas, trans)
    )
    times = np.arange(frames)[:, None, None] / 30  # s
    turns = 0.2 * rng.standard_normal((24, 3)) * np.sin(2 * times + rng.uniform(0, 6, (24, 3)))
    shape = rng.standard_normal(body.n_betas)
    way = np.stack([0.1 * np.sin(times[:, 0, 0] + k) for k in range(3)], axis=1)
    place = body.joints if of_joints else lambda *at: body.landmark("coco", *at)
    where = [place(one, shape, t) for one, t in zip(turns, way, strict=True)]
    terms, numbers, cameras = [], {}, []
    for i in range(4):
        camera = wb.Camera(f"camera {i + 1}/")
        K = np.array([[1000.0, 0, 500], [0, 1000.0, 500], [0, 0, 1]])  # px
        R = np.diag([1.0, -1, -1]) @ matrix_from_vector([0, -np.pi / 2 * i, 0])
        known = camera.values(K=K, R=R, t=[0, 0, 4])
        pixels = np.array([camera.pixels(one, known) for one in where])
        observed = wb.Block(f"camera {i + 1}/observed", pixels.shape[1:], "px")
        numbers |= known | {observed.name: pixels + SIGMA * rng.standard_normal(pixels.shape)}
        sure = np.ones(points.count)
        terms.append(
            wb.residuals.keypoints(
                points, camera, observed.symbol, sure, sigma=SIGMA, name=f"camera {i + 1}"
            )
        )
        cameras += [block.name for block in camera.blocks]
    priors = (
        wb.residuals.gaussian(pose, covariance=0.3**2, unit="rad", name="pose prior"),
        wb.residuals.gaussian(betas, name="shape prior"),
    )
    frame = wb.Problem([*terms, *priors], ("trans", "pose", "betas"))
    between = (wb.residuals.smooth("pose", sigma=0.05), wb.residuals.smooth("trans", sigma=0.02))
    video = wb.sequence([frame] * frames, shared=("betas", *cameras), between=between)
    begin = body.start()
    start = {n: np.repeat(begin[n][None], frames, axis=0) for n in ("pose", "trans")}
    return Film(frame, video, begin | numbers | start)


@dataclass(frozen=True, eq=False)
class Candidates:
    """What is timed, at points that differ from call to call by a number."""

    film: Film

    @cached_property
    def here(self) -> wb.Linearization:
        """The sequence where the fit begins."""
        return self.film.video.linearize_at(*self.film.split)

    @cached_property
    def J(self) -> csc_array:
        """Its Jacobian, for whoever solves by hand."""
        J = self.here.jacobian
        return csc_array(J if isinstance(J, np.ndarray) else by_nonzeros(J))

    def apart(self, shift: float) -> None:
        """Residual and Jacobian of every frame alone."""
        for x, fixed in self.film.apart:
            self.film.frame.linearize_at(x + shift, fixed)

    def whole(self, shift: float) -> None:
        """Those of the sequence."""
        x, fixed = self.film.split
        self.film.video.linearize_at(x + shift, fixed)

    def step(self, shift: float) -> Array:
        """Normal equations and a damped step, of a Jacobian that is there."""
        return wb.Linearization(self.here.residual + shift, self.here.jacobian).step(DAMPING)

    def direct(self, shift: float) -> Array:
        """The same by SciPy's SuperLU as it is."""
        N = self.J.T @ self.J + DAMPING * diags_array(np.ones(self.J.shape[1]))
        return np.asarray(spsolve(csc_array(N), -self.J.T @ (self.here.residual + shift)))


def measure(
    rounds: int,
    seen: Sequence[str] = (JOINTS, COCO),
    frames: int = FRAMES,
    lengths: Sequence[int] = LENGTHS,
) -> dict[str, Any]:
    """By what is seen: unknowns, rows, seconds by candidate, and how far a few frames are from the
    dense solution; by the number of frames, seconds and bytes of a process of its own.
    """
    found: dict[str, Any] = {"seen": {}, "frames": {}}
    for name in seen:
        each = Candidates(film(frames, name))
        expected = each.direct(1e-3)
        near = 1e-8 * np.abs(expected).max()
        np.testing.assert_allclose(each.step(1e-3), expected, rtol=0, atol=near)
        candidates = {APART: each.apart, WHOLE: each.whole, STEP: each.step, DIRECT: each.direct}
        seconds = side_by_side(candidates, [1e-4 * k for k in range(1, 5)], rounds)
        # alternately, so that a disturbance meets both
        both = [(_timed(each.apart, 1e-5 * k), iterations(each.film)) for k in range(rounds)]
        seconds[APART] += [one for one, _ in both]
        found["seen"][name] = {
            "frames": frames,
            "unknowns": each.film.video.free.size,
            "rows": each.film.video.size,
            "seconds": {**seconds, ITERATION: [s for _, several in both for s in several]},
            "off": off(name),
        }
    for count in lengths:
        found["frames"][str(count)] = _asked(count)
    return found


def iterations(made: Film) -> list[float]:
    """Seconds of each of a few iterations, as a solve has them: linearize, step, judge, record."""
    found = wb.LevenbergMarquardt(max_iterations=ITERATIONS).solve(made.video, made.values)
    return [float(s) for s in np.diff([iterate.seconds for iterate in found.trace])]


def off(seen: str) -> float:
    """The largest difference of two solutions of six frames: by blocks, and by a dense Jacobian."""
    solver = wb.LevenbergMarquardt(gradient_tolerance=1e-10)
    found = []
    for way in (_by_blocks, _as_an_array):
        with way():
            made = film(FEW, seen)
            found.append(made.video.free.pack(solver.solve(made.video, made.values).values))
    apart = float(np.abs(found[0] - found[1]).max())
    if not apart < SAME:
        raise AssertionError(f"{apart:g} between the solutions of {FEW} frames")
    return apart


def memory_of(frames: int) -> dict[str, Any]:
    """Of this process, which should have done nothing else: bytes, before and at the worst, and
    seconds of iterations and of a linearization.
    """
    before = peak()
    made = film(frames)
    made.video.prepare()
    with_problem = peak()
    each, x, fixed = iterations(made), *made.split
    alone = [_timed(lambda y: made.video.linearize_at(y, fixed), x + 1e-4 * k) for k in range(3)]
    return {
        "unknowns": made.video.free.size,
        "rows": made.video.size,
        "before": before,
        "problem": with_problem,
        "peak": peak(),
        "seconds": {ITERATION: each, WHOLE: alone},
    }


def _timed(run: Any, given: Any) -> float:
    began = time.perf_counter()
    run(given)
    return time.perf_counter() - began


@contextmanager
def _by_blocks() -> Iterator[None]:
    """So few frames would have an array."""
    always = patch.object(frame_chains, "is_sparse", lambda *_: True)
    with always, patch.object(frame_chains, "WORTH", 10**9):
        yield


@contextmanager
def _as_an_array() -> Iterator[None]:
    with patch.object(frame_chains, "is_sparse", lambda *_: False):
        yield


def _asked(frames: int) -> dict[str, Any]:
    """memory_of in a process of its own."""
    command = [sys.executable, "-m", "benchmarks", "memory", str(frames), "sequences"]
    here = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=here, check=True, capture_output=True, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found
