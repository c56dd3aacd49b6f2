"""Slides are made of the slide cells of a lecture, and nothing of them comes from a network."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from tests.browsers import dumped, need_browser
from workbench.course.cells import cells
from workbench.course.outline import Lecture, course, lecture
from workbench.course.slides import MOST_BULLETS, MOST_ROWS, Slide, slides, write_slides
from workbench.errors import BadFile

THERE = list(course())
FEWEST, MOST = 20, 35  # with the title and the exercises


@pytest.mark.parametrize("one", THERE, ids=lambda one: one.folder_name)
def test_every_lecture_has_slides_and_every_figure_is_on_one(one: Lecture) -> None:
    count, drawn = 2, False
    for cell in cells(one.folder / "lecture.py", slides=True):
        place = f"{one.folder_name}, line {cell.line}"
        if cell.slide:
            count += 1
            drawn = drawn and cell.slide == "still"
            code = "".join(re.findall(r"```python\n(.*?)```", cell.text, re.S))
            assert cell.text.startswith("## "), place
            assert len(re.findall(r"^- ", cell.text, re.M)) <= MOST_BULLETS, place
            assert code.count("\n") <= MOST_ROWS, place
            text = re.sub(
                r"\{\{.*?\}\}", "0", re.sub(r"```.*?```|\|.*\|", "", cell.text, flags=re.S)
            )
            assert len(text.split()) <= 90, f"{place}: prose belongs into the notes"
        elif not cell.prose and re.search(r"^Picture\(", cell.text, re.M):
            assert not drawn, f"{place}: the figure before this one is on no slide"
            drawn = True
    assert not drawn, f"{one.folder_name}: the last figure is on no slide"
    assert FEWEST <= count <= MOST, one.folder_name


LECTURE = """# %% [markdown]
# Said before.
# %%
x = 7
# %% slide [markdown]
# ## It is {{ x }}
# - a formula, $x^2$
# ```python
# x = 7
# ```
# %% [markdown]
# Said after.
"""


def made(tmp_path: Path, text: str) -> list[Slide]:
    (tmp_path / "lecture.py").write_text(text)
    return slides(replace(lecture(2), place=tmp_path))


def test_prose_becomes_notes_and_fields_are_filled(tmp_path: Path) -> None:
    pytest.importorskip("mdit_py_plugins")
    slide, exercises = made(tmp_path, LECTURE)
    assert slide.headline == "It is 7"
    assert r"\(x^2\)" in slide.words
    assert "7</span>" in slide.words
    assert "Said before." in slide.notes
    assert "Said after." in slide.notes
    assert "Said" not in slide.words
    assert "2.1" in exercises.words


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        (
            "# x = 7\n# ```",
            "# y = 7\n# ```",
            "line 6: a slide quotes rows of code that the lecture has",
        ),
        ("## It", "It", "begins with its headline"),
        ("# - a", "# - b\n# - c\n# - d\n# - a", "at most 3 bullets"),
        ("# x = 7\n# ```", "# x = 7\n" * 13 + "# ```", "at most 12 rows"),
        ("# %% slide [", "# %% [", "has no slides"),
    ],
)
def test_what_is_no_slide_is_refused(right: str, wrong: str, told: str, tmp_path: Path) -> None:
    pytest.importorskip("mdit_py_plugins")
    assert LECTURE.count(right) == 1
    with pytest.raises(BadFile, match=told):
        made(tmp_path, LECTURE.replace(right, wrong))


LOOKED_AT = """
<pre id="answers"></pre>
<script>
(async () => {
  while (!document.body.dataset.ready) await new Promise(done => setTimeout(done, 50));
  const told = [];
  for (let k = 0; k < Reveal.getTotalSlides(); k++) {
    Reveal.slide(k);
    await new Promise(done => setTimeout(done, 100));
    const slide = Reveal.getCurrentSlide(), body = slide.querySelector(".body");
    const figure = slide.querySelector(".figure");
    for (let i = 0; i < 20 && body && body.scrollHeight > body.clientHeight + 2; i++)
      await new Promise(done => setTimeout(done, 100));  // a formula may still be set
    if (slide.querySelector("mjx-merror")) told.push(`${k + 1}: a formula`);
    if (body && body.scrollHeight > body.clientHeight + 2) told.push(`${k + 1}: too high`);
    if (body && body.scrollWidth > body.clientWidth + 2) told.push(`${k + 1}: too wide`);
    if (figure && figure.clientHeight < 300) told.push(`${k + 1}: a small figure`);
  }
  document.getElementById("answers").textContent = told.join("; ") || "fits";
})();
</script>
</body>"""


@pytest.mark.thorough
@pytest.mark.parametrize("number", [2, 6])
def test_page_fits_and_needs_no_network(number: int, tmp_path: Path) -> None:
    pytest.importorskip("sphinx_revealjs")
    one = lecture(number)
    page = write_slides(one, tmp_path / "slides")
    text = page.read_text(encoding="utf-8")
    outer = re.sub(r'srcdoc="[^"]*"', "", text)
    for address in re.findall(r'(?:src|href)="([^"]+)"', outer):
        local = address.startswith(("data:", "#")) or (page.parent / address).is_file()
        assert local or address.startswith("https://"), address  # a source that is cited
    assert not re.search(r"@import|url\(http|<(script|img|link)[^>]*(src|href)=.http", text)
    need_browser()
    page.write_text(text.replace("</body>", LOOKED_AT), encoding="utf-8")
    shown, complaints = dumped(page, "--window-size=1280,720", "--virtual-time-budget=60000")
    found = re.search(r'<pre id="answers">(.*?)</pre>', shown)
    assert found, complaints
    assert found[1] == "fits"
    page.write_text("somebody's")
    with pytest.raises(BadFile, match="no file of ours"):
        write_slides(one, tmp_path / "slides")
