"""What does not work in a browser says so, and what to do; everything else works.

Lectures, bodies, figures and pages have tests of their own that bear the same mark.
"""

import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from workbench import environment
from workbench.cli.app import app
from workbench.comparison import workers
from workbench.environment import SAMPLING, MissingLibrary
from workbench.plots.posterior import corner_sheet
from workbench.processes import NoProcesses
from workbench.training.registrations import over_halves

pytestmark = pytest.mark.browser


@pytest.fixture
def in_a_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "PLATFORMS", (sys.platform,))


@pytest.fixture
def without_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*SAMPLING, "rtree"):
        monkeypatch.setitem(sys.modules, name, None)


def line() -> wb.Problem:
    x = wb.Block("x", (2,))
    return wb.Problem((wb.Residual("near", x.symbol - np.arange(2.0), 0.1),), ("x",), blocks=(x,))


@pytest.mark.usefixtures("without_libraries")
def test_what_needs_a_missing_library_says_which_and_laplace_needs_none() -> None:
    with pytest.raises(MissingLibrary, match=r"needs emcee.*pip install 'emcee>=3\.1\.6'"):
        wb.sample(line(), {"x": np.zeros(2)})
    found = wb.laplace(line(), {"x": np.arange(2.0)}, draws=200)
    np.testing.assert_allclose(found.sd, 0.1, rtol=0.2)  # of 200 draws
    with pytest.raises(MissingLibrary, match=r"needs arviz.*pip install 'arviz>=0\.20,<2'"):
        found.inference_data()
    with pytest.raises(MissingLibrary, match=r"needs corner.*pip install 'corner>=2\.2\.2'"):
        corner_sheet(found, (0, 1))


@pytest.mark.usefixtures("without_libraries")
def test_the_command_ends_with_the_sentence(tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["sample", "landmarks", "--steps", "50"])
    assert isinstance(ended.exception, MissingLibrary), ended.output
    assert "pip install 'emcee>=3.1.6'" in str(ended.exception)


def test_libraries_are_asked_for_as_the_distribution_asks() -> None:
    text = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    extra = project["optional-dependencies"]["arviz"]
    assert set(SAMPLING.values()) < {*project["dependencies"], *extra}


@pytest.mark.usefixtures("in_a_browser")
def test_what_needs_other_processes_or_threads_says_so_or_does_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "pool", cache(workers.Pool))  # without workers of other tests
    with pytest.raises(NoProcesses, match="none can be started in a browser"):
        wb.compare(["landmarks"], ["trust-region"])
    assert over_halves(sum, [1, 2, 3, 4, 5]) == [3, 12]
