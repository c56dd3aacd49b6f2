"""A problem's posterior: sampled by emcee, or approximated by Laplace; and what draws are worth.

Draws are usable if the chains have mixed, no mode is missing, and nothing that matters is held
fixed. Intervals are marginal unless conditional ones are asked for: with at most 21 free numbers
all are sampled by emcee; with more, Laplace's approximation stands for those that are not named, if
importance weights confirm it with a clear margin, and otherwise all are drawn by Hamiltonian Monte
Carlo. Walkers of one ensemble are not independent chains, so R-hat is computed between ensembles
(`mixing`). Modules: what is sampled (`subspace`), its density (`log_density`) and limits
(`feasible`), moves, runs and checkpoints (`ensembles`), modes (`descent`, `modes`), the verdict
(`posterior`).
"""

from workbench.sampling.conditioning import Conditioning
from workbench.sampling.contraction import contraction, contraction_bar, prior_deviations
from workbench.sampling.descent import Mode
from workbench.sampling.determined import determined
from workbench.sampling.ensemble_settings import Progress
from workbench.sampling.importance import Importance
from workbench.sampling.laplace import EntryComparison, compared_with_laplace, laplace
from workbench.sampling.limbs import sampling_blocks
from workbench.sampling.mixing import Mixing, Usability
from workbench.sampling.modes import ModeSearch, search_in_words
from workbench.sampling.moves import MOVES, BiasedMove, Snooker
from workbench.sampling.posterior import NotConverged, Posterior
from workbench.sampling.posterior_mean import PosteriorMean, posterior_mean
from workbench.sampling.sample import sample
from workbench.sampling.subspace import Improper, Names, Subspace, directions, fixed, integrated

__all__ = [
    "MOVES",
    "BiasedMove",
    "Conditioning",
    "EntryComparison",
    "Importance",
    "Improper",
    "Mixing",
    "Mode",
    "ModeSearch",
    "Names",
    "NotConverged",
    "Posterior",
    "PosteriorMean",
    "Progress",
    "Snooker",
    "Subspace",
    "Usability",
    "compared_with_laplace",
    "contraction",
    "contraction_bar",
    "determined",
    "directions",
    "fixed",
    "integrated",
    "laplace",
    "posterior_mean",
    "prior_deviations",
    "sample",
    "sampling_blocks",
    "search_in_words",
]
