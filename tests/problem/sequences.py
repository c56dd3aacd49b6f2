"""Sequences of a made-up body, seen by joints and by a camera, and what their numbers must be."""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from workbench import residuals
from workbench.problem import frames as frame_chains
from workbench.problem.storage import dense
from workbench.residuals import geman_mcclure

Array = np.ndarray
BODY = random_body(2, n_vertices=8, n_joints=3, n_betas=2)
POSE, BETAS, TRANS = BODY.blocks()
SYMBOLS = POSE.symbol, BETAS.symbol, TRANS.symbol
JOINTS, SKIN = BODY.joint_points(*SYMBOLS), BODY.points(*SYMBOLS)
SEEN = wb.Block("seen", (3, 3), "m", BODY.joint_names)
PIXELS, SURE = wb.Block("pixels", (8, 2), "px"), wb.Block("sure", (8,))
CAMERA = wb.Camera("left/")
OF_CAMERA = tuple(block.name for block in CAMERA.blocks)
SHARED = ("betas", *OF_CAMERA)
FREE = ("trans", "pose", "betas")
SMOOTH = (
    residuals.smooth("pose", sigma=0.1),
    residuals.smooth("trans", sigma=0.05, order=2),
)


@cache
def frame() -> wb.Problem:
    """One frame: its joints in space, its skin in an image, priors on pose and shape."""
    terms = (
        residuals.landmarks(JOINTS, SEEN.symbol, sigma=0.02, name="joints"),
        residuals.keypoints(
            SKIN, CAMERA, PIXELS.symbol, SURE.symbol, sigma=3.0, kernel=geman_mcclure, name="image"
        ),
        residuals.gaussian(POSE.symbol, covariance=0.3**2, unit="rad", name="pose prior"),
        residuals.gaussian(BETAS.symbol, name="shape prior"),
    )
    return wb.Problem(terms, FREE, blocks=(SEEN, PIXELS, SURE))


def values(count: int, seed: int = 0) -> wb.Values:
    """A smooth motion of T frames and what was seen of it (synthetic)."""
    rng = np.random.default_rng(seed)
    times = np.arange(count)[:, None, None] / 4
    pose = 0.4 * rng.standard_normal((3, 3)) * np.sin(times + rng.uniform(0, 6, (3, 3)))
    betas = rng.standard_normal(2)
    trans = 0.1 * np.sin(times[:, :, 0] + rng.uniform(0, 6, 3))
    calibration = CAMERA.values(
        K=np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]),
        R=np.diag([1.0, -1, -1]),
        t=[0.0, 0, 4],
    )
    joints = np.array([BODY.joints(p, betas, t) for p, t in zip(pose, trans, strict=True)])
    skin = [BODY.vertices(p, betas, t) for p, t in zip(pose, trans, strict=True)]
    pixels = np.array([CAMERA.pixels(points, calibration) for points in skin])
    sure = rng.uniform(0.2, 1, (count, 8))
    sure[0, 3] = 0.0
    return calibration | {
        "pose": pose + 0.05 * rng.standard_normal(pose.shape),
        "betas": betas + 0.1 * rng.standard_normal(2),
        "trans": trans + 0.02 * rng.standard_normal(trans.shape),
        "seen": joints + 0.02 * rng.standard_normal(joints.shape),
        "pixels": pixels + 3.0 * rng.standard_normal(pixels.shape),
        "sure": sure,
    }


def of_frame(whole: wb.Problem, values: wb.Values, t: int) -> wb.Values:
    """The values of one frame."""
    framed = {name for name, block in whole.known.items() if block.framed}
    return {name: value[t] if name in framed else value for name, value in values.items()}


def frame_by_frame(
    whole: wb.Problem, each: Sequence[wb.Problem], values: wb.Values, once: Sequence[str] = ()
) -> tuple[Array, Array, Array]:
    """The rows that residuals of frames have, whitened, and their Jacobian by the whole graph of
    every frame alone; and which rows these are. Residuals named in `once` are taken once.
    """
    r, J = np.zeros(whole.size), np.zeros((whole.size, whole.free.size))
    known = np.zeros(whole.size, dtype=bool)
    first = {name: rows.start for name, rows in whole.rows.items()}
    for t, problem in enumerate(each):
        own, derivative = problem.derivative(*problem.split(of_frame(whole, values, t)))
        columns, places = [], []
        for block in problem.free.blocks:
            start = t * block.base.size if whole.known[block.name].framed else 0
            for i, entry in enumerate(block.places):
                place = whole.free.place(block.name, start + entry)
                if place is not None:
                    columns.append(problem.free.slices[block.name].start + i)
                    places.append(place)
        for name, rows in problem.rows.items():
            if name in once and known[whole.rows[name]].any():
                continue
            at = np.arange(first[name], first[name] + rows.stop - rows.start)
            first[name] = int(at[-1]) + 1
            known[at] = True
            r[at] = np.asarray(own).ravel()[rows]
            J[np.ix_(at, places)] = np.asarray(derivative)[rows][:, columns]
    return r, J, known


def assert_numbers(problem: wb.Problem, values: wb.Values) -> wb.Linearization:
    """Every number that the problem gives is that of its whole graph."""
    x, fixed = problem.split(values)
    r, J = (np.asarray(part) for part in problem.derivative(x, fixed))
    r = r.ravel()
    np.testing.assert_allclose(np.asarray(problem.function(x, fixed)).ravel(), r, atol=1e-12)
    near = 1e-11 * np.abs(J).max()
    here = problem.linearize_at(x, fixed)
    np.testing.assert_allclose(here.residual, r, rtol=0, atol=1e-11 * np.abs(r).max())
    np.testing.assert_allclose(here.dense, J, rtol=0, atol=near)
    problem.residual(x + 0.1, fixed)  # elsewhere, and back
    alone = problem.residual(x, fixed)
    np.testing.assert_allclose(alone, r, rtol=0, atol=1e-11 * np.abs(r).max())
    after = problem.linearize_at(x, fixed)
    np.testing.assert_allclose(after.dense, here.dense, rtol=0, atol=near)
    cost, gradient = problem.cost_and_gradient(x, fixed)
    assert cost == pytest.approx(0.5 * r @ r, rel=1e-12)
    expected = J.T @ r
    near = 1e-11 * max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=near)
    np.testing.assert_allclose(here.gradient, expected, rtol=0, atol=near)
    there = problem.pattern.toarray() != 0
    assert there.shape == J.shape
    assert not (J != 0)[~there].any()
    rows = np.random.default_rng(0).standard_normal(len(r))
    by_pattern = np.sqrt(there.T.astype(float) @ rows**2)
    np.testing.assert_allclose(problem.support.norms(rows), by_pattern, atol=1e-12)
    return here


def in_blocks_of_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the Jacobian of every sequence stored by blocks, however small."""
    monkeypatch.setattr(frame_chains, "is_sparse", lambda *_: True)
    monkeypatch.setattr(frame_chains, "BAND_PER_ENTRY", 10**9)


def both_storages(
    build: Callable[[], wb.Problem], monkeypatch: pytest.MonkeyPatch
) -> tuple[wb.Problem, wb.Problem]:
    """The same problem with an array, and with blocks of frames, as its Jacobian."""
    plain = build()
    plain.prepare()
    assert not plain.sparse
    with monkeypatch.context() as patched:
        in_blocks_of_frames(patched)
        blocked = build()
        assert blocked.sparse
        x = np.zeros(blocked.free.size)
        kept = blocked.linearize_at(x, np.ones(blocked.fixed.size))
    assert dense(kept.jacobian).shape == (blocked.size, blocked.free.size)
    return plain, blocked
