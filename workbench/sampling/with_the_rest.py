"""Draws of what is named together with all other free numbers, of which only the named are judged.

Where there are more free numbers than ensembles can sample, `sample` first integrates those that
are not named out by Laplace's approximation, and weighs whether that holds. If it does not surely
hold, everything is drawn by Hamiltonian Monte Carlo: the marginal of the named entries is what
their columns show. Chains have to mix in these columns, not in all: an interval of a person's
place is right whether or not the bend of each elbow has been explored as often.
"""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.sampling.descent import Mode, NoMinimum, mode_from
from workbench.sampling.ensemble_settings import Callback
from workbench.sampling.hamiltonian import HamiltonianRun, HamiltonianSettings, run_hamiltonian
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import ModeSearch, modes, walkers_at
from workbench.sampling.subspace import BandedRest, Improper, Subspace, fixed, movable

SAME = 1.0  # standard deviations between two modes that are one in what is named


@dataclass(frozen=True, eq=False)
class WholeRun:
    """A run on all free numbers, with modes and draws of what is named."""

    run: HamiltonianRun
    mode_search: ModeSearch

    @property
    def in_words(self) -> str:
        """What was drawn, for a comparison."""
        n, effective = self.run.points.shape[1], self.run.mixing.effective.min()
        return f"{effective:,.0f} effective draws of all {n} free numbers"


def drawn_with_the_rest(
    target: LogDensity,
    plan: HamiltonianSettings,
    rng: np.random.Generator,
    callback: Callback = None,
) -> WholeRun | None:
    """Draws of all free numbers, judged in what the target samples; None where that is not to be.

    That is so for long sequences, and where a direction of the rest has no width or leads to no
    minimum. Chains begin at draws of Laplace's approximation at the modes of everything, each mode
    by its share of the mass.
    """
    problem, given, space = target.problem, target.fixed, target.subspace
    if isinstance(space.rest, BandedRest):
        return None
    x = space.origin
    free = np.flatnonzero(movable(problem))
    whole = LogDensity(
        problem, given, fixed(problem, problem.linearize_at(x, given), x, free), target.way
    )
    try:
        first = mode_from(whole, whole.subspace.centre)
        found = modes(whole, first, rng)
    except (Improper, NoMinimum, np.linalg.LinAlgError):
        return None
    starts = walkers_at(whole, found.modes, plan.ensembles * plan.walkers, rng)
    into = _into(space, free)
    run = run_hamiltonian(
        whole,
        starts,
        found.modes,
        lambda z: space.centre + (z - x[free]) @ into.T,
        space.labels,
        plan,
        rng,
        callback,
    )
    return WholeRun(run, replace(found, modes=_seen(found.modes, space, x[free], into)))


def _into(space: Subspace, free: Index) -> Array:
    """The matrix (k, c) that takes a change of all that is free to the change of z."""
    if space.entries is not None:
        return np.asarray((space.entries[:, None] == free).astype(float))
    return np.asarray(np.linalg.pinv(space.span[free])[: space.size])


def _seen(found: tuple[Mode, ...], space: Subspace, centre: Array, into: Array) -> tuple[Mode, ...]:
    """The modes in z; those that are the same there are one."""
    kept: list[Mode] = []
    for mode in found:
        half = np.asarray(np.asarray(np.linalg.qr((into @ mode.half).T, mode="r")).T)
        one = replace(mode, z=space.centre + into @ (mode.z - centre), half=half)
        same = [
            i for i, known in enumerate(kept) if max(known.away(one.z), one.away(known.z)) < SAME
        ]
        if same:
            known = kept[same[0]]
            kept[same[0]] = replace(
                known, share=known.share + one.share, found=known.found + one.found
            )
        else:
            kept.append(one)
    return tuple(kept)
