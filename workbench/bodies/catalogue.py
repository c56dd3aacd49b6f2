"""The bodies that come with the workbench, and those in files of your own."""

from collections.abc import Callable
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Literal, get_args, overload

from workbench.bodies.files.embedded import (
    embedded,
    embedded_hand,
    embedded_triangles,
    embedded_with_hands,
)
from workbench.bodies.files.layouts import body_from, is_triangle_body, triangle_body_from
from workbench.bodies.files.reading import contents_of
from workbench.bodies.hands import mirrored
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.environment import expanded
from workbench.errors import BadBody, BadFile, listed

Embedded = Literal[  # of these, type checkers know that they are skinned
    "default",
    "default-female",
    "default-male",
    "small",
    "full",
    "full-female",
    "full-male",
]
WithHands = Literal["full-hands", "full-hands-female", "full-hands-male"]  # skinned as well
Hands = Literal["hand", "hand-left"]  # and these
EmbeddedTriangles = Literal[
    "small-scape", "small-blend-scape", "default-scape", "default-blend-scape"
]


def embedded_left_hand() -> SkinnedBody:
    """The embedded hand in a mirror, which has no file of its own."""
    return mirrored(embedded_hand(), "hand-left")


BODIES: dict[str, Callable[[], SkinnedBody | TriangleBody]] = {
    **{name: partial(embedded, name) for name in get_args(Embedded)},
    **{name: partial(embedded_with_hands, name) for name in get_args(WithHands)},
    "hand": embedded_hand,
    "hand-left": embedded_left_hand,
    **{name: partial(embedded_triangles, name) for name in get_args(EmbeddedTriangles)},
}  # a body of your own is a function without arguments that returns it, and a line here


@overload
def load_body(name_or_path: Embedded | WithHands | Hands = "default") -> SkinnedBody: ...
@overload
def load_body(name_or_path: EmbeddedTriangles) -> TriangleBody: ...
@overload
def load_body(name_or_path: str | Path) -> SkinnedBody | TriangleBody: ...
def load_body(name_or_path: str | Path = "default") -> SkinnedBody | TriangleBody:
    """A body of the catalogue by its name in `BODIES`, or the body in an .npz or .pkl file.

    Files are in the layout of SMPL (SMPL, SMPL-H, SMPL-X, MANO, FLAME, STAR and the like), or were
    written by `save_body`; `check_body_file` says what is wrong with one. The first bytes of a file
    tell what it is; its name does not. A file whose `bs_style` is `triangles` holds a TriangleBody,
    all others hold a SkinnedBody. Nothing in a file is ever run, changed or copied. `Path("small")`
    means a file that is called like a body.

    Arrays that a body does not compute with, such as the principal components of MANO's hands or
    the face landmarks of SMPL-X, are the body's `extras`. Entries that cannot be kept, such as
    Python objects, are named with the reason in the body's card under `left_out`.

    Raises BadFile (UnsafePickle) if there is no such body or file, or it is not a body, and
    BadBody if its arrays do not fit together.
    """
    if isinstance(name_or_path, str) and name_or_path in BODIES:
        return BODIES[name_or_path]()
    if not isinstance(name_or_path, (str, PathLike)):
        raise BadFile(
            f"a body is loaded by name or from a path, not by a {type(name_or_path).__name__}; "
            f"the bodies are {listed(BODIES)}"
        )
    path = expanded(name_or_path)
    if not path.exists():
        raise BadFile(
            f"no body is called {str(name_or_path)!r}, and there is no such file; "
            f"the bodies are {listed(BODIES)}, or give the path of an .npz or .pkl file"
        )
    raw = contents_of(path)
    make = triangle_body_from if is_triangle_body(raw) else body_from
    return make(raw, path.stem, str(path))


def load_skinned(name_or_path: str | Path = "default") -> SkinnedBody:
    """A body with a chain of bones and weights for each vertex; otherwise as `load_body`.

    Raises what `load_body` raises, and BadBody for a TriangleBody.
    """
    body = load_body(name_or_path)
    if isinstance(body, SkinnedBody):
        return body
    skinned = (*get_args(Embedded), *get_args(WithHands), *get_args(Hands))
    raise BadBody(
        f"a SkinnedBody is needed here, but body {body.name!r} is a TriangleBody; the skinned "
        f"bodies are {listed(skinned)}, or give a file of another kind"
    )
