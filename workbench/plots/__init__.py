"""Figures, one file each: they take results and draw; they compute, show and save nothing."""

from matplotlib.figure import Figure as Figure

from workbench.plots.body import (
    caption_body as caption_body,
    caption_capsules as caption_capsules,
    caption_differences as caption_differences,
    caption_direction as caption_direction,
    caption_distances as caption_distances,
    caption_shape_gallery as caption_shape_gallery,
    plot_differences as plot_differences,
    plot_distances as plot_distances,
    plot_shape_gallery as plot_shape_gallery,
    plot_stitching as plot_stitching,
)
from workbench.plots.diagnosis import (
    caption_data_share as caption_data_share,
    caption_measurement_choice as caption_measurement_choice,
    caption_measurement_ranking as caption_measurement_ranking,
    caption_profile_likelihood as caption_profile_likelihood,
    caption_sigmas as caption_sigmas,
    caption_singular_values as caption_singular_values,
    caption_sparsity as caption_sparsity,
    caption_taylor as caption_taylor,
    plot_data_share as plot_data_share,
    plot_measurement_choice as plot_measurement_choice,
    plot_measurement_ranking as plot_measurement_ranking,
    plot_profile_likelihood as plot_profile_likelihood,
    plot_sigmas as plot_sigmas,
    plot_singular_values as plot_singular_values,
    plot_sparsity as plot_sparsity,
    plot_taylor as plot_taylor,
)
from workbench.plots.posterior import (
    caption_beside_laplace as caption_beside_laplace,
    caption_corner as caption_corner,
    caption_spray as caption_spray,
    caption_traces as caption_traces,
    widest as widest,
)
from workbench.plots.solutions import (
    caption_convergence as caption_convergence,
    caption_minima as caption_minima,
    plot_minima as plot_minima,
)
from workbench.plots.style import (
    house_style as house_style,
    png as png,
    sheet as sheet,
    smallest as smallest,
    svg as svg,
)
from workbench.plots.views import (
    caption_autocorrelation as caption_autocorrelation,
    caption_hypothesis as caption_hypothesis,
    caption_overlay as caption_overlay,
    caption_stage as caption_stage,
    caption_strip as caption_strip,
    plot_autocorrelation as plot_autocorrelation,
    plot_hypothesis as plot_hypothesis,
    plot_motion as plot_motion,
    plot_overlay as plot_overlay,
    plot_stage as plot_stage,
    plot_strip as plot_strip,
)
