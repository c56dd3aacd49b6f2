"""What a problem is given: its parts, and names, held against the blocks that it reads."""

from collections.abc import Collection, Iterable

from workbench.blocks import Block
from workbench.blocks.checks import several
from workbench.errors import BadBlock, BadConstraint, BadResidual, UnknownName, UnreadBlock
from workbench.problem.constraint import Constraint
from workbench.residuals import Residual


def parts_of(
    residuals: object, constraints: object, blocks: object
) -> tuple[tuple[Residual, ...], tuple[Constraint, ...], tuple[Block, ...]]:
    """What a problem is made of, as tuples. Raises BadResidual, BadConstraint or BadBlock."""
    return (
        several("the residuals of a problem", residuals, Residual, BadResidual),
        several("the constraints of a problem", constraints, Constraint, BadConstraint),
        several("the blocks of a problem", blocks, Block, BadBlock),
    )


def check_names(asked: Iterable[str], read: Collection[str], named: Iterable[Block]) -> None:
    """Raise UnreadBlock for a name among the blocks that are `named` but not read, UnknownName for
    one that is known from nowhere.
    """
    described = {block.name for block in named}
    for name in asked:
        if name in read:
            continue
        if name in described:
            raise UnreadBlock(name, read)
        more = "a block that no residual and no constraint reads can be neither free nor bounded"
        raise UnknownName("block", name, read, more=more)
