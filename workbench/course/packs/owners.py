"""Whose a file or a folder is, by its name, and by the name of the pack that it carries."""

from pathlib import Path

from workbench.course.packs.handing_out import pack_name, plain_name
from workbench.course.packs.keys import ClassKey
from workbench.errors import BadFile


def owner(path: Path, key: ClassKey) -> str | None:
    """The student whose name the outermost folder, or the file, has or begins with.

    Names are compared without case, spaces and punctuation: `Ben O'Neil_20413_file_` is a folder of
    `ben-o-neil`. After the name has to come its end, or a character that is neither a letter nor a
    digit. The name as the pack wrote it counts first, then the longest. Raises BadFile if two
    students have the same name but for punctuation.
    """
    outer = path.parts[0]
    named = outer if len(path.parts) > 1 else Path(outer).stem
    for student in key.students:
        if named.lower() == student.lower():
            return student
    begins = f"{plain_name(named)}-"
    found = {
        student: len(plain)
        for student, name in key.students.items()
        for plain in (plain_name(student), plain_name(name))
        if plain and begins.startswith(f"{plain}-")
    }
    if not found:
        return None
    longest = [student for student, length in found.items() if length == max(found.values())]
    if len(longest) > 1:
        both = " and ".join(key.students[student] for student in longest)
        raise BadFile(
            f"{outer} may belong to {both}; name it as the pack named their folders: "
            f"{' or '.join(longest)}"
        )
    return longest[0]


def pack_owner(says: object, key: ClassKey) -> str | None:
    """The student for whom a file was made that says PACK = `says`."""
    return next((one for one in key.students if pack_name(key, one) == says), None)
