"""Notebooks and the site: from the same scripts, whole, with no page that needs the network."""

import importlib.util
import inspect
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.site.links import pages_of, troubles
from workbench.course import notebooks
from workbench.course.cells import Cell, cells, only_imports
from workbench.course.notebooks import notebook, tool, without_results
from workbench.course.outline import lecture
from workbench.course.site import SITE_TOOLS, write_course_site
from workbench.errors import BadFile
from workbench.lectures.outline import COURSE

THERE = COURSE


@pytest.mark.thorough
def test_notebook_holds_the_lecture_its_results_and_no_solution() -> None:
    nbformat = pytest.importorskip("nbformat")
    one = lecture(2)
    made = notebook(one)
    nbformat.validate(nbformat.from_dict(made))
    text = "\n".join(cell["source"] for cell in made["cells"])
    assert text.startswith(f"# {one.title}")
    assert "{{" not in text.partition("## Exercises")[0].replace("{{'", "")
    for name in one.exercises:
        assert f"`{name}(" in text
        assert inspect.getsource(one.solution(name)).partition("\n")[2] not in text
    shown = [output for cell in made["cells"] for output in cell.get("outputs", [])]
    assert any("<figure" in output.get("data", {}).get("text/html", "") for output in shown)
    assert any("det M = " in output.get("text", "") for output in shown)
    folded = [cell["source"] for cell in made["cells"] if "hide-input" in tags_of(cell)]
    assert all(code.startswith("with house_style():") or only_imports(code) for code in folded)
    assert not any(cell.get("outputs") for cell in without_results(made)["cells"])
    assert json.dumps(notebook(one)) == json.dumps(made)


def tags_of(cell: dict) -> list:
    return cell["metadata"].get("tags", [])


def test_lecture_that_fails_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "lecture.py").write_text("# %%\n1 / 0\n")
    with pytest.raises(BadFile, match="lecture 2 stops: ZeroDivisionError"):
        notebook(replace(lecture(2), place=tmp_path))


def test_missing_tool_is_named_with_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(notebooks, "import_module", absent)
    with pytest.raises(BadFile, match=r"pip install 'smpl-workbench\[course\]', or in .*'\.\[c"):
        tool("sphinx")


def have(*names: str) -> None:
    for name in names:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")


def not_run(path: Path, names: dict) -> Iterator[tuple[Cell, None, str]]:
    return ((cell, None, "") for cell in cells(path))


@pytest.mark.thorough
def test_site_is_whole_and_loads_nothing_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every link leads somewhere, and nothing is loaded from elsewhere. No cell is run here."""
    have(*SITE_TOOLS)
    monkeypatch.setattr(notebooks, "run_cells", not_run)
    out = tmp_path / "new" / "site"
    assert write_course_site(out) == out / "index.html"
    pages = {path.name: links for path, links in pages_of(out).items()}
    made = {f"{one.folder_name}.html" for one in THERE}
    assert made | {"GUIDE.html"} <= pages.keys()
    assert troubles(out) == []
    (out / "left-over.html").touch()
    write_course_site(out)  # once more, in its own place
    assert not (out / "left-over.html").exists()
