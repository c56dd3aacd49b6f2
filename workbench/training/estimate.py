"""What training finds, and how far from ordinary each of its terms may be."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.training.posing import Posing

Array = NDArray[np.float64]
Change = dict[str, Array]
NAMES = ("templates", "posedirs", "joints", "poses", "weights")


@dataclass(frozen=True, eq=False)
class Estimate:
    """S subjects in J registrations of N vertices on K joints; F = 9 (K - 1) pose features."""

    templates: Array  # (S, N, 3) m: each subject at rest
    joints: Array  # (S, K, 3) m: each subject's joints at rest
    posedirs: Array  # (N, 3, F) m per unit of pose feature
    weights: Array  # (N, K), rows sum to one
    poses: Array  # (J, K, 3) rad
    parents: tuple[int, ...]
    regressor: csr_array | None = None  # (K, N): joints from templates, once it is learned

    @cached_property
    def posing(self) -> Posing:
        """The rotations of every registration."""
        return Posing.of(self.poses, self.parents)

    def moved(self, change: Change, share: float = 1.0) -> "Estimate":
        """After a step; poses are turned, everything else is added."""
        found = {n: getattr(self, n) + share * d for n, d in change.items() if n != "poses"}
        if "poses" in change:
            found["poses"] = self.posing.turned(share * change["poses"]).poses
        return replace(self, **found)

    def zero_change(self, names: tuple[str, ...]) -> Change:
        """No step."""
        return {name: np.zeros_like(getattr(self, name)) for name in names}

    def arrays(self) -> dict[str, Array]:
        """By name, as a checkpoint stores them."""
        found = {name: getattr(self, name) for name in NAMES}
        return found if self.regressor is None else found | {"regressor": self.regressor.toarray()}


@dataclass(frozen=True)
class Sigmas:
    """What is ordinary in each term; infinite switches a term off.

    The lectures' weights are ratios of variances: lambda_P = (data / posedirs)^2 and so on, so
    that E = E_D + lambda_Y E_Y + lambda_J E_J + lambda_P E_P + lambda_W E_W is 2 data^2 times
    the cost.
    """

    data: float = 0.002  # m, E_D: a registration from the model
    symmetry: float = 0.01  # m, E_Y: a template from its mirror image
    joint_symmetry: float = 0.01  # m, E_Y: joints from theirs
    rings: float = 0.01  # m, E_J: joints from the middle of their ring of vertices, later regressed
    posedirs: float = 0.01  # m per unit of feature, E_P: about zero
    weights: float = 0.3  # E_W: about the initial ones
    subjects: float = 0.03  # m, E_T: a template from the first one

    @property
    def lambdas(self) -> dict[str, float]:
        """The lectures' weights."""
        names = (f.name for f in fields(self) if f.name != "data")
        return {name: (self.data / getattr(self, name)) ** 2 for name in names}

    def loosened(self, factor: float) -> "Sigmas":
        """Every term but the data's this many times as loose."""
        names = [f.name for f in fields(self) if f.name != "data"]
        return replace(self, **{name: factor * getattr(self, name) for name in names})


TERMS = tuple(f.name for f in fields(Sigmas) if f.name != "data")
NO_TERMS = dict.fromkeys(TERMS, inf)
