"""A body's .npz file: its arrays, never the Python objects that one can hide."""

from pathlib import Path

from workbench.bodies.files.entries import Contents, Unread
from workbench.errors import BadFile, cut
from workbench.reading.arrays import LONGEST_REASON, open_arrays

OBJECTS = (
    "an array of Python objects, which are not read: unpacking them runs code of the file's "
    "choosing. Where you trust the file, load it there with allow_pickle=True and save "
    "this entry again as an array of numbers"
)
NO_ARRAY = "a file of another kind than .npy, which is not read"


def read_npz(path: Path) -> Contents:
    """The arrays of an .npz file by key; arrays of objects and other files in it are `Unread`.

    Raises BadFile if it is cut off or damaged, holds no arrays or two of one name, or if they
    take more memory than those of a file of its size should (`workbench.reading.arrays`).
    """
    try:
        with open_arrays(path) as archive:
            raw: Contents = {name: Unread(NO_ARRAY) for name in archive.others}
            for name, header in archive.headers.items():
                raw[name] = Unread(OBJECTS) if header.dtype.hasobject else archive.array(name)
            return raw
    except BadFile as error:
        raise BadFile(
            f"{path} cannot be read: {cut(error, LONGEST_REASON)}. If it is cut off or damaged, "
            "fetch or export it again"
        ) from error
