"""A problem's posterior: sampled by emcee, or approximated by Laplace; and what draws are worth.

Intervals are marginal unless conditional ones are asked for: with at most 21 free numbers all are
sampled by emcee; with more, Laplace's approximation stands for those that are not named, if
importance weights confirm it with a clear margin, and otherwise all are drawn by Hamiltonian Monte
Carlo. To be read in this order: `sample`, `subspace`, `log_density`, `modes`, `ensembles`,
`mixing`, `posterior`; then `laplace` and `importance`, `hamiltonian`, `conditioning`.
"""

from workbench.sampling.conditioning import (
    Conditioning,
    contraction,
    prior_deviations,
)
from workbench.sampling.ensembles import SamplingProgress
from workbench.sampling.importance import Importance
from workbench.sampling.laplace import EntryComparison, compared_with_laplace, laplace
from workbench.sampling.mixing import Mixing, Usability, integrated_time
from workbench.sampling.modes import Mode, ModeSearch
from workbench.sampling.posterior import NotConverged, Posterior
from workbench.sampling.posterior_mean import PosteriorMean, posterior_mean
from workbench.sampling.sample import sample
from workbench.sampling.subspace import (
    Improper,
    Names,
    Subspace,
    fixed,
    integrated,
    sampling_blocks,
)

__all__ = [
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
    "SamplingProgress",
    "Subspace",
    "Usability",
    "compared_with_laplace",
    "contraction",
    "fixed",
    "integrated",
    "integrated_time",
    "laplace",
    "posterior_mean",
    "prior_deviations",
    "sample",
    "sampling_blocks",
]
