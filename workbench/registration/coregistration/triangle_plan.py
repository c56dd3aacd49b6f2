"""What a coregistration of triangles does, and how strongly its terms hold."""

from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from workbench.errors import BadArgument
from workbench.registration.free_vertices import CLOSE, TOGETHER
from workbench.registration.scan_term import ScanTerm
from workbench.solvers import Solver


@dataclass(frozen=True)
class TrianglePlan:
    """What a coregistration of triangles does, and how strongly its terms hold.

    Raises BadArgument for no rounds, and for a sigma or weight that is not above zero.

    Attributes:
        rounds: how often the model and the registrations are found in turn.
        coupling: sigma_C in m, of each coordinate of an edge.
        neighbours: sigma_D of what the entries of D differ by between neighbouring faces.
        bends: sigma_Q of an entry of posedirs, per rad.
        weight: lambda_C.
        symmetric: whether lambda_C multiplies the priors of poses, D and Q as it does E_C.
        blocks: which parts of the model are found, of persons and bends; none holds it.
        term: how a scan pulls, E_S.
        solver: what finds vertices and pose.
        settled: a scan is done after a step that lowers its cost by less than this share of it.
    """

    rounds: int = 4
    coupling: float = 0.01
    neighbours: float = 0.05
    bends: float = 0.1
    weight: float = 1.0
    symmetric: bool = True
    blocks: tuple[str, ...] = ("persons", "bends")
    term: ScanTerm = CLOSE
    solver: Solver = field(default=TOGETHER)
    settled: float = 1e-3

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise BadArgument(f"a coregistration has one round or more, not {self.rounds}")
        for name in ("coupling", "neighbours", "bends", "weight"):
            if not 0 < getattr(self, name) < np.inf:
                raise BadArgument(f"{name} is above zero, not {getattr(self, name):g}")
        if unknown := set(self.blocks) - {"persons", "bends"}:
            raise BadArgument(f"no block is called {sorted(unknown)[0]!r}; give persons and bends")

    @property
    def of_edges(self) -> float:
        """Sigma in m of a coordinate of an edge, lambda_C included."""
        return self.coupling / sqrt(self.weight)

    @property
    def of_priors(self) -> float:
        """What multiplies the priors."""
        return self.weight if self.symmetric else 1.0
