"""The full site: all pages are gathered, built, and put into their folder."""

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from builder.site.pages import (
    NUMBERED,
    START,
    TEXTS,
    checkout,
    contents,
    run_all,
    write_documents,
    write_example_pages,
    write_licence_page,
)
from builder.site.reference import Reference
from workbench.course.site import (
    Tell,
    build,
    copy_licences,
    refuse,
    replace_site,
    write_course_pages,
)


def write_site(folder: str | Path, tell: Tell = lambda said: None) -> Path:
    """Run all lectures and examples, write the whole site, and return its first page.

    `tell` is called with a line for each part that begins. Raises BadFile if a tool is missing, if
    this is no checkout, if a lecture or example fails, if Sphinx warns, or if the folder holds
    something else than a site.
    """
    folder = Path(folder)
    refuse(folder)
    source = checkout()
    with TemporaryDirectory(prefix="workbench-site-") as place:
        scratch = Path(place)
        pages, files = scratch / "pages", scratch / "files"
        write_course_pages(pages / "lectures", files / "lectures", tell)
        examples = source / "examples"
        done = run_all(examples, NUMBERED, scratch / "examples", tell)
        shown = run_all(examples / "reference", "*.py", scratch / "examples" / "reference", tell)
        tell("writing pages")
        write_example_pages(done, pages / "examples")
        Reference(shown).write(pages / "reference")
        documents = write_documents(source, pages)
        for name in TEXTS:
            shutil.copy(source / name, files / name)
        copy_licences(files / "licences")
        write_licence_page(pages, TEXTS, files / "licences")
        with (pages / START).open("a", encoding="utf-8") as front:
            front.write(
                contents(
                    {
                        "Learn": ["lectures/index", "examples/index"],
                        "Look up": ["reference/index", *documents, "licences"],
                    }
                )
            )
        replace_site(build("workbench", pages, files, scratch), folder)
    return folder / "index.html"
