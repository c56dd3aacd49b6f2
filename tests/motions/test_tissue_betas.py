"""Soft tissue as betas: the same surface as the model's own, on pages and in files."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from tests.motions.test_expressions import played_by_hand
from workbench.cli.app import app
from workbench.motions import load_tissue, write_glb
from workbench.motions.tissue_betas import betas_with_tissue, displaced_by, with_tissue
from workbench.synthetic.motions_made_up import made_up_motion

BODY, TISSUE = wb.load_body("default"), load_tissue()
MOTION = made_up_motion(BODY, seconds=0.1, seed=1)


def test_a_body_with_tissue_is_the_model_of_tissue(tmp_path: Path) -> None:
    assert isinstance(BODY, wb.SkinnedBody)
    body, betas = with_tissue(BODY, TISSUE), betas_with_tissue(BODY, TISSUE, MOTION, 2.0)
    expected = TISSUE.vertices(BODY, MOTION, 2.0)
    assert np.abs(expected - MOTION.vertices(BODY)).max() > 1e-3
    by = displaced_by(TISSUE, betas)
    rest = body.vertices(None, betas) - BODY.vertices(None, betas[:, : BODY.n_betas])
    np.testing.assert_allclose(by, rest, atol=1e-12)
    at = MOTION.pose, betas, MOTION.trans
    np.testing.assert_allclose(body.vertices(*at), expected, atol=1e-9)
    np.testing.assert_allclose(body.joints(*at), MOTION.joints(BODY), atol=1e-9)
    write_glb(tmp_path / "a.glb", MOTION, body, betas=betas)
    assert np.abs(played_by_hand(tmp_path / "a.glb", MOTION.pose) - expected).max() < 1e-5


def test_the_command_shows_tissue(tmp_path: Path) -> None:
    wb.save_motion(tmp_path / "walk.npz", MOTION)
    out = ["--page", str(tmp_path / "walk.html"), "--out", str(tmp_path / "walk.glb")]
    said = CliRunner().invoke(
        app, ["motion", str(tmp_path / "walk.npz"), "--tissue", "--exaggeration", "2", *out]
    )
    assert said.exit_code == 0, said.output
    text = (tmp_path / "walk.html").read_text()
    by = displaced_by(TISSUE, betas_with_tissue(BODY, TISSUE, TISSUE.prepared(MOTION), 2.0))
    most = 1e3 * np.linalg.norm(by, axis=2).max()
    for shown in (" ".join(said.output.split()), text):
        assert "The soft tissue is simulated, and was learned from no measurement of peo" in shown
        assert f"{most:.0f} mm at most, 2 times as far as the model says" in shown
    assert "Charts are shown" not in text
    assert len(text) > 1e5
    assert (tmp_path / "walk.glb").stat().st_size > 1e5


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--tissue"], "--tissue shows on a page or in a .glb"),
        (["--tissue", "--page", "a.html", "--body", "small"], "this soft tissue is that of"),
        (["--tissue", "--page", "a.html", "--body", "small-scape"], "has no soft tissue; take"),
    ],
)
def test_what_shows_no_tissue_is_refused(tmp_path: Path, options: list[str], said: str) -> None:
    wb.save_motion(tmp_path / "walk.npz", MOTION)
    with pytest.raises(wb.WorkbenchError, match=said):
        CliRunner().invoke(
            app, ["motion", str(tmp_path / "walk.npz"), *options], catch_exceptions=False
        )
