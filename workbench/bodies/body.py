"""What every body is: named blocks in, points out."""

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

import casadi as cs
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points, Values
from workbench.bodies.landmarks import Landmarks
from workbench.errors import BadBlock, NotSupported, UnknownName

Blocks = tuple[Block, Block, Block]
Given = ArrayLike | None  # an argument in numbers; None: as in the template
T = TypeVar("T")


class Body(Protocol):
    """A surface of N vertices that a pose of K joints, B betas and a translation move.

    Written in `blocks()`, problems take the points of any body; `vertices` and `joints` are the
    same in numbers, for batches.
    """

    @property
    def name(self) -> str:
        """The name of the body."""

    @property
    def card(self) -> Mapping[str, Any]:
        """Where its numbers come from."""

    @property
    def template(self) -> Array:
        """The vertices of the mean person at rest, (N, 3) m."""

    @property
    def faces(self) -> Index:
        """The corners of each triangle, (F, 3)."""

    @property
    def landmarks(self) -> Mapping[str, Landmarks]:
        """Named sets of landmarks."""

    @property
    def extras(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of its file that nothing computes with, by name."""

    @property
    def n_vertices(self) -> int:
        """N, the number of vertices of the surface."""

    @property
    def n_joints(self) -> int:
        """K, the number of joints, the root included."""

    @property
    def n_betas(self) -> int:
        """B, the number of shape coefficients."""

    @property
    def parents(self) -> tuple[int, ...]:
        """parents[0] == -1, and parents[k] < k."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, (K,)."""

    @property
    def bind_pose(self) -> Array:
        """The pose (K, 3) rad that leaves the template as it is."""

    @property
    def vertex_weights(self) -> Array:
        """How much each vertex follows each joint, (N, K); rows sum to one."""

    def blocks(self, prefix: str = "") -> Blocks:
        """`pose` (K, 3) rad, `betas` (B,), `trans` (3,) m: the same objects for the same prefix."""

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""

    def start(self, prefix: str = "") -> Values:
        """Values at which the body is its template.

        They are the bind pose, and betas and trans of zero, under names that begin with `prefix`.
        """

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: ArrayLike | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or some of it: a list of vertices, or a mask (N,)."""

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The posed joints, (3, K) m."""

    def landmark_points(
        self,
        name: str,
        pose: cs.MX,
        betas: cs.MX,
        trans: cs.MX,
        offsets: cs.MX | None = None,
    ) -> Points:
        """A named set of landmarks on the posed surface, (3, M) m.

        Those of a SkinnedBody may have offsets (3, M) m, which displace them at rest.
        """

    def vertices(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""

    def joints(self, pose: Given = None, betas: Given = None, trans: Given = None) -> Array:
        """The posed joints (..., K, 3) m."""

    def landmark(
        self,
        name: str,
        pose: Given = None,
        betas: Given = None,
        trans: Given = None,
        offsets: Given = None,
    ) -> Array:
        """A named set of landmarks (..., M, 3) m; `joints` are always there.

        Those of a SkinnedBody may have offsets (..., M, 3) m, which displace them at rest.
        """

    def landmark_names(self, name: str) -> tuple[str, ...]:
        """The names of the points of a landmark set."""


def blocks_of(body: Body, prefix: str, made: dict[str, Blocks]) -> Blocks:
    """The three blocks that a body is written in: those in `made`, or new ones kept there.

    Raises BadBlock for a prefix that is no text.
    """
    if not isinstance(prefix, str):
        raise BadBlock(f"the prefix of a body's blocks is a text, not a {type(prefix).__name__}")
    if prefix not in made:
        made[prefix] = (
            Block(prefix + "pose", (body.n_joints, 3), "rad", body.joint_names),
            Block(prefix + "betas", (body.n_betas,), "sd"),
            Block(prefix + "trans", (3,), "m", ("x", "y", "z")),
        )
    return made[prefix]


def offsets_of(
    sets: Mapping[str, Landmarks], name: str, prefix: str, made: dict[tuple[str, str], Block]
) -> Block:
    """The block of the offsets of a set of landmarks: the one in `made`, or a new one kept there.

    Raises UnknownName, NotSupported for joints, and BadBlock for a prefix that is no text.
    """
    if isinstance(name, str) and name == "joints":
        raise NotSupported(no_offsets("of joints"))
    names = landmark_set(sets, name).names
    if not isinstance(prefix, str):
        raise BadBlock(f"the prefix of a body's blocks is a text, not a {type(prefix).__name__}")
    if (prefix, name) not in made:
        made[prefix, name] = Block(prefix + "offsets", (len(names), 3), "m", names)
    return made[prefix, name]


def no_offsets(of_what: str) -> str:
    """Why there are no offsets of some points."""
    return (
        f"there are no offsets {of_what}: they displace vertices at rest, of which the landmarks "
        "of a SkinnedBody are means; take a landmark set of such a body, such as one with a single "
        "vertex for each point"
    )


def landmark_set(sets: Mapping[str, T], name: str) -> T:
    """One of a body's sets of landmarks. Raises UnknownName."""
    if not isinstance(name, str) or name not in sets:
        raise UnknownName("landmark set", str(name), ("joints", *sets))
    return sets[name]
