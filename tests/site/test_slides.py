"""A lecture as slides: all of its prose, results and figures, and nothing from a network."""

import re
from pathlib import Path

import pytest

from workbench.course.cells import cells
from workbench.course.outline import lecture
from workbench.course.slides import LINES, slides, write_slides
from workbench.errors import BadFile

pytestmark = pytest.mark.thorough

ONE = lecture(6)


@pytest.fixture(scope="module")
def made() -> list:
    return slides(ONE)


def test_all_headings_are_there_in_order(made: list) -> None:
    text = "\n".join(cell.text for cell in cells(ONE.folder / "lecture.py") if cell.prose)
    headings = [title.strip() for title in re.findall(r"^#+ (.+)$", text, flags=re.M)]
    sections = list(dict.fromkeys(slide.section for slide in made))
    assert sections == [*headings, "Exercises"]


def test_prose_results_figures_and_code_are_there(made: list) -> None:
    whole = "".join(slide.body for slide in made)
    assert whole.count("<figure") == whole.count("<figcaption") >= 2
    assert r"\(J^\top e\)" in whole  # a formula, for MathJax
    assert "difference quotient" in re.sub("<[^>]*>", "", whole)
    assert all(slide.lines <= 2 * LINES for slide in made)
    for slide in made:
        if "<figure" in slide.body:
            assert "figure" in re.sub("<[^>]*>", "", slide.below)
    assert "6.4" in made[-1].body
    assert "about 15" in made[-1].body


def test_pages_need_no_network_and_no_other_file_is_written_over(tmp_path: Path) -> None:
    pytest.importorskip("sphinx_revealjs")
    page = write_slides(ONE, tmp_path / "slides")
    text = page.read_text(encoding="utf-8")
    for address in re.findall(r'(?:src|href)="([^"]+)"', text):
        assert address.startswith(("data:", "#")) or (page.parent / address).is_file(), address
    assert not re.search(r"@import|url\(http", text)
    page.write_text("somebody's")
    with pytest.raises(BadFile, match="no file of ours"):
        write_slides(ONE, tmp_path / "slides")
