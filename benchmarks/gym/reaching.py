"""Kinematics: arms that reach for a target, in the plane and in space."""

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case, posed
from workbench.blocks import Block
from workbench.fitting.setup import Setup
from workbench.geometry.rotation import rodrigues
from workbench.problem import Problem
from workbench.residuals import Residual

LINKS = (3, 6)
SEEDS = range(3)
COMFORT = 0.5  # rad, the standard deviation of a joint at rest
REACH = 0.01  # of the arm's length


def planar_arm(links: int = 3, seed: int = 0) -> Setup:
    """The tip of an arm of hinges is at a target that it can reach; more angles than equations."""
    rng = np.random.default_rng((11, links, seed))
    lengths = rng.uniform(0.5, 1.5, links) / links
    truth = rng.uniform(-1.5, 1.5, links)
    angle = Block("angle", (links,), "rad")

    def tip(angles: cs.MX) -> cs.MX:
        headings = cs.cumsum(angles)
        along = cs.horzcat(cs.cos(headings), cs.sin(headings))
        return along.T @ cs.DM(lengths)

    target = tip(cs.DM(truth))
    problem = Problem(
        (Residual("tip", tip(angle.symbol) - target, REACH),), ("angle",), blocks=(angle,)
    )
    return posed(
        f"arm-planar-{links}-{seed}",
        problem,
        {"angle": np.round(0.3 * rng.standard_normal(links), 9)},
        "the angles by which the target was placed",
        {"angle": truth},
    )


def spatial_arm(seed: int = 0) -> Setup:
    """Three ball joints of an arm: its tip is at a target, its joints are as near rest as can be.

    The target was placed with joints turned by one radian per axis, and the arm begins at rest.
    """
    rng = np.random.default_rng((12, seed))
    truth = np.round(rng.standard_normal((3, 3)), 9)
    bones = np.round(rng.uniform(0.2, 0.4, (3, 3)), 9)
    joint = Block("joint", (3, 3), "rad")

    def tip(joints: cs.MX) -> cs.MX:
        R, place = cs.MX(cs.DM.eye(3)), cs.MX(cs.DM.zeros(3))
        for k in range(3):
            R = R @ rodrigues(joints[:, k])
            place = place + R @ cs.DM(bones[k])
        return place

    placed = cs.Function("tip", [joint.symbol], [tip(joint.symbol)])
    target = np.round(np.asarray(placed(cs.DM(truth.T)), dtype=float).ravel(), 9)
    residuals = (
        Residual("tip", tip(joint.symbol) - cs.DM(target), REACH),
        Residual("comfort", cs.vec(joint.symbol), COMFORT),
    )
    return posed(
        f"arm-spatial-{seed}",
        Problem(residuals, ("joint",), blocks=(joint,)),
        {"joint": np.zeros((3, 3))},
        "the lowest of many descents, from rest and from the truth; no proof",
        made_of={"joint": truth},
    )


ARMS: tuple[Case, ...] = (
    *(
        case(
            f"arm-planar-{links}-{seed}",
            "kinematics",
            planar_arm,
            {"links": links, "seed": seed},
        )
        for links in LINKS
        for seed in SEEDS
    ),
    *(case(f"arm-spatial-{seed}", "kinematics", spatial_arm, {"seed": seed}) for seed in range(4)),
)
