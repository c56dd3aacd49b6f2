"""The licences of the libraries whose style sheets, scripts and fonts are part of a site."""

import shutil
from importlib.metadata import distribution
from pathlib import Path

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
