"""The bodies that come with the workbench, and those in files of your own."""

from importlib.resources import as_file, files
from os import PathLike
from pathlib import Path
from typing import Literal, get_args, overload

from workbench.bodies.files.embedded import read_embedded
from workbench.bodies.files.npz_files import read_npz
from workbench.bodies.files.pickled_arrays import read_pickled_arrays
from workbench.bodies.files.smpl_layout import body_from
from workbench.bodies.files.triangle_layout import is_triangle_body, triangle_body_from
from workbench.bodies.landmarks import Landmarks
from workbench.bodies.readonly import locked
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadBody, BadFile, listed
from workbench.homes import expanded

Name = Literal[  # in workbench/data/bodies, each read when it is asked for; neutral unless they say
    "default",
    "default-female",
    "default-male",
    "small",
    "full",
    "full-female",
    "full-male",
]
BODIES: tuple[str, ...] = get_args(Name)
NPZ = b"PK\x03\x04"
PICKLES = (b"\x80", b"(", b"}", b"]", b"c")  # protocol 2 and later; Python 2's own
OTHERS = (  # how other files begin that people try
    (b"\x93NUMPY", "a single array (.npy)"),
    (b"\x1f\x8b", "packed with gzip; unpack it first"),
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


@overload
def load_body(name_or_path: Name = "default") -> SkinnedBody: ...
@overload
def load_body(name_or_path: str | Path) -> SkinnedBody | TriangleBody: ...
def load_body(name_or_path: str | Path = "default") -> SkinnedBody | TriangleBody:
    """An embedded body by its name in `BODIES`, or the body in an .npz or .pkl file of yours.

    Files are in the layout of SMPL (SMPL, SMPL-H, SMPL-X, MANO and the like), or were written by
    `save_body`; what a file is, its first bytes tell, not its name. One whose `bs_style` is
    `triangles` holds a TriangleBody, all others a SkinnedBody. Nothing in it is ever run,
    changed or copied. A path called like a body is meant by `Path("small")`.

    Arrays that a body does not compute with, as the hands' principal components of MANO or the
    face landmarks of SMPL-X, are the body's `extras`. Entries that cannot be kept, as objects of
    Python, are named with the reason in the body's card under `left_out`.

    Raises BadFile (UnsafePickle) if there is no such body or file, or it is not a body, and
    BadBody if its arrays do not fit together.
    """
    if isinstance(name_or_path, str) and name_or_path in BODIES:
        with as_file(files("workbench") / "data" / "bodies" / f"{name_or_path}.npz") as packed:
            return embedded_body(packed)
    if not isinstance(name_or_path, (str, PathLike)):
        raise BadFile(
            f"a body is loaded by name or from a path, not by a {type(name_or_path).__name__}; "
            f"the bodies are {listed(BODIES)}"
        )
    path = expanded(name_or_path)
    if path.is_dir():
        raise BadFile(f"{path} is a folder; give the file in it")
    if not path.exists():
        raise BadFile(
            f"no body is called {str(name_or_path)!r}, and there is no such file; "
            f"the bodies are {listed(BODIES)}, or give the path of an .npz or .pkl file"
        )
    if not path.is_file():  # opening a pipe waits for somebody to write to it, perhaps for ever
        raise BadFile(f"{path} is a pipe or a device; give a file")
    try:
        return _from_file(path)
    except OSError as error:
        raise BadFile(f"cannot read {path}: {error.strerror}") from error


def load_skinned(name_or_path: str | Path = "default") -> SkinnedBody:
    """The same for whoever needs a chain of bones and weights per vertex.

    Raises what `load_body` raises, and BadBody for the file of a TriangleBody.
    """
    body = load_body(name_or_path)
    if isinstance(body, SkinnedBody):
        return body
    raise BadBody(
        f"a SkinnedBody is needed here, but {str(name_or_path)!r} holds body {body.name!r}, a "
        f"TriangleBody; the bodies are {listed(BODIES)}, or give a file of another kind"
    )


def embedded_body(path: Path) -> SkinnedBody:
    """A body in the form in which those of the workbench are packed. Raises BadFile."""
    arrays = read_embedded(path)
    return SkinnedBody(
        template=locked(arrays["template"]),
        shapedirs=locked(arrays["shapedirs"]),
        posedirs=locked(arrays["posedirs"]),
        J_regressor=arrays["J_regressor"],
        weights=locked(arrays["weights"]),
        parents=arrays["parents"],
        faces=arrays["faces"],
        joint_names=arrays["joint_names"],
        mirror=arrays["mirror"],
        landmarks={name: Landmarks(*both) for name, both in arrays["landmarks"].items()},
        name=path.stem,
        card=arrays["card"],
    )


def _from_file(path: Path) -> SkinnedBody | TriangleBody:
    with path.open("rb") as file:
        start = file.read(32)
    if start.startswith(NPZ):
        raw = read_npz(path)
    else:
        for magic, what in OTHERS:
            if start.lstrip().startswith(magic):
                raise BadFile(f"{path} is {what}; a body is an .npz or .pkl file in SMPL's layout")
        if not start.startswith(PICKLES):
            what = "empty" if not start else "neither"
            raise BadFile(f"{path} is {what}; a body is an .npz or .pkl file in SMPL's layout")
        raw = read_pickled_arrays(path)
    make = triangle_body_from if is_triangle_body(raw) else body_from
    return make(raw, path.stem, str(path))
