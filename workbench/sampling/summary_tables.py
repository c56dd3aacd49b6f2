"""The lines of a posterior's summary in letters: how draws were made, entries, times."""

from collections.abc import Iterator

import numpy as np

from workbench.arrays import Array
from workbench.sampling.conditioning import Conditioning
from workbench.sampling.contraction import contraction_bar
from workbench.sampling.mixing import Mixing


def how_sampled(method: str, mixing: Mixing, seconds: float, interrupted: bool) -> str:
    """How many ensembles, walkers and steps there were, and how long they took."""
    E, S, W, k = mixing.draws.shape
    if method == "laplace":
        return f"Laplace's approximation, {E * S} independent draws of {k} entries"
    how = f"{E} ensembles of {W} walkers"
    if method == "hamiltonian":
        how = f"Hamiltonian Monte Carlo of all free numbers: {E} groups of {W} chains"
    return (
        f"{'emcee: ' if method == 'emcee' else ''}{how}, {mixing.steps} steps after "
        f"{mixing.discarded} discarded, {mixing.acceptance:.0%} accepted, {seconds:.1f} s"
        + (", interrupted" if interrupted else "")
    )


def entry_table(
    labels: tuple[str, ...],
    units: tuple[str, ...],
    numbers: Array,
    held: Conditioning | None,
    truth: Array | None,
    bars: Array,
) -> Iterator[str]:
    """A line for each of some entries, after lines that say what the columns are.

    The columns of `numbers` (k, 4) are mean, sd and the ends of the 90 % interval. `held` is given
    if intervals are conditional. `truth` (k,) is what synthetic data were made of, and `bars` (k,)
    the contractions, NaN where they are not known.
    """
    wide, known = max([5, *map(len, labels)]), bool(np.isfinite(bars).any())
    if held is not None:
        yield (
            "The intervals are conditional: they hold only if what is held fixed is known "
            "exactly. `marginal` is the sd by J'J if it is free too, and `ratio` is `marginal` "
            "over the sd by J'J with it fixed"
        )
    if known:
        yield "`contraction` is 1 - sd / (sd of the prior): 0 if the data said nothing"
    yield (
        f"{'entry':{wide}} {'mean':>10} {'sd':>9} {'5 %':>10} {'95 %':>10}  {'unit':6}"
        + ("" if held is None else f" {'marginal':>9} {'ratio':>7}  {'interval':11}")
        + ("" if truth is None else f" {'truth':>10}")
        + ("  contraction" if known else "")
    ).rstrip()
    for i, (label, (mean, sd, low, high)) in enumerate(zip(labels, numbers, strict=False)):
        line = f"{label:{wide}} {mean:>10.4g} {sd:>9.3g} {low:>10.4g} {high:>10.4g}  {units[i]:6}"
        if held is not None:
            line += f" {held.marginal[i]:>9.3g} {held.ratios[i]:>7.3g}  conditional"
        if truth is not None:
            line += f" {truth[i]:>10.4g}"
        if known:
            line += f"  {contraction_bar(float(bars[i]))}"
        yield line.rstrip()


def time_table(mixing: Mixing, most: int) -> Iterator[str]:
    """That there are no intervals; of chains, the entries with the longest times."""
    if mixing.exact:
        yield "No intervals are given."
        return
    wide = max([5, *(len(label) for label in mixing.labels[:most])])
    yield "No intervals are given. The autocorrelation time of each entry, in steps:"
    for i in np.argsort(-mixing.times)[:most]:
        yield (f"{mixing.labels[i]:{wide}} {mixing.times[i]:>8.0f}   R-hat {mixing.scales[i]:.3f}")
