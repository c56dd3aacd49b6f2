"""The posterior that is looked at: a person on a beam, seen by one camera."""

from dataclasses import dataclass

import workbench as wb
from workbench.experiments import find
from workbench.fitting.setup import Setup


def arm(side: str) -> tuple[str, ...]:
    """The nine rotations of one."""
    return tuple(f"pose[{side}_{joint}]" for joint in ("shoulder", "elbow", "wrist"))


BLOCKS = {
    "betas": ("betas",),
    "left arm": arm("left"),
    "betas, trans": ("betas", "trans"),
    "orientation, betas, trans": ("pose[pelvis]", "betas", "trans"),
    "both arms, trans": (*arm("left"), *arm("right"), "trans"),
}


@dataclass(frozen=True, eq=False)
class Fitted:
    """A setup at its answer."""

    setup: Setup
    values: wb.Values

    @property
    def problem(self) -> wb.Problem:
        """The problem."""
        return self.setup.problem


def monocular() -> Fitted:
    """`balance-monocular`, solved."""
    setup = find("balance-monocular").setup()
    return Fitted(setup, setup.start | wb.solve(setup.problem, setup.start).values)
