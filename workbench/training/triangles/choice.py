"""How strongly a model is held, chosen on subjects that are held back from it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Choice:
    """What was tried, and what each left of subjects held back."""

    tried: tuple[float, ...]
    left: tuple[float, ...]  # mm, rms per vertex

    @property
    def chosen(self) -> float:
        """That which leaves least."""
        return self.tried[int(np.argmin(self.left))]
