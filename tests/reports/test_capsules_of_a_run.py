"""A run whose problem reads capsules shows them, and others do not."""

from pathlib import Path

import numpy as np
import pytest

from workbench.experiments import EXPERIMENTS, find, run
from workbench.reports.report import capsule_figure


@pytest.mark.parametrize("constrained", [False, True])
def test_the_deepest_gap_is_on_the_page(constrained: bool, tmp_path: Path) -> None:
    experiment = find("self-contact")
    if constrained:
        file = tmp_path / "own.py"
        file.write_text(OWN)
        experiment = find(str(file))
    outcome = run(experiment, compare=False)
    shown = capsule_figure(outcome)
    assert shown is not None
    assert "31 capsules" in shown.caption


def test_others_have_none() -> None:
    outcome = run(EXPERIMENTS["landmarks"], compare=False)
    assert np.isfinite(outcome.solution.cost)
    assert capsule_figure(outcome) is None


OWN = '''
"""A limit on the gaps of capsules."""
import numpy as np
from workbench import Constraint, Problem, Setup, SOLVERS, load_body
from workbench.bodies import capsule_points
from workbench.residuals import gaps, landmarks

body = load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
data = landmarks(body.joint_points(pose, betas, trans), body.joints(), sigma=0.01)
ends = capsule_points(body, pose, betas, trans)
limit = Constraint(
    "apart", gaps(ends, body.capsules.radii, body.capsules.pairs[:5]), 0.0, unit="m", points=(ends,)
)
problem = Problem([data], free=("pose", "trans"), constraints=[limit])
setup = Setup(
    problem, body.start(), "Which pose?", body=body, strategy=lambda one: one or SOLVERS["sqp"]
)
'''
