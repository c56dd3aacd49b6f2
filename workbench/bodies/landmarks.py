"""Named points on a mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from workbench.blocks.checks import texts
from workbench.bodies.readonly import readonly_matrix
from workbench.errors import BadBody


@dataclass(frozen=True, eq=False)
class Landmarks:
    """M named points, each a weighted mean of the vertices of a surface, such as the nose.

    Raises NotNumbers for a regressor that holds no numbers, and BadBody for names that are not
    texts.

    Attributes:
        names: the name of each point.
        regressor: (M, N) the weights of N vertices; every row sums to one.
    """

    names: tuple[str, ...]
    regressor: csr_array

    def __post_init__(self) -> None:
        regressor = readonly_matrix("the regressor of landmarks", self.regressor)
        names = texts("the names of landmarks", self.names, BadBody)
        self.__dict__.update(names=names, regressor=regressor)

    @property
    def of_vertices(self) -> tuple[csr_array, list[int]]:
        """The regressor (M, n) of the vertices that carry weight, and these, n of them."""
        columns = self.regressor.tocsc()
        used = np.flatnonzero(np.diff(columns.indptr)).tolist()
        return columns[:, used].tocsr(), used

    def __reduce__(self) -> tuple[Any, ...]:
        return Landmarks, (self.names, self.regressor)  # so that a copy is read-only as well
