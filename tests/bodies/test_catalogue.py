"""What every body of the catalogue must keep, whoever added it."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.bodies.laws import (
    assert_bind_pose_leaves_template,
    assert_root_turns_everything_about_pelvis,
    some_arguments,
)
from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench.bodies.catalogue import BODIES, load_body, load_skinned
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.cli.app import app
from workbench.errors import BadFile

EACH = pytest.mark.parametrize("name", few(BODIES, ("small", "hand", "small-scape")))


def assert_contract(body: SkinnedBody | TriangleBody) -> None:
    assert_bind_pose_leaves_template(body)
    assert_root_turns_everything_about_pelvis(body)
    pose, betas, trans = some_arguments(body)
    posed = body.vertices(pose, betas, trans)
    points = body.points(*(block.symbol for block in body.blocks()))
    numeric = points.source.numeric
    if numeric is not None:
        values = dict(zip(numeric.reads, (pose, betas, trans), strict=True))
        np.testing.assert_allclose(numeric.evaluate(values).points, posed, atol=1e-9)
    copied = pickle.loads(pickle.dumps(body))
    np.testing.assert_array_equal(copied.template, body.template)


@pytest.mark.browser
@EACH
def test_every_body_keeps_the_laws_of_bodies(name: str) -> None:
    assert_contract(load_body(name))


def mine() -> SkinnedBody:
    """As a newcomer would write it, in a module of their own."""
    return random_body(4, n_vertices=30, n_joints=4)


def test_a_function_and_a_line_make_a_body(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadFile, match="no body is called 'mine'"):
        load_body("mine")
    monkeypatch.setitem(BODIES, "mine", mine)
    assert_contract(load_body("mine"))
    assert load_skinned("mine").n_joints == 4
    with pytest.raises(BadFile, match=r"the bodies are default, .*mine"):
        load_body("yours")
    found = CliRunner().invoke(app, ["body", "mine", "--out", str(tmp_path)])
    assert found.exit_code == 0, found.output
    assert (tmp_path / "body-mine").is_dir()
