"""The plan of a training: which blocks run in which order, and with which sigmas."""

from dataclasses import dataclass, field, replace

from workbench.errors import BadArgument, check_known
from workbench.training.blocks import BLOCKS, BlockOptions
from workbench.training.estimate import Sigmas

Names = tuple[str, ...]  # of blocks, in order
NO_LIMIT = 10**6
# For registrations with noise: digits that the next block changes are not worth their passes.
QUICK = BlockOptions(linear_tolerance=1e-4, together_tolerance=0.1, together_steps=3, products=40)
ROUND = ("regressor", "surfaces", "poses")
REACH = 2  # bones between a vertex and the farthest joint that its blend shapes follow
ROUGH, TIED = 2.5, 0.2  # factors on the sigma of E_D at first, and on that of E_J later


@dataclass(frozen=True)
class Stage:
    """Blocks that are run a number of times, with the same sigmas and options.

    Raises UnknownName for a block that is not in `BLOCKS`.

    Attributes:
        sigmas: the standard deviation of each term.
        blocks: the names of the blocks, in order.
        rounds: how often they are run.
        options: when the blocks stop.
    """

    sigmas: Sigmas
    blocks: tuple[str, ...]
    rounds: int = 1
    options: BlockOptions = field(default_factory=BlockOptions)

    def __post_init__(self) -> None:
        for block in self.blocks:
            check_known("block of training", block, BLOCKS)


@dataclass(frozen=True)
class Plan:
    """The plan of a training: its stages, in order. Raises BadArgument for one without a block.

    Attributes:
        stages: the stages.
        reach: the largest number of bones from a vertex to a joint that changes the surface there,
            see `locality.local_features`; None allows all joints.
    """

    stages: tuple[Stage, ...]
    reach: int | None = None

    def __post_init__(self) -> None:
        if not self.steps:
            raise BadArgument("a plan needs at least one block; `alternation()` is the usual plan")

    @property
    def steps(self) -> list[tuple[Stage, str]]:
        """All blocks in the order in which they run, each with its stage."""
        return [
            (stage, block)
            for stage in self.stages
            for _ in range(stage.rounds)
            for block in stage.blocks
        ]


def alternation(sigmas: Sigmas | None = None, rounds: int = 2, reach: int | None = None) -> Plan:
    """The alternation of the lectures, with all names at once near its end.

    First only templates and joints are fitted, with a larger sigma of the data: skinning without
    blend shapes cannot be right to millimetres. Blend shapes are added when poses are nearly
    right. Then, for a number of rounds, the joints are compared with the regressor that the body
    will have, and no longer with their rings. A vertex is bent by the joints within `reach`
    bones; None allows all joints, as in the paper.
    """
    last = ("together", "weights", "regressor", "surfaces", "poses", "regressor", "surfaces")
    stages = _alternating(sigmas, ("surfaces", "poses"), ROUND, rounds, last)
    return Plan(stages, reach)


def without_blend_shapes(sigmas: Sigmas | None = None, rounds: int = 2) -> Plan:
    """The alternation without pose blend shapes: templates, joints, weights and poses alone.

    What skinning alone leaves of the data is then the cost, and not compensated by 9 (K - 1) free
    directions for every vertex: from registrations that linear blending explains, joints and
    weights are found that blend shapes would hide.
    """
    last = ("skinning", "weights", "regressor", "rest", "poses", "regressor", "rest")
    first, each = ("rest", "poses", "weights"), ("regressor", "rest", "poses")
    return Plan(_alternating(sigmas, first, each, rounds, last))


def _alternating(
    sigmas: Sigmas | None, first: Names, each: Names, rounds: int, last: Names
) -> tuple[Stage, ...]:
    """Templates and poses with a larger sigma of the data, `first`, and then, with joints tied to
    the regressor, rounds of `each`, and `last`.
    """
    held = Sigmas() if sigmas is None else sigmas
    rough = replace(held, data=ROUGH * held.data)
    tied = replace(held, rings=TIED * held.rings)
    return (
        Stage(rough, ("rest", "poses"), 1, QUICK),
        Stage(held, first, 1, QUICK),
        Stage(tied, each, rounds, QUICK),
        Stage(tied, last, 1, QUICK),
    )
