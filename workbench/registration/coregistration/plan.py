"""What a coregistration does: its rounds, sigmas, blocks, and how the model takes the scans."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

from workbench.arrays import Index
from workbench.errors import BadArgument
from workbench.registration.coregistration.scan_block import ScanPull
from workbench.registration.coregistration.state import State
from workbench.registration.free_vertices import CLOSE
from workbench.residuals import Form
from workbench.training.blocks import BlockOptions
from workbench.training.estimate import Sigmas
from workbench.training.registrations import InMemory

EDGES = 0.01  # m
SETTINGS = Sigmas(data=0.003, rings=0.002, posedirs=0.001, weights=0.05)

Observe = Callable[[State, Index], InMemory]
"""Scans as registrations for the model's blocks, from a state and the subjects (J,) of scans."""


def soft(state: State, subject: Index) -> InMemory:
    """Scans as they are: targets, with a confidence for each direction of each vertex."""
    return InMemory(state.targets, subject, state.confidence)


def hard(state: State, subject: Index) -> InMemory:
    """The registrations as if they had been observed, hidden vertices included."""
    return InMemory(state.vertices, subject)


@dataclass(frozen=True)
class CoregistrationPlan:
    """What a coregistration does, and how strongly its terms hold.

    Raises BadArgument for no rounds.

    Attributes:
        rounds: how often registrations and the model are found in turn; at the end the
            registrations are found once more.
        sigmas: of the terms; `data` is sigma_C, the coupling of registrations and model, in m.
        edges: sigma in m of the edges of a template, beyond what betas explain (E_T); None holds
            every vertex of a template for itself, by `sigmas.subjects`.
        blocks: those of training that make up the step of the model; none holds it.
        observe: how scans are seen by the model's blocks, `soft` or `hard`.
        terms: how a scan pulls, together E_S.
        options: when the inner iterations of the model's blocks stop.
    """

    rounds: int = 4
    sigmas: Sigmas = SETTINGS
    edges: float | None = EDGES
    bends: float = inf
    blocks: tuple[str, ...] = ("people", "surfaces", "regressor")
    observe: Observe = soft
    terms: tuple[ScanPull, ...] = (CLOSE,)
    options: BlockOptions = field(default_factory=lambda: BlockOptions(linear_tolerance=1e-3))

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise BadArgument(f"a coregistration has one round or more, not {self.rounds}")

    def written(self) -> str:
        """The plan in letters, the same in every process, by which checkpoints are known."""
        pulls = tuple((type(term).__qualname__, sorted(vars(term).items())) for term in self.terms)
        rest = (self.rounds, self.sigmas, self.edges, self.bends, self.blocks, self.options)
        return repr((*rest, _named(self.observe), _named(pulls)))


def _named(value: object) -> object:
    """A value without addresses in memory: functions by their names, and forms by their sizes."""
    if isinstance(value, tuple | list):
        return tuple(_named(one) for one in value)
    if isinstance(value, Form):
        return value.numbers
    return getattr(value, "__qualname__", value)
