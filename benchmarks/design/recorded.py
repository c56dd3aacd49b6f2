"""The four real cameras of `balance`: does the predicted second camera have the smaller error?

One camera is there, and each of the other three could be the second one. The landmarks of the limbs
matter: their standard deviation in the fit to two cameras is predicted at the fit to the first
camera alone. The error is their distance from those of the fit to all four cameras.
"""

from typing import Any

import casadi as cs
import numpy as np
from scipy.stats import kendalltau

import workbench as wb
from benchmarks.images.limbs import NAMES
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.diagnostics.design import Quantity, design, sd_of
from workbench.experiments.balance import balance, observations
from workbench.fitting.candidates import cameras_of

FRAMES = tuple(range(0, 100, 4))
RESAMPLED = 2000


def places(body: SkinnedBody) -> Quantity:
    """The places of the twelve landmarks of the limbs, (36, 1) m."""
    points = body.landmark_points("coco", *(block.symbol for block in body.blocks()))
    names = body.landmark_names("coco")
    chosen = [names.index(name) for name in NAMES]
    return Quantity("the limbs", cs.vec(points.symbol[:, chosen]), "m", (points,))


def limbs_at(body: SkinnedBody, values: Values) -> Array:
    """The same in numbers, (12, 3) m."""
    names = body.landmark_names("coco")
    found = body.landmark("coco", *(values[block.name] for block in body.blocks()))
    return np.asarray(found[[names.index(name) for name in NAMES]])


def frame(number: int, sigma: float = 4.0) -> list[dict[str, Any]]:
    """Every first and second camera of a frame: predicted sd and error, m, rms over landmarks."""
    photographs = observations(number)[0].photographs
    cameras = [photo.name for photo in photographs]
    fitted: dict[frozenset[str], Values] = {}

    def fit(*seen: str) -> tuple[wb.Problem, Values, SkinnedBody]:
        held_out = [name for name in cameras if name not in seen]
        setup = balance(number, held_out=held_out, sigma=sigma, compared=())
        assert isinstance(setup.body, SkinnedBody)
        key = frozenset(seen)
        if key not in fitted:
            fitted[key] = setup.start | wb.solve(setup.problem, setup.start).values
        return setup.problem, fitted[key], setup.body

    _, four, body = fit(*cameras)
    true = limbs_at(body, four)
    found = []
    for first in cameras:
        problem, values, own = fit(first)
        others = [photo for photo in photographs if photo.name != first]
        told = design(
            problem, cameras_of(own, others, sigma=sigma), values, criterion=sd_of(places(own))
        )
        predicted = {one.name: one.sd / np.sqrt(len(NAMES)) for one in told.ranking}
        for second in predicted:
            off = limbs_at(own, fit(first, second)[1]) - true
            error = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
            found.append(
                {
                    "frame": number,
                    "first": first,
                    "second": second,
                    "predicted": float(predicted[second]),
                    "error": error,
                }
            )
    return found


def judged(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How often the predicted best is the best, and how alike the two orders of three are."""
    frames = sorted({row["frame"] for row in rows})
    firsts = sorted({row["first"] for row in rows})
    hits, taus = np.zeros((len(frames), len(firsts))), np.zeros((len(frames), len(firsts)))
    for i, number in enumerate(frames):
        for j, first in enumerate(firsts):
            three = [row for row in rows if row["frame"] == number and row["first"] == first]
            sd, error = (np.array([row[key] for row in three]) for key in ("predicted", "error"))
            hits[i, j] = np.argmin(sd) == np.argmin(error)
            taus[i, j] = kendalltau(sd, error).statistic
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(frames), (RESAMPLED, len(frames)))  # whole frames

    def spread(each: Array) -> list[float]:
        return [float(q) for q in np.quantile(each[picks].mean(axis=(1, 2)), [0.025, 0.975])]

    together = []
    for first in firsts:
        for second in sorted({row["second"] for row in rows if row["first"] == first}):
            some = [row for row in rows if (row["first"], row["second"]) == (first, second)]
            rms = {
                key: float(np.sqrt(np.mean([row[key] ** 2 for row in some])))
                for key in ("predicted", "error")
            }
            together.append({"first": first, "second": second} | rms)
    orders = {}
    for first in firsts:
        three = [row for row in together if row["first"] == first]
        for key in ("predicted", "error"):
            ordered = sorted(three, key=lambda row, by=key: row[by])  # type: ignore[misc]
            orders.setdefault(first, {})[key] = [row["second"] for row in ordered]
    return {
        "frames": len(frames),
        "cases": hits.size,
        "best is best": float(hits.mean()),
        "best is best, interval": spread(hits),
        "tau": float(taus.mean()),
        "tau, interval": spread(taus),
        "pairs": together,
        "orders": orders,
    }


def run() -> dict[str, Any]:
    """All frames."""
    rows = []
    for number in FRAMES:
        rows += frame(number)
        print("frame", number, flush=True)
    return judged(rows) | {"rows": rows}
