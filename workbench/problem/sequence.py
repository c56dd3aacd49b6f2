"""Many similar problems as one: the frames of a video or a motion, the scans of one person.

A sequence is a `Problem` whose residuals are those of the frames, stacked; its graph is CasADi's
map of one frame. Numbers come from `FrameChain`. The Jacobian is a `BlockMatrix` with dense blocks
for frames, its normal equations a `BandedMatrix` with the shared unknowns as a border; where a band
would be mostly zeros (free meshes, or a residual from the last frame to the first), they are
ordinary sparse matrices.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.checks import several, texts
from workbench.blocks.composed_points import FrameBlocks, framed
from workbench.errors import BadArgument, BadConstraint, BadResidual, UnknownName
from workbench.problem.constraints import Constraint
from workbench.problem.problem import Problem
from workbench.residuals import Residual
from workbench.residuals.sequences import Between, Frames

Part = TypeVar("Part", Residual, Constraint)


def sequence(
    frames: Iterable[Problem],
    *,
    shared: str | Iterable[str] = (),
    between: Iterable[Between] = (),
) -> Problem:
    """The problem of all frames at once: their costs and the residuals `between` them, summed up.

        video = sequence([frame] * 200, shared=("betas",), between=[smooth("pose", sigma=0.1)])

    Every frame has its own pose, observations and other blocks, which are one block of the
    sequence, `pose` (T, K, 3), whose entries are called `pose[12, left_knee, x]`. A block that is
    named in `shared`, free or fixed, is one and the same for all frames: the shape of a person, the
    focal length of a camera. A residual that reads nothing but shared blocks, such as a prior on
    betas, is taken once if all frames have the same Residual; if frames have different ones under
    the same name, all of them count. The frames may be one problem, repeated, or problems that
    differ in their residuals. The name and the shape of a block, and whether it is free, must be
    the same in all frames that read it.

    Frames meet only in shared blocks and in the residuals `between` them, so that time and memory
    are proportional to the number of frames.

    Raises BadArgument for frames that do not go together, UnknownName for a shared block that no
    frame reads, and what Problem raises.
    """
    problems = several("the frames of a sequence", frames, Problem, BadArgument)
    if not problems:
        raise BadArgument("a sequence needs at least one frame")
    if any(block.framed for _, problem in _distinct(problems) for block in problem.known.values()):
        raise BadArgument(
            "one of the frames is a sequence itself; make one sequence of all the single frames"
        )
    names = texts("the names of shared blocks", shared)
    whole = Frames(_blocks(problems, names))
    once = {name: block for name, block in whole.blocks.blocks.items() if not block.framed}
    residuals = _gathered(
        problems,
        lambda problem: problem.residuals,
        once,
        lambda parts: whole.residual({t: (part, problems[t].known) for t, part in parts.items()}),
    )
    constraints = _gathered(
        problems,
        lambda problem: problem.constraints,
        once,
        lambda parts: _stacked_constraint(whole, problems, parts),
    )
    if callable(between) or not isinstance(between, Iterable):
        raise BadArgument("what is between frames is a list of functions; put the one into a list")
    for link in between:
        if not callable(link):
            raise BadArgument(
                "what is between frames is a function from Frames to a Residual, such as "
                f"smooth('pose', sigma=0.1), not something of type {type(link).__name__}"
            )
        residual = link(whole)
        if not isinstance(residual, Residual):
            raise BadResidual(
                "what is between frames makes a Residual of them, not something of type "
                f"{type(residual).__name__}"
            )
        residuals.append(residual)
    free, blocks = _free(problems, whole.blocks), tuple(whole.blocks.blocks.values())
    return Problem(residuals, free, _bounds(problems, whole.blocks), blocks, constraints)


def _blocks(problems: Sequence[Problem], shared: Sequence[str]) -> FrameBlocks:
    """The blocks of the sequence. Raises BadArgument where frames have other shapes."""
    first: dict[str, tuple[int, Block]] = {}
    for t, problem in _distinct(problems):
        for name, block in problem.known.items():
            s, known = first.setdefault(name, (t, block))
            if known.shape != block.shape:
                raise BadArgument(
                    f"block {name!r} has the shape {block.shape} in frame {t} and {known.shape} in "
                    f"frame {s}; a block has one shape in all frames"
                )
    for name in shared:
        if name not in first:
            raise UnknownName("block", name, first, more="a shared block is one that a frame reads")
    return FrameBlocks(
        len(problems),
        {
            name: block if name in shared else framed(block, len(problems))
            for name, (_, block) in first.items()
        },
    )


def _distinct(problems: Sequence[Problem]) -> list[tuple[int, Problem]]:
    """Each problem once, with the first frame that it stands for."""
    first: dict[int, tuple[int, Problem]] = {}
    for t, problem in enumerate(problems):
        first.setdefault(id(problem), (t, problem))
    return list(first.values())


def _gathered(
    problems: Sequence[Problem],
    of: Callable[[Problem], Sequence[Part]],
    once: dict[str, Block],
    stack: Callable[[dict[int, Part]], Part],
) -> list[Part]:
    """Residuals or constraints that have one name in all frames, stacked into one.

    Those that read only shared blocks, which are in `once`, are taken once.
    """
    by_name: dict[str, dict[int, Part]] = {}
    for t, problem in enumerate(problems):
        for part in of(problem):
            by_name.setdefault(part.name, {})[t] = part
    gathered = []
    for parts in by_name.values():
        t, first = next(iter(parts.items()))
        same = len({id(part) for part in parts.values()}) == 1
        if not once.keys() >= set(first.reads):
            gathered.append(stack(parts))
        elif not same:  # every different one once
            first_frames = {id(part): t for t, part in reversed(parts.items())}
            gathered.append(stack({t: parts[t] for t in sorted(first_frames.values())}))
        elif all(cs.is_equal(problems[t].known[n].symbol, once[n].symbol) for n in first.reads):
            gathered.append(first)
        else:  # the frame has its own symbols for shared blocks
            gathered.append(stack({t: first}))
    return gathered


def _stacked_constraint(
    whole: Frames, problems: Sequence[Problem], parts: dict[int, Constraint]
) -> Constraint:
    """The constraints of frames that have one name, as one, with the smallest tolerance.

    Raises BadConstraint where their units differ.
    """
    columns = {t: (c.expression, problems[t].known, c.points) for t, c in parts.items()}
    expression, points = whole.stacked(columns)
    first_frame = min(parts)
    first = parts[first_frame]
    for t, part in parts.items():
        if part.unit != first.unit:
            raise BadConstraint(
                f"constraint {part.name!r} has the unit {part.unit} in frame {t} and {first.unit} "
                f"in frame {first_frame}; call it by another name there"
            )
    lower, upper = zip(*(parts[t].limits for t in sorted(parts)), strict=True)
    return Constraint(
        first.name,
        expression,
        np.concatenate(lower),
        np.concatenate(upper),
        first.unit,
        points,
        min(c.tolerance for c in parts.values()),
    )


def _free(problems: Sequence[Problem], blocks: FrameBlocks) -> list[str]:
    """Names of the free entries in the sequence. Raises BadArgument where frames disagree."""
    free_places: dict[str, tuple[int, tuple[int, ...]]] = {}  # and the first frame
    for t, problem in _distinct(problems):
        for name in problem.known:
            places = tuple(problem.free[name].places) if name in problem.free.names else ()
            s, known = free_places.setdefault(name, (t, places))
            if known != places:
                raise BadArgument(
                    f"block {name!r} is not free in the same entries in frame {t} as in frame {s}; "
                    "free it alike, or hold entries of single frames afterwards by freeing(...)"
                )
    order = dict.fromkeys(n for _, problem in _distinct(problems) for n in problem.free.names)
    names = []
    for name in order:
        block, (_, places) = blocks[name], free_places[name]
        size = block.size // blocks.count if block.framed else block.size
        if len(places) == size:
            names.append(name)
            continue
        frames = range(blocks.count) if block.framed else range(1)
        names += [name + block.entry(t * size + i) for t in frames for i in places]
    return names


def _bounds(
    problems: Sequence[Problem], blocks: FrameBlocks
) -> dict[str, tuple[ArrayLike, ArrayLike]]:
    """The bounds of all frames; for a shared block, the narrowest."""
    low: dict[str, Array] = {}
    high: dict[str, Array] = {}
    for t, problem in enumerate(problems):
        if not problem.bounded:
            continue
        for part in problem.free.blocks:
            at, block = problem.free.slices[part.name], blocks[part.name]
            lower = low.setdefault(part.name, np.full(block.shape, -np.inf)).reshape(-1)
            upper = high.setdefault(part.name, np.full(block.shape, np.inf)).reshape(-1)
            places = np.array(part.places, dtype=np.int64)
            places += t * part.base.size if block.framed else 0
            lower[places] = np.maximum(lower[places], problem.lower[at])
            upper[places] = np.minimum(upper[places], problem.upper[at])
    limited = [n for n in low if np.isfinite(low[n]).any() or np.isfinite(high[n]).any()]
    return {name: (low[name], high[name]) for name in limited}
