"""What a lecture shows of its cells: code apart from drawing, the library's own code, formulas."""

import re
from pathlib import Path

import pytest

import workbench as wb
from workbench.course import source
from workbench.course.cells import cells, run_cells, split_at_drawing
from workbench.course.formulas import in_letters
from workbench.course.outline import course
from workbench.errors import BadFile
from workbench.motions.soft_tissue import MovingFrames, second_differences
from workbench.sampling.mixing import integrated_time

THERE = course()


def test_apart_splits_a_cell_where_drawing_begins() -> None:
    computing, drawing = split_at_drawing(
        "x = f()\n\n# two lines\nwith house_style():\n    g(x)\nPicture(figure, 'so')"
    )
    assert computing == "x = f()"
    assert drawing == "# two lines\nwith house_style():\n    g(x)\nPicture(figure, 'so')"
    assert split_at_drawing("x = f()\ng(x)") == ("x = f()\ng(x)", "")
    assert split_at_drawing("with house_style():\n    g()")[0] == ""


def run(tmp_path: Path, text: str) -> list[str]:
    """The prose of a script, filled."""
    path = tmp_path / "lecture.py"
    path.write_text(text)
    return [cell.text for cell, _, _ in run_cells(path) if cell.prose]


def test_prose_takes_its_numbers_from_the_run(tmp_path: Path) -> None:
    code = "# %%\nx = {'a b': -1234.56}\nprint('up to 1,250.5 mm, 3 of 4')\n# %% [markdown]\n"
    (said,) = run(tmp_path, code + "# It is {{ x['a\n# b']:,.1f }}{{ x['a b'] < 0 }}.")
    assert said == "It is -1,234.6."
    (said,) = run(
        tmp_path, code + "# $x = {{ printed('up to')[0]:g }}$ of {{ printed('mm')[-1]:.0f}}"
    )
    assert said == "$x = 1250.5$ of 4"


@pytest.mark.parametrize(
    ("field", "told"),
    [
        ("{{ x > 3 }}", "line 4: what the prose says is not so in this run: {{ x > 3 }}"),
        ("{{ y }}", "line 4: {{ y }} has no value: NameError"),
        ("{{ printed('z')[0] }}", "no printed line holds"),
    ],
)
def test_prose_that_the_run_does_not_bear_out_is_refused(
    field: str, told: str, tmp_path: Path
) -> None:
    with pytest.raises(BadFile, match=re.escape(told)):
        run(tmp_path, f"# %%\nx = 2\n# %% [markdown]\n# It is so: {field}")


def test_folded_code_of_every_lecture_only_draws() -> None:
    for lecture in THERE:
        for one in cells(lecture.folder / "lecture.py"):
            computing, drawing = split_at_drawing(one.text) if not one.prose else ("", "")
            place = f"{lecture.folder_name}, line {one.line}"
            assert "print(" not in drawing, f"{place}: print before the figure is drawn"
            assert "Picture(" not in computing, f"{place}: draw within `with house_style():`"


def test_source_shows_constants_above_the_code_that_reads_them() -> None:
    shown = source(integrated_time)
    assert shown.text.startswith("WINDOW = 5.0  # autocorrelation times")
    assert "TOGETHER = " not in shown.text
    assert shown.where == "workbench.sampling.mixing.integrated_time"
    shown = source(second_differences, MovingFrames.forces)
    order = [shown.text.index(part) for part in ("GRAVITY = ", "def second_d", "def forces")]
    assert order == sorted(order)
    assert shown.where.count("workbench.motions.soft_tissue.") == 2
    assert source(wb.Linearization.gradient).text.startswith("@cached_property\ndef gradient")


@pytest.mark.parametrize(
    ("formula", "letters"),
    [
        (r"\tfrac12 \|e + J p\|^2", "½ ‖e + J p‖²"),
        (r"w_{ik}\, G'_k\, t_i", "wᵢₖ G'ₖ tᵢ"),
        (r"\sin^2 \tfrac\alpha2", "sin² (α/2)"),  # and not (sin² α)/2
        (r"z^2 / 2n + \frac{z^2}{2n}", "z² / 2n + z²/(2n)"),
        (r"(J^\top J)^{-1} \hat x_q", "(Jᵀ J)⁻¹ x\u0302_q"),
        (r"\begin{pmatrix} R & t \\ 0 & 1 \end{pmatrix}", "[ R   t; 0   1 ]"),
        ("a \\ge b, \\qquad\nc .", "a ≥ b,\nc."),
        (r"J = \mathcal J\, T, \mathcal{W}", "J = 𝒥 T, 𝒲"),
    ],
)
def test_formula_is_written_in_letters(formula: str, letters: str) -> None:
    assert in_letters(formula) == letters


def test_formulas_of_every_lecture_are_known() -> None:
    for lecture in THERE:
        prose = "\n".join(
            re.sub(r"`[^`]*`", "", one.text)
            for one in cells(lecture.folder / "lecture.py")
            if one.prose
        )
        formulas = re.findall(r"\$\$(.+?)\$\$|\$([^$]+)\$", prose, re.S)
        for display, inline in formulas:
            letters = in_letters(display or inline)
            assert not re.search(r"\\|\$", letters.replace("\\{", "")), lecture.folder_name
        assert prose.count("$") == sum(4 if display else 2 for display, _ in formulas)
        assert r"\\theta" not in prose, "one backslash is enough in a comment"
