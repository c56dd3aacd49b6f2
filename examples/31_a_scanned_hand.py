"""A hand on a scan that nobody labelled, and on its skeleton.

Four simulated depth cameras stand around a synthetic hand; no hand was measured. The scan does not
say how the hand is turned, so the fit begins from 48 starts. With a skeleton of 21 noisy points as
well it needs one. Half of the scan is held out, and tells how well the other half was fitted.

`python 31_a_scanned_hand.py HAND.glb` fits a scan of your own, of a right hand in metres, such as
the hand that an artist modelled for webxr-input-profiles (npm package @webxr-input-profiles/assets,
MIT licence, profile generic-hand), and draws it beside this file. It does not come with the
workbench.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

import workbench as wb
from workbench.bodies import HAND_POINTS, pose_space
from workbench.fitting import Scan, hand_problem, hand_start, read_scan
from workbench.fitting.hands import points_of
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import HAND_RECIPE, Registration, register, with_skeleton
from workbench.synthetic import Noise, SimulatedScan, scan, scanners

NOISE = 0.002  # m along each axis, of the points of the skeleton


class Made(NamedTuple):
    """A synthetic hand: its values, its surface (778, 3) m, its noisy points, and a scan of it."""

    values: wb.Values
    vertices: np.ndarray
    points: np.ndarray
    scan: SimulatedScan


def made(hand: wb.SkinnedBody, seed: int) -> Made:
    """A hand in a pose of the pose space, turned any way, scanned from four sides."""
    rng = np.random.default_rng(seed)
    space = pose_space(hand)
    pose = space.poses(hand, space.deviations * rng.standard_normal(space.n_components))
    pose[0] = rng.standard_normal(3)
    values = {"pose": pose, "betas": rng.standard_normal(10), "trans": rng.standard_normal(3)}
    vertices = hand.vertices(**values)
    around = scanners(4, distance=0.4, target=vertices.mean(axis=0))
    seen = scan(vertices, hand.faces, around, seed=seed, noise=Noise(0.0, 0.0005, 0.0))
    points = points_of(hand, values) + NOISE * rng.standard_normal((21, 3))
    return Made(values, vertices, points, seen)


def away(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances of points from a surface, in mm."""
    return 1e3 * np.abs(SurfaceTree(vertices, faces).closest(points).distances)


def halves(whole: Scan) -> tuple[Scan, Scan]:
    """The points to be fitted, and as many that are held out."""
    chosen = np.random.default_rng(0).random(whole.n_points) < 0.5
    return whole.some(chosen), whole.some(~chosen)


def of_a_file(path: Path, hand: wb.SkinnedBody) -> tuple[Registration, np.ndarray]:
    """A scan in a file, half of which is registered; and distances of the other half in mm."""
    fitted, held_out = halves(read_scan(path).scan)
    found = register(hand, fitted)
    return found, away(found.vertices, hand.faces, held_out.points)


def draw(found: Registration, path: Path) -> None:
    """The points over the surface, from four sides."""
    from workbench.plots import png
    from workbench.plots.scans import registered_scan_sheet

    path.write_bytes(png(registered_scan_sheet(found)))


hand = wb.load_body("hand")
one = made(hand, seed=3)
fitted, held_out = halves(one.scan.scan)

alone = HAND_RECIPE.fit(hand, fitted)
both = with_skeleton(HAND_RECIPE, hand, one.points).fit(hand, fitted)
problem = hand_problem(hand)
skeleton = wb.solve(problem, hand_start(hand, one.points))
surfaces = {
    "21 points": hand.vertices(*(skeleton.values[name] for name in ("pose", "betas", "trans"))),
    "scan": alone.vertices(),
    "scan and 21 points": both.vertices(),
}
errors = {
    name: 1e3 * np.linalg.norm(vertices - one.vertices, axis=1)
    for name, vertices in surfaces.items()
}
for name, off in errors.items():
    median = np.median(away(surfaces[name], hand.faces, held_out.points))
    print(
        f"{name}: mean error of a vertex {off.mean():.2f} mm, largest {off.max():.1f} mm; "
        f"held-out points {median:.2f} mm off the surface (median)"
    )

# What 16 joints and 21 points leave open of the pose, where no prior says anything.
bare = hand_problem(hand, priors=()).freeing("pose")
joints = np.where([[name.endswith("_tip")] for name in HAND_POINTS], np.nan, one.points)
ranks = {
    "16 joints": wb.diagnose(bare, hand_start(hand, joints)).rank,
    "21 points": wb.diagnose(bare, hand_start(hand, one.points)).rank,
}
print("rank of the pose, 48 numbers:", ranks)

if __name__ == "__main__" and len(sys.argv) == 2:
    registration, off = of_a_file(Path(sys.argv[1]), hand)
    print(
        f"{sys.argv[1]}: {len(off)} held-out points, median {np.median(off):.2f} mm, "
        f"95 % within {np.percentile(off, 95):.2f} mm"
    )
    picture = Path(__file__).with_name("a_scanned_hand.png")
    draw(registration, picture)
    print(f"drawn in {picture.name}: points over the surface, coloured by their distance from it")
