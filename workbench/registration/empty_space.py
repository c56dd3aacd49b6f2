"""How a body is kept out of the space that a camera saw to be empty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.scans.scan import Scan
from workbench.registration.fit_stage import FitStage
from workbench.registration.scan_starts import STRAY, WHOLE
from workbench.residuals import Residual, free_space, geman_mcclure, scaled
from workbench.residuals.scans import BEFORE, BESIDE

BEHIND = 0.02  # of the points of a scan may be behind a camera that looks at their middle


@dataclass(frozen=True)
class EmptySpace:
    """How `residuals.free_space` counts in the fit of a body. The lengths suit a whole person.

    Raises BadArgument for a number that is not above zero.

    Attributes:
        vertices: how many of the body, drawn at random, are kept out.
        sigma: in m, how far into empty space a vertex gets without being wrong, at least; in a
            stage it is `widths` times the stage's sigma, if that is more.
        widths: see `sigma`. A stage that is coarse in its distances is as coarse in this.
        reach: in m, the scale of the robust kernel. It is long, because a limb in empty space has a
            long way back, and nothing else may pull it there.
        beside: in m, as near to a ray of the scan as this, space may not be empty.
        before: in m, the same along the ray, before the point.
    """

    vertices: int = 300
    sigma: float = 0.03
    widths: float = 3.0
    reach: float = 0.2
    beside: float = BESIDE
    before: float = BEFORE

    def __post_init__(self) -> None:
        if (
            not min(self.vertices, self.sigma, self.widths, self.reach, self.beside, self.before)
            > 0
        ):
            raise BadArgument(f"the numbers of an empty space are above zero, not {self}")

    def residual(self, body: Body, scan: Scan, camera: ArrayLike, stage: FitStage) -> Residual:
        """How far vertices stand in space that a camera at `camera` (3,) m saw to be empty.

        Of a scan that shows only a part of the body (see `shows_all`), what is beside counts as
        out of view.
        """
        order = np.random.default_rng(0).permutation(body.n_vertices)
        shown = np.inf if shows_all(body, scan) else self.beside
        sigma = max(self.widths * stage.sigma, self.sigma)
        symbols = (block.symbol for block in body.blocks())
        return free_space(
            body.points(*symbols, vertices=np.sort(order[: self.vertices])),
            scan.points,
            camera,
            sigma=sigma,
            kernel=scaled(geman_mcclure, self.reach / sigma),
            beside=self.beside,
            before=self.before,
            within=shown,
            name="empty space",
        )


def shows_all(body: Body, scan: Scan) -> bool:
    """Whether a scan is at least 0.6 times as high as the body, as `scan_starts` asks for too.

    A lower one may have been cut off, so that nothing is known of what is beyond its points.
    """
    low, high = np.quantile(scan.points[:, 1], [STRAY, 1 - STRAY])
    return bool(high - low > WHOLE * np.ptp(body.template[:, 1]))


def sees(camera: ArrayLike, points: Array) -> bool:
    """Whether one look from `camera` (3,) m can have all but 2 % of points (M, 3) m before it.

    A camera that stands among the points cannot have taken them.
    """
    rays = points - np.asarray(camera, dtype=float)
    far = np.linalg.norm(rays, axis=1)
    if not (far > 0).all():
        return False
    unit = rays / far[:, None]
    return bool(np.mean(unit @ np.median(unit, axis=0) <= 0) <= BEHIND)
