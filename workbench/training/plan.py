"""What training does in which order, and how tightly it holds each term meanwhile."""

from dataclasses import dataclass, field, replace
from math import inf

from workbench.training.blocks import Effort
from workbench.training.estimate import Sigmas
from workbench.training.first_guess import MOST_WEIGHTS

NO_LIMIT = 10**6
# Of registrations with noise: digits beyond the next block's doing are not worth their passes.
QUICK = Effort(linear_tolerance=1e-4, together_tolerance=0.1, together_steps=3, products=40)
ROUND = ("regressor", "surfaces", "poses")
FREE_ROUND = ("surfaces", "weights", "poses")
REACH = 2  # bones between a vertex and the farthest joint that its blend shapes follow
ROUGH, TIED = 2.5, 0.2  # of what is ordinary in E_D at first, and in E_J later
TO_THE_END = 3000  # products in a step: what the data hardly notice takes that many
EXACT = 1e-9  # m, rms of E_D: a thousandth of what is asked of the model


@dataclass(frozen=True)
class Stage:
    """Blocks in order, so many times, under these sigmas and with this effort."""

    sigmas: Sigmas
    blocks: tuple[str, ...]
    rounds: int = 1
    effort: Effort = field(default_factory=Effort)


@dataclass(frozen=True)
class Plan:
    """Stages in order."""

    stages: tuple[Stage, ...]
    reach: int | None = None  # bones: see noticing.noticed; None: blend shapes of all joints

    @property
    def steps(self) -> list[tuple[Stage, str]]:
        """Every block that will run, in order, with the stage that it is in."""
        return [
            (stage, block)
            for stage in self.stages
            for _ in range(stage.rounds)
            for block in stage.blocks
        ]


def alternation(sigmas: Sigmas | None = None, rounds: int = 2, reach: int | None = None) -> Plan:
    """The lectures' alternation, and all names at once near its end.

    First templates and joints alone, the data being trusted less: skinning without blend shapes
    cannot be right to millimetres. Blend shapes come in when poses are near. Then the joints are
    held to the regressor that a body has in the end, and no longer to their rings; so many
    rounds of that. Blend shapes follow joints within `reach` bones; as in the paper, all.
    """
    held = Sigmas() if sigmas is None else sigmas
    rough = replace(held, data=ROUGH * held.data)
    tied = replace(held, rings=TIED * held.rings)
    last = ("together", "weights", "regressor", "surfaces", "poses", "regressor", "surfaces")
    return Plan(
        (
            Stage(rough, ("rest", "poses"), 1, QUICK),
            Stage(held, ("surfaces", "poses"), 1, QUICK),
            Stage(tied, ROUND, rounds, QUICK),
            Stage(tied, last, 1, QUICK),
        ),
        reach,
    )


def annealed(sigmas: Sigmas, factors: tuple[float, ...] = (1.0, 10.0, 1e2, 1e3, inf)) -> Plan:
    """Every term but E_D loosened to nothing, for registrations without noise.

    Each lambda falls with the square of its factor; the end is a fit of the data alone. How
    many weights a vertex has is limited at the end only: which of them are zero shows by then.
    Steps are cut short until then, and the last ones are not: joints that hardly any vertex
    notices come right last.
    """
    free = Effort(together_tolerance=1e-3, together_steps=12, most_weights=NO_LIMIT)
    first = Stage(sigmas, FREE_ROUND, 3, free)
    rest = [Stage(sigmas.loosened(f), ("weights", "together"), effort=free) for f in factors]
    limited = replace(free, most_weights=MOST_WEIGHTS, products=TO_THE_END, enough=EXACT)
    last = Stage(sigmas.loosened(inf), ("cut", "weights", "together"), effort=limited)
    return Plan((first, *rest, last))


def without(sigmas: Sigmas, *terms: str) -> Sigmas:
    """The same with some terms switched off, by the names of their sigmas."""
    return replace(sigmas, **dict.fromkeys(terms, inf))
