"""The home folders of users."""

from pathlib import Path

from workbench.errors import BadFile


def home() -> Path:
    """The home folder of the user. Raises BadFile if neither HOME nor the system names it."""
    return expanded("~")


def expanded(path: str | Path) -> Path:
    """A path whose `~` or `~name` is replaced by a folder. Raises BadFile if there is none."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise BadFile(
            f"no home folder is known for {path}; give a whole path, or set the variable HOME"
        ) from error
