"""A synthetic person who wears markers: poses, one shape, and the places of the markers."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument
from workbench.fitting.marker_sets import MARKERS, MarkerSet, default_markers
from workbench.fitting.markers import marker_fit, surface_frames
from workbench.fitting.setup import Measure, Setup, rms
from workbench.geometry.surface_tree import SurfaceTree
from workbench.priors.poses import draw_poses, shipped_gaussian

Placed = Callable[[SkinnedBody, MarkerSet, Array, float, np.random.Generator], Array]
WORN = (
    "the person is the model itself, in poses that are drawn from the pose prior, with made-up "
    "places of the markers; nobody was recorded, skin does not slide, and no marker is mislabelled"
)


def markers(
    body: str = "default",
    seed: int = 0,
    frames: int = 12,
    noise: float = 1.0,
    missing: float = 0.05,
    apart: float = 5.0,
) -> Setup:
    """Fit poses, shape and offsets to 41 markers in some frames, as MoSh does.

    Noise is in mm. A share `missing` of the places was not seen. The markers sit `apart` mm from
    their nominal places, along each axis. Raises BadArgument for a body without SMPL's joints.
    """
    if not 0 <= missing < 1:
        raise BadArgument(f"missing is a share of the markers, from 0 to 1, not {missing}")
    if frames < 1 or not noise > 0 or apart < 0:
        raise BadArgument("markers need one frame or more, a noise above 0 mm, and apart from 0 mm")
    model = load_body(body)
    if not isinstance(model, SkinnedBody):
        raise BadArgument(f"markers have offsets on a SkinnedBody, and {body} is none")
    rng = np.random.default_rng(seed)
    worn = default_markers(model)
    poses = draw_poses(shipped_gaussian(), frames, rng)
    truth, observed = dressed_person(model, worn, poses, rng, noise / 1e3, missing, apart / 1e3)
    setup = marker_fit(
        observed,
        model,
        worn,
        f"A synthetic person (seed {seed}) wears {len(worn.names)} markers, up to several mm from "
        f"their nominal places, seen in {frames} frames to {noise:g} mm; {100 * missing:g} % are "
        "missing. Which shape, and which places of the markers, explain them?",
        sigma=noise / 1e3,
    )
    measured = setup.measures
    return Setup(
        problem=setup.problem,
        start=setup.start,
        question=setup.question,
        measures=lambda found: (*true_measures(model, found, truth), *measured(found)),
        priors=setup.priors,
        synthetic=WORN,
        made_of=truth,
    )


def anywhere(
    body: SkinnedBody, worn: MarkerSet, betas: Array, apart: float, rng: np.random.Generator
) -> Array:
    """Offsets (M, 3) m that are normally distributed about the nominal ones along each axis."""
    return np.asarray(worn.nominal + apart * rng.normal(size=worn.nominal.shape))


def on_the_surface(
    body: SkinnedBody, worn: MarkerSet, betas: Array, apart: float, rng: np.random.Generator
) -> Array:
    """Offsets (M, 3) m of markers somewhere on the person at rest, all of the nominal height.

    The place is the vertex, displaced in two directions along the surface by normally distributed
    lengths with a standard deviation of `apart` m each, and brought back to the surface. The centre
    is straight above it, as far from the surface as the nominal one is from its vertex.
    """
    vertices = body.vertices(betas=betas)
    feet = vertices[worn.vertices]
    along = surface_frames(body, worn)[:, :2]
    lengths = apart * rng.normal(size=(len(feet), 2))
    towards = feet + worn.nominal + np.einsum("md,mdi->mi", lengths, along)
    places = SurfaceTree(vertices, body.faces).closest(towards).points
    up = towards - places
    up *= np.linalg.norm(worn.nominal, axis=1, keepdims=True) / np.linalg.norm(
        up, axis=1, keepdims=True
    )
    return np.asarray(places + up - feet)


def dressed_person(
    body: SkinnedBody,
    worn: MarkerSet,
    poses: Array,
    rng: np.random.Generator,
    noise: float,
    missing: float,
    apart: float,
    placed: Placed = anywhere,
) -> tuple[Values, Array]:
    """A random person in poses (T, K, 3) rad with markers: the truth, and markers (T, M, 3) m.

    Offsets are those of `placed`, `apart` m from the nominal ones.
    """
    T, M = len(poses), len(worn.names)
    betas = rng.normal(size=body.n_betas)
    offsets = placed(body, worn, betas, apart, rng)
    trans = rng.normal(size=(T, 3)) * [1.0, 0.1, 1.0]
    exact = worn.on(body).landmark(MARKERS, poses, betas, trans, offsets)
    observed = exact + noise * rng.normal(size=exact.shape)
    observed[rng.random((T, M)) < missing] = np.nan
    pose, shape, place = (block.name for block in body.blocks())
    return {pose: poses, shape: betas, place: trans, "offsets": offsets}, observed


def true_measures(body: SkinnedBody, found: Values, truth: Values) -> tuple[Measure, ...]:
    """How far the shape at rest and the offsets are from the truth, root mean squares in mm."""
    betas = body.blocks()[1].name
    off = body.shapedirs @ (found[betas] - truth[betas])
    return (
        rms("rest shape to synthetic truth", 1e3 * np.linalg.norm(off, axis=1)),
        rms(
            "offsets to synthetic truth",
            1e3 * np.linalg.norm(found["offsets"] - truth["offsets"], axis=1),
        ),
    )
