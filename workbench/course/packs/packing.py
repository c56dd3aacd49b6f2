"""Writing a pack: a folder for each student, and the keys in another folder."""

import secrets
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from workbench.course.packs.choosing import chosen
from workbench.course.packs.keys import ClassKey, make_keys, write_keys
from workbench.course.packs.texts import EXAMPLES, examples, notebook, script
from workbench.errors import BadArgument, BadFile


def write_pack(
    what: Sequence[str],
    group: str,
    students: dict[str, str],
    folder: Path,
    keys: Path,
    seed: int | None = None,
    tell: Callable[[str], None] = lambda said: None,
) -> ClassKey:
    """Write exercises for every student into `folder`, and the keys into `keys`.

    Both are made, and must not exist or be empty. Nothing is written if anything is wrong, and an
    interrupted run leaves neither. Without a seed, one is chosen that nobody can guess; the keys
    hold it. Raises BadArgument, BadFile, UnknownName.
    """
    if not group.strip():
        raise BadArgument("--for takes the name of the class, which has to have letters")
    some = chosen(what)
    for place in (folder, keys):
        if place.exists() and (not place.is_dir() or any(place.iterdir())):
            raise BadFile(f"{place} exists already, and is not written over; name a new folder")
    if keys.resolve() == folder.resolve() or folder.resolve() in keys.resolve().parents:
        raise BadArgument(f"the keys must not be inside of {folder}, which is handed out")
    key = make_keys(group, secrets.randbits(60) if seed is None else seed, students, some)
    variants = {one.number: one.variant for one in some}
    try:
        for place in (folder, keys):
            place.parent.mkdir(parents=True, exist_ok=True)
        with (
            TemporaryDirectory(prefix=".pack-", dir=folder.parent) as out,
            TemporaryDirectory(prefix=".keys-", dir=keys.parent) as hidden,
        ):
            for student in students:
                tell(student)
                mine = Path(out) / "pack" / student
                mine.mkdir(parents=True)
                for sheet in key.titles:
                    text = script(key, sheet, student, variants)
                    (mine / f"{sheet}.py").write_text(text, encoding="utf-8")
                    book = notebook(key, sheet, student, variants)
                    (mine / f"{sheet}.ipynb").write_text(book, encoding="utf-8")
                (mine / EXAMPLES).write_text(examples(key, student), encoding="utf-8")
            inner = Path(hidden) / "keys"
            inner.mkdir(mode=0o700)  # others on this machine do not read it
            write_keys(key, inner)
            for made, place in ((Path(out) / "pack", folder), (inner, keys)):
                if place.exists():
                    place.rmdir()
                made.replace(place)
    except OSError as error:
        raise BadFile(f"cannot write the pack: {error.strerror or error}") from error
    return key
