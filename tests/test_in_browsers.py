"""What does not work in a browser says so, and what to do; everything else works.

Lectures, bodies, figures and pages have tests of their own that bear the same mark.
"""

import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import workbench as wb
from workbench import environment
from workbench.comparison import workers
from workbench.environment import SAMPLING, MissingLibrary
from workbench.plots.posterior import plot_corner
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
        plot_corner(found, (0, 1), Figure())


def test_libraries_are_asked_for_as_the_distribution_asks() -> None:
    text = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    extra = project["optional-dependencies"]["arviz"]
    assert set(SAMPLING.values()) < {*project["dependencies"], *extra}


@pytest.mark.usefixtures("in_a_browser")
<<<<<<< HEAD
def test_a_file_is_graded_in_the_same_process(tmp_path: Path) -> None:
    path, before = tmp_path / "mine.py", list(sys.path)
    path.write_text(ANSWERS)
    found = grade(lecture(2), path)
    assert "without a limit of time" in " ".join(found.note.split())
    assert found.printed[""] == "begun"
    assert found.printed["nearest_rotation"].startswith("asked")
    results = found.exercises
    assert {one.state for one in results["shorter"]} == {CheckState.NOT_ATTEMPTED}
    assert "sys.exit(3)" in results["rodrigues"][0].came
    assert all(one.state is CheckState.PASSED for one in results["nearest_rotation"])
    (turned,) = results["hat"]
    assert "v x w" in turned.hint
    assert results["angle_between"][0].came == "no such name in the file"
    assert sys.path == before
    assert "answers" not in sys.modules
    assert [one.name for one in tmp_path.iterdir()] == ["mine.py"]
    path.write_text("import numpy as np\n1 / 0\n")
    lost = grade(lecture(2), path)
    assert lost.trouble == "line 2: ZeroDivisionError: division by zero"
    assert lost.note
    assert not lost.points


@pytest.mark.usefixtures("in_a_browser")
=======
>>>>>>> main
def test_what_needs_other_processes_or_threads_says_so_or_does_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "pool", cache(workers.Pool))  # without workers of other tests
    with pytest.raises(NoProcesses, match="none can be started in a browser"):
        wb.compare(["landmarks"], ["trust-region"])
    assert over_halves(sum, [1, 2, 3, 4, 5]) == [3, 12]
