"""A posterior in words; the verdict first, and no interval without it."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from workbench.sampling.conditioning import Conditioning
from workbench.sampling.descent import Mode
from workbench.sampling.mixing import Mixing
from workbench.sampling.modes import Found, searched

Array = NDArray[np.float64]
MOST = 40  # entries in a summary


class Described(Protocol):
    """What is told of a posterior; see Posterior."""

    @property
    def verdict(self) -> str:
        """What the draws are worth, in a sentence."""

    @property
    def method(self) -> str:
        """`emcee` or `laplace`."""

    @property
    def draws(self) -> Array:
        """(E, S, W, k)."""

    @property
    def mixing(self) -> Mixing:
        """How chains went."""

    @property
    def found(self) -> Found:
        """The search for modes."""

    @property
    def held(self) -> Conditioning:
        """What was held fixed."""

    @property
    def seconds(self) -> float:
        """How long it took."""

    @property
    def interrupted(self) -> bool:
        """Whether somebody stopped it."""

    @property
    def modes(self) -> tuple[Mode, ...]:
        """What least squares finds."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the entries."""

    @property
    def units(self) -> tuple[str, ...]:
        """Of the entries."""

    @property
    def size(self) -> int:
        """k, the number of entries."""

    @property
    def mixed(self) -> bool:
        """Whether intervals mean something."""

    @property
    def mean(self) -> Array:
        """(k,)."""

    @property
    def sd(self) -> Array:
        """(k,)."""

    def conditional_interval(self, level: float = 0.9) -> Array:
        """(k, 2)."""


def summary(posterior: Described, truth: Array | None = None) -> str:
    """Verdict, how it was drawn, what is held fixed, and a line for each entry.

    `truth` (k,) is what synthetic data were made of; it stands beside the entries.
    """
    lines = [posterior.verdict, _how(posterior), f"Modes: {searched(posterior.found)}."]
    if truth is not None:
        lines.append("The data are synthetic; `truth` is what they were made of")
    if len(posterior.modes) > 1:
        shares = ", ".join(f"{mode.share:.0%}" for mode in posterior.modes)
        lines.append(f"Least squares finds {len(posterior.modes)} modes, with {shares} of the mass")
    lines.append(str(posterior.held))
    if posterior.held.given:
        lines.append(f"Taken as given by the problem: {', '.join(posterior.held.given)}.")
    lines += list(_intervals(posterior, truth))
    if posterior.size > MOST:
        lines.append(f"and {posterior.size - MOST} entries more")
    return "\n".join(lines)


def _how(posterior: Described) -> str:
    E, S, W, k = posterior.draws.shape
    if posterior.method == "laplace":
        return f"Laplace's approximation, {E * S} independent draws of {k} entries"
    mixing = posterior.mixing
    return (
        f"emcee: {E} ensembles of {W} walkers, {mixing.steps} steps after {mixing.discarded}, "
        f"{mixing.acceptance:.0%} accepted, {posterior.seconds:.1f} s"
        + (", interrupted" if posterior.interrupted else "")
    )


def _intervals(posterior: Described, truth: Array | None) -> Iterator[str]:
    """The table of entries: intervals where they mean something, else how chains went."""
    p, wide = posterior, max([5, *(len(label) for label in posterior.labels[:MOST])])
    some = range(min(p.size, MOST))
    if p.mixed:
        held = p.held.count > 0
        if held:
            yield (
                "The intervals hold only if what is held fixed is known exactly; `if free` is the "
                "sd by J'J if that is left free too, and `ratio` is `if free` over the sd by J'J "
                "with it fixed"
            )
        yield (
            f"{'entry':{wide}} {'mean':>10} {'sd':>9} {'5 %':>10} {'95 %':>10}  {'unit':6}"
            + (f" {'if free':>9} {'ratio':>7}" if held else "")
            + (f" {'truth':>10}" if truth is not None else "")
        ).rstrip()
        ends = p.conditional_interval(0.9)
        for i in some:
            yield (
                f"{p.labels[i]:{wide}} {p.mean[i]:>10.4g} {p.sd[i]:>9.3g} {ends[i, 0]:>10.4g} "
                f"{ends[i, 1]:>10.4g}  {p.units[i]:6}"
                + (f" {p.held.marginal[i]:>9.3g} {p.held.ratios[i]:>7.3g}" if held else "")
                + (f" {truth[i]:>10.4g}" if truth is not None else "")
            ).rstrip()
    elif p.mixing.exact:
        yield "No intervals are given."
    else:
        yield "No intervals are given. The memory of each entry, in steps:"
        for i in np.argsort(-p.mixing.times)[:MOST]:
            yield (
                f"{p.labels[i]:{wide}} {p.mixing.times[i]:>8.0f}   R-hat {p.mixing.scales[i]:.3f}"
            )
