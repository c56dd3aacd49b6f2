"""Which exercises a pack holds: `4` for a lecture, `4.2` for one exercise, or a FILE.py."""

import importlib.util
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from workbench.course.outline import Lecture, lecture
from workbench.course.packs.variants import Slip, Variant, slips_in, variants_in
from workbench.errors import BadArgument, BadFile, UnknownName, WorkbenchError

FILE = "variants.py"


@dataclass(frozen=True)
class Chosen:
    """An exercise of a pack.

    Attributes:
        number: as it is printed, such as `4.2`; for a file, its name and a number.
        sheet: the name of the student's file, without its ending.
        title: the title of the lecture or of the file.
        variant: the exercise.
        slips: wrong answers to it that are known.
        published: where a solution of the exercise in the lecture stands, or None.
    """

    number: str
    sheet: str
    title: str
    variant: Variant
    slips: tuple[Slip, ...]
    published: Lecture | None


def chosen(what: Sequence[str]) -> list[Chosen]:
    """The exercises that are named, in the order of their names; none is there twice.

    Raises BadArgument, BadFile, UnknownName.
    """
    found: dict[str, Chosen] = {}
    for name in what:
        some = of_file(Path(name)) if name.endswith(".py") else _of_lecture(name)
        found |= {one.number: one for one in some}
    if not found:
        raise BadArgument("a pack needs exercises: numbers of lectures (4), or of exercises (4.2)")
    sheets: dict[str, str] = {}
    for one in found.values():
        if sheets.setdefault(one.sheet, one.title) != one.title:
            raise BadArgument(f"two files would be called {one.sheet}.py; rename {one.title}")
    _check_names(list(found.values()))
    return list(found.values())


def _check_names(some: list[Chosen]) -> None:
    """Numbers stand in one file, so that no two exercises in it may use one name for them."""
    owners: dict[tuple[str, str], str] = {}
    for one in some:
        for name in one.variant.constants:
            other = owners.setdefault((one.sheet, name), one.number)
            if other != one.number:
                raise BadArgument(
                    f"{name} is a number of exercise {other} and of exercise {one.number}, which "
                    f"stand in one file, {one.sheet}.py; rename one of them"
                )


def variants_of(one: Lecture) -> list[Chosen]:
    """All variants of a lecture, in the order of its exercises; none if it has no such file."""
    if not (one.folder / FILE).is_file():
        return []
    module = one.module("variants")
    places = {name: k for k, name in enumerate(one.exercises, 1)}
    return [
        Chosen(
            f"{one.number}.{places[variant.exercise]}",
            one.folder_name,
            f"lecture {one.number}, {one.title}",
            variant,
            _of(module, variant),
            one,
        )
        for variant in sorted(variants_in(module), key=lambda v: places[v.exercise])
    ]


def of_file(path: Path) -> list[Chosen]:
    """All variants of a lecturer's own file. Raises BadFile."""
    if not path.is_file():
        raise BadFile(f"there is no file {path}; name a file with variants, or a lecture's number")
    spec = importlib.util.spec_from_file_location(f"variants_of_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise BadFile(f"{path} does not run: {type(error).__name__}: {error}") from error
    found = variants_in(module)
    if not found:
        raise BadFile(
            f"{path} has no variants; write them with `workbench.course.packs.variant`, as "
            "lectures/lec04_skinning/variants.py does"
        )
    return [
        Chosen(f"{path.stem}.{k}", path.stem, path.stem, variant, _of(module, variant), None)
        for k, variant in enumerate(found, 1)
    ]


def _of(module: ModuleType, variant: Variant) -> tuple[Slip, ...]:
    return tuple(one for one in slips_in(module) if one.exercise == variant.exercise)


def _of_lecture(name: str) -> list[Chosen]:
    if not re.fullmatch(r"\d{1,3}(\.\d{1,2})?", name):
        raise BadArgument(
            f"{name!r} is neither a lecture (4), nor an exercise (4.2), nor a file (mine.py)"
        )
    one = lecture(int(name.partition(".")[0]))
    some = variants_of(one)
    if not some:
        raise WorkbenchError(
            f"lecture {one.number} has no exercises with numbers that vary; write your own in a "
            "file, and name that"
        )
    if "." not in name:
        return some
    these = [found for found in some if found.number == name]
    if not these:
        there = ", ".join(found.number for found in some)
        raise UnknownName("exercise with numbers that vary", name, hint=there)
    return these
