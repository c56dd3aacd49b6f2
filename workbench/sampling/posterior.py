"""A posterior as draws, with what is known of their worth."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.entries import entries
from workbench.errors import BadArgument, WorkbenchError, some_of
from workbench.problem import Problem
from workbench.sampling.arviz_interface import inference_data
from workbench.sampling.conditioning import Conditioning
from workbench.sampling.contraction import contraction, contraction_bar, prior_deviations
from workbench.sampling.descent import Mode
from workbench.sampling.importance import Importance
from workbench.sampling.mixing import Mixing, Usability
from workbench.sampling.modes import ModeSearch, missed_mode, search_in_words
from workbench.sampling.subspace import Subspace

MOST = 40  # entries in a summary


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
        method: `emcee` or `laplace`.
        mode_search: the modes that least squares found.
        conditioning: what was held fixed, and how much wider intervals are without that.
        importance: how well a Gaussian stands for what was not sampled; None if there is none.
        seconds: how long the sampling took.
        interrupted: whether it was stopped early.
        unsaved: why the last checkpoint could not be written; empty if it was.
        whole: the draws of all free numbers, where these are some of their columns; the verdict is
            on all of them.
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
    seconds: float = 0.0
    interrupted: bool = False
    unsaved: str = ""
    whole: "Posterior | None" = field(default=None, repr=False)

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

        The checks are, in this order: whether the chains have mixed; whether the draws miss a mode;
        whether Laplace's Gaussian fits; whether intervals are narrow because numbers are held
        fixed.
        """
        if self.whole is not None:
            return self.whole.judgement
        verdict, why = self.mixing.judgement
        if verdict is not Usability.USABLE:
            return verdict, why
        if self.missed_mode is not None:
            share, here = self.missed_mode
            return Usability.MODE_MISSED, (
                f"least squares finds another mode with {share:.0%} of the mass (by Laplace's "
                f"approximation), where {here:.1%} of the draws are. "
                + (
                    "Laplace's approximation is of one mode; draw with `sample`"
                    if self.mixing.exact
                    else "Begin at the other mode and compare, or add what tells the modes apart"
                )
            )
        if self.importance is not None and not self.importance.holds:
            return Usability.NOT_GAUSSIAN, str(self.importance)
        if not self.conditioning.holds:
            mixed = "" if self.mixing.exact else f"the chains have mixed ({why}), but "
            return Usability.CONDITIONAL, mixed + self.conditioning.failed
        told = [
            why,
            *([] if self.importance is None else [str(self.importance)]),
            search_in_words(self.mode_search),
        ]
        return verdict, "; ".join(told)

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
        """What was sampled (k,), read from values of free blocks; missing ones are as in `given`.

        Where directions were sampled, it is the nearest point that they reach.
        """
        x, space = self.problem.free.pack({**self.given, **values}), self.subspace
        if space.entries is not None:
            return np.asarray(x[space.entries])
        span = space.span
        return np.asarray(space.centre + np.linalg.lstsq(span, x - space.origin)[0][: space.size])

    def marginal(self, names: str | Iterable[str]) -> "Posterior":
        """These draws of some entries alone, whatever the others are; the verdict stays as it is.

        Raises UnknownName for names that are not free, and BadArgument for entries that were not
        sampled, or if directions were.
        """
        space, meant = self.subspace, entries(self.problem.free, names)
        if space.entries is None or not np.isin(meant, space.entries).all():
            raise BadArgument(
                f"only what was sampled has a marginal: {some_of(self.labels)}; name some of these"
            )
        at = np.array([int(np.flatnonzero(space.entries == i)[0]) for i in meant])
        there = replace(
            space,
            along=space.along[:, at],
            centre=space.centre[at],
            labels=tuple(space.labels[i] for i in at),
            units=tuple(space.units[i] for i in at),
            entries=meant,
        )
        draws, held = np.ascontiguousarray(self.draws[..., at]), self.conditioning
        modes = tuple(replace(mode, z=mode.z[at], half=_half(mode.half[at])) for mode in self.modes)
        return replace(
            self,
            subspace=there,
            draws=draws,
            mixing=replace(self.mixing, labels=there.labels, draws=draws),
            mode_search=replace(self.mode_search, modes=modes),
            conditioning=replace(
                held,
                labels=there.labels,
                conditional=held.conditional[at],
                marginal=held.marginal[at],
            ),
            whole=self if self.whole is None else self.whole,
        )

    def points(self, count: int, seed: int = 0) -> Array:
        """`count` random draws of all free numbers (count, n), what was integrated out included."""
        if self.whole is not None:
            return self.whole.points(count, seed)
        rng = np.random.default_rng(seed)
        z = self.flat[rng.integers(len(self.flat), size=count)]
        return self.subspace.points(z, rng.standard_normal((count, self.subspace.rest.shape[1])))

    def values(self, count: int, seed: int = 0) -> list[Values]:
        """Random draws as values of all blocks, fixed ones included, as a body takes them."""
        fixed = {
            name: np.asarray(self.given[name], dtype=float) for name in self.problem.fixed.names
        }
        return [fixed | self.problem.free.unpack(x, fixed) for x in self.points(count, seed)]

    def inference_data(self) -> Any:
        """The draws as arviz.InferenceData; a chain is an ensemble, not a walker."""
        return inference_data(self.draws, self.log_prob, self.labels, self.verdict)

    def __str__(self) -> str:
        return self.summary()

    @property
    def conditional(self) -> bool:
        """Whether intervals are given numbers that are held fixed."""
        return self.conditioning.count > 0

    @property
    def rest(self) -> str:
        """What became of the free numbers that are no entries here, in a few words."""
        if self.whole is not None:
            return "sampled too" if self.method == "emcee" else "in the same Gaussian"
        if self.conditional:
            return f"held fixed: {self.conditioning.what}"
        if self.subspace.rest.shape[1]:
            return "integrated out, by Laplace's approximation"
        return "nothing else is free"

    def contraction(self, priors: Iterable[str]) -> Array:
        """1 - sd / (sd of the prior) of each entry, (k,); NaN where that is not known.

        `priors` are the names of the residuals that are priors, as in `Setup.priors`.
        """
        problem, told = self.problem, tuple(priors)
        at = self.subspace.entries
        if at is None or problem.linearize(self.given).by_frames:
            return np.full(self.size, np.nan)
        return contraction(self.sd, prior_deviations(problem, self.given, self.labels, told))

    def summary(self, truth: Array | None = None, priors: Iterable[str] = ()) -> str:
        """The verdict, how the draws were made, what is held fixed, and a line for each entry.

        `truth` (k,) holds the values that synthetic data were made with; it is printed beside the
        entries. With the names of the residuals that are `priors`, each line has a bar of
        `contraction`.
        """
        lines = [self.verdict, _how(self), f"Modes: {search_in_words(self.mode_search)}."]
        if truth is not None:
            lines.append("The data are synthetic; `truth` is what they were made of")
        if len(self.modes) > 1:
            shares = ", ".join(f"{mode.share:.0%}" for mode in self.modes)
            lines.append(f"Least squares finds {len(self.modes)} modes, with {shares} of the mass")
        if self.whole is not None or self.subspace.rest.shape[1]:
            lines.append(f"All other free numbers: {self.rest}.")
        lines.append(str(self.conditioning))
        if self.conditioning.given:
            lines.append(
                f"The problem assumes that these are known: {', '.join(self.conditioning.given)}."
            )
        lines += list(_intervals(self, truth, tuple(priors)))
        if self.size > MOST:
            lines.append(f"and {self.size - MOST} entries more")
        return "\n".join(lines)


def _half(rows: Array) -> Array:
    """The square half (k, k) of the covariance of some rows (k, n) of a half (n, n)."""
    return np.asarray(np.asarray(np.linalg.qr(rows.T, mode="r")).T)


def _how(posterior: Posterior) -> str:
    E, S, W, k = posterior.draws.shape
    if posterior.method == "laplace":
        return f"Laplace's approximation, {E * S} independent draws of {k} entries"
    mixing = posterior.mixing
    return (
        f"emcee: {E} ensembles of {W} walkers, {mixing.steps} steps after {mixing.discarded} "
        f"discarded, {mixing.acceptance:.0%} accepted, {posterior.seconds:.1f} s"
        + (", interrupted" if posterior.interrupted else "")
    )


def _intervals(posterior: Posterior, truth: Array | None, priors: tuple[str, ...]) -> Iterator[str]:
    """The table of entries: intervals where they mean something, else how chains went."""
    p, wide = posterior, max([5, *(len(label) for label in posterior.labels[:MOST])])
    some = range(min(p.size, MOST))
    if p.mixed:
        held, bars = p.conditional, p.contraction(priors)
        known = bool(np.isfinite(bars).any())
        if held:
            yield (
                "The intervals are conditional: they hold only if what is held fixed is known "
                "exactly. `marginal` is the sd by J'J if it is free too, and `ratio` is `marginal` "
                "over the sd by J'J with it fixed"
            )
        if known:
            yield "`contraction` is 1 - sd / (sd of the prior): 0 if the data said nothing"
        yield (
            f"{'entry':{wide}} {'mean':>10} {'sd':>9} {'5 %':>10} {'95 %':>10}  {'unit':6}"
            + (f" {'marginal':>9} {'ratio':>7}  {'interval':11}" if held else "")
            + (f" {'truth':>10}" if truth is not None else "")
            + ("  contraction" if known else "")
        ).rstrip()
        ends = p.conditional_interval(0.9)
        for i in some:
            yield (
                f"{p.labels[i]:{wide}} {p.mean[i]:>10.4g} {p.sd[i]:>9.3g} {ends[i, 0]:>10.4g} "
                f"{ends[i, 1]:>10.4g}  {p.units[i]:6}"
                + (
                    f" {p.conditioning.marginal[i]:>9.3g} {p.conditioning.ratios[i]:>7.3g}"
                    "  conditional"
                    if held
                    else ""
                )
                + (f" {truth[i]:>10.4g}" if truth is not None else "")
                + (f"  {contraction_bar(float(bars[i]))}" if known else "")
            ).rstrip()
    elif p.mixing.exact:
        yield "No intervals are given."
    else:
        yield "No intervals are given. The autocorrelation time of each entry, in steps:"
        for i in np.argsort(-p.mixing.times)[:MOST]:
            yield (
                f"{p.labels[i]:{wide}} {p.mixing.times[i]:>8.0f}   R-hat {p.mixing.scales[i]:.3f}"
            )
