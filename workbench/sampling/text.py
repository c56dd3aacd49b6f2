"""A posterior in words; the verdict first, and no interval without it."""

import numpy as np

from workbench.sampling.posterior import Posterior

MOST = 40  # entries in a summary


def summary(posterior: Posterior) -> str:
    """Verdict, how it was drawn, and a line for each entry."""
    E, S, W, k = posterior.draws.shape
    lines = [posterior.verdict]
    if posterior.method == "laplace":
        lines.append(f"Laplace's approximation, {E * S} independent draws of {k} entries")
    else:
        mixing = posterior.mixing
        lines.append(
            f"emcee: {E} ensembles of {W} walkers, {mixing.steps} steps after {mixing.discarded}, "
            f"{mixing.acceptance:.0%} accepted, {posterior.seconds:.1f} s"
            + (", interrupted" if posterior.interrupted else "")
        )
    if len(posterior.modes) > 1:
        shares = ", ".join(f"{mode.share:.0%}" for mode in posterior.modes)
        lines.append(f"least squares finds {len(posterior.modes)} modes, with {shares} of the mass")
    wide = max([5, *(len(label) for label in posterior.labels[:MOST])])
    if posterior.usable:
        lines.append(f"{'entry':{wide}} {'mean':>10} {'sd':>9} {'5 %':>10} {'95 %':>10}  unit")
        ends = posterior.interval(0.9)
        rows = zip(
            posterior.labels, posterior.mean, posterior.sd, ends, posterior.units, strict=True
        )
        lines += [
            f"{label:{wide}} {mean:>10.4g} {sd:>9.3g} {low:>10.4g} {high:>10.4g}  {unit}"
            for label, mean, sd, (low, high), unit in list(rows)[:MOST]
        ]
    else:
        lines.append("No intervals are given. The memory of each entry, in steps:")
        order = np.argsort(-posterior.mixing.times)[:MOST]
        lines += [
            f"{posterior.labels[i]:{wide}} {posterior.mixing.times[i]:>8.0f}"
            f"   R-hat {posterior.mixing.scales[i]:.3f}"
            for i in order
        ]
    if k > MOST:
        lines.append(f"and {k - MOST} entries more")
    return "\n".join(lines)
