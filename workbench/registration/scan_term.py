"""The term by which a scan pulls a surface: robust, by area, and only where normals agree."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Points
from workbench.errors import BadArgument
from workbench.fitting.scans.scan import Scan
from workbench.problem.sparsity import rows_of_nonzeros
from workbench.residuals import Form, Residual, distance, geman_mcclure, scaled, scan_to_model
from workbench.residuals.contacts import MovingContacts

PATCH = 1e-3  # m^2 of a scan that count as one observation


@dataclass(frozen=True)
class ScanTerm:
    """How a scan becomes a residual on a surface: E_S, Geman-McClure's, weighted by areas.

    The weight of a point, outside of the kernel, is the area that it stands for, divided by
    `patch`. The weighted sum approximates the integral of rho over the scanned surface, divided by
    `patch`. So neither the resolution of the scan nor that of the template changes how much the
    scan counts beside priors and the coupling. Neighbouring points are not independent observations
    of a model that is not exact, so that counting every one would trust the scan too much. Points
    whose areas are not known share the template's area evenly.

    Raises BadArgument for a length or an area that is not above zero.

    Attributes:
        sigma: in m, the noise of the scan.
        outlier: in m, the distance at which Geman-McClure's rho is half of its largest value.
        within: in m, the gate: a point farther away has no contact.
        facing: the least cosine of the angle between the normals in contact, if the scan has some.
        patch: in m^2, how much surface counts as one observation.
        form: what a contact says.
    """

    sigma: float = 0.003
    outlier: float = 0.03
    within: float = 0.1
    facing: float = 0.5
    patch: float = PATCH
    form: Form = distance

    def __post_init__(self) -> None:
        if not min(self.sigma, self.outlier, self.within, self.patch) > 0:
            raise BadArgument(
                "the sigma, the outlier's distance, the gate and the patch of a scan's term are "
                f"above zero, not {self.sigma:g}, {self.outlier:g}, {self.within:g} m and "
                f"{self.patch:g} m^2"
            )

    def residual(self, points: Points | cs.MX, faces: Index, scan: Scan, area: float) -> Residual:
        """The residual, in m, of a surface's vertices (N, 3); `area` in m^2 is the template's."""
        areas = (
            np.full(scan.n_points, area / scan.n_points) if scan.weights is None else scan.weights
        )
        return scan_to_model(
            points,
            faces,
            scan.points,
            sigma=self.sigma,
            kernel=scaled(geman_mcclure, self.outlier / self.sigma),
            weights=areas / self.patch,
            normals=scan.normals,
            within=self.within,
            facing=self.facing,
            form=self.form,
            name="scan",
        )


def touched(scan_residual: Residual, values: Mapping[str, Array], outlier: float) -> Mask:
    """Which vertices (N,) the scan touches: corners of triangles in contact with its points.

    A contact counts if its share in the vertex is above zero and it is at most `outlier` m long.
    Vertices that nothing touches are known only through the others. Raises BadArgument for a
    residual that has no contacts.
    """
    source = scan_residual.points[0].source if scan_residual.points else None
    if not isinstance(source, MovingContacts):
        raise BadArgument(
            f"residual {scan_residual.name!r} chooses no contacts; give one made by scan_to_model"
        )
    contacts = source.contacts(values)
    near = contacts.found & (np.linalg.norm(contacts.numbers, axis=1) <= outlier)
    rows = np.repeat(near, contacts.numbers.shape[1])[rows_of_nonzeros(contacts.slopes)]
    columns = contacts.slopes.indices[rows & (contacts.slopes.data != 0)]
    found = np.zeros(contacts.slopes.shape[1] // 3, dtype=bool)
    found[columns // 3] = True
    return found
