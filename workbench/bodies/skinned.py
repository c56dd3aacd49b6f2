"""A body whose surface rides on its joints: SMPL and its relatives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.blocks import Block, Points, Values
from workbench.bodies import evaluation, sources, surface
from workbench.bodies.motion import Kinematics
from workbench.bodies.numeric import Chunk, chunks_of
from workbench.bodies.skinning import Skinning, linear_blend
from workbench.bodies.validation import check
from workbench.errors import UnknownName

Array = NDArray[np.float64]
FREEABLE = {"template": "m", "shapedirs": "m", "posedirs": "m", "J_regressor": "1", "weights": "1"}


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Named points, each a weighted mean of vertices: `regressor` (M, N), rows sum to one."""

    names: tuple[str, ...]
    regressor: csr_array


@dataclass(frozen=True, eq=False)
class SkinnedBody:
    """N vertices on K joints with B shape directions, in the arrays of SMPL's files.

    Metres, y up, facing +z. The arrays are numbers; those in `free` are symbols in every
    expression as well, so that training a body is a fit with other names free.
    Raises BadBody if the arrays do not fit together.
    """

    template: Array  # (N, 3) m, the mean rest surface
    shapedirs: Array  # (N, 3, B) m per unit of betas
    posedirs: Array  # (N, 3, 9 (K - 1)) m per unit of pose feature
    J_regressor: csr_array  # (K, N), rows sum to one: joints from rest vertices
    weights: Array  # (N, K), rows sum to one
    parents: tuple[int, ...]  # parents[0] == -1, and parents[k] < k
    faces: NDArray[np.int64]  # (F, 3)
    joint_names: tuple[str, ...]
    mirror: NDArray[np.int64] | None = None  # (N,): the vertex on the other side of each
    landmarks: Mapping[str, Landmarks] = field(default_factory=dict)
    skinning: Skinning = linear_blend
    name: str = "body"
    card: Mapping[str, Any] = field(default_factory=dict)  # where the numbers come from
    bound_in: Array | None = None  # (K, 3) rad, the pose that the template is drawn in; None: 0
    free: Mapping[str, Block] = field(default_factory=dict)
    _made: dict[str, tuple[Block, Block, Block]] = field(
        default_factory=dict, init=False, repr=False
    )

    def __post_init__(self) -> None:
        check(self)

    @property
    def n_vertices(self) -> int:
        """N."""
        return len(self.template)

    @property
    def n_joints(self) -> int:
        """K, the root included."""
        return len(self.parents)

    @property
    def n_betas(self) -> int:
        """B."""
        return int(self.shapedirs.shape[2])

    @property
    def bind_pose(self) -> Array:
        """The pose (K, 3) rad that leaves the template as it is."""
        return np.zeros((self.n_joints, 3)) if self.bound_in is None else self.bound_in

    # What a problem is written with.

    def blocks(self, prefix: str = "") -> tuple[Block, Block, Block]:
        """`pose` (K, 3) rad, `betas` (B,), `trans` (3,) m: the same objects for the same prefix."""
        if prefix not in self._made:
            self._made[prefix] = (
                Block(prefix + "pose", (self.n_joints, 3), "rad", self.joint_names),
                Block(prefix + "betas", (self.n_betas,), "sd"),
                Block(prefix + "trans", (3,), "m", ("x", "y", "z")),
            )
        return self._made[prefix]

    @property
    def known_blocks(self) -> tuple[Block, ...]:
        """Every block that this body has made so far."""
        return (*(b for blocks in self._made.values() for b in blocks), *self.free.values())

    def freed(self, *names: str, prefix: str = "") -> "SkinnedBody":
        """The same body, the named arrays being blocks of unknowns in every expression."""
        for name in names:
            if name not in FREEABLE:
                raise UnknownName("array to free", name, FREEABLE)
        made = {n: Block(prefix + n, self.array(n).shape, FREEABLE[n]) for n in names}
        return replace(self, free={**self.free, **made})

    def start(self, prefix: str = "") -> Values:
        """The template as values: bind pose, mean shape, at the origin; free arrays as they are."""
        pose, betas, trans = self.blocks(prefix)
        return {
            pose.name: self.bind_pose.copy(),
            betas.name: np.zeros(betas.shape),
            trans.name: np.zeros(trans.shape),
            **{block.name: self.array(name).copy() for name, block in self.free.items()},
        }

    def points(
        self, pose: cs.MX, betas: cs.MX, trans: cs.MX, *, vertices: Sequence[int] | None = None
    ) -> Points:
        """The posed surface, (3, N) m, or just some vertices of it."""
        chosen = surface.ALL if vertices is None else [int(v) for v in vertices]
        return Points.of(sources.SurfacePoints(self, (pose, betas, trans), chosen), "vertices")

    def joint_points(self, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """The posed joints, (3, K) m."""
        return Points.of(sources.JointPoints(self, (pose, betas, trans)), "joints")

    def landmark_points(self, name: str, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> Points:
        """A named set of landmarks on the posed surface, (3, M) m; `joints` are always there."""
        if name == "joints":
            return self.joint_points(pose, betas, trans)
        source = sources.LandmarkPoints(self, self._landmarks(name), (pose, betas, trans))
        return Points.of(source, name)

    # Numbers, for those who want no symbols. Any argument may have a batch in front.

    def vertices(
        self,
        pose: ArrayLike | None = None,
        betas: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """The posed surface (..., N, 3) m of poses (..., K, 3) or (..., 3 K) rad."""
        return evaluation.vertices(self, pose, betas, trans)

    def joints(
        self,
        pose: ArrayLike | None = None,
        betas: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """The posed joints (..., K, 3) m."""
        return evaluation.joints(self, pose, betas, trans)

    def landmark(
        self,
        name: str,
        pose: ArrayLike | None = None,
        betas: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """A named set of landmarks (..., M, 3) m; `joints` are always there."""
        if name == "joints":
            return self.joints(pose, betas, trans)
        regressor = self._landmarks(name).regressor
        v = self.vertices(pose, betas, trans)
        flat = np.moveaxis(v, -2, 0).reshape(self.n_vertices, -1)
        return np.moveaxis((regressor @ flat).reshape(-1, *v.shape[:-2], 3), 0, -2)

    def landmark_names(self, name: str) -> tuple[str, ...]:
        """The names of the points of a landmark set."""
        return self.joint_names if name == "joints" else self._landmarks(name).names

    def array(self, name: str) -> Array:
        """One of the arrays that can be freed, dense."""
        array = getattr(self, name)
        return array.toarray() if isinstance(array, csr_array) else array

    @cached_property
    def kinematics(self) -> Kinematics:
        """The joints' motions and their derivatives in numbers."""
        return Kinematics(self)

    @cached_property
    def chunks(self) -> list[Chunk]:
        """The arrays packed for arithmetic."""
        return chunks_of(self, surface.ALL)

    def _landmarks(self, name: str) -> Landmarks:
        if name not in self.landmarks:
            raise UnknownName("landmark set", name, ("joints", *self.landmarks))
        return self.landmarks[name]

    @cached_property
    def skinned_rest(self) -> cs.Function:
        """(pose, betas) -> the posed surface before translation, (3, N), for any skinning."""
        body = replace(self, free={})
        pose, betas = (block.symbol for block in body.blocks()[:2])
        expression = surface.posed(body, pose, betas, cs.MX(cs.DM.zeros(3)))
        return cs.Function("skinned_rest", [pose, betas], [expression])
