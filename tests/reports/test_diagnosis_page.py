"""A diagnosis as a folder: the page, the text and the data say the same."""

import json
from pathlib import Path
from typing import Any

import casadi as cs
import markupsafe
import numpy as np
import pytest

from tests.diagnostics import cases
from tests.tiers import few
from workbench import Block, Constraint, Problem, Residual, diagnose
from workbench.reports import write_diagnosis

NAMES = {"index.html", "diagnosis.txt", "diagnosis.json", "summary.json"}
KNOWN = (cases.joints_only, cases.uneven, cases.scale_against_depth)


@pytest.mark.parametrize("case", few(KNOWN, 1), ids=lambda case: case.__name__)
def test_diagnosis_page_text_and_data_agree(case: Any, tmp_path: Path) -> None:
    found = diagnose(*case())
    page = write_diagnosis(found, tmp_path / "d", title=case.__name__)
    assert {path.name for path in page.parent.iterdir()} == NAMES
    html = page.read_text(encoding="utf-8")
    data = json.loads((page.parent / "diagnosis.json").read_text(encoding="utf-8"))
    assert (data["schema"], data["version"]) == ("workbench.diagnosis", 3)
    assert (page.parent / "diagnosis.txt").read_text(encoding="utf-8").startswith("FINDINGS")
    for finding in found.findings:
        assert _escaped(finding.text) in html
    for suggestion in found.suggestions:
        assert _escaped(suggestion.what) in html
    if found.here.finite:
        others = [d for d in found.null_directions if d.kind != "entry"]
        assert all(_escaped(d.name) in html for d in others)
        assert data["rank"] == found.rank
    assert "://" not in html.replace("http://www.w3.org", "")  # nothing is fetched


def _escaped(text: str) -> str:
    return str(markupsafe.escape(text))


@pytest.mark.thorough
def test_diagnosis_page_without_a_body_speaks_of_none(tmp_path: Path) -> None:
    """Nothing of blend shapes, what a constraint holds, and no infinite number for an unknown."""
    q, end = Block("angles", (3,), "rad", ("shoulder", "elbow", "wrist")), Block("end", (2,), "m")
    a = cs.cumsum(q.symbol)
    tip = cs.vertcat(cs.sum1(cs.cos(a)), cs.sum1(cs.sin(a)))
    reach = Residual("reach", tip - end.symbol, 0.01, "m", blocks=(end,))
    high = Residual("height", 1e-6 * tip[1], 0.01, "m")
    level = Constraint("level", a[2], 0, 0, "rad")
    values = {"angles": np.array([0.3, 0.5, -0.8]), "end": np.array([2.0, 1.0])}
    problem = Problem([reach, high], "angles", blocks=[q], constraints=[level])
    folder = write_diagnosis(diagnose(problem, values), tmp_path / "held", title="robot").parent
    loose = diagnose(problem.without("reach"), values)
    write_diagnosis(loose, tmp_path / "loose", title="robot")
    for file in ("index.html", "diagnosis.txt"):
        text = (folder / file).read_text(encoding="utf-8")
        assert "blend shapes" not in text
        assert "active constraints (level) fix 1 direction, which counts towards the rank" in text
        assert "for angles: a radian" in text
        other = (tmp_path / "loose" / file).read_text(encoding="utf-8")
        for page in (text, other):
            assert "inf &gt; inf" not in page
            assert "∞ → ∞" not in page
