"""A file of markers: shape and places of the markers from twelve frames, then all poses (MoSh).

The file is made here, from a synthetic person in poses that are drawn from the pose prior. Its
markers are in millimetres with 1 mm of noise, one in twenty is missing, and they sit several
millimetres from their nominal places, as real ones do.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import workbench as wb
from workbench.experiments.moving_people import dressed_person, true_measures
from workbench.fitting import default_markers, mosh, read_markers
from workbench.priors.poses import draw_poses, shipped_gaussian

body = wb.load_body("small")
worn = default_markers(body)  # 41 vertices by name, 9.5 mm out along the normal
rng = np.random.default_rng(0)
poses = draw_poses(shipped_gaussian(), 30, rng)
truth, seen = dressed_person(body, worn, poses, rng, noise=0.001, missing=0.05, apart=0.005)

with TemporaryDirectory() as folder:
    file = Path(folder) / "markers.npz"
    np.savez(file, markers=1000 * seen, labels=np.array(worn.names), fps=30.0)
    recording = read_markers(file, up="y")
print(*recording.notes, sep="\n")

found = mosh(recording.markers, body, worn, sigma=0.001, progress=print)
for measure in true_measures(body, {"betas": found.betas, "offsets": found.offsets}, truth):
    print(f"{measure.name}: {measure.value:.1f} {measure.unit}")
errors = 1e3 * np.sqrt(np.nanmean(found.errors**2, axis=0))
for m in np.argsort(-errors)[:3]:
    print(f"marker {worn.names[m]} is {errors[m]:.1f} mm off")
