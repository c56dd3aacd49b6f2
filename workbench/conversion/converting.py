"""The motion of one body as that of another: other joints, other shapes, another mesh."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.bodies.capsule_fitting import BONES
from workbench.bodies.spaces import shape_space
from workbench.conversion.correspondence import (
    Correspondence,
    correspond,
    counted,
    rest_pose_prior,
    sampled_vertices,
)
from workbench.errors import BadArgument
from workbench.fitting.doubts import of_person
from workbench.fitting.known_points import from_correspondences
from workbench.fitting.tracking import PointTracker, Progress, quiet
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.motions import Motion

SAMPLED_VERTICES = 1200  # vertices to which a pose is fitted
SIGMA = 0.005  # m, of a vertex beside its place on the other body
POSE_SIGMA = 1.0  # rad, about the rest pose: it holds only what no vertex shows
DOUBTED_ERROR = 0.05  # m, from what a motion was made of: a farther one is doubted
FRAMES_AT_ONCE = 25  # frames whose surfaces are in memory at once


def vertex_parts(body: Body) -> tuple[str, ...]:
    """The name (N,) of each vertex's part: that of the joint which moves it most.

    A joint without a part, such as one of a finger, belongs to that of its parent; what lies below
    a wrist is fingers. Bodies without SMPL's joints, such as a hand, have a part for each joint.
    """
    names: list[str] = []
    for k, joint in enumerate(body.joint_names):
        parent = body.joint_names[body.parents[k]] if k else ""
        below = names[body.parents[k]] if k else ""
        if joint in BONES:
            names.append(BONES[joint])
        elif parent in ("left_wrist", "right_wrist"):
            names.append(parent.replace("wrist", "fingers"))
        else:
            names.append(below if below in BONES.values() else joint)
    return tuple(names[k] for k in body.vertex_weights.argmax(axis=1))


@dataclass(frozen=True, eq=False)
class Converted:
    """A motion of another body, and how far its surface is from that of the first one.

    Attributes:
        motion: the motion of the target.
        correspondence: the places of the target's vertices on the source.
        errors: (T, N) m from each vertex of the target to its place on the source; NaN for
            vertices that have none.
        parts: (N,) the part of each vertex.
    """

    motion: Motion
    correspondence: Correspondence
    errors: Array
    parts: tuple[str, ...]

    @property
    def by_part(self) -> dict[str, tuple[float, float]]:
        """The mean and the largest error of each part, in m, the worst first."""
        names = np.array(self.parts)
        errors = {}
        for name in dict.fromkeys(self.parts):
            of_part = self.errors[:, names == name]
            if np.isfinite(of_part).any():
                errors[name] = float(np.nanmean(of_part)), float(np.nanmax(of_part))
        return dict(sorted(errors.items(), key=lambda item: -item[1][0]))

    def mean(self) -> float:
        """The mean error in m."""
        return float(np.nanmean(self.errors))


def convert(
    motion: Motion,
    source: Body,
    target: Body,
    *,
    correspondence: Correspondence | None = None,
    progress: Progress = quiet,
) -> Converted:
    """The motion of a source as that of a target whose surface is closest to it in every frame.

    The same angles mean other poses for a body of other joints and proportions, so the target is
    fitted to the places of its vertices on the source (`correspond`): its betas, shared by all
    frames, from some frames that differ, and then pose and trans frame by frame. Each frame begins
    where the one before ended, turned on as the source's joints of the same names were. What the
    source cannot show, such as fingers that it does not have, stays near the rest pose. Where both
    bodies have a face and the motion an expression, each frame gets an expression with its pose.

    `correspondence` is that of another motion of the same two bodies. `progress` is called with
    what is done, and with how many of how many frames. Raises BadArgument for a correspondence of
    other bodies, and what `correspond` and `Motion.named` raise.
    """
    played = motion.named(source)
    if correspondence is None:
        correspondence = correspond(source, target)
    if correspondence.places.shape != (target.n_vertices, source.n_vertices):
        raise BadArgument(
            f"this correspondence takes {correspondence.places.shape[1]} vertices to "
            f"{correspondence.places.shape[0]}, but bodies {source.name!r} and {target.name!r} "
            f"have {source.n_vertices} and {target.n_vertices}; find theirs with correspond"
        )
    space = shape_space(target)
    talks = played.betas_on(source).ndim == 2 and len(space.expression) > 0
    own = space.expression if talks else range(0)
    tracker, person = _tracker(played, source, target, correspondence, own)
    shape = tracker.shape(person, progress)
    blocks = tracker.poses(shape, progress)
    pose, betas, trans = (blocks[block.name] for block in target.blocks())
    new = Motion(
        pose,
        trans,
        motion.fps,
        tuple(target.joint_names),
        shape[: space.shape.stop] if talks else shape,
        betas[:, own.start : own.stop] if talks else None,
        origin=f"converted from body {source.name!r}: {motion.origin}".removesuffix(": "),
        notes=played.notes,
    )
    errors = conversion_errors(new, target, played, source, correspondence)
    return Converted(new, correspondence, errors, vertex_parts(target))


def conversion_errors(
    new: Motion, target: Body, motion: Motion, source: Body, correspondence: Correspondence
) -> Array:
    """How far each vertex of the target is from its place on the source in each frame, (T, N) m."""
    errors = np.empty((len(motion), target.n_vertices))
    for first in range(0, len(motion), FRAMES_AT_ONCE):
        some = slice(first, first + FRAMES_AT_ONCE)
        places = correspondence.of(motion[some].vertices(source))
        errors[some] = np.linalg.norm(new[some].vertices(target) - places, axis=2)
    errors[:, ~correspondence.matched] = np.nan
    return errors


def skeleton_errors(new: Motion, target: Body, skeleton: Motion) -> Array | None:
    """How far joints of the target are from those of the same names of the skeleton that a motion
    brought, in each frame, (T, J) m; None for a motion without bones of its own.
    """
    if skeleton.bones is None:
        return None
    shared = [name for name in target.joint_names if name in skeleton.joint_names]
    ours = [target.joint_names.index(name) for name in shared]
    theirs = [skeleton.joint_names.index(name) for name in shared]
    off = new.joints(target)[:, ours] - skeleton.joints()[:, theirs]
    return np.asarray(np.linalg.norm(off, axis=2))


def doubts_of(new: Motion, target: Body, errors: Array, of: str) -> tuple[str, ...]:
    """What speaks against the motion of a target, in sentences, as `fitting.doubts` has them.

    It is (T, L) m from what it was made of, which `of` names: `the points`.
    """
    middle = float(np.nanmedian(errors)) if np.isfinite(errors).any() else np.inf
    far = (
        f"the body is {100 * middle:.0f} cm from {of} in the median; check which are which, their "
        "unit, the axis that is up, and the rest pose"
    )
    return (*([far] if middle > DOUBTED_ERROR else []), *of_person(target, new.betas_on(target)))


def _tracker(
    played: Motion, source: Body, target: Body, correspondence: Correspondence, own: range
) -> tuple[PointTracker, Array]:
    """The frames of the source as observed places of the target, and the shape to begin with."""
    some = sampled_vertices(target, SAMPLED_VERTICES)
    some = some[correspondence.matched[some]]
    observed = np.concatenate(
        [
            correspondence.of(played[t : t + FRAMES_AT_ONCE].vertices(source))[:, some]
            for t in range(0, len(played), FRAMES_AT_ONCE)
        ]
    )
    pose, betas, trans = (block.symbol for block in target.blocks())

    def starts(t: int, before: Values | None) -> list[Values]:
        if before is None or t == 0:
            return [
                from_correspondences(
                    target, correspondence.of(played[t : t + 1].vertices(source))[0]
                )
            ]
        return [turned_on(target, before, played, t)]

    tracker = PointTracker(
        target,
        target.points(pose, betas, trans, vertices=some),
        observed,
        counted(target, some),
        SIGMA,
        rest_pose_prior(target, POSE_SIGMA),
        starts,
        own=own,
    )
    whole = correspondence.of(source.vertices(source.bind_pose, played.betas))
    return tracker, from_correspondences(target, whole)[target.blocks()[1].name]


def turned_on(target: Body, before: Values, played: Motion, t: int) -> Values:
    """Pose and trans of a frame: those before, turned as the source's joints from t - 1 to t."""
    pose, _, trans = (block.name for block in target.blocks())
    shared = [k for k, name in enumerate(target.joint_names) if name in played.joint_names]
    ours: Index = np.array([played.joint_names.index(target.joint_names[k]) for k in shared])
    last, now = (matrix_from_vector(played.pose[s, ours]) for s in (t - 1, t))
    moved = before[pose].copy()
    own = matrix_from_vector(moved[shared])
    moved[shared] = vector_from_matrix(now @ last.swapaxes(1, 2) @ own)
    step = played.trans[t] - played.trans[t - 1]
    return {**before, pose: moved, trans: before[trans] + step}
