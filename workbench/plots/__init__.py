"""Figures, one file each: they take results and draw; they compute, show and save nothing."""

from matplotlib.figure import Figure

from workbench.plots.body import (
    caption_body,
    caption_shape_gallery,
    plot_body,
    plot_shape_gallery,
)
from workbench.plots.convergence import (
    ITERATIONS,
    SECONDS,
    caption_convergence,
    plot_convergence,
)
from workbench.plots.direction import caption_direction, plot_direction
from workbench.plots.distances import caption_distances, plot_distances
from workbench.plots.figure import house_style, png, sheet, smallest, svg
from workbench.plots.knowledge import (
    caption_data_share,
    caption_sigmas,
    plot_data_share,
    plot_sigmas,
)
from workbench.plots.overlay import caption_overlay, plot_overlay
from workbench.plots.singular_values import caption_singular_values, plot_singular_values
from workbench.plots.sparsity import caption_sparsity, plot_sparsity
from workbench.plots.stitching import caption_stitching, plot_stitching
from workbench.plots.taylor import caption_taylor, plot_taylor

__all__ = [
    "ITERATIONS",
    "SECONDS",
    "Figure",
    "caption_body",
    "caption_convergence",
    "caption_data_share",
    "caption_direction",
    "caption_distances",
    "caption_overlay",
    "caption_shape_gallery",
    "caption_sigmas",
    "caption_singular_values",
    "caption_sparsity",
    "caption_stitching",
    "caption_taylor",
    "house_style",
    "plot_body",
    "plot_convergence",
    "plot_data_share",
    "plot_direction",
    "plot_distances",
    "plot_overlay",
    "plot_shape_gallery",
    "plot_sigmas",
    "plot_singular_values",
    "plot_sparsity",
    "plot_stitching",
    "plot_taylor",
    "png",
    "sheet",
    "smallest",
    "svg",
]
