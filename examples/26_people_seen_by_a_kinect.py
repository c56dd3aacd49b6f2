"""Three real people in their clothes, of whom one depth camera saw only the backs.

Keep the scans anywhere, and give the path of their file: `python 26_people_seen_by_a_kinect.py
kinect_people.npz`. It holds arrays `person_a`, `person_b`, `person_c`, (N, 3) m with y up, and
`camera_position` (3,) m; clouds of your own in this form will do as well. The three people were
published with the Point Cloud Library under a BSD licence, and do not come with the workbench.

A Kinect rounds depths, so that its clouds are terraces up to about two centimetres apart. Half of
the points are held out, drawn at random. The boundary, where pixels mix a person with what is
behind, is left out. A body is fitted to the rest, and then its vertices are free; distances of the
held-out points from the surface say how well. Clothing lies outside of the body, and a fit by the
plain distance takes it for flesh. A loose distance counts three tenths where a point is in front of
the skin, which leaves room for clothing.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

import workbench as wb
from workbench.fitting import ReadScan, boundary, read_scan
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import (
    FitStage,
    FreeVertices,
    ModelFit,
    Registered,
    ScanTerm,
    VertexStage,
    facing,
    fit_model,
)
from workbench.residuals import distance, loose
from workbench.solvers import TrustRegion

BORDER = 0.02  # m, left out of the fits along the boundary; with more, thin legs are gone
MEASURED = 0.04  # m from the boundary and farther: where held-out points are measured
WIDE = 1.2  # m, of each panel of the figure
SHARE = 0.3  # of a distance that counts in front of the skin
FORMS = {"distance": distance, "loose distance": loose(SHARE)}
FIT_STAGES = (
    FitStage(300, 0.05, 0.10, starts=16, iterations=20),
    FitStage(800, 0.02, 0.05, starts=8, iterations=25),
    FitStage(3000, 0.01, 0.03, starts=3, iterations=40, settled=0.002),
    FitStage(8000, 0.005, 0.015, starts=1, iterations=40, settled=0.002),
)
KINECT = ScanTerm(sigma=0.006, outlier=0.03, within=0.05)  # 22 mm / sqrt(12): rounded depth
EVERYTHING, TOGETHER = ("pose", "betas", "trans", "vertices"), TrustRegion(max_iterations=30)
VERTEX_STAGES = (
    VertexStage("strong", EVERYTHING, 0.002, KINECT, TOGETHER),
    VertexStage("weak", EVERYTHING, 0.2, KINECT, TOGETHER),
)
NEEDED = (
    "This example needs the path of an .npz file with scans of people, such as kinect_people.npz: "
    "arrays person_a, person_b, person_c (N, 3) in metres with y up, and camera_position (3,). "
    "The three people of that file were published with the Point Cloud Library "
    "(https://github.com/PointCloudLibrary, BSD licence), and do not come with the workbench."
)


class Person(NamedTuple):
    """One person: the scan, which points are held out, and what was fitted to the others."""

    read: ReadScan
    held_out: np.ndarray
    fits: dict[str, ModelFit]
    registered: Registered


def person(
    path: Path,
    name: str,
    body: wb.SkinnedBody,
    fit_stages: tuple[FitStage, ...] = FIT_STAGES,
) -> Person:
    """Fit a body to half of one cloud in a file, by each of the forms, and free its vertices."""
    read = read_scan(path, name=name)
    inner, measured = (~boundary(read.scan, width=width) for width in (BORDER, MEASURED))
    half = np.random.default_rng(0).random(read.scan.n_points) < 0.5
    fits = {
        form: fit_model(body, read.scan, keep=inner & half, stages=fit_stages, form=says)
        for form, says in FORMS.items()
    }
    known = read.scan.some(inner & half)
    registered = FreeVertices(body, known).register(fits["distance"].values, VERTEX_STAGES)
    return Person(read, measured & ~half, fits, registered)


def away(one: Person, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Signed distances of the held-out points to a surface, in mm; above 0 outside of it."""
    found = SurfaceTree(vertices, faces).closest(one.read.scan.points[one.held_out])
    return 1e3 * found.distances


def facing_away(one: Person) -> float:
    """The cosine between where the fitted body faces and the way from the camera to it."""
    pose = one.fits["distance"].values["pose"]
    forward = facing(pose[0], one.fits["distance"].body.bind_pose[0])
    assert one.read.camera_position is not None
    from_camera = (one.read.scan.points.mean(axis=0) - one.read.camera_position) * [1, 0, 1]
    return float(forward @ from_camera / np.linalg.norm(from_camera))


def in_words(name: str, one: Person, faces: np.ndarray) -> str:
    """What was found of one person."""
    off = {form: away(one, fit.vertices(), faces) for form, fit in one.fits.items()}
    free = away(one, one.registered.vertices, faces)
    size = {form: np.linalg.norm(fit.values["betas"]) for form, fit in one.fits.items()}
    outside = {form: np.mean(some > 0) for form, some in off.items()}
    median = {form: np.median(np.abs(some)) for form, some in off.items()}
    return (
        f"{name}: {one.held_out.sum():,} held-out points; faces away from the camera "
        f"(cosine {facing_away(one):.2f})\n"
        f"  median distance: model {median['distance']:.1f} mm, vertices free "
        f"{np.median(np.abs(free)):.1f} mm, model by a loose distance "
        f"{median['loose distance']:.1f} mm\n"
        f"  |betas| {size['distance']:.1f}, loose {size['loose distance']:.1f}; "
        f"points outside of the body {100 * outside['distance']:.0f} %, loose "
        f"{100 * outside['loose distance']:.0f} %"
    )


def draw(people: dict[str, Person], faces: np.ndarray, path: Path) -> None:
    """Held-out points over the bodies, each person from the camera and from the side."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    from workbench.plots import house_style, png
    from workbench.plots.body import front, painted, side

    scale = ScalarMappable(Normalize(0, 25), "plasma")
    with house_style():
        figure = Figure(figsize=(12, 4.2 * len(people)), layout="constrained")
        rows = figure.subplots(len(people), 6, squeeze=False, sharey=True)
        for row, (name, one) in zip(rows, people.items(), strict=True):
            surfaces = {form: fit.vertices() for form, fit in one.fits.items()}
            surfaces["vertices free"] = one.registered.vertices
            points = one.read.scan.points[one.held_out]
            shown = slice(None, None, -(-len(points) // 2000))
            for k, (title, vertices) in enumerate(surfaces.items()):
                colours = scale.to_rgba(np.abs(away(one, vertices, faces))[shown])
                for ax, look in zip(row[2 * k : 2 * k + 2], (front, side), strict=True):
                    solid = look(vertices)
                    ax.add_collection(painted(solid[:, :2], solid, faces))
                    dots = look(points[shown])
                    nearest = np.argsort(dots[:, 2])
                    ax.scatter(*dots[nearest, :2].T, c=colours[nearest], s=1.5)
                    middle = np.median(dots[:, 0])
                    ax.set(aspect="equal", xlabel="m")
                    ax.set(xlim=(middle - WIDE / 2, middle + WIDE / 2), ylim=(-0.25, 2.0))
                    ax.set_title(f"{title},\nfrom the {'camera' if look is front else 'side'}")
            row[0].set_ylabel(f"{name}: y (m)")
        figure.colorbar(scale, ax=rows, label="distance of a held-out point (mm)", extend="max")
    path.write_bytes(png(figure))


def main(path: Path, body: wb.SkinnedBody, figure: Path) -> dict[str, Person]:
    """Fit all people of a file, say what was found, and draw it."""
    with np.load(path) as arrays:
        names = [name for name in arrays.files if name.startswith("person")]
        has_camera = "camera_position" in arrays.files
    if not names or not has_camera:
        print(NEEDED)
        return {}
    people = {}
    for name in names:
        people[name] = person(path, name, body)
        print(in_words(name, people[name], body.faces), flush=True)
    draw(people, body.faces, figure)
    print(
        "Held-out points of the scans over the fitted bodies, coloured by their distance from the "
        "surface. What no point lies on was not seen, and rests on the priors."
    )
    return people


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_file():
        print(NEEDED)
    else:
        png_file = Path(__file__).with_name("people_seen_by_a_kinect.png")
        main(Path(sys.argv[1]), wb.load_body(), png_file)
