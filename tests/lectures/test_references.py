"""What lectures link is in the bibliography, and the bibliography holds nothing else."""

import re

from workbench.course.outline import root
from workbench.course.site import cites, references, sources_page
from workbench.lectures.outline import COURSE

THERE = [one for one in COURSE if one.there]
WORK = re.compile(r"\]\((https?://[^)]+)\)")


def test_works_that_lectures_link_are_in_the_bibliography() -> None:
    known = {work["link"] for work in references()}
    for one in THERE:
        linked = set(WORK.findall((one.folder / "lecture.py").read_text(encoding="utf-8")))
        assert linked <= known, one.folder_name


def test_works_of_the_bibliography_are_whole_and_cited() -> None:
    works = references()
    assert len(works) == (root() / "references.bib").read_text(encoding="utf-8").count("\n@")
    for work in works:
        assert any(cites(one, work) for one in THERE), f"no lecture cites {work['title']}"
        assert work["link"].startswith("https://") or not work.keys() & {"doi", "eprint", "url"}
    page = sources_page(THERE)
    assert page.count("\n- ") == len(works)
    assert "*[Keep It SMPL: " in page
    assert "/10.1016/0262-8856%2892%2990066-C)" in page  # a bracket would end the link
