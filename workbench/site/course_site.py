"""The site of the course: its pages are written, built, and put into their folder."""

from pathlib import Path
from tempfile import TemporaryDirectory

from workbench.site.building import build, put, refuse
from workbench.site.course_pages import Tell, write_course_pages
from workbench.site.licences import copy_licences


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
