"""How heavy a person is for their height."""

import numpy as np
from numpy.typing import ArrayLike

from workbench.bodies.body import Body
from workbench.geometry.solids import volume

DENSITY = 985.0  # kg/m^3, of a person with air in the lungs


def body_mass_index(body: Body, betas: ArrayLike | None = None) -> float:
    """The body mass index in kg/m^2 of the person with these betas, at rest.

    It is the volume of the surface times 985 kg/m^3 over the square of the height, from the lowest
    vertex to the highest one. Neither the embedded bodies nor their people were weighed.
    """
    surface = body.vertices(body.bind_pose, betas)
    height = float(np.ptp(surface[:, 1]))
    return DENSITY * volume(surface, body.faces) / height**2
