"""The mean of the posterior of a fit to images in place of its mode, and how far they are apart."""

from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.fitting.setup import Setup
from workbench.sampling.posterior_mean import posterior_mean

# frames 0, 8, ..., 96 of `balance`, each camera alone; the truth is the fit to all four cameras
SPREAD = (
    "too small: on 52 images of one real person, landmarks were 1.6 times as far from the truth "
    "(root mean square; 1.0 to 2.0 times, by landmark)"
)


@dataclass(frozen=True, eq=False)
class ImageMean:
    """The expected body of a fit to images, beside the likeliest one.

    Attributes:
        values: all blocks, with the mean of what is free.
        names: the landmarks (M,) of the body.
        landmarks: (M, 3) m their places on the body of the means.
        sd: (M,) m the standard deviations of their distances from there, once the middle of all
            landmarks of a draw is brought to that of the mean. They are those of the posterior
            near its mode; `SPREAD` says how far landmarks were from measured ones instead.
        moved: how far that middle is from the one of the likeliest body, in m.
        apart: (M,) m how far landmarks are from those of the likeliest body, about their middles.
        error: the standard error of the mean place, from the number of draws, in m.
        draws: how many there were.
    """

    values: Values = field(repr=False)
    names: tuple[str, ...] = field(repr=False)
    landmarks: Array = field(repr=False)
    sd: Array = field(repr=False)
    moved: float
    apart: Array = field(repr=False)
    error: float
    draws: int


def image_mean(setup: Setup, values: Values) -> ImageMean:
    """Draw about `values`, the solution of a fit to images, and take the mean of the draws.

    Raises what `posterior_mean` raises.
    """
    body = setup.body
    assert body is not None  # which every fit to images has
    found = posterior_mean(setup.problem, values)
    kind = next(view.landmarks for view in setup.views)
    blocks = [block.name for block in body.blocks()]
    given = setup.problem.split(values)[1]
    drawn = [setup.problem.values(x, given) for x in found.draws]
    places = body.landmark(kind, *(np.array([one[name] for one in drawn]) for name in blocks))
    mean, likeliest = (
        body.landmark(kind, *(at[name] for name in blocks)) for at in (found.values, values)
    )
    return ImageMean(
        found.values,
        tuple(body.landmark_names(kind)),
        mean,
        np.sqrt(np.sum((_centred(places) - _centred(mean)) ** 2, axis=2).mean(axis=0)),
        float(np.linalg.norm(mean.mean(axis=0) - likeliest.mean(axis=0))),
        np.linalg.norm(_centred(mean) - _centred(likeliest), axis=1),
        float(np.linalg.norm(setup.problem.free.unpack(found.error, values)[blocks[2]])),
        len(found.draws),
    )


def _centred(places: Array) -> Array:
    return np.asarray(places - places.mean(axis=-2, keepdims=True))
