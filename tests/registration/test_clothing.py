"""Bodies in clothes: a loose distance comes nearer to the shape below them than a plain one."""

import numpy as np
import pytest

from workbench import load_body
from workbench.blocks import Values
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import FitStage, fit_model
from workbench.residuals import distance, loose
from workbench.residuals.contacts import Form
from workbench.synthetic import (
    Clothing,
    Noise,
    ScannedPerson,
    SimulatedScan,
    clothed,
    people,
    scan,
    scanners,
)

pytestmark = pytest.mark.thorough

BODY = load_body("small")
STAGE = (FitStage(800, 0.01, 0.03, starts=1, iterations=40, settled=0.001),)


def dressed(seed: int, thickest: float) -> tuple[ScannedPerson, SimulatedScan]:
    """A person in clothes of up to `thickest` m, seen by four scanners."""
    poses = draw_poses(shipped_gaussian(), 20, np.random.default_rng(1))
    (person,) = people(BODY, poses, 1, seed)
    clothing = Clothing(thickest, where=clothed(BODY))
    noise = Noise(growth=0.0, floor=0.002)
    return person, scan(
        person.vertices, BODY.faces, scanners(4), seed=seed, noise=noise, clothing=clothing
    )


def fitted(person: ScannedPerson, made: SimulatedScan, form: Form) -> Values:
    """The fit that begins at the true pose with the mean shape."""
    start = {**person.values, "betas": np.zeros(BODY.n_betas)}
    return fit_model(
        BODY, made.scan, starts=lambda body, scan: [start], stages=STAGE, form=form
    ).values


def off(person: ScannedPerson, made: SimulatedScan, form: Form) -> tuple[float, float]:
    """How far betas, and in mm the vertices at rest, are from the truth."""
    found, true = fitted(person, made, form)["betas"], person.values["betas"]
    apart = BODY.vertices(betas=found) - BODY.vertices(betas=true)
    return float(np.linalg.norm(found - true)), 1e3 * float(np.linalg.norm(apart, axis=1).mean())


def test_loose_distance_reads_less_clothing_as_shape() -> None:
    clothes = [dressed(seed, 0.03) for seed in range(20, 26)]
    plain = np.array([off(*one, distance) for one in clothes])
    less = np.array([off(*one, loose(0.3)) for one in clothes])
    (betas, shape), (loose_betas, loose_shape) = plain.mean(axis=0), less.mean(axis=0)
    assert shape > 12  # mm
    assert loose_shape < 0.8 * shape
    assert loose_betas < 0.85 * betas
    assert (less < plain).sum(axis=0).min() >= 5  # of 6


def test_plain_distance_is_nearer_without_clothes() -> None:
    naked = dressed(24, 0.0)
    assert off(*naked, distance)[1] < off(*naked, loose(0.3))[1]
