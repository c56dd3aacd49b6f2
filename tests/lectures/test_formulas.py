"""Formulas of lectures as a terminal shows them."""

import re

import pytest

from workbench.course.cells import cells
from workbench.course.formulas import in_letters
from workbench.course.outline import Lecture, course
from workbench.errors import BadFile

THERE = [one for one in course() if one.there]


@pytest.mark.parametrize(
    ("formula", "letters"),
    [
        (r"\tfrac12 \|e + J p\|^2", "½ ‖e + J p‖²"),
        (r"w_{ik}\, G'_k\, t_i", "wᵢₖ G'ₖ tᵢ"),
        (r"\sin^2 \tfrac\alpha2", "sin² (α/2)"),  # and not (sin² α)/2
        (r"\frac{F\, l}{D + l}", "(F l)/(D + l)"),
        (r"z^2 / 2n + \frac{z^2}{2n}", "z² / 2n + z²/(2n)"),
        (r"(J^\top J)^{-1} \hat x_q", "(Jᵀ J)⁻¹ x\u0302_q"),
        (r"\begin{pmatrix} R & t \\ 0 & 1 \end{pmatrix}", "[ R   t; 0   1 ]"),
        ("a \\ge b, \\qquad\nc .", "a ≥ b,\nc."),
    ],
)
def test_a_formula_in_letters(formula: str, letters: str) -> None:
    assert in_letters(formula) == letters


def test_what_it_does_not_know_is_named() -> None:
    with pytest.raises(BadFile, match=r"the command \\oint, which .* add it to SYMBOLS"):
        in_letters(r"\oint f")


@pytest.mark.parametrize("lecture", THERE, ids=lambda one: one.folder_name)
def test_every_formula_of_the_lectures_is_known(lecture: Lecture) -> None:
    prose = "\n".join(
        re.sub(r"`[^`]*`", "", one.text)
        for one in cells(lecture.folder / "lecture.py")
        if one.prose
    )
    formulas = re.findall(r"\$\$(.+?)\$\$|\$([^$]+)\$", prose, re.S)
    for display, inline in formulas:
        assert not re.search(r"\\|\$", in_letters(display or inline).replace("\\{", ""))
    assert prose.count("$") == sum(4 if display else 2 for display, _ in formulas)
    assert r"\\theta" not in prose, "one backslash is enough in a comment"
