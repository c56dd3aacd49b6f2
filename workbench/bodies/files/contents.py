"""What an .npz or .pkl file holds by key, whatever its name; what it is, its first bytes tell."""

from pathlib import Path

from workbench.bodies.files.entries import Contents
from workbench.bodies.files.npz_files import read_npz
from workbench.bodies.files.pickled_arrays import read_pickled_arrays
from workbench.errors import BadFile

NPZ = b"PK\x03\x04"
PICKLES = (b"\x80", b"(", b"}", b"]", b"c")  # protocol 2 and later; Python 2's own
OTHERS = (  # how other files begin that people try
    (b"\x93NUMPY", "a single array (.npy)"),
    (b"\x1f\x8b", "compressed with gzip; decompress it first"),
    (b"Rar!", "a rar archive; unpack it first"),
    (b"7z\xbc\xaf", "a 7z archive; unpack it first"),
    (b"\x89HDF", "an HDF5 file"),
    (b"glTF", "a glTF mesh, which read_mesh reads"),
    (b"ply", "a PLY mesh, which read_mesh reads"),
    (b"OFF", "an OFF mesh, which read_mesh reads"),
    (b"solid", "an STL mesh, which read_mesh reads"),
    (b"version https://git-lfs", "a pointer of git-lfs, not the file itself; run `git lfs pull`"),
    (b"<", "a web page, perhaps the one that asked you to log in"),
)


def contents_of(path: Path) -> Contents:
    """The entries of the file of a body: arrays, csr_arrays, plain values, and what stayed unread.

    Nothing in a file is ever run, changed or copied. Raises BadFile (UnsafePickle) for a file of
    another kind, and for what cannot be read.
    """
    if path.is_dir():
        raise BadFile(f"{path} is a folder; give the file in it")
    if not path.exists():
        raise BadFile(f"there is no file {path}")
    if not path.is_file():  # opening a pipe waits until another process writes to it
        raise BadFile(f"{path} is a pipe or a device; give a file")
    try:
        return _entries(path)
    except OSError as error:
        raise BadFile(f"cannot read {path}: {error.strerror}") from error


def is_npz(path: Path) -> bool:
    """Whether a file begins as an .npz does; the others that are read are pickles."""
    with path.open("rb") as file:
        return file.read(len(NPZ)) == NPZ


def _entries(path: Path) -> Contents:
    with path.open("rb") as file:
        start = file.read(32)
    if start.startswith(NPZ):
        return read_npz(path)
    for magic, what in OTHERS:
        if start.lstrip().startswith(magic):
            raise BadFile(f"{path} is {what}; a body is an .npz or .pkl file in SMPL's layout")
    if not start.startswith(PICKLES):
        what = "is empty" if not start else "is neither an .npz nor a .pkl file"
        raise BadFile(f"{path} {what}; a body is one of these, in SMPL's layout")
    return read_pickled_arrays(path)
