"""Figures, one file each: they take results and draw; they compute, show and save nothing."""

from matplotlib.figure import Figure

from workbench.plots.basins import (
    caption_basin_grid,
    caption_basins,
    plot_basin_grid,
    plot_basins,
)
from workbench.plots.body import caption_body, caption_shape_gallery, plot_body, plot_shape_gallery
from workbench.plots.capsules import caption_capsules, plot_capsules
from workbench.plots.convergence import ITERATIONS, SECONDS, caption_convergence, plot_convergence
from workbench.plots.direction import caption_direction, plot_direction
from workbench.plots.distances import (
    caption_differences,
    caption_distances,
    plot_differences,
    plot_distances,
)
from workbench.plots.figure import house_style, png, sheet, smallest, svg
from workbench.plots.measurement_design import (
    caption_measurement_choice,
    caption_measurement_ranking,
    plot_measurement_choice,
    plot_measurement_ranking,
)
from workbench.plots.minima import caption_minima, plot_minima
from workbench.plots.motion_strip import caption_motion, plot_motion
from workbench.plots.overlay import (
    caption_hypothesis,
    caption_overlay,
    caption_stage,
    plot_hypothesis,
    plot_overlay,
    plot_stage,
)
from workbench.plots.posterior import (
    caption_beside_laplace,
    caption_corner,
    caption_spray,
    caption_traces,
    plot_beside_laplace,
    plot_corner,
    plot_spray,
    plot_spray_in_view,
    plot_traces,
    widest,
)
from workbench.plots.profile_likelihood import caption_profile_likelihood, plot_profile_likelihood
from workbench.plots.singular_values import caption_singular_values, plot_singular_values
from workbench.plots.sparsity import caption_sparsity, plot_sparsity
from workbench.plots.stitching import caption_stitching, plot_stitching
from workbench.plots.strip import (
    caption_autocorrelation,
    caption_strip,
    plot_autocorrelation,
    plot_strip,
)
from workbench.plots.taylor import caption_taylor, plot_taylor
from workbench.plots.uncertainty import (
    caption_data_share,
    caption_sigmas,
    plot_data_share,
    plot_sigmas,
)

__all__ = [
    "ITERATIONS",
    "SECONDS",
    "Figure",
    "caption_autocorrelation",
    "caption_basin_grid",
    "caption_basins",
    "caption_beside_laplace",
    "caption_body",
    "caption_capsules",
    "caption_convergence",
    "caption_corner",
    "caption_data_share",
    "caption_differences",
    "caption_direction",
    "caption_distances",
    "caption_hypothesis",
    "caption_measurement_choice",
    "caption_measurement_ranking",
    "caption_minima",
    "caption_motion",
    "caption_overlay",
    "caption_profile_likelihood",
    "caption_shape_gallery",
    "caption_sigmas",
    "caption_singular_values",
    "caption_sparsity",
    "caption_spray",
    "caption_stage",
    "caption_stitching",
    "caption_strip",
    "caption_taylor",
    "caption_traces",
    "house_style",
    "plot_autocorrelation",
    "plot_basin_grid",
    "plot_basins",
    "plot_beside_laplace",
    "plot_body",
    "plot_capsules",
    "plot_convergence",
    "plot_corner",
    "plot_data_share",
    "plot_differences",
    "plot_direction",
    "plot_distances",
    "plot_hypothesis",
    "plot_measurement_choice",
    "plot_measurement_ranking",
    "plot_minima",
    "plot_motion",
    "plot_overlay",
    "plot_profile_likelihood",
    "plot_shape_gallery",
    "plot_sigmas",
    "plot_singular_values",
    "plot_sparsity",
    "plot_spray",
    "plot_spray_in_view",
    "plot_stage",
    "plot_stitching",
    "plot_strip",
    "plot_taylor",
    "plot_traces",
    "png",
    "sheet",
    "smallest",
    "svg",
    "widest",
]
