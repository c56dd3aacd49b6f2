"""The pages of the course: the executed lectures, their table, and the guides for teachers."""

import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from workbench.course.notebooks import executed, notebook, write_notebook
from workbench.course.outline import Lecture, course, root
from workbench.site.building import build, copy_licences, put, refuse

GUIDES = ("GUIDE", "PLANS", "AUTHORS")  # the pages beside the lectures
TABLE = "<!-- the outline -->"  # a guide has this line where the table of lectures belongs
Tell = Callable[[str], None]  # is called with a line for each part that begins


def write_course_pages(pages: Path, files: Path, tell: Tell) -> None:
    """Run every lecture and write its page, the index of the course, and the guides.

    `pages` receives what Sphinx reads, `files` what readers download; both are made. Raises
    CellFailed if a lecture stops with an error.
    """
    pages.mkdir(parents=True, exist_ok=True)
    files.mkdir(parents=True, exist_ok=True)
    there = [one for one in course() if one.there]
    for one in there:
        tell(f"running lecture {one.number}, {one.title}")
        _write_lecture(one, pages, files)
    (pages / "index.md").write_text(_index(there), encoding="utf-8")
    for guide in GUIDES:
        text = (root() / f"{guide}.md").read_text(encoding="utf-8")
        (pages / f"{guide}.md").write_text(text.replace(TABLE, _table()), encoding="utf-8")


def _write_lecture(one: Lecture, pages: Path, files: Path) -> None:
    made, name = notebook(one), one.folder_name
    write_notebook(made, files / f"{name}.ipynb")
    shutil.copy(one.folder / "exercises.py", files / f"{name}.py")
    with TemporaryDirectory() as scratch:
        done = executed(made, one, Path(scratch))
    first = done.cells[0]
    head, _, rest = first.source.partition("\n")
    facts = (
        f'<p class="facts">Lecture {one.number}, {one.minutes} minutes. Assumes {one.assumes}. '
        f'<a href="{name}.ipynb">notebook</a>, <a href="{name}.py">exercises</a></p>'
    )
    first.source = f"{head}\n\n{facts}\n{rest}"
    write_notebook(done, pages / f"{name}.ipynb")


def _index(there: list[Lecture]) -> str:
    """The first page of the course: every lecture with its question."""
    rows = [
        f"| {one.number} | [{one.title}]({one.folder_name}.ipynb)<br>{one.question} "
        f"| {one.minutes} | {sum(check.points for check in one.checks)} |"
        if one.there
        else f"| {one.number} | {one.title} (to come) | | |"
        for one in course()
    ]
    names = [one.folder_name for one in there]
    return (
        "# Body models, from a function to a posterior\n\n"
        "A course on the workbench. All figures and numbers on these pages were computed by the "
        "code beside them when the pages were made.\n\n"
        "| | lecture | minutes | points |\n| --- | --- | --- | --- |\n" + "\n".join(rows) + "\n\n"
        "```{toctree}\n:hidden:\n\n" + "\n".join((*names, *GUIDES)) + "\n```\n"
    )


def _table() -> str:
    """What each lecture assumes and teaches, and how long it and its exercises take, in minutes."""
    rows = [
        f"| {one.number} | {one.title}{'' if one.there else ' (to come)'} | {one.minutes} "
        f"| {one.exercise_minutes if one.there else ''} | {one.assumes} | {one.teaches} |"
        for one in course()
    ]
    head = (
        "| | lecture | minutes | exercises (estimated) | assumes | teaches |\n"
        "| --- | --- | --- | --- | --- | --- |"
    )
    return "\n".join((head, *rows))


def write_course_site(folder: str | Path, tell: Tell = lambda said: None) -> Path:
    """Run every lecture, write a site of the course alone, and return its first page.

    `tell` is called with a line for each part that begins. Raises BadFile if a tool is missing, if
    Sphinx warns, or if the folder holds something else than a site, and CellFailed, which is a
    BadFile, if a lecture fails.
    """
    folder = Path(folder)
    refuse(folder)
    with TemporaryDirectory(prefix="workbench-site-") as place:
        scratch = Path(place)
        pages, files = scratch / "pages", scratch / "files"
        write_course_pages(pages, files, tell)
        copy_licences(files / "licences")
        tell("writing pages")
        put(build("Body models", pages, files, scratch), folder)
    return folder / "index.html"
