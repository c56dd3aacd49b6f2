"""What a cell computes is shown; what it draws with is folded."""

import pytest

from workbench.course.cells import cells
from workbench.course.drawing import apart
from workbench.course.outline import Lecture, course

THERE = [one for one in course() if one.there]


def test_a_cell_comes_apart_where_it_begins_to_draw() -> None:
    computing, drawing = apart(
        "x = f()\n\n# two lines\nwith house_style():\n    g(x)\nPicture(figure, 'so')"
    )
    assert computing == "x = f()"
    assert drawing == "# two lines\nwith house_style():\n    g(x)\nPicture(figure, 'so')"
    assert apart("x = f()\ng(x)") == ("x = f()\ng(x)", "")
    assert apart("with house_style():\n    g()")[0] == ""


@pytest.mark.parametrize("lecture", THERE, ids=lambda one: one.folder_name)
def test_no_lecture_computes_what_it_prints_in_code_that_is_folded(lecture: Lecture) -> None:
    for one in cells(lecture.folder / "lecture.py"):
        computing, drawing = apart(one.text) if not one.prose else ("", "")
        assert "print(" not in drawing, f"line {one.line}: print before the figure is drawn"
        assert "Picture(" not in computing, f"line {one.line}: draw within `with house_style():`"
