"""The licences of what a site ships: ours, and those of the libraries that it copies parts of."""

import shutil
from importlib.metadata import distribution
from pathlib import Path

from workbench.site.examples import raw

SHIPPED = ("Sphinx", "Pygments", "myst-nb")  # their style sheets and scripts are copied
LICENCE = ("licen", "copying", "notice", "authors")  # how the names of such files begin
OTHERS = Path(__file__).with_name("licence_texts")  # of what is installed without its own: MathJax


def copy_licences(folder: Path) -> None:
    """Copy the licences of the libraries whose style sheets, scripts and fonts a site ships."""
    shutil.copytree(OTHERS, folder)
    for name in SHIPPED:
        for path in distribution(name).files or ():
            if path.name.lower().startswith(LICENCE) and path.suffix not in (".py", ".pyc"):
                source = Path(str(path.locate()))
                if source.is_file():
                    shutil.copy(source, folder / f"{name}-{path.stem}.txt")


def write_licence_page(pages: Path, ours: tuple[str, ...], folder: Path) -> None:
    """Write a page with links to the workbench's own texts and to those in the folder."""
    texts = [*ours, *sorted(f"{folder.name}/{path.name}" for path in folder.iterdir())]
    items = "".join(f'<li><a href="{text}">{text}</a></li>' for text in texts)
    listed = raw(f"<ul>{items}</ul>")
    (pages / "licences.md").write_text(
        "# Licences\n\nThe licence of the workbench, its notices, and the licences of the "
        f"libraries whose style sheets, scripts and fonts are part of this site.\n\n{listed}\n",
        encoding="utf-8",
    )
