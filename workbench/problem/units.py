"""Whether an expression adds or subtracts quantities of different units, where these are known.

A CasADi symbol carries only a name; the units are those of the blocks that the symbols stand for.
Points of bodies are in metres. A sum has the unit of each of its summands. A product, a quotient or
a function may change the unit, so that nothing is concluded about what it returns:
`observed.symbol / 1000` has no known unit. CasADi leaves out a factor of 1, so that a speed in m/s
may stand for the way of one second: of units that are put together, those are different which
differ in one unit above the line alone, such as m/s and mm/s, or N/m and kN/m.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import casadi as cs

from workbench.blocks import Block, Points
from workbench.errors import BadResidual
from workbench.problem.constraint import Constraint
from workbench.residuals import Residual

NONE = "1"  # the unit of a block of which nobody said one
FACTOR = re.compile(r"([^\W\d_]+|[%°])(?:\^?(-?\d+))?")  # of a unit that is put together of others
METRES = "m"
MOST, DEEPEST = 1_000, 100  # parts of an expression that are looked at, from its end
SUMS = (cs.OP_ADD, cs.OP_SUB)
SAME = (  # operations that move numbers and do not change them
    cs.OP_NEG,
    cs.OP_RESHAPE,
    cs.OP_TRANSPOSE,
    cs.OP_GETNONZEROS,
    cs.OP_HORZCAT,
    cs.OP_VERTCAT,
    cs.OP_HORZREPMAT,
)


@dataclass(frozen=True)
class Measured:
    """The unit of an expression, and the name of a block or of points that it comes from."""

    unit: str
    name: str


def check_units(
    parts: Iterable[Residual | Constraint], blocks: Mapping[str, Block], points: Iterable[Points]
) -> None:
    """Raise BadResidual if a residual or a constraint adds or subtracts different units.

    Both units must be known: those of blocks whose unit is "1" are not, nor those of products.
    """
    known = {b.symbol.__hash__(): Measured(b.unit, b.name) for b in blocks.values()}
    known |= {
        p.symbol.__hash__(): Measured(METRES, p.name) for p in points if p.symbol.shape[0] == 3
    }
    known = {key: one for key, one in known.items() if one.unit != NONE}
    if len({one.unit for one in known.values()}) < 2:
        return
    for part in parts:
        if not (isinstance(part, Residual) and part.by_frame):  # its frames were looked at
            Units(known, f"{type(part).__name__.lower()} {part.name!r}").of(part.expression)


def different(first: str, second: str) -> bool:
    """Whether no number of one unit is a number of the other, as m and mm, or m/s and mm/s.

    Powers must be the same in both but for the name of one unit above the line. Nothing is said of
    m/s and m, since a factor of 1 s may have been left out, nor of N m and J.
    """
    if first == second:
        return False
    parts = [powers(unit) for unit in (first, second)]
    if None in parts:
        return False
    here, there = (dict(part or {}) for part in parts)
    for name in here.keys() & there.keys():
        if here[name] == there[name]:
            del here[name], there[name]
    mine, others = list(here.values()), list(there.values())
    return mine == others and len(mine) == 1 and mine[0] > 0


def powers(unit: str) -> dict[str, int] | None:
    """The powers of the units in `kg m/s^2` or `rad²`; None for a text of another form."""
    found: dict[str, int] = {}
    above, *below = unit.replace("²", "^2").replace("³", "^3").split("/")
    for sign, text in ((1, above), *((-1, one) for one in below)):
        for factor in re.split(r"[\s*·]+", text.strip()):
            whole = FACTOR.fullmatch(factor)
            if whole:
                found[whole[1]] = found.get(whole[1], 0) + sign * int(whole[2] or 1)
            elif factor != "1":
                return None
    return found


@dataclass
class Units:
    """The units of the parts of one expression, each found once.

    Attributes:
        known: the units of symbols, by their hash.
        what: what the expression is, for the error.
        found: the parts that were looked at, by their hash.
    """

    known: Mapping[int, Measured]
    what: str
    found: dict[int, Measured | None] = field(default_factory=dict)

    def of(self, part: cs.MX, depth: int = 0) -> Measured | None:
        """The unit of a part, or None where it is not known. Raises BadResidual."""
        key = part.__hash__()
        if key not in self.found:
            self.found[key] = None  # also of all that is not looked at any more
            if len(self.found) <= MOST and depth < DEEPEST:
                self.found[key] = self._of(part, depth)
        return self.found[key]

    def _of(self, part: cs.MX, depth: int) -> Measured | None:
        if part.is_symbolic():
            return self.known.get(part.__hash__())
        units = [self.of(part.dep(i), depth + 1) for i in range(part.n_dep())]
        if part.op() in SUMS:
            first, second = units
            if first and second and different(first.unit, second.unit):
                raise BadResidual(self._said(first, second))
            return None if first and second and first.unit != second.unit else first or second
        alike = len({one.unit if one else None for one in units}) == 1
        return units[0] if part.op() in SAME and alike else None

    def _said(self, first: Measured, second: Measured) -> str:
        return (
            f"{self.what} adds or subtracts {first.name!r}, in {first.unit}, and {second.name!r}, "
            f"in {second.unit}; give both in one unit, or convert one where it is read, as in "
            "observed.symbol / 1000 from mm to m. Where two spellings mean one unit, take one"
        )
