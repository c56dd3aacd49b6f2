"""A posterior as draws, with what is known of their worth."""

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.special
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.layout import entries
from workbench.environment import optional_library, version_of
from workbench.errors import BadArgument, WorkbenchError, some_of
from workbench.problem import Problem
from workbench.residuals import quadratic
from workbench.sampling.conditioning import (
    Conditioning,
    contraction,
    prior_deviations,
)
from workbench.sampling.importance import Importance
from workbench.sampling.mixing import Mixing, Usability
from workbench.sampling.modes import Mode, ModeSearch, missed_mode
from workbench.sampling.subspace import Subspace

MOST_SHOWN = 40  # entries in a summary
DOUBTFUL_CHANCE = 1e-6  # of a sum of squares as large


class NotConverged(WorkbenchError):
    """An interval was asked of draws that do not carry one."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of what was sampled, (E, S, W, k): ensembles, steps, walkers, entries.

    The verdict judges them by `mixing`, by the modes of `mode_search`, by `conditioning` (what was
    held fixed, and how much wider intervals are without that), and by `importance` where a
    Gaussian stands for the posterior. It is printed before everything else, and `interval` raises
    an error unless it is `usable`.

    Attributes:
        problem: the problem.
        given: the values of every block that the problem reads.
        subspace: what was sampled.
        draws: (E, S, W, k).
        log_prob: (E, S, W) log densities, up to a constant.
        mixing: whether the chains have mixed.
        method: `emcee`, `hamiltonian` or `laplace`.
        mode_search: the modes that least squares found.
        conditioning: what was held fixed, and how much wider intervals are without that.
        importance: how well a Gaussian stands for what was not sampled; None if there is none.
        improper: why there is no posterior, where draws run away; empty otherwise.
        seconds: how long the sampling took.
        interrupted: whether it was stopped early.
        unsaved: why the last checkpoint could not be written; empty if it was.
        whole: the posterior of all free numbers from which `marginal` took these columns; whether
            chains have mixed, and whether a mode is missed, is judged on all of them. Else None.
        all_free: (R, n) some draws of all free numbers, if all were sampled, but only the named
            ones are judged. Else None.
    """

    problem: Problem = field(repr=False)
    given: Values = field(repr=False)
    subspace: Subspace = field(repr=False)
    draws: Array = field(repr=False)
    log_prob: Array = field(repr=False)
    mixing: Mixing
    method: str
    mode_search: ModeSearch = field(repr=False)
    conditioning: Conditioning = field(repr=False)
    importance: Importance | None = None
    improper: str = ""
    seconds: float = 0.0
    interrupted: bool = False
    unsaved: str = ""
    whole: "Posterior | None" = field(default=None, repr=False)
    all_free: Array | None = field(default=None, repr=False)

    @property
    def labels(self) -> tuple[str, ...]:
        """What was sampled: `betas[0]`, `pose[left_elbow, x]`."""
        return self.subspace.labels

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each entry."""
        return self.subspace.units

    @property
    def size(self) -> int:
        """k, the number of entries."""
        return self.subspace.size

    @cached_property
    def flat(self) -> Array:
        """All draws in one table (E S W, k)."""
        return self.draws.reshape(-1, self.size)

    @property
    def mean(self) -> Array:
        """The mean of each entry, (k,)."""
        return np.asarray(self.flat.mean(axis=0))

    @property
    def sd(self) -> Array:
        """The standard deviation of each entry, (k,)."""
        return np.asarray(self.flat.std(axis=0))

    @property
    def covariance(self) -> Array:
        """The covariance of the entries, (k, k)."""
        return np.atleast_2d(np.cov(self.flat.T))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The minima of the cost that were found, the one with the largest mass first."""
        return self.mode_search.modes

    @cached_property
    def missed_mode(self) -> tuple[float, float] | None:
        """A mode that the draws hardly visit, or None: its shares of the mass and of the draws."""
        return missed_mode(self.modes, self.flat)

    @cached_property
    def judgement(self) -> tuple[Usability, str]:
        """The verdict, and its reason: the first problem that was found, or the checks passed.

        The checks: is there a posterior at all; have the chains mixed; do the draws miss a mode;
        does Laplace's Gaussian fit; are intervals narrow because numbers are held fixed?
        """
        of = self if self.whole is None else self.whole
        if of.improper:
            return Usability.IMPROPER, of.improper
        verdict, why = of.mixing.judgement
        if verdict is not Usability.USABLE:
            return verdict, why
        if of.missed_mode is not None:
            mode_share, draws_share = of.missed_mode
            return Usability.MODE_MISSED, (
                f"least squares finds another mode with {mode_share:.0%} of the mass (by Laplace's "
                f"approximation), where {draws_share:.1%} of the draws are. "
            ) + (
                "Laplace's approximation is of one mode; draw with `sample`"
                if of.mixing.exact
                else "Begin at the other mode and compare, or add what tells the modes apart"
            )
        if self.importance is not None and not self.importance.holds:
            return Usability.NOT_GAUSSIAN, str(self.importance)
        if not self.conditioning.holds:
            mixed = "" if self.mixing.exact else f"the chains have mixed ({why}), but "
            return Usability.CONDITIONAL, mixed + self.conditioning.failed
        fits = [] if self.importance is None else [str(self.importance)]
        return verdict, "; ".join([why, *fits, str(self.mode_search)])

    @cached_property
    def doubt(self) -> str:
        """That the data contradict sigmas or priors, in a sentence; empty if that is not seen.

        Where residuals are linear and sigmas right, the sum of squares of m rows at the minimum is
        chi-square of m less the rank of J. It is doubted if a larger sum has a chance below 1e-6.
        Nothing is known where a kernel or a mixture makes rows other than Gaussian, nor of long
        sequences.
        """
        problem, of = self.problem, self if self.whole is None else self.whole
        x, fixed_values = problem.split(self.given)
        here = problem.linearize_at(of.subspace.points(of.modes[0].z[None])[0], fixed_values)
        robust = [r for r in problem.residuals if r.kernel is not quadratic or r.components]
        if robust or here.by_frames:
            return ""
        J, rows = here.dense, [here.residual, problem.residual(x, fixed_values)]
        squares = min(float(r @ r) for r in rows)  # x may be the better minimum
        lengths = np.linalg.norm(J, axis=0)
        rank = int(np.linalg.matrix_rank(J / np.where(lengths > 0, lengths, 1.0)))
        freedom = int((J.any(axis=1) | (rows[0] != 0)).sum()) - rank
        if freedom < 1 or scipy.special.chdtrc(freedom, squares) >= DOUBTFUL_CHANCE:
            return ""
        return (
            f"the data contradict the sigmas or the priors: the least sum of squares is "
            f"{squares:,.0f}, where {freedom:,} are expected. The draws are those of this model, "
            "whose intervals will hold the truth less often than they say"
        )

    @property
    def usable(self) -> bool:
        """Whether intervals from these draws may be used as they are."""
        return self.judgement[0] is Usability.USABLE

    @property
    def mixed(self) -> bool:
        """Whether intervals are right at least if the fixed numbers are known exactly."""
        return self.judgement[0] in (Usability.USABLE, Usability.CONDITIONAL)

    @property
    def verdict(self) -> str:
        """Whether the draws can be used, and why, in a sentence or two."""
        verdict, why = self.judgement
        return f"{verdict.value}: {why}"

    def interval(self, level: float = 0.9) -> Array:
        """The central interval of each entry (k, 2); `conditioning` says what is held fixed.

        Raises NotConverged unless the draws are usable. If the only problem is that numbers
        held fixed make the interval narrow, `conditional_interval` still returns it.
        """
        if not self.usable:
            raise NotConverged(f"there is no interval: {self.verdict}")
        return self._central(level)

    def conditional_interval(self, level: float = 0.9) -> Array:
        """The central interval of each entry, (k, 2), given what is held fixed.

        Raises NotConverged if the draws are worth nothing even so.
        """
        if not self.mixed:
            raise NotConverged(f"there is no interval: {self.verdict}")
        return self._central(level)

    def _central(self, level: float) -> Array:
        tail = (1 - level) / 2
        return np.quantile(self.flat, [tail, 1 - tail], axis=0).T

    def coordinates(self, values: Mapping[str, ArrayLike]) -> Array:
        """What was sampled (k,), read from values of free blocks, or else from `given`."""
        x = self.problem.free.pack({**self.given, **values})
        return np.asarray(x[self.subspace.entries])

    def marginal(self, names: str | Iterable[str]) -> "Posterior":
        """These draws of some entries alone, whatever the others are; the verdict stays as it is.

        Raises UnknownName for names that are not free, and BadArgument for entries that were not
        sampled.
        """
        space, chosen = self.subspace, entries(self.problem.free, names)
        if not np.isin(chosen, space.entries).all():
            raise BadArgument(
                f"only what was sampled has a marginal: {some_of(self.labels)}; name some of these"
            )
        places = np.array([int(np.flatnonzero(space.entries == i)[0]) for i in chosen])
        marginal_space, into = space.of_columns(places), np.eye(self.size)[places]
        modes = tuple(mode.mapped(into, mode.z[places]) for mode in self.modes)
        draws = np.ascontiguousarray(self.draws[..., places])
        importance = self.importance
        return replace(
            self,
            subspace=marginal_space,
            draws=draws,
            mixing=replace(self.mixing, labels=marginal_space.labels, draws=draws),
            mode_search=replace(self.mode_search, modes=modes),
            conditioning=self.conditioning.of_entries(places),
            importance=None if importance is None else importance.of_entries(places),
            whole=self if self.whole is None else self.whole,
        )

    def points(self, count: int, seed: int = 0) -> Array:
        """`count` random draws of all free numbers (count, n), what was integrated out included."""
        if self.whole is not None:
            return self.whole.points(count, seed)
        rng = np.random.default_rng(seed)
        if self.all_free is not None:
            return self.all_free[rng.integers(len(self.all_free), size=count)]
        z = self.flat[rng.integers(len(self.flat), size=count)]
        return self.subspace.points(z, rng.standard_normal((count, self.subspace.rest.shape[1])))

    def values(self, count: int, seed: int = 0) -> list[Values]:
        """Random draws as values of all blocks, fixed ones included, as a body takes them."""
        fixed = {
            name: np.asarray(self.given[name], dtype=float) for name in self.problem.fixed.names
        }
        return [fixed | self.problem.free.unpack(x, fixed) for x in self.points(count, seed)]

    def inference_data(self) -> Any:
        """The draws for ArviZ; a chain is an ensemble, not a walker.

        An InferenceData of ArviZ 0.x, or a DataTree from 1.0 on. The variable is `z` with the
        coordinate `entry`; `lp` is the log density; the verdict is an attribute of the posterior.
        Raises MissingLibrary without the extra `arviz`.
        """
        E, S, W, k = self.draws.shape
        groups = {
            "posterior": {"z": self.draws.reshape(E, S * W, k)},
            "sample_stats": {"lp": self.log_prob.reshape(E, S * W)},
        }
        names: dict[str, Any] = {"coords": {"entry": list(self.labels)}, "dims": {"z": ["entry"]}}
        with warnings.catch_warnings():  # ArviZ 0.x announces 1.0 whenever it is imported
            warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
            arviz = optional_library("arviz", "InferenceData of a posterior")
        if (version_of("arviz") or "") < "1":
            data = arviz.from_dict(**groups, **names)
        else:
            data = arviz.from_dict(groups, **names)
        data["posterior"].attrs["verdict"] = self.verdict
        return data

    def __str__(self) -> str:
        return self.summary()

    @property
    def conditional(self) -> bool:
        """Whether intervals are given numbers that are held fixed."""
        return self.conditioning.count > 0

    @property
    def rest(self) -> str:
        """What became of the free numbers that are no entries here, in a few words."""
        if self.whole is not None or self.all_free is not None:
            return "in the same Gaussian" if self.method == "laplace" else "sampled too"
        if self.conditional:
            return f"held fixed: {self.conditioning.what}"
        if self.subspace.rest.shape[1]:
            return "integrated out, by Laplace's approximation"
        return "nothing else is free"

    def contraction(self, priors: Iterable[str]) -> Array:
        """1 - sd / (sd of the prior) of each entry, (k,); NaN where that is not known.

        `priors` are the names of the residuals that are priors, as in `Setup.priors`.
        """
        before = prior_deviations(self.problem, self.given, self.labels, tuple(priors))
        return contraction(self.sd, before)

    def summary(self, truth: Array | None = None, priors: Iterable[str] = ()) -> str:
        """The verdict, how the draws were made, what is held fixed, and a line for each entry.

        `truth` (k,) holds what synthetic data were made of, and is printed beside the entries. With
        the names of the residuals that are `priors`, each line has a bar of `contraction`.
        """
        lines = [self.verdict, self._how, f"Modes: {self.mode_search}."]
        if self.doubt:
            lines.append(f"Doubtful: {self.doubt}.")
        if truth is not None:
            lines.append("The data are synthetic; `truth` is what they were made of")
        if len(self.modes) > 1:
            shares = ", ".join(f"{mode.share:.0%}" for mode in self.modes)
            lines.append(f"Least squares finds {len(self.modes)} modes, with {shares} of the mass")
        if self.whole is not None or self.subspace.rest.shape[1]:
            lines.append(f"All other free numbers: {self.rest}.")
        lines.append(str(self.conditioning))
        if known := self.conditioning.given:
            lines.append(f"The problem assumes that these are known: {', '.join(known)}.")
        if self.mixed:
            lines += self._entry_lines(truth, self.contraction(priors))
        elif self.mixing.exact:
            lines.append("No intervals are given.")
        else:
            lines.append(
                "No intervals are given. The autocorrelation time of each entry, in steps:"
            )
            width, mixing = max([5, *map(len, self.labels[:MOST_SHOWN])]), self.mixing
            for i in np.argsort(-mixing.times)[:MOST_SHOWN]:
                name, scale = mixing.labels[i], mixing.scales[i]
                lines.append(f"{name:{width}} {mixing.times[i]:>8.0f}   R-hat {scale:.3f}")
        if self.size > MOST_SHOWN:
            lines.append(f"and {self.size - MOST_SHOWN} entries more")
        return "\n".join(lines)

    @property
    def _how(self) -> str:
        """How many ensembles, walkers and steps there were, and how long they took."""
        E, S, W, k = self.draws.shape
        if self.method == "laplace":
            return f"Laplace's approximation, {E * S} independent draws of {k} entries"
        how = f"emcee: {E} ensembles of {W} walkers"
        if self.method == "hamiltonian":
            how = f"Hamiltonian Monte Carlo of all free numbers: {E} groups of {W} chains"
        return (
            f"{how}, {self.mixing.steps} steps after {self.mixing.discarded} discarded, "
            f"{self.mixing.acceptance:.0%} accepted, {self.seconds:.1f} s"
            + (", interrupted" if self.interrupted else "")
        )

    def _entry_lines(self, truth: Array | None, bars: Array) -> Iterator[str]:
        """A line for each entry, after lines that say what the columns are."""
        held = self.conditioning if self.conditional else None
        width, known = max([5, *map(len, self.labels[:MOST_SHOWN])]), bool(np.isfinite(bars).any())
        if held is not None:
            yield (
                "The intervals are conditional: they hold only if what is held fixed is known "
                "exactly. `marginal` is the sd by J'J if it is free too, and `ratio` is `marginal` "
                "over the sd by J'J with it fixed"
            )
        if known:
            yield "`contraction` is 1 - sd / (sd of the prior): 0 if the data said nothing"
        yield (
            f"{'entry':{width}} {'mean':>10} {'sd':>9} {'5 %':>10} {'95 %':>10}  {'unit':6}"
            + ("" if held is None else f" {'marginal':>9} {'ratio':>7}  {'interval':11}")
            + ("" if truth is None else f" {'truth':>10}")
            + ("  contraction" if known else "")
        ).rstrip()
        numbers = np.column_stack([self.mean, self.sd, self._central(0.9)])
        for i, (label, (mean, sd, low, high)) in enumerate(
            zip(self.labels[:MOST_SHOWN], numbers, strict=False)
        ):
            line = f"{label:{width}} {mean:>10.4g} {sd:>9.3g} {low:>10.4g} {high:>10.4g}"
            line += f"  {self.units[i]:6}"
            if held is not None:
                line += f" {held.marginal[i]:>9.3g} {held.ratios[i]:>7.3g}  conditional"
            if truth is not None:
                line += f" {truth[i]:>10.4g}"
            if known:
                line += f"  {bars[i]:5.2f}" if np.isfinite(bars[i]) else "  no prior known"
            yield line.rstrip()
