"""The documents of a checkout as pages: each keeps its place, so that links between them hold."""

import os
import re
import shutil
from pathlib import Path

import workbench
from workbench.errors import BadFile

FRONT, START = "README.md", "index.md"
DOCUMENTS = (
    "COMMANDS.md",
    "howto/problem.md",
    "howto/residual.md",
    "howto/solver.md",
    "howto/experiment.md",
    "howto/diagnose.md",
    "howto/fit.md",
    "howto/scan.md",
    "howto/train.md",
    "examples/README.md",
    "examples/studies/README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
)
BENCHMARKS = "benchmarks/*.md"
TEXTS = ("LICENSE", "NOTICE")
LINK = re.compile(r"(!?\[[^\]]*\])\(([^)\s#:]+)(#[^)\s]*)?\)")


def checkout() -> Path:
    """The folder of the checkout. Raises BadFile for an installed wheel, which has no examples."""
    folder = Path(workbench.__file__).parents[1]
    for name in (FRONT, "examples", *DOCUMENTS):
        if not (folder / name).exists():
            raise BadFile(
                f"the site is built from a checkout, with its documents and examples; {folder} has "
                f"no {name}. `workbench lecture site FOLDER` writes the course alone"
            )
    return folder


def write_documents(source: Path, pages: Path) -> list[str]:
    """Write the front page and all documents; return the names of the documents' pages."""
    found = [source / name for name in DOCUMENTS] + sorted(
        source.glob(BENCHMARKS), key=lambda path: (path.name != FRONT, path.name)
    )
    for path in (source / FRONT, *found):
        place = path.relative_to(source)
        page = pages / (START if place == Path(FRONT) else place)
        page.parent.mkdir(parents=True, exist_ok=True)
        text = _linked(path.read_text(encoding="utf-8"), path.parent, source, pages)
        page.write_text(text, encoding="utf-8")
    return [path.relative_to(source).with_suffix("").as_posix() for path in found]


def contents(groups: dict[str, list[str]]) -> str:
    """The list of all pages beside each page, in groups with a title."""
    return "\n\n" + "\n\n".join(
        f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n" + "\n".join(names) + "\n```"
        for title, names in groups.items()
    )


def _linked(text: str, here: Path, source: Path, pages: Path) -> str:
    """Links to examples lead to their pages; other files are copied; dead links become words."""

    def to(found: re.Match[str]) -> str:
        words, target, anchor = found[1], found[2], found[3] or ""
        path = Path(os.path.normpath(here / target))
        if not path.is_file() or source not in path.parents:
            return words.strip("![]")
        place = path.relative_to(source)
        if place == Path(FRONT):
            return f"{words}({os.path.relpath(source / START, here)}{anchor})"
        if path.parent == source / "examples" and path.suffix == ".py":
            return f"{words}({target.removesuffix('.py')}.md)"
        if path.suffix != ".md":
            copy = pages / place
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, copy)
        return found[0]

    parts = re.split(r"(^```.*?^```)", text, flags=re.S | re.M)
    return "".join(part if k % 2 else LINK.sub(to, part) for k, part in enumerate(parts))
