"""Notebooks and the site: from the same scripts, whole, with no page that needs the network."""

import importlib.util
import os
from pathlib import Path
from urllib.parse import urlparse

import pytest

import workbench
from tests.site.links import pages_of, troubles
from workbench.course import notebooks
from workbench.course import site as course_pages
from workbench.course.cells import only_imports
from workbench.course.notebooks import exercises, notebook, tool
from workbench.course.site import NEEDED, write_course_site
from workbench.errors import BadFile
from workbench.lectures.outline import COURSE

THERE = [one for one in COURSE if one.there]


@pytest.mark.thorough
@pytest.mark.parametrize("lecture", THERE, ids=lambda one: one.folder_name)
def test_notebook_holds_the_lecture_and_no_solution(lecture) -> None:
    pytest.importorskip("jupytext")
    nbformat = pytest.importorskip("nbformat")
    made = notebook(lecture)
    nbformat.validate(made)
    text = "\n".join(cell.source for cell in made.cells)
    assert made.cells[0].source.startswith(f"# {lecture.title}")
    for name in lecture.exercises:
        assert f"`{name}(" in text
    assert not any(cell.get("outputs") for cell in made.cells)
    exercises_begin = next(
        k for k, cell in enumerate(made.cells) if cell.source.startswith("## Exercises")
    )
    for cell in made.cells[:exercises_begin]:
        aside = cell.cell_type == "code" and (
            cell.source.startswith("with house_style():") or only_imports(cell.source)
        )
        assert ("hide-input" in cell.metadata.get("tags", ())) is aside  # folded on the site
    assert [c.source for c in notebook(lecture).cells] == [c.source for c in made.cells]


def test_exercises_are_listed_with_their_points() -> None:
    rotations = next(one for one in COURSE if one.number == 2)
    head, first, *rest = exercises(rotations)
    assert "workbench lecture check 2" in head
    assert "### 2.1 `hat(w)`" in first
    assert first.endswith("1 point, about 5 minutes")
    assert len(rest) == len(rotations.exercises) - 1


def test_missing_tool_is_named_with_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(notebooks, "import_module", absent)
    with pytest.raises(BadFile, match=r"pip install 'smpl-workbench\[course\]', or in .*'\.\[c"):
        tool("nbclient")


@pytest.mark.thorough
def test_site_replaces_nothing_of_others(tmp_path: Path) -> None:
    have(*notebooks.NEEDED, *NEEDED)
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(BadFile, match="no site of ours"):
        write_course_site(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def have(*names: str) -> None:
    for name in names:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")


@pytest.mark.thorough
def test_site_is_whole_and_loads_nothing_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every link leads somewhere, and nothing is loaded from elsewhere. No cell is run here."""
    have(*notebooks.NEEDED, *NEEDED)
    monkeypatch.setattr(course_pages, "executed", lambda made, lecture, folder: made)
    out = tmp_path / "new" / "site"
    assert write_course_site(out) == out / "index.html"
    pages = {path.name: links for path, links in pages_of(out).items()}
    assert {f"{one.folder_name}.html" for one in THERE} | {"GUIDE.html"} <= pages.keys()
    assert troubles(out) == []
    assert not [to for links in pages.values() for to in links.to if urlparse(to).netloc]
    (out / "left-over.html").touch()
    write_course_site(out)  # once more, in its own place
    assert not (out / "left-over.html").exists()


@pytest.mark.thorough
def test_kernel_finds_the_workbench_that_started_it(tmp_path: Path) -> None:
    """Also that of a checkout that is not installed."""
    have(*notebooks.NEEDED)
    v4 = tool("nbformat").v4
    made = v4.new_notebook(cells=[v4.new_code_cell("import os; os.environ['PYTHONPATH']")])
    done = notebooks.executed(made, THERE[0], tmp_path)
    first = done.cells[0].outputs[0]["data"]["text/plain"].strip("'").split(os.pathsep)[0]
    assert Path(first) == Path(workbench.__file__).parents[1]


@pytest.mark.thorough
def test_notebook_of_a_lecture_executes(tmp_path: Path) -> None:
    """One: the cells of every lecture are run in tests/lectures."""
    have(*notebooks.NEEDED)
    lecture = next(one for one in THERE if one.number == 2)
    done = notebooks.executed(notebook(lecture), lecture, tmp_path)
    shown = [output for cell in done.cells for output in cell.get("outputs", [])]
    assert any("<figure" in output.get("data", {}).get("text/html", "") for output in shown)
    assert not any(output.get("name") == "stderr" for output in shown)
