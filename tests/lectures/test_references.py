"""What lectures link is in the bibliography, and the bibliography holds nothing else."""

import re

from workbench.course.cells import cells
from workbench.course.outline import root
from workbench.lectures.outline import COURSE

THERE = COURSE
WORK = re.compile(r"\]\((https?://[^)]+)\)")


def test_bibliography_holds_the_works_that_lectures_link() -> None:
    text = (root() / "references.bib").read_text(encoding="utf-8")
    prose = {
        one.folder_name: " ".join(c.text for c in cells(one.folder / "lecture.py") if c.prose)
        for one in THERE
    }
    known = {f"https://doi.org/{doi}" for doi in re.findall(r"doi = \{(.*)\}", text)}
    known |= {f"https://arxiv.org/abs/{one}" for one in re.findall(r"eprint = \{(.*)\}", text)}
    known |= set(re.findall(r"url = \{(.*)\}", text))
    known = {link.replace("(", "%28").replace(")", "%29") for link in known}
    linked = {link for each in prose.values() for link in WORK.findall(each)}
    assert linked <= known
    assert all(any(link in each for each in prose.values()) for link in linked)
