"""The page with sliders computes what Python computes: both are asked, one in a real browser."""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workbench as wb
from tests.browsers import dumped, need_browser
from workbench.bodies.ablations import ABLATIONS, without_blend_weights, without_pose_blend_shapes
from workbench.geometry.solids import volume
from workbench.reports.sliders import write_sliders

pytestmark = pytest.mark.thorough

BODY = wb.load_body("small")
RNG = np.random.default_rng(0)
BETAS = RNG.normal(size=10)
POSES = {
    "as drawn": np.zeros((24, 3)),
    "nearly": 1e-6 * RNG.normal(size=(24, 3)),
    "some": 0.5 * RNG.normal(size=(24, 3)),
    "far": 2.0 * RNG.normal(size=(24, 3)),
}
KEPT = {
    "whole": ({}, BODY),
    "rigid": ({"weights": False}, without_blend_weights(BODY)),
    "unbent": ({"pose_shapes": False}, without_pose_blend_shapes(BODY)),
    "alike": ({"shape_shapes": False}, ABLATIONS["shape blend shapes"](BODY)),
    "dual": ({"dual": True}, replace(BODY, skinning=wb.dual_quaternion_blend)),
}


ASKED = """
<pre id="answers"></pre>
<script>
document.addEventListener("ready", ({ detail: { body, state, take } }) => {
const answers = {};
for (const [name, [pose, betas, keep]] of Object.entries(%s))
  answers[name] = [...body.vertices(pose, betas, keep)];
take({ pose: { left_elbow: [0, -90, 0] }, pose_shapes: false });
const joint_slider = document.querySelectorAll("#angles input")[1];
joint_slider.value = -120;
joint_slider.dispatchEvent(new Event("input"));
answers.elbow = state.pose[3 * body.joint_names.indexOf("left_elbow") + 1];
const beta_slider = document.querySelectorAll("#betas input")[1];
beta_slider.value = 2;
beta_slider.dispatchEvent(new Event("input"));
answers.measured = document.getElementById("measured").textContent;
answers.address = decodeURIComponent(location.hash.slice(1));
document.getElementById("answers").textContent = JSON.stringify(answers);
});
</script>
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What the page of a skinned body says when it is asked in the browser."""
    return asked(BODY, KEPT, tmp_path_factory.mktemp("page"))


def asked(body: wb.SkinnedBody, kept: Any, folder: Path) -> Any:
    need_browser()
    page = write_sliders(body, folder / "sliders.html")
    questions = {
        f"{where}, {which}": [pose.ravel().tolist(), BETAS.tolist(), keep]
        for where, pose in POSES.items()
        for which, (keep, _) in kept.items()
    }
    text = page.read_text(encoding="utf-8")
    asking = text.replace("</main>", ASKED % json.dumps(questions) + "</main>")
    page.write_text(asking, encoding="utf-8")
    shown, complaints = dumped(page, "--disable-gpu", "--virtual-time-budget=5000")
    found = re.search(r'<pre id="answers">(.*?)</pre>', shown, re.DOTALL)
    assert found, complaints
    assert found[1], "the page's script stopped"
    return json.loads(unescape(found[1]))


def test_vertices_in_the_browser_are_those_of_python(answers: Any) -> None:
    for where, pose in POSES.items():
        for which, (_, body) in KEPT.items():
            found = np.array(answers[f"{where}, {which}"]).reshape(-1, 3)
            off = np.linalg.norm(found - body.vertices(pose, BETAS), axis=1)
            assert off.max() < 1e-8, (where, which)  # m, as the page says


def test_sliders_move_the_body_and_the_numbers_beside_it(answers: Any) -> None:
    assert answers["elbow"] == pytest.approx(np.radians(-120))
    pose = np.zeros((24, 3))
    pose[BODY.joint_names.index("left_elbow"), 1] = np.radians(-120)
    whole, chosen = (
        body.vertices(pose, [0, 2.0]) for body in (BODY, without_pose_blend_shapes(BODY))
    )
    away = 1e3 * np.linalg.norm(chosen - whole, axis=1)
    litres = [1e3 * volume(v, BODY.faces) for v in (chosen, whole)]
    assert answers["measured"] == (
        f"mean {away.mean():.2f} mm, largest {away.max():.1f} mm; "
        f"volume {litres[0]:.2f} l here, {litres[1]:.2f} l of SMPL"
    )
    said = json.loads(answers["address"])
    assert said["pose"] == {"left_elbow": [0, -120, 0]}
    assert said["betas"][:3] == [0, 2, 0]
    assert said["pose_shapes"] is False
