"""Training soft tissue: known models are found again, and simulated tissue is explained."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.lectures.material.tissue import (
    TissueClip,
    TissuePlan,
    score_tissue,
    soft_parts,
    train_tissue,
)
from workbench.lectures.material.tissue_simulation import simulate_tissue
from workbench.motions import Motion, SoftTissue
from workbench.synthetic.made_up import made_up_motion

SMALL = wb.load_body("small")
PLAN = TissuePlan(components=8, parts=12)


def moved(seconds: float, seed: int, betas: Array | None = None) -> Motion:
    motion = made_up_motion(SMALL, seconds, seed=seed, turn=0.1)
    return replace(motion, betas=np.zeros(0) if betas is None else betas)


def simulated(motion: Motion) -> TissueClip:
    return TissueClip(motion, simulate_tissue(SMALL, motion))


@pytest.fixture(scope="module")
def motions() -> list[Motion]:
    rng = np.random.default_rng(1)
    return [moved(4.0, seed, rng.standard_normal(10)) for seed in range(8)]


@pytest.fixture(scope="module")
def clips(motions: list[Motion]) -> list[TissueClip]:
    return [simulated(motion) for motion in motions]


@pytest.fixture(scope="module")
def tissue(clips: list[TissueClip]) -> SoftTissue:
    return train_tissue(SMALL, clips, PLAN)


@pytest.mark.thorough
def test_free_run_explains_an_unseen_clip(tissue: SoftTissue) -> None:
    score = score_tissue(tissue, SMALL, simulated(moved(4.0, 99, np.full(10, 0.3))))
    assert tissue.spectral_radius < 1
    assert score.explained > 0.7
    assert score.error < score.rms
    assert score.frames == 240


@pytest.mark.thorough
def test_known_model_and_gain_are_recovered(motions: list[Motion]) -> None:
    """Tissue made by a model of this form, of people of different weight."""
    rng = np.random.default_rng(0)
    everywhere = TissueClip(motions[0], np.ones((240, SMALL.n_vertices, 3)))
    part = soft_parts(SMALL, [everywhere], 2, seed=0)
    X = 6 * 24 + 6 + 3 * (int(part.max()) + 1) + 1
    a = 0.99 * np.exp(1j * np.array([0.3, 0.5]))  # two wobbles of 2.9 and 4.8 Hz
    D = np.linalg.qr(np.sign(rng.standard_normal((3 * SMALL.n_vertices, 2))))[0].reshape(-1, 3, 2)
    response = 1e-3 * rng.standard_normal((2, X))
    response[:, : 6 * 24] *= 0.01
    true = SoftTissue(
        D * [0.3, 0.2],
        np.diag(2 * a.real),
        -np.diag(abs(a) ** 2),
        response,
        part,
        60.0,
        SMALL.joint_names,
        power=0.6,
    )
    made = [
        TissueClip(
            motion,
            true.displacements(SMALL, true.coefficients(SMALL, motion), motion.betas),
        )
        for motion in motions
    ]
    plan = TissuePlan(components=2, parts=2, ridge=0.0, most=0.998)
    found = train_tissue(SMALL, made, plan)
    assert found.power == pytest.approx(0.6, abs=0.1)
    assert score_tissue(found, SMALL, made[0]).explained > 0.98
    poles = sorted(found.poles, key=lambda z: (abs(np.angle(z)), z.imag))
    wanted = sorted([*a, *a.conj()], key=lambda z: (abs(np.angle(z)), z.imag))
    np.testing.assert_allclose(poles, wanted, atol=0.02)


def test_untrainable_clips_are_refused(motions: list[Motion]) -> None:
    still = [TissueClip(motion, np.zeros((240, SMALL.n_vertices, 3))) for motion in motions[:2]]
    slow = replace(still[0], motion=replace(still[0].motion, fps=30.0))
    with pytest.raises(BadArgument, match="one rate"):
        train_tissue(SMALL, [*still, slow])
    with pytest.raises(BadArgument, match="32 components"):
        train_tissue(SMALL, still[:1])
    with pytest.raises(BadArgument, match="none at all"):
        train_tissue(SMALL, [])
