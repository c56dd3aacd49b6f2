"""Small problems with something wrong, each of which is known in every detail."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import casadi as cs
import numpy as np

from tests.bodies_made_up import random_body, smpl_like_body
from workbench import Block, Diagnosis, Problem, Residual, Values, diagnose, residuals
from workbench.geometry.camera import Camera

Case = tuple[Problem, Values]


def shape_without_effect() -> Case:
    """A surface that does not change with betas[1]."""
    body = random_body(n_betas=3)
    body = replace(body, shapedirs=body.shapedirs * np.array([1.0, 0.0, 1.0]))
    observed = Block("observed", (30, 3), "m")
    points = body.points(*(block.symbol for block in body.blocks()))
    problem = Problem(
        (residuals.vertices(points, observed.symbol, sigma=0.01),), ("betas", "trans")
    )
    return problem, body.start() | {"observed": np.zeros((30, 3))}


def pose_that_nobody_reads() -> Case:
    """Only the root is observed: the whole pose is free, and no residual reads it."""
    body = smpl_like_body()
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    root = Residual("root", joints.symbol[:, 0] - cs.DM([1, 2, 3]), 0.01, "m", points=(joints,))
    return Problem((root,), ("pose", "trans")), body.start()


def the_same_twice() -> Case:
    """Two residuals with the same rows, and a third one with others."""
    rng = np.random.default_rng(0)
    x = Block("x", (4,))
    A, B = cs.DM(rng.normal(size=(6, 4))), cs.DM(rng.normal(size=(6, 4)))
    found = (
        Residual("first", A @ x.symbol - 1, 0.5),
        Residual("other", B @ x.symbol - 1, 0.5),
        Residual("second", 2 * (1 - A @ x.symbol), 1.0),
    )
    return Problem(found, ("x",), blocks=(x,)), {"x": np.zeros(4)}


def template_and_translation() -> Case:
    """Moving the template one way and the body back changes nothing."""
    body = random_body().freed("template")
    observed = Block("observed", (30, 3), "m")
    points = body.points(*(block.symbol for block in body.blocks()))
    problem = Problem(
        (residuals.vertices(points, observed.symbol, sigma=0.01),), ("template", "trans")
    )
    return problem, body.start() | {"observed": np.zeros((30, 3))}


def scale_against_depth() -> Case:
    """A thing twice as large, twice as far away, looks the same to one camera."""
    rng = np.random.default_rng(0)
    scale, trans = Block("scale", ()), Block("trans", (3,), "m", ("x", "y", "z"))
    observed, confidence = Block("observed", (8, 2), "px"), Block("confidence", (8,))
    camera = Camera("camera/")
    shape = cs.DM(rng.normal(scale=0.3, size=(8, 3)).T)
    seen = residuals.keypoints(
        scale.symbol * shape + cs.repmat(trans.symbol, 1, 8),
        camera,
        observed.symbol,
        confidence.symbol,
        sigma=1.0,
    )
    values = camera.values(K=[[1000, 0, 500], [0, 1000, 500], [0, 0, 1]]) | {
        "scale": np.array(1.0),
        "trans": np.array([0.1, 0.2, 3.0]),
        "observed": rng.normal(500, 100, size=(8, 2)),
        "confidence": np.ones(8),
    }
    return Problem((seen,), ("scale", "trans"), blocks=(scale, trans)), values


def two_pieces() -> Case:
    """Differences of nine points along edges, in two pieces."""
    points = Block("points", (9, 3), "m")
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 8), (8, 4)]
    along = cs.vertcat(*[points.symbol[:, i] - points.symbol[:, j] for i, j in ends])
    problem = Problem((Residual("edges", along, 0.01, "m"),), ("points",), blocks=(points,))
    return problem, {"points": np.random.default_rng(0).normal(size=(9, 3))}


def joints_only() -> Case:
    """The 24 joints of a body, by its pose."""
    body = smpl_like_body()
    observed = Block("observed", (24, 3), "m")
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    pose = np.random.default_rng(1).normal(size=(24, 3))
    return Problem(
        (residuals.landmarks(joints, observed.symbol, sigma=0.01),), ("pose", "trans")
    ), body.start() | {"pose": pose, "observed": np.zeros((24, 3))}


def naive_rodrigues() -> Case:
    """A rotation by sin(t) / t without a thought for t = 0, at t = 0."""
    turn = Block("turn", (3,), "rad", ("x", "y", "z"))
    t = cs.norm_2(turn.symbol)
    K = cs.skew(turn.symbol / t)
    R = cs.MX.eye(3) + cs.sin(t) * K + (1 - cs.cos(t)) * K @ K
    points = cs.DM(np.random.default_rng(0).normal(size=(4, 3)).T)
    turned = Residual("turned", cs.vec(R @ points), 0.01, "m")
    return Problem((turned,), ("turn",), blocks=(turn,)), {"turn": np.zeros(3)}


def uneven() -> Case:
    """Full rank, one unknown in units a million times too large."""
    rng = np.random.default_rng(0)
    x = Block("x", (5,))
    A = rng.normal(size=(12, 5))
    A[:, 3] *= 1e-6
    return Problem((Residual("r", cs.DM(A) @ x.symbol, 1.0),), ("x",), blocks=(x,)), {
        "x": np.ones(5)
    }


CASES = (
    joints_only,
    shape_without_effect,
    pose_that_nobody_reads,
    the_same_twice,
    template_and_translation,
    scale_against_depth,
    two_pieces,
    naive_rodrigues,
    uneven,
)


@cache
def diagnosed(case: Callable[[], Case]) -> Diagnosis:
    """Of one of the cases, once for all tests."""
    return diagnose(*case())
