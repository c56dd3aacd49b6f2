"""What to measure next: the best place for a second camera, and the ten best of 41 markers.

The person of `balance-monocular` was seen by one camera, so that the distance is hardly known.
What a further measurement would tell depends on its Jacobian, and not on what will be observed.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.experiments.balance import balance_monocular
from workbench.fitting import (
    cameras_on_a_sphere,
    default_markers,
    depth_of,
    marker_candidates,
    stature_of,
)

setup = balance_monocular()
body, view = setup.body, setup.views[0]
values = setup.start | wb.solve(setup.problem, setup.start).values
centre = body.joints(*(values[block.name] for block in body.blocks()))[0]

places = cameras_on_a_sphere(body, centre)  # 12 around, in three heights, 4 m away
depth = wb.sd_of(depth_of(body, view.camera, values))
second = wb.design(setup.problem, places, values, criterion=depth)
overall = wb.design(setup.problem, places, values)  # D-optimal: the volume of all uncertainty

worn = marker_candidates(body, default_markers(body))
ten = wb.design(setup.problem, worn, values, choose=10)
for_stature = wb.design(
    setup.problem, worn, values, choose=10, criterion=wb.sd_of(stature_of(body))
)
shared = sorted(set(ten.chosen) & set(for_stature.chosen))

if __name__ == "__main__":
    from workbench.plots import house_style, plot_measurement_ranking, png, sheet

    print(second.report())
    print(f"\nmost in all is known after the camera {overall.best}")
    print(f"\nten markers for everything: {', '.join(ten.chosen)}")
    before, after = 1e3 * np.array([for_stature.before.sd, for_stature.after.sd])
    print(f"ten for the stature: {', '.join(for_stature.chosen)}")
    print(f"they share {len(shared)}; the stature is known to {before:.0f} mm, then {after:.1f} mm")
    with house_style():
        figure, (ax,) = sheet(7.4, 7)
        plot_measurement_ranking(second, ax=ax)
    Path(__file__).with_name("what_to_measure_next.png").write_bytes(png(figure))
