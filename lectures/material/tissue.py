"""Soft tissue from meshes in motion: dynamic blend shapes, and a stable model that drives them.

Directions are principal components, parts are clusters of vertices that move alike, and the
matrices that predict the coefficients of the next frame are found by least squares. There is no
open recording of tissue; `tissue_simulation` simulates it with springs that stiffen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.cluster.vq import kmeans2

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.spaces import body_mass_index
from workbench.errors import BadArgument
from workbench.motions import Motion
from workbench.motions.soft_tissue import (
    MovingFrames,
    SoftTissue,
    companion,
    free_run,
    tissue_inputs,
)

HARDLY = 0.01  # of an input's bound: what moves less than this in the clips hardly moves
MOST_POWERS, CLOSE = 10, 0.02  # of the gain: how often it is improved, and when it stays
SOFT = 0.15  # of the largest rms: vertices that move less are in no soft part


@dataclass(frozen=True, eq=False)
class TissueClip:
    """A motion, of a person with its betas, and how far their tissue was displaced in it.

    Attributes:
        motion: T frames, at the rate of the model.
        displacements: (T, N, 3) m at rest, as `simulate_tissue` gives them, or as what is left of
            registrations that were unposed.
    """

    motion: Motion
    displacements: Array


@dataclass(frozen=True, eq=False)
class OneStep:
    """The rows of the one-step model of all clips: targets = regressors @ [A_1 A_2 B]'.

    Attributes:
        regressors: (M, 2 C + X): the coefficients of the two frames before, and the inputs.
        targets: (M, C).
    """

    regressors: Array
    targets: Array

    @staticmethod
    def of(clips: list[tuple[Array, Array]]) -> "OneStep":
        """Of clips of coefficients (T, C) and inputs (T, X); no row goes over a clip's end."""
        rows, targets = [], []
        for phi, x in clips:
            rows.append(np.hstack([phi[1:-1], phi[:-2], x[2:]]))
            targets.append(phi[2:])
        return OneStep(np.concatenate(rows), np.concatenate(targets))

    def solve(self, ridge: float) -> tuple[Array, Array, Array]:
        """A_1, A_2 and B of the least squares with a penalty on the factors of the inputs.

        The penalty is `ridge` (mean square of the input + `HARDLY`^2) times the squared factor.
        So an input that hardly moves in the clips gets a small factor, and not one that explains
        noise and shakes the tissue as soon as a motion does move it.
        """
        C, Z = self.targets.shape[1], self.regressors
        size = (Z**2).mean(axis=0)
        own = np.arange(Z.shape[1]) < 2 * C
        price = np.where(own, 1e-9 * size, ridge * (size + HARDLY**2))
        found = penalised(Z, self.targets, price)
        return found[:C].T, found[C : 2 * C].T, found[2 * C :].T


def penalised(Z: Array, Y: Array, price: Array) -> Array:
    """The W (n, C) of least mean of |Z W - Y|^2 over the rows, plus price (n,) times W^2.

    That is (Z'Z / M + diag(price)) W = Z'Y / M. Columns of Z are brought to one size first, so that
    rounding does not depend on their units; a column of zeros gets zeros.
    """
    size = (Z**2).mean(axis=0)
    scale = np.sqrt(np.where(size > 0, size, 1.0))
    H = (Z / scale).T @ (Z / scale) / len(Z) + np.diag(price / scale**2)
    H[size == 0, size == 0] = 1.0
    W: Array = np.linalg.solve(H, (Z / scale).T @ Y / len(Z)) / scale[:, None]
    return W


def stabilized(first: Array, second: Array, most: float) -> tuple[Array, Array]:
    """A_1 and A_2 whose poles are all multiplied by one factor, so that none is above `most`.

    A pole z solves z^2 v = z A_1 v + A_2 v. With s A_1 and s^2 A_2 the poles are s z, with the same
    vectors v: every wobble keeps its frequency and its form, and dies away a little faster.
    """
    radius = float(np.abs(np.linalg.eigvals(companion(first, second))).max())
    s = min(1.0, most / radius)
    return s * first, s * s * second


@dataclass(frozen=True)
class TissuePlan:
    """What a training of soft tissue decides beforehand.

    Attributes:
        components: C, how many dynamic blend shapes.
        parts: P, how many soft parts there are, whose accelerations are inputs.
        ridge: the price of the inputs' factors; see `OneStep.solve`.
        most: the largest spectral radius.
        n_betas: how many betas are inputs.
        seed: of the division into soft parts.
    """

    components: int = 32
    parts: int = 24
    ridge: float = 1e-2
    most: float = 0.99
    n_betas: int = 0
    seed: int = 0


def train_tissue(
    body: SkinnedBody,
    clips: Sequence[TissueClip],
    plan: TissuePlan | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> SoftTissue:
    """Dynamic blend shapes, and the model of their coefficients, from clips of displaced tissue.

    Directions are the principal components, about zero, of all displacements. Soft parts are
    clusters of vertices that move. The matrices are the least squares of one step ahead. The power
    of the gain is a straight line through the logarithms of how much more than the model each
    person moves, against their body mass index; all is found again with this gain until it stays.
    Raises BadArgument for clips of different rates, and for too few frames.
    """
    plan = TissuePlan() if plan is None else plan
    rates = {clip.motion.fps for clip in clips}
    if len(rates) != 1:
        raise BadArgument(f"all clips have one rate; these have {sorted(rates) or 'none at all'}")
    if (frames := sum(len(clip.motion) for clip in clips)) < 10 * plan.components:
        raise BadArgument(
            f"{plan.components} components need {10 * plan.components} frames or more, "
            f"not {frames}; give more clips, or ask for fewer components"
        )
    part = soft_parts(body, clips, plan.parts, plan.seed)
    progress(f"{len(clips)} clips, {frames} frames, {part.max() + 1} soft parts")
    inputs = [
        tissue_inputs(MovingFrames.of(body, clip.motion), part, plan.n_betas) for clip in clips
    ]
    index = np.log([body_mass_index(body, clip.motion.betas) for clip in clips])
    index -= np.log(body_mass_index(body))
    power = 0.0
    for _ in range(MOST_POWERS if np.ptp(index) else 0):
        gains = np.exp(power * index)
        made = _at_gains(body, clips, inputs, gains, part, plan)
        left = _power_left(made, clips, inputs, gains, index)
        power += left
        progress(f"gain: body mass index to the power of {power:.2f}")
        if abs(left) < CLOSE:
            break
    gains = np.exp(power * index)
    return replace(_at_gains(body, clips, inputs, gains, part, plan), power=power)


def one_step_of(tissue: SoftTissue, body: SkinnedBody, clips: Sequence[TissueClip]) -> OneStep:
    """The rows of the least squares that the matrices of a tissue solve, in these clips."""
    pairs = []
    for clip in clips:
        frames = MovingFrames.of(body, clip.motion)
        gain = tissue.gain(body, clip.motion.betas)
        phi = coefficients_of(tissue.directions, clip.displacements) / gain
        pairs.append((phi, tissue_inputs(frames, tissue.part, tissue.n_betas)))
    return OneStep.of(pairs)


def soft_parts(body: SkinnedBody, clips: Sequence[TissueClip], count: int, seed: int) -> Index:
    """The soft part of each vertex, (N,): clusters of those that move; -1 for the others."""
    total = sum(np.square(clip.displacements).sum(axis=(0, 2)) for clip in clips)
    size = np.sqrt(np.asarray(total))
    soft = np.flatnonzero(size > SOFT * size.max())
    part = np.full(body.n_vertices, -1)
    if len(soft) and count:
        count = min(count, len(soft))
        _, label = kmeans2(body.template[soft], count, minit="++", rng=seed)
        part[soft] = np.unique(label, return_inverse=True)[1]
    return part


def principal_directions(clips: Sequence[TissueClip], gains: Array, count: int) -> Array:
    """The principal components (N, 3, C) m of displacements divided by their gains, about zero.

    They are scaled so that coefficients have a mean square of one in the clips.
    """
    N = clips[0].displacements.shape[1]
    moves = np.any([(clip.displacements != 0).any(axis=0) for clip in clips], axis=0)
    H, frames = np.zeros((int(moves.sum()),) * 2), 0
    for clip, gain in zip(clips, gains, strict=True):
        flat = clip.displacements[:, moves] / gain
        H += flat.T @ flat
        frames += len(flat)
    last = len(H) - 1
    sizes, vectors = scipy.linalg.eigh(H / frames, subset_by_index=(max(0, last - count + 1), last))
    found = np.zeros((N, 3, len(sizes)))
    found[moves] = (vectors * np.sqrt(np.maximum(sizes, 0)))[:, ::-1]
    return found


def coefficients_of(directions: Array, displacements: Array) -> Array:
    """The coefficients (T, C) that are closest to displacements (T, N, 3) m."""
    D = directions.reshape(-1, directions.shape[2])
    return np.asarray(displacements.reshape(len(displacements), -1) @ D / (D**2).sum(axis=0))


def _at_gains(
    body: SkinnedBody,
    clips: Sequence[TissueClip],
    inputs: Sequence[Array],
    gains: Array,
    part: Index,
    plan: TissuePlan,
) -> SoftTissue:
    """All but the power of the gain."""
    D = principal_directions(clips, gains, plan.components)
    phis = [
        coefficients_of(D, clip.displacements) / gain
        for clip, gain in zip(clips, gains, strict=True)
    ]
    one = OneStep.of(list(zip(phis, inputs, strict=True)))
    first, second, response = one.solve(plan.ridge)
    first, second = stabilized(first, second, plan.most)
    names, fps = tuple(body.joint_names), clips[0].motion.fps
    return SoftTissue(D, first, second, response, part, fps, names, plan.n_betas)


def _power_left(
    made: SoftTissue,
    clips: Sequence[TissueClip],
    inputs: Sequence[Array],
    gains: Array,
    index: Array,
) -> float:
    """The slope of log(how much farther than the model tissue moves) over log(body mass index)."""
    logs = []
    for clip, x, gain in zip(clips, inputs, gains, strict=True):
        phi = coefficients_of(made.directions, clip.displacements) / gain
        run = free_run(made.first, made.second, x @ made.response.T)
        logs.append(0.5 * np.log(np.square(phi).sum() / np.square(run).sum()))
    frames = np.array([len(clip.motion) for clip in clips], dtype=float)
    centred = index - np.average(index, weights=frames)
    return float((frames * centred) @ np.array(logs) / ((frames * centred) @ centred))


@dataclass(frozen=True)
class TissueScore:
    """A free run of the model in one clip, against what the tissue did.

    Attributes:
        explained: the share of the variance of the displacements, about the mean of each
            coordinate in the clip, that the free run explains.
        rms: in m, of the displacements of vertices that ever move.
        error: in m, the rms of what the free run leaves.
        largest: in m, the largest displacement of the free run.
        frames: of the clip.
    """

    explained: float
    rms: float
    error: float
    largest: float
    frames: int


def score_tissue(tissue: SoftTissue, body: SkinnedBody, clip: TissueClip) -> TissueScore:
    """Compare a free run, which sees the motion alone, with the displacements of a clip."""
    phi = tissue.coefficients(body, clip.motion)
    found = tissue.displacements(body, phi, clip.motion.betas)
    true = clip.displacements
    moves = (true != 0).any(axis=(0, 2)) | (found != 0).any(axis=(0, 2))
    off = np.square(true - found).sum()
    spread = np.square(true - true.mean(axis=0)).sum()
    counted = max(1, int(moves.sum()) * len(true))
    return TissueScore(
        explained=float(1 - off / spread) if spread > 0 else float("nan"),
        rms=float(np.sqrt(np.square(true).sum() / counted)),
        error=float(np.sqrt(off / counted)),
        largest=float(np.linalg.norm(found, axis=-1).max()),
        frames=len(true),
    )
