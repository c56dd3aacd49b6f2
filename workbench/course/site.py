"""The pages of the course as a site."""

import re
import shutil
import warnings
from collections.abc import Callable
from importlib.metadata import distribution
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from workbench.course.cells import cells
from workbench.course.notebooks import Notebook, notebook, tool, without_results, write_notebook
from workbench.course.outline import Lecture, course, root
from workbench.errors import BadFile

STYLE = Path(__file__).with_name("site.css")
SITE_TOOLS = ("sphinx", "myst_nb", "sphinx-mathjax-offline")  # beside the tools of notebooks
LIGHT, DARK = "default", "github-dark"  # the colours of code, by Pygments' names
SITE_MARK = "searchindex.js"  # a folder with this file is a site, which may be built anew
SHIPPED = ("Sphinx", "Pygments", "myst-nb")  # their style sheets and scripts are copied
LICENCE_NAMES = ("licen", "copying", "notice", "authors")  # how the names of such files begin
OTHERS = Path(__file__).with_name("licence_texts")  # of what is installed without its own: MathJax


def refuse(folder: Path) -> None:
    """Raise BadFile if a tool is missing, or if the folder holds anything but a site."""
    for name in SITE_TOOLS:
        if find_spec(name) is None:
            tool(name)
    if folder.exists() and not folder.is_dir():
        raise BadFile(f"{folder} is a file; give a folder for the site")
    if folder.exists() and any(folder.iterdir()) and not (folder / SITE_MARK).is_file():
        raise BadFile(f"{folder} holds something that is no site of ours; give a new folder")


def build(title: str, pages: Path, files: Path, scratch: Path) -> Path:
    """Build the site of the pages, with `files` copied beside them; return its folder.

    Raises BadFile if Sphinx fails or warns.
    """
    static, out, log = scratch / "static", scratch / "out", StringIO()
    static.mkdir()
    (static / "site.css").write_text(_style(), encoding="utf-8")
    settings: dict[str, Any] = {
        "project": title,
        "extensions": ["myst_nb", "sphinx-mathjax-offline"],
        "myst_enable_extensions": ["dollarmath", "amsmath"],
        "myst_heading_anchors": 4,
        # the bar of a transpose is thinner than a pixel on many screens
        "mathjax3_config": {"tex": {"macros": {"top": r"\mathsf{T}"}}},
        "nb_code_prompt_show": "Show the code",
        "nb_code_prompt_hide": "Hide the code",
        "nb_execution_mode": "off",  # lectures were run before, where an error can be told
        "html_theme": "basic",
        "html_title": title,
        "html_css_files": ["site.css"],
        "html_static_path": [str(static)],
        "html_extra_path": [str(files)],
        "html_sidebars": {"**": ["searchbox.html", "globaltoc.html"]},
        "html_copy_source": False,
        "html_show_sphinx": False,
        "html_show_copyright": False,
        "html_use_index": False,
        "html_domain_indices": False,
        "pygments_style": LIGHT,
        "suppress_warnings": ["myst.header"],  # documents need not go down level by level
    }
    sphinx, namespaces = tool("sphinx.application"), tool("sphinx.util.docutils")
    try:
        with (
            warnings.catch_warnings(),
            namespaces.patch_docutils(),
            namespaces.docutils_namespace(),
        ):
            # of these libraries about each other
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            app = sphinx.Sphinx(
                pages, None, out, scratch / "doctrees", "html", settings, status=None, warning=log
            )
            app.build()
    except Exception as error:
        raise BadFile(f"Sphinx could not build the site: {error}\n{log.getvalue()}") from error
    if app.statuscode or log.getvalue().strip():
        raise BadFile(f"Sphinx is not content with the site: {log.getvalue().strip()}")
    return out


def replace_site(out: Path, folder: Path) -> None:
    """Put the built site into its folder, in the place of an older one."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if folder.exists():
            shutil.rmtree(folder)
        shutil.copytree(out, folder, ignore=shutil.ignore_patterns(".buildinfo", "_sources"))
    except OSError as error:
        raise BadFile(f"cannot write {folder}: {error.strerror or error}") from error


def _style() -> str:
    """Our style sheet, and the colours of code for dark screens."""
    formatter = tool("pygments.formatters").HtmlFormatter(style=DARK)
    dark = formatter.get_style_defs(".highlight")
    screen = f"@media screen and (prefers-color-scheme: dark) {{\n{dark}\n}}\n"
    return f"{STYLE.read_text(encoding='utf-8')}\n{screen}"


def copy_licences(folder: Path) -> None:
    """Copy the licences of the libraries whose style sheets, scripts and fonts a site ships."""
    shutil.copytree(OTHERS, folder)
    for name in SHIPPED:
        for path in distribution(name).files or ():
            if path.name.lower().startswith(LICENCE_NAMES) and path.suffix not in (".py", ".pyc"):
                source = Path(str(path.locate()))
                if source.is_file():
                    shutil.copy(source, folder / f"{name}-{path.stem}.txt")


VENUES = ("journal", "booktitle", "institution", "howpublished", "publisher")  # in BibTeX
GUIDES = ("GUIDE", "PLANS", "AUTHORS")  # the pages beside the lectures
Tell = Callable[[str], None]  # is called with a line for each part that begins


def write_course_pages(pages: Path, files: Path, tell: Tell) -> None:
    """Run every lecture and write its page, the index of the course, and the guides.

    `pages` receives what Sphinx reads, `files` what readers download; both are made. Raises
    CellFailed if a lecture stops with an error.
    """
    pages.mkdir(parents=True, exist_ok=True)
    files.mkdir(parents=True, exist_ok=True)
    lectures, books = list(course()), []
    for lecture in lectures:
        tell(f"running lecture {lecture.number}, {lecture.title}")
        books.append(_write_lecture(lecture, pages, files))
    (pages / "index.md").write_text(_index(lectures, _moving(books)), encoding="utf-8")
    (pages / "sources.md").write_text(sources_page(lectures), encoding="utf-8")
    for guide in GUIDES:
        shutil.copy(root() / f"{guide}.md", pages)


def _moving(made: list[Notebook]) -> str:
    """The first figure of the lectures that moves, for a page in Markdown; empty if none does."""
    outputs = (out for book in made for cell in book["cells"] for out in cell.get("outputs", []))
    outputs_html = (out.get("data", {}).get("text/html", "") for out in outputs)
    figure = next((html for html in outputs_html if "<iframe" in html), "")
    return figure and f"```{{raw}} html\n{figure}\n```\n\n"


def _write_lecture(lecture: Lecture, pages: Path, files: Path) -> Notebook:
    book, name = notebook(lecture), lecture.folder_name
    write_notebook(without_results(book), files / f"{name}.ipynb")
    shutil.copy(lecture.folder / "exercises.py", files / f"{name}.py")
    first = book["cells"][0]
    head, _, rest = first["source"].partition("\n")
    facts = (
        f'<p class="facts">Lecture {lecture.number}, {lecture.minutes} minutes. '
        f"Assumes {lecture.assumes}. "
        f'<a href="{name}.ipynb">notebook</a>, <a href="{name}.py">exercises</a></p>'
    )
    first["source"] = f"{head}\n\n{facts}\n{rest}"
    write_notebook(book, pages / f"{name}.ipynb")
    return book


def _index(lectures: list[Lecture], figure: str) -> str:
    """The first page of the course: a figure, and every lecture with its question."""
    rows = [
        f"| {lecture.number} | [{lecture.title}]({lecture.folder_name}.ipynb)<br>"
        f"{lecture.question} "
        f"| {lecture.minutes} | {sum(check.points for check in lecture.checks)} |"
        for lecture in lectures
    ]
    names = [lecture.folder_name for lecture in lectures]
    return (
        "# Body models, from a function to a posterior\n\n"
        "A course on the workbench. All figures and numbers on these pages were computed by the "
        "code beside them when the pages were made.\n\n"
        f"{figure}| | lecture | minutes | points |\n| --- | --- | --- | --- |\n"
        + "\n".join(rows)
        + "\n\n"
        "```{toctree}\n:hidden:\n\n" + "\n".join((*names, "sources", *GUIDES)) + "\n```\n"
    )


def references() -> list[dict[str, str]]:
    """The works of `references.bib`: their fields, and `link`, which is empty if they have none."""
    text = (root() / "references.bib").read_text(encoding="utf-8")
    works = []
    for entry in re.findall(r"^@\w+\{\w+,\n(.*?)^\}", text, re.M | re.S):
        fields = re.findall(r"^ *(\w+) = \{(.*)\},?$", entry, re.M)
        work = {name: re.sub(r"[{}]", "", value) for name, value in fields}
        if "doi" in work:  # brackets would end a link of Markdown
            link = "https://doi.org/" + work["doi"].replace("(", "%28").replace(")", "%29")
        else:
            link = f"https://arxiv.org/abs/{work['eprint']}" if "eprint" in work else ""
        works.append(work | {"link": link or work.get("url", "")})
    return works


def cites(lecture: Lecture, work: dict[str, str]) -> bool:
    """Whether a lecture links a work, or names the title of one without a link in italics."""
    texts = [cell.text for cell in cells(lecture.folder / "lecture.py") if cell.prose]
    sought = f"({work['link']})" if work["link"] else f"*{work['title']}*"
    return sought.casefold() in " ".join(" ".join(texts).split()).casefold()


def sources_page(lectures: list[Lecture]) -> str:
    """The bibliography of the course, with the lectures that cite each work."""
    rows = []
    for work in references():
        names = [" ".join(name.split(", ")[::-1]) for name in work.get("author", "").split(" and ")]
        title = f"[{work['title']}]({work['link']})" if work["link"] else work["title"]
        facts = [", ".join(names), f"*{title}*", *(work[k] for k in (*VENUES, "year") if k in work)]
        by = [f"[{k.number}]({k.folder_name}.ipynb)" for k in lectures if cites(k, work)]
        rows.append(f"- {', '.join(filter(None, facts))} (lecture {', '.join(by)})\n")
    return "# Sources\n\nWhat the lectures cite, also as `lectures/references.bib`.\n\n" + "".join(
        rows
    )


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
        replace_site(build("Body models", pages, files, scratch), folder)
    return folder / "index.html"
