"""A hyperparameter chosen by its errors on subjects that are held out from training."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Selection:
    """The values of a hyperparameter that were tried, and their errors.

    Attributes:
        tried: the values.
        errors: the root mean square distance of vertices, in mm, on the subjects held out.
    """

    tried: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def chosen(self) -> float:
        """The value with the smallest error."""
        return self.tried[int(np.argmin(self.errors))]
