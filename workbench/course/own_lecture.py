"""Lectures that are not part of the course, each in a folder of its own beside its `outline.py`."""

import sys
from dataclasses import replace
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from os.path import isdir
from pathlib import Path
from types import ModuleType

from workbench.course.outline import FILES, LECTURES, Lecture, lecture, root
from workbench.errors import BadFile

OUTLINE = "outline.py"  # of a single lecture: it defines LECTURE


def lecture_named(text: str) -> Lecture:
    """A lecture by its number in the course, or by the folder of one that is not part of it.

    Raises UnknownName for a number that the course does not have, BadArgument for a lecture that is
    still to come, and BadFile for a folder that holds no lecture.
    """
    return lecture(int(text)) if text.strip().isdecimal() else own_lecture(text)


def own_lecture(folder: str | Path) -> Lecture:
    """The lecture in a folder, which has the files of every lecture and an `outline.py`.

    Its modules are imported as `workbench.lectures.<name of the folder>.checks` and so on, as those
    of the course are, so that the folder may later be moved there as it is. Raises BadFile.
    """
    place = Path(folder).resolve()
    if not isdir(place):  # also for a name that no file system takes
        raise BadFile(
            f"there is no folder {folder}; give the number of a lecture, which `workbench lecture "
            "list` names, or the folder of a lecture of your own (`workbench new lecture NAME`)"
        )
    if missing := [name for name in (*FILES, OUTLINE) if not (place / name).is_file()]:
        raise BadFile(
            f"{folder} holds no lecture: it has no {', '.join(missing)}; `workbench new lecture "
            "NAME` writes a folder that has all files"
        )
    name = f"{LECTURES}.{place.name}"
    taken = root() / place.name
    if not place.name.isidentifier() or (taken.is_dir() and not taken.samefile(place)):
        raise BadFile(
            f"{folder} cannot be imported as {name}, because the course has a lecture of this name "
            "or it is no name in Python; call the folder lecNN_name"
        )
    known = sys.modules.setdefault(name, _package(name, place))
    if Path(known.__path__[0]) != place:
        raise BadFile(f"{folder} and {known.__path__[0]} have the same name; rename one of them")
    found = getattr(import_module(f"{name}.{OUTLINE.removesuffix('.py')}"), "LECTURE", None)
    if not isinstance(found, Lecture) or found.folder_name != place.name:
        called = found.folder_name if isinstance(found, Lecture) else "no Lecture"
        raise BadFile(
            f"{place.name}/{OUTLINE} must define LECTURE, a Lecture whose number and name are "
            f"those in the name of its folder; it defines {called}"
        )
    return replace(found, place=Path(folder))


def _package(name: str, place: Path) -> ModuleType:
    """A package whose modules are in a folder, whatever file of that name stands beside it."""
    spec = ModuleSpec(name, None, is_package=True)
    spec.submodule_search_locations = [str(place)]
    return module_from_spec(spec)
