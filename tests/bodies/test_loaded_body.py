"""A body from a file, as others write it, against the paper's equations written out."""

from pathlib import Path

import numpy as np
import pytest

from tests.bodies.paper import smpl
from tests.bodies.random_bodies import entries
from workbench.bodies.catalogue import load_body


@pytest.mark.parametrize(("N", "B"), [(40, 10), (301, 3), (7, 0)])
def test_it_is_smpl(tmp_path: Path, N: int, B: int) -> None:
    np.savez(tmp_path / "somebody.npz", **entries(N=N, B=B, seed=N))
    body = load_body(tmp_path / "somebody.npz")
    rng = np.random.default_rng(B)
    arguments = rng.normal(size=(24, 3)), rng.normal(size=B), rng.normal(size=3)
    vertices, joints = smpl(body, *arguments)
    np.testing.assert_allclose(body.vertices(*arguments), vertices, rtol=0, atol=1e-12)
    np.testing.assert_allclose(body.joints(*arguments), joints, rtol=0, atol=1e-12)
