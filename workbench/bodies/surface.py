"""The SMPL function in symbols: from pose, betas and trans to points on a skinned body.

    M(theta, beta) = W(T + B_S(beta) + B_P(theta), J(beta), theta)        (SMPL eq. 6)

The posed surface, the posed joints and landmarks are three sources of points over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.blocks import Block, Tree
from workbench.bodies.kinematics import binding_motions, pose_features
from workbench.errors import BadBody
from workbench.geometry.rotation import rodrigues

if TYPE_CHECKING:
    from workbench.bodies.skinned import Landmarks, SkinnedBody

Vertices = Sequence[int] | slice
ALL = slice(None)


def template(body: SkinnedBody, vertices: Vertices = ALL) -> cs.MX:
    """(3, N) m."""
    if "template" in body.free:
        return body.free["template"].symbol[:, vertices]
    return cs.MX(cs.DM(body.template[vertices].T))


def directions(body: SkinnedBody, name: str, vertices: Vertices = ALL) -> cs.MX:
    """`shapedirs` or `posedirs`, (3 N, .) over the points' columns; sparse unless free."""
    array = getattr(body, name)
    if name in body.free:
        rows = np.arange(3 * body.n_vertices).reshape(-1, 3)[vertices].ravel()
        return body.free[name].symbol.T[rows.tolist(), :]
    some = array[vertices]
    return cs.MX(cs.sparsify(cs.DM(some.reshape(3 * len(some), array.shape[2]))))


def weights(body: SkinnedBody, vertices: Vertices = ALL) -> cs.MX:
    """(N, K), sparse unless free."""
    if "weights" in body.free:
        return body.free["weights"].symbol.T[vertices, :]
    return cs.MX(cs.sparsify(cs.DM(body.weights[vertices])))


def shaped(body: SkinnedBody, betas: cs.MX, vertices: Vertices = ALL) -> cs.MX:
    """T + B_S(beta), (3, N) m: one person at rest, before the pose blend shapes."""
    mean = template(body, vertices)
    return mean + cs.reshape(directions(body, "shapedirs", vertices) @ betas, mean.shape)


def rest_joints(body: SkinnedBody, betas: cs.MX) -> cs.MX:
    """J(beta) = J_regressor (T + B_S(beta)), (3, K) m (SMPL eq. 10)."""
    if "J_regressor" in body.free:
        return shaped(body, betas) @ body.free["J_regressor"].symbol
    if body.free.keys() & {"template", "shapedirs"}:
        return shaped(body, betas) @ cs.MX(cs.DM(body.J_regressor.T.tocsc()))
    # numbers only: regress the mean and the directions once, N drops out
    mean = body.J_regressor @ body.template  # (K, 3)
    moves = body.J_regressor @ body.shapedirs.reshape(body.n_vertices, -1)  # (K, 3 B)
    moved = cs.DM(moves.reshape(3 * body.n_joints, body.n_betas)) @ betas
    return cs.DM(mean.T) + cs.reshape(moved, 3, body.n_joints)


def motions(body: SkinnedBody, pose: cs.MX, betas: cs.MX) -> tuple[cs.MX, list[cs.MX], cs.MX]:
    """Pose features (9 (K - 1), 1), binding motions (3, 4) per joint, posed joints (3, K) m."""
    if pose.shape != (3, body.n_joints) or betas.shape != (body.n_betas, 1):
        raise BadBody(
            f"body {body.name!r} takes symbols of shape (3, {body.n_joints}) for pose and "
            f"({body.n_betas}, 1) for betas, not {pose.shape} and {betas.shape}; "
            "take the symbols of body.blocks()"
        )
    R = rodrigues(pose)
    R_bind = rodrigues(cs.DM(body.bind_pose.T))
    G, joints = binding_motions(R, R_bind, rest_joints(body, betas), body.parents)
    return pose_features(R, R_bind), G, joints


def posed(
    body: SkinnedBody, pose: cs.MX, betas: cs.MX, trans: cs.MX, vertices: Vertices = ALL
) -> cs.MX:
    """M(theta, beta) + trans, (3, N) m."""
    features, G, _ = motions(body, pose, betas)
    rest = shaped(body, betas, vertices)
    rest += cs.reshape(directions(body, "posedirs", vertices) @ features, rest.shape)
    skinned = body.skinning(rest, G, weights(body, vertices))
    return skinned + cs.repmat(trans, 1, rest.shape[1])


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Vertices of the posed surface, all or some."""

    body: SkinnedBody
    arguments: tuple[cs.MX, cs.MX, cs.MX]  # pose (3, K), betas (B, 1), trans (3, 1)
    vertices: Vertices

    @cached_property
    def expression(self) -> cs.MX:
        """(3, N) m."""
        return posed(self.body, *self.arguments, self.vertices)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the body's free arrays."""
        return _blocks(self.body, self.expression)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return _tree(self.body, self.arguments[0])

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Vertices have no names but their numbers."""
        if isinstance(self.vertices, slice):
            return None
        return tuple(f"vertex {i}" for i in self.vertices)


@dataclass(frozen=True, eq=False)
class JointPoints:
    """The posed joints: J'_k is where G_k puts joint k, not the regressor on posed vertices."""

    body: SkinnedBody
    arguments: tuple[cs.MX, cs.MX, cs.MX]

    @cached_property
    def expression(self) -> cs.MX:
        """(3, K) m."""
        pose, betas, trans = self.arguments
        joints = motions(self.body, pose, betas)[2]
        return joints + cs.repmat(trans, 1, self.body.n_joints)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the body's free arrays."""
        return _blocks(self.body, self.expression)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return _tree(self.body, self.arguments[0])

    @property
    def labels(self) -> tuple[str, ...]:
        """The joints' names."""
        return self.body.joint_names


@dataclass(frozen=True, eq=False)
class LandmarkPoints:
    """Weighted means of posed vertices; only the vertices that carry weight are posed."""

    body: SkinnedBody
    landmarks: Landmarks
    arguments: tuple[cs.MX, cs.MX, cs.MX]

    @cached_property
    def expression(self) -> cs.MX:
        """(3, M) m."""
        regressor = self.landmarks.regressor.tocsc()
        used = np.flatnonzero(np.diff(regressor.indptr))
        surface = posed(self.body, *self.arguments, used.tolist())
        return surface @ cs.MX(cs.DM(regressor[:, used].T.tocsc()))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the body's free arrays."""
        return _blocks(self.body, self.expression)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return _tree(self.body, self.arguments[0])

    @property
    def labels(self) -> tuple[str, ...]:
        """The landmarks' names."""
        return self.landmarks.names


def _blocks(body: SkinnedBody, expression: cs.MX) -> tuple[Block, ...]:
    """The block behind each symbol, the body's own (with unit and labels) where it is one."""
    known = {b.symbol.__hash__(): b for b in body.known_blocks}
    return tuple(known.get(s.__hash__()) or Block.of(s) for s in cs.symvar(expression))


def _tree(body: SkinnedBody, pose: cs.MX) -> Tree | None:
    """The tree behind a pose that is a plain block; a pose made of pieces has no single name."""
    return Tree(pose.name(), body.joint_names, body.parents) if pose.is_symbolic() else None
