"""Exercises in notebooks: cells for answers, and cells that check them."""

import numpy as np
import pytest

from workbench.course.grading import check_here
from workbench.course.notebooks import add_links, notebook, requirements
from workbench.course.outline import lecture
from workbench.errors import BadArgument, UnknownName


def hat(w):
    return np.cross(np.eye(3), -w)


def test_answer_is_checked_where_it_is_defined(capsys: pytest.CaptureFixture[str]) -> None:
    check_here(2, hat)
    said = capsys.readouterr().out
    assert "failed: hat(w) @ v is w x v" in said
    assert "perhaps this is v x w" in said
    assert said.endswith("0 of 1 points\n")
    with pytest.raises(UnknownName, match="no exercise of lecture 2 is called 'test_here'"):
        check_here(2, test_here)


def test_here() -> None:
    """A function that is no exercise."""


@pytest.mark.thorough
@pytest.mark.parametrize("number", [2, 6, 9])
def test_notebook_has_cells_for_answers_and_checks(
    number: int, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("jupytext")
    one = lecture(number)
    made = notebook(one)
    tags = [cell["metadata"].get("tags") for cell in made.cells]
    first = tags.index(["answer"])
    assert tags.count(["answer"]) == tags.count(["check"]) == len(one.exercises)
    names: dict[str, object] = {}
    for cell in made.cells[first - 2 :]:
        if cell["cell_type"] == "code":
            exec(cell["source"], names)
    assert capsys.readouterr().out.count("not attempted") == len(one.checks)


@pytest.mark.thorough
def test_links_lead_to_the_notebook_in_the_repository() -> None:
    pytest.importorskip("jupytext")
    made = add_links(notebook(lecture(2)), "somebody/course", "main/notebooks", "lec02_rotations")
    text = made.cells[1]["source"]
    assert "github/somebody/course/blob/main/notebooks/lec02_rotations.ipynb" in text
    assert "gh/somebody/course/main?labpath=notebooks%2Flec02_rotations.ipynb" in text
    assert '%pip install --quiet "smpl-workbench"' in made.cells[2]["source"]
    assert requirements().startswith("smpl-workbench\n")
    with pytest.raises(BadArgument, match="OWNER/NAME"):
        add_links(made, "https://github.com/a/b", "main", "x")
