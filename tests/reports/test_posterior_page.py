"""The page of a posterior: what is held fixed, what is not known, and a truth that is marked."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.sampling.densities import conditioned, gaussian
from workbench.experiments import find
from workbench.fitting.setup import Setup
from workbench.reports import write_posterior
from workbench.reports.posterior import BlockPosterior, anchors, contradictions
from workbench.sampling import fixed, laplace, sample

C = conditioned(3, 30.0, seed=3)


def written(
    folder: Path, names: object, made_of: object, **how: int
) -> tuple[Path, BlockPosterior]:
    problem, at = gaussian(C), {"x": np.zeros(3)}
    posterior = sample(problem, at, names, rest=fixed, walkers=16, **how)  # type: ignore[arg-type]
    part = BlockPosterior("part", posterior, laplace(problem, at, names, rest=fixed))  # type: ignore[arg-type]
    setup = Setup(problem, at, "How well is x known?")
    if made_of is not None:
        setup = replace(setup, made_of=made_of)
    write_posterior([part], folder, title="made up", setup=setup)
    return folder, part


def words(page: str) -> str:
    """Of a page, without tags and figures."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page))


@pytest.mark.thorough
def test_conditional_posterior_says_so_everywhere(tmp_path: Path) -> None:
    folder, part = written(tmp_path / "p", "x[1]", None, steps=1000)
    assert not part.posterior.usable
    ratio = part.posterior.conditioning.ratios[0]
    assert ratio > 1.2
    page = words((folder / "index.html").read_text())
    for said in (page, (folder / "posterior.txt").read_text()):
        assert "NOT USABLE" in said
        assert "Held fixed: 2 of the 3 numbers of x" in said
        assert f"{ratio:.3g} times as large" in said
        assert "usable: " not in said.replace("NOT USABLE: ", "")
    assert "is true only if the unknowns that are held fixed are known exactly" in page
    assert "marginal sd" in page
    data = json.loads((folder / "summary.json").read_text())["parts"]["part"]
    assert data["verdict"] == "CONDITIONAL"
    assert not data["usable"]
    assert data["sd"] is None
    assert data["ratio"] == pytest.approx([ratio])
    assert data["held_fixed"] == ["2 of the 3 numbers of x"]


@pytest.mark.thorough
def test_posterior_page_without_intervals_draws_none(tmp_path: Path) -> None:
    """Chains that have not mixed show how they went, and no range, no cloud, no body."""
    folder, part = written(tmp_path / "p", None, None, steps=40)
    assert not part.posterior.usable
    page = (folder / "index.html").read_text()
    assert "No intervals are given" in page
    assert page.count("<img") == 1  # the traces
    for claim in ("90 %", "sd / Laplace", "agrees with the draws", "Contours"):
        assert claim not in words(page), claim
    usable, _ = written(tmp_path / "q", None, None, steps=2000)
    assert (usable / "index.html").read_text().count("<img") == 3


@pytest.mark.thorough
def test_what_synthetic_data_were_made_of_is_marked(tmp_path: Path) -> None:
    truth = {"x": np.array([0.123, -0.457, 0.789])}
    folder, _ = written(tmp_path / "p", None, truth, steps=2000)
    page, text = words((folder / "index.html").read_text()), (folder / "posterior.txt").read_text()
    assert "The data are synthetic" in page
    assert page.count("the values that they were made of are marked") == 3  # figures
    for number in ("0.123", "0.457", "0.789"):
        assert number in page
        assert number in text
    data = json.loads((folder / "summary.json").read_text())["parts"]["part"]
    assert data["truth"] == pytest.approx(truth["x"])
    without, _ = written(tmp_path / "q", None, None, steps=2000)
    assert "synthetic" not in words((without / "index.html").read_text())


def test_blocks_that_differ_in_signs_have_files_of_their_own() -> None:
    assert anchors(["x[0]", "x(0)", "X-0", "..."]) == ["x-0", "x-0-2", "X-0-3", "block"]


def test_truth_against_a_prior_is_said() -> None:
    """Angles of 0.3 rad are far outside of the prior of some joints; draws from it are not."""
    assert contradictions(find("landmarks").setup()) == []
    [text] = contradictions(find("landmarks", {"pose_sigma": 0.3}).setup())
    assert "contradicts the pose prior: the sum of its 69 squares" in text
    assert contradictions(replace(find("landmarks").setup(), made_of=None)) == []
