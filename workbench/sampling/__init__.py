"""A problem's posterior: sampled by emcee, or approximated by Laplace; and what draws are worth."""

from workbench.sampling.comparison import Compared, beside_laplace
from workbench.sampling.conditioning import Conditioning
from workbench.sampling.ensembles import Progress
from workbench.sampling.entries import blocks_of
from workbench.sampling.following import following
from workbench.sampling.laplace import laplace
from workbench.sampling.mixing import Mixing, Verdict
from workbench.sampling.modes import searched
from workbench.sampling.moves import MOVES, BiasedMove, Snooker
from workbench.sampling.posterior import NotConverged, Posterior
from workbench.sampling.sample import sample
from workbench.sampling.subspace import Improper, Names, conditional, directions, fixed
from workbench.sampling.text import summary

__all__ = [
    "MOVES",
    "BiasedMove",
    "Compared",
    "Conditioning",
    "Improper",
    "Mixing",
    "Names",
    "NotConverged",
    "Posterior",
    "Progress",
    "Snooker",
    "Verdict",
    "beside_laplace",
    "blocks_of",
    "conditional",
    "directions",
    "fixed",
    "following",
    "laplace",
    "sample",
    "searched",
    "summary",
]
