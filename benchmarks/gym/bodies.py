"""Bodies from far: every vertex of the small body is known, its joints are bent, and the fit begins
at the template. The seeds are others than those that any test of the workbench fits.
"""

from benchmarks.gym.case import Case, case
from workbench.experiments.body_fits import body_vertices

SIGMAS = (0.3, 0.6, 1.0)  # rad per axis
SEEDS = range(1000, 1006)

FAR_BODIES: tuple[Case, ...] = tuple(
    case(
        f"body-{sigma:g}-{seed}",
        "bodies",
        body_vertices,
        {"body": "small", "seed": seed, "pose_sigma": sigma},
    )
    for sigma in SIGMAS
    for seed in SEEDS
)
