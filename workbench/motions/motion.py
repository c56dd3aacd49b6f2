"""A motion: the poses of a skeleton's joints and the place of its root, frame by frame."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from workbench.arrays import Array, Index, Mask
from workbench.blocks.checks import reals
from workbench.bodies.body import Body
from workbench.bodies.spaces import shape_space
from workbench.errors import BadArgument, some_of
from workbench.geometry.rotation import matrix_from_vector
from workbench.motions.bones import Bones


def between(values: Array, frames: Array) -> Array:
    """Values (T, ...) at fractional frames (S,), linear from frame to frame: (S, ...)."""
    before, after, share = _neighbours(len(values), frames)
    shares = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[before] * (1 - shares) + values[after] * shares)


def rotations_between(pose: Array, frames: Array) -> Array:
    """Rotation vectors (T, K, 3) rad at fractional frames (S,): (S, K, 3) rad.

    From a to b, R(s) = R_a exp(s log(R_a' R_b)), which turns at a constant speed about one axis by
    at most half a turn (slerp: Shoemake, Animating Rotation with Quaternion Curves, 1985). At whole
    frames the vectors are those that were given.
    """
    before, after, share = _neighbours(len(pose), frames)
    first, second = pose[before], pose[after]
    a, b = (Rotation.from_rotvec(v.reshape(-1, 3)) for v in (first, second))
    change = (a.inv() * b).as_rotvec().reshape(first.shape)
    turned = a * Rotation.from_rotvec((share[:, None, None] * change).reshape(-1, 3))
    vectors = turned.as_rotvec().reshape(first.shape)
    return np.asarray(np.where((share > 0)[:, None, None], vectors, first))


def _neighbours(T: int, frames: Array) -> tuple[Index, Index, Array]:
    """The frames before and after, (S,), and how far it is from the one to the other, 0 to 1."""
    before: Index = np.clip(np.floor(frames).astype(np.int64), 0, T - 1)
    return before, np.minimum(before + 1, T - 1), np.clip(frames - before, 0.0, 1.0)


ROUNDING = 1e-9  # frames, by which the last frame of another rate may lie beyond the last one


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of a pose of K joints, of one person.

    Metres and radians, y up. As in SMPL, the body turns about its root joint, which is at its rest
    place + trans. It keeps copies of what it is given. Raises BadArgument for arrays that
    do not fit together, and NotNumbers.

    Attributes:
        pose: (T, K, 3) rad, the rotation vector of each joint relative to its parent.
        trans: (T, 3) m.
        fps: frames a second.
        joint_names: (K,) different names.
        betas: (B,) the shape of the person; of no length if it is not known.
        expression: (T, E) coefficients of the face, if there are any. They move a body whose betas
            have an expression (`workbench.bodies.spaces`): SMPL-X's and FLAME's.
        bones: the skeleton of a motion that brought its own; None if a body has it.
        origin: where the motion comes from.
        notes: sentences on what was guessed, filled or left out.
        gender: of the person, as the file says it; empty if it is not known.
        dmpls: (T, D) coefficients of dynamic blend shapes, as AMASS has them, if there are any.
    """

    pose: Array
    trans: Array
    fps: float
    joint_names: tuple[str, ...]
    betas: Array = ()  # type: ignore[assignment]  # __post_init__ makes it an array
    expression: Array | None = None
    bones: Bones | None = None
    origin: str = ""
    notes: tuple[str, ...] = ()
    gender: str = ""
    dmpls: Array | None = None

    def __post_init__(self) -> None:
        names = tuple(map(str, self.joint_names))
        arrays: dict[str, Any] = {
            name: reals(name, getattr(self, name)).copy()
            for name in ("pose", "trans", "betas", "expression", "dmpls")
            if getattr(self, name) is not None
        }
        T, K = len(np.atleast_1d(arrays["pose"])), len(names)
        shapes = {"pose": (T, K, 3), "trans": (T, 3), "betas": ("B",), "expression": (T, "E")}
        shapes["dmpls"] = (T, "D")
        for name, array in arrays.items():
            shape = tuple(shapes[name])
            fits = array.ndim == len(shape) and all(
                isinstance(n, str) or n == m for n, m in zip(shape, array.shape, strict=True)
            )
            if not fits or (name == "pose" and not array.size):
                raise BadArgument(
                    f"{name} of a motion of {K} joints in {T} frames, one or more, has the shape "
                    f"({', '.join(map(str, shape))}), not {array.shape}"
                )
            if not np.isfinite(array).all():
                where = np.unravel_index(int(np.isfinite(array).argmin()), array.shape)
                raise BadArgument(
                    f"{name} is {array[where]} at {[int(i) for i in where]}; leave such frames out"
                )
        if not _above_zero(self.fps):
            raise BadArgument(f"fps is a number above 0, not {self.fps!r:.60}")
        if len({*names}) < len(names):
            repeated = [name for name in dict.fromkeys(names) if names.count(name) > 1]
            raise BadArgument(f"two joints are called {some_of(repeated)}; each needs its own name")
        if self.bones is not None and len(self.bones.parents) != len(names):
            raise BadArgument(
                f"the skeleton has {len(self.bones.parents)} joints, and {len(names)} have names"
            )
        notes = tuple(map(str, self.notes))
        self.__dict__.update(arrays, fps=float(self.fps), joint_names=names, notes=notes)

    def __len__(self) -> int:
        return len(self.pose)

    def __getitem__(self, frames: slice) -> "Motion":
        """Some frames: `motion[10:50]`. A step makes the rate smaller: `motion[::2]`.

        Raises BadArgument for a single number, for no frame, and for a step back.
        """
        if not isinstance(frames, slice):
            raise BadArgument(
                f"some frames of a motion are a slice, such as motion[10:50], not {frames!r:.60}"
            )
        first, end, step = frames.indices(len(self))
        if step < 1 or first >= end:
            raise BadArgument(f"{frames} takes no frame, or goes back, in {len(self)} frames")
        lines = {name: line[frames] for name, line in self._lines.items()}
        return replace(self, pose=self.pose[frames], fps=self.fps / step, **lines)  # type: ignore[arg-type]

    @property
    def seconds(self) -> float:
        """The time from the first frame to the last, in s."""
        return (len(self) - 1) / self.fps

    @property
    def _lines(self) -> dict[str, Array]:
        """What is neither a rotation nor the same in all frames."""
        lines = {"trans": self.trans, "expression": self.expression, "dmpls": self.dmpls}
        return {name: line for name, line in lines.items() if line is not None}

    def resampled(self, fps: float) -> "Motion":
        """The same motion at another rate, from the first frame to the last one or just before it.

        Joints turn along the shortest arc from frame to frame (slerp), and the root moves along a
        line. New frames at the time of an old one are equal to it. Raises BadArgument for a
        rate that is not above zero, or that makes more than ten million frames.
        """
        if not _above_zero(fps):
            raise BadArgument(f"fps is a number above 0, not {fps!r:.60}")
        count = self.seconds * fps + 1 + ROUNDING
        if count > 1e7:
            raise BadArgument(f"{self.seconds:g} s at {fps:g} frames a second are too many frames")
        times = np.arange(int(count)) * (self.fps / fps)
        frames: Array = np.where(abs(times - np.rint(times)) < ROUNDING, np.rint(times), times)
        pose = rotations_between(self.pose, frames)
        lines = {name: between(line, frames) for name, line in self._lines.items()}
        return replace(self, pose=pose, fps=float(fps), **lines)  # type: ignore[arg-type]

    def turned(self, turn: ArrayLike, root: ArrayLike | None = None) -> "Motion":
        """The motion in a world that a rotation matrix (3, 3) has turned about its origin.

        The root joint rests at `root` (3,) m. SMPL's trans is not the place of the root: with R the
        turn, J_0 the root at rest and t the trans, R (J_0 + t) = J_0 + t' for
        t' = R t + (R - I) J_0. Without `root`, a motion with bones takes the
        place at rest of their root, and any other motion zero.
        """
        R = np.asarray(turn, dtype=float)
        if root is None:
            root = np.zeros(3) if self.bones is None else self.bones.offsets[0]
        root_place = np.asarray(root, dtype=float)
        pose = self.pose.copy()
        pose[:, 0] = (Rotation.from_matrix(R) * Rotation.from_rotvec(pose[:, 0])).as_rotvec()
        return replace(self, pose=pose, trans=(self.trans + root_place) @ R.T - root_place)

    def named(self, body: Body) -> "Motion":
        """The motion with the joints of a body, in the body's order, without bones.

        Joints go by their names. Those that the motion lacks do not turn, and those that the body
        lacks are left out; `notes` name both. Betas and expression beyond the body's are left out
        too, and said. If the motion has an expression and the body a face, betas are coefficients
        of shape alone, and those beyond the body's directions of shape are left out. The root is
        where it was, also if the motion's own bones rest elsewhere. These are the same angles,
        which are not the same places on a body of other proportions. Raises BadArgument if most
        joints have no partner, as the body would be a statue then.
        """
        own_index = {name: k for k, name in enumerate(self.joint_names)}
        common = [name for name in body.joint_names if name in own_index]
        if 2 * len(common) < min(len(own_index), len(body.joint_names)) or not common:
            raise BadArgument(
                f"of the {len(own_index)} joints of the motion ({some_of(self.joint_names)}), "
                f"{len(common)} have a partner among those of body {body.name!r} "
                f"({some_of(body.joint_names)}), which would stand still; rename the joints of the "
                "motion, or play it on its own bones"
            )
        notes = []
        if still := [name for name in body.joint_names if name not in own_index]:
            notes.append(f"joints of the body that the motion lacks stay at rest: {some_of(still)}")
        if left_out := [name for name in own_index if name not in body.joint_names]:
            notes.append(f"joints that the body lacks are left out: {some_of(left_out)}")
        pose = np.tile(body.bind_pose, (len(self), 1, 1))
        body_index = [k for k, name in enumerate(body.joint_names) if name in own_index]
        pose[:, body_index] = self.pose[:, [own_index[body.joint_names[k]] for k in body_index]]
        betas, expression, coefficient_notes = self._coefficients_on(body)
        trans = self.trans
        if self.bones is not None:  # whose root may rest elsewhere than the body's
            body_root = body.joints(np.zeros((body.n_joints, 3)), betas)[0]
            trans = trans + self.bones.offsets[0] - body_root
        return replace(
            self,
            pose=pose,
            trans=trans,
            betas=betas,
            expression=expression,
            joint_names=tuple(body.joint_names),
            bones=None,
            notes=(*self.notes, *notes, *coefficient_notes),
        )

    def _coefficients_on(self, body: Body) -> tuple[Array, Array | None, list[str]]:
        """Betas and expression without those beyond the body's, and notes."""
        notes = []
        space, betas, expression = shape_space(body), self.betas, self.expression
        most = body.n_betas - _tissue_count(body) if expression is None else len(space.shape)
        if len(betas) > most:
            what = "betas" if expression is None else "betas of shape"
            notes.append(f"of {len(betas)} betas, the body has the first {most} as {what}")
            betas = betas[:most]
        if expression is not None and not space.expression:
            notes.append("the expression is kept, but the body has no face that it moves")
        elif expression is not None and expression.shape[1] > len(space.expression):
            notes.append(
                f"of {expression.shape[1]} coefficients of expression, the body has the first "
                f"{len(space.expression)}"
            )
            expression = expression[:, : len(space.expression)]
        return betas, expression, notes

    def betas_on(self, body: Body) -> Array:
        """The betas of a body in all frames, (B,), or (T, B) if its face or its tissue moves.

        An expression moves the face of a body that has one, and dmpls the tissue of `with_dmpls`.
        """
        here, space, tissue_count = self.named(body), shape_space(body), _tissue_count(body)
        betas = np.zeros(body.n_betas)
        betas[: len(here.betas)] = here.betas
        if tissue_count and here.dmpls is not None:
            rows, dmpls = np.tile(betas, (len(self), 1)), here.dmpls[:, :tissue_count]
            first = body.n_betas - tissue_count
            rows[:, first : first + dmpls.shape[1]] = dmpls
            return rows
        if here.expression is None or not space.expression:
            return betas
        return space.numbers(betas[: len(space.shape)], here.expression)

    def vertices(self, body: Body) -> Array:
        """The body's surface in every frame, (T, N, 3) m; see `named`. Slice a long motion."""
        here = self.named(body)
        return body.vertices(here.pose, here.betas_on(body), here.trans)

    def landmark(self, body: Body, name: str) -> Array:
        """A set of landmarks of the body in every frame, (T, M, 3) m; see `named`."""
        here = self.named(body)
        return body.landmark(name, here.pose, here.betas_on(body), here.trans)

    def joints(self, body: Body | None = None) -> Array:
        """The joints in every frame, (T, K, 3) m: those of a body, or of the motion's own bones.

        Raises BadArgument if there is neither.
        """
        if body is not None:
            here = self.named(body)
            return body.joints(here.pose, here.betas_on(body), here.trans)
        if self.bones is None:
            raise BadArgument("this motion has no bones of its own; give a body to play it on")
        return self.bones.joints(self.pose, self.trans)

    @property
    def up(self) -> tuple[str, float]:
        """The axis to which the root's own y points on average, and how clearly, from 0 to 1."""
        pointing = matrix_from_vector(self.pose[:, 0])[:, :, 1].mean(axis=0)
        axis = int(np.argmax(abs(pointing)))
        sign = "-" if pointing[axis] < 0 else ""
        return sign + "xyz"[axis], float(abs(pointing[axis]))


def _tissue_count(body: Body) -> int:
    """How many of the last betas of a body are coefficients of `with_dmpls`."""
    return int(body.extras.get("dmpls", 0))


def _above_zero(number: object) -> bool:
    real = isinstance(number, (int, float, np.number, np.ndarray)) and not isinstance(number, bool)
    return real and np.ndim(number) == 0 and 0 < float(number) < np.inf  # type: ignore[arg-type]


def without_gaps(
    pose: Array, lines: Mapping[str, Array]
) -> tuple[Array, dict[str, Array], tuple[str, ...]]:
    """Pose (T, K, 3) rad and lines (T, ...), such as trans, without NaN, and sentences on it.

    A frame that holds NaN is interpolated between the frames before and after it; at both ends
    such frames are left out. Raises BadArgument if no frame is whole.
    """
    T = len(pose)
    missing: Mask = np.asarray(np.isnan(pose).reshape(T, -1).any(axis=1))
    for line in lines.values():
        missing |= np.isnan(line).any(axis=1)
    if not missing.any():
        return pose, dict(lines), ()
    whole = np.flatnonzero(~missing)
    if not len(whole):
        raise BadArgument("no frame of the motion is whole: each one holds NaN")
    first, last = int(whole[0]), int(whole[-1])
    frames = np.interp(np.arange(first, last + 1), whole, np.arange(len(whole)))
    interpolated, left_out = int(missing[first:last].sum()), T - (last + 1 - first)
    notes = []
    if interpolated:
        notes.append(f"{interpolated} of {T} frames were not found, and are interpolated")
    if left_out:
        notes.append(f"{left_out} of {T} frames at the ends were not found, and are left out")
    moved = {name: between(line[whole], frames) for name, line in lines.items()}
    return rotations_between(pose[whole], frames), moved, tuple(notes)


SPLINE_FRAMES = 4  # frames, of a cubic spline with free ends


def splined(motion: Motion, fps: float) -> Motion:
    """The motion at another rate, through the same frames, with continuous accelerations.

    `Motion.resampled` turns joints along the shortest arcs, at speeds that jump from one frame to
    the next. Here rotations are cubic splines on the group (`scipy`'s RotationSpline) and places
    are cubic splines. What lies between the recorded frames is made up all the same: a recording
    at 10 frames a second holds nothing above 5 Hz.

    Raises BadArgument for fewer than 4 frames, a rate that is not above zero, or one that makes
    more than ten million frames.
    """
    if len(motion) < SPLINE_FRAMES:
        raise BadArgument(
            f"a spline needs {SPLINE_FRAMES} frames or more, and this motion has {len(motion)}; "
            "use motion.resampled, or a longer motion"
        )
    resampled = motion.resampled(fps)  # checks the rate
    new_times = np.arange(len(resampled)) / resampled.fps
    old_times = np.arange(len(motion)) / motion.fps
    pose = np.stack(
        [
            RotationSpline(old_times, Rotation.from_rotvec(turns))(new_times).as_rotvec()
            for turns in motion.pose.swapaxes(0, 1)
        ],
        axis=1,
    )
    note = f"resampled by splines from {motion.fps:g} to {resampled.fps:g} frames a second"
    return replace(
        motion,
        pose=pose,
        fps=resampled.fps,
        notes=(*motion.notes, note),
        **{name: CubicSpline(old_times, line)(new_times) for name, line in motion._lines.items()},  # type: ignore[arg-type]
    )
