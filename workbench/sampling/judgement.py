"""What draws are worth, of all that is known: the verdict before any interval."""

from workbench.sampling.conditioning import Conditioning
from workbench.sampling.importance import Importance
from workbench.sampling.mixing import Mixing, Verdict
from workbench.sampling.modes import Found


def judged(
    mixing: Mixing,
    found: Found,
    overlooked: tuple[float, float] | None,
    importance: Importance | None,
    held: Conditioning,
) -> tuple[Verdict, str]:
    """The verdict with its reason: the first thing that is wrong, or what was looked at.

    In this order: chains that have not mixed; modes that draws miss (`overlooked`, by their share
    of the mass and of the draws); a Gaussian that does not hold; intervals that are narrow because
    of what was held fixed.
    """
    verdict, why = mixing.judged
    if verdict is not Verdict.USABLE:
        return verdict, why
    if overlooked is not None:
        share, here = overlooked
        return Verdict.MODE_MISSED, (
            f"least squares finds another mode with {share:.0%} of the mass (by Laplace's "
            f"approximation), where {here:.1%} of the draws are. "
            + (
                "Laplace's approximation is of one mode; draw with `sample`"
                if mixing.exact
                else "Begin at the other mode and compare, or add what tells the modes apart"
            )
        )
    if importance is not None and not importance.holds:
        return Verdict.NOT_GAUSSIAN, str(importance)
    if not held.holds:
        mixed = "" if mixing.exact else f"the chains have mixed ({why}), but "
        return Verdict.CONDITIONAL, mixed + held.failed
    told = [why, *([] if importance is None else [str(importance)]), searched(found)]
    return verdict, "; ".join(told)


def searched(found: Found) -> str:
    """How widely other modes were looked for, and how many modes are known."""
    count = len(found.modes)
    if not found.search.starts:
        return str(found.search)
    return f"{found.search}, {'found none' if count == 1 else f'led to {count} modes in all'}"
