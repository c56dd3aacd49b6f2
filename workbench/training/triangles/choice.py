"""How strongly a model is held, chosen on subjects that are held back from it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]
HELD_BACK = 5  # every how manieth subject, at least one


@dataclass(frozen=True)
class Choice:
    """What was tried, and what each left of subjects held back."""

    tried: tuple[float, ...]
    left: tuple[float, ...]  # mm, rms per vertex

    @property
    def chosen(self) -> float:
        """That which leaves least."""
        return self.tried[int(np.argmin(self.left))]


def kept_and_held_back(subject: Index) -> tuple[Index, Index]:
    """Rows of registrations (J,): of most subjects, and of the last fifth of them."""
    S = int(subject.max()) + 1
    back = subject >= S - max(1, S // HELD_BACK)
    return np.flatnonzero(~back), np.flatnonzero(back)
