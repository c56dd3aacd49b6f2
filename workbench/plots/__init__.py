"""Figures, one file each: they take results and draw; they compute, show and save nothing."""

from matplotlib.figure import Figure as Figure

from workbench.plots.body import (
    caption_body as caption_body,
    caption_differences as caption_differences,
    caption_distances as caption_distances,
    caption_shape_gallery as caption_shape_gallery,
    plot_differences as plot_differences,
    plot_distances as plot_distances,
    plot_shape_gallery as plot_shape_gallery,
    plot_stitching as plot_stitching,
)
from workbench.plots.diagnosis import (
    caption_measurement_ranking as caption_measurement_ranking,
    caption_profile_likelihood as caption_profile_likelihood,
    caption_sigmas as caption_sigmas,
    caption_singular_values as caption_singular_values,
    caption_sparsity as caption_sparsity,
    plot_measurement_ranking as plot_measurement_ranking,
    plot_profile_likelihood as plot_profile_likelihood,
    plot_sigmas as plot_sigmas,
    plot_singular_values as plot_singular_values,
    plot_sparsity as plot_sparsity,
)
from workbench.plots.posterior import (
    caption_beside_laplace as caption_beside_laplace,
    caption_corner as caption_corner,
    caption_traces as caption_traces,
    widest as widest,
)
from workbench.plots.solutions import caption_convergence as caption_convergence
from workbench.plots.style import (
    house_style as house_style,
    png as png,
    sheet as sheet,
    smallest as smallest,
    svg as svg,
)
from workbench.plots.views import caption_overlay as caption_overlay, plot_overlay as plot_overlay
