"""A ninth set of problems with known gauges and remedies, drawn from those of the eighth.

The 43 problems of both sets were written together by an author who had not seen the search, and
committed with their predictions before any was diagnosed. These 14, drawn at random, were run
only after the search had been mended for what the eighth set showed, by the same author, who thus
knew these problems, but left them and their predictions as they were.

In that run the numbers were as predicted in 14 of 14, the acts in 13, the kinds of gauges in 9, and
what can be exchanged in 14. The search that had not been mended named the same 9. Of the others,

- three were equally right under another name: offsets of columns for translations in
  `crystal_from_intensities` and in `tilt_series` (nanometres are not known as a length), and
  translations for offsets in `pipes_under_three_loads`, whose heads in three loads have the form of
  points;
- in `tracks_through_planes` the kinds were right, but one direction was not told to rounding;
- in `circular_orbit_by_velocities` an unknown that nearly is a null direction was taken for one,
  so that a trade-off was told as `passage against argument`.

The last two were mended. In `tilt_series` the prediction of three acts was wrong, and so was the
one act that was found, as in `tucker_factors` of the eighth set: two suffice (mended). What is
listed below is what is right, and not always what was predicted.
"""

import casadi as cs
import numpy as np

from tests.bodies_made_up import smpl_like_body
from tests.diagnostics.zoo import Specimen, all_of, beside, observed, problem_of, turned
from workbench import Block, Problem, Residual, Values


def pipes_under_three_loads() -> tuple[Problem, Values]:
    """Flows c |dh|^0.54 in a net of pipes: a level of heads in each load, and heads against c."""
    rng = np.random.default_rng(830)
    head, c = Block("heads", (4, 3), "m"), Block("conductance", (6,))
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    rows = []
    for load in range(3):
        for k, (i, j) in enumerate(pairs):
            fall = head.symbol[load, i] - head.symbol[load, j]
            rows.append(c.symbol[k] * cs.sign(fall) * cs.fabs(fall) ** 0.54)
    at = {"heads": 5 * rng.normal(size=(4, 3)), "conductance": rng.uniform(0.5, 2.0, size=6)}
    return problem_of(all_of(rows, 0.01, "m^3/s"), head, c), at


def tilt_series() -> tuple[Problem, Values]:
    """Electron tomography: markers on a stage that is tilted about y, seen along parallel rays.

    Tilts, shifts and magnifications of the views are unknown.
    """
    rng = np.random.default_rng(831)
    X = Block("markers", (6, 3), "nm")
    tilt, shift = Block("tilts", (6,), "rad"), Block("shifts", (6, 2), "nm")
    size = Block("magnifications", (6,))
    rows = []
    for k in range(6):
        c, s = cs.cos(tilt.symbol[k]), cs.sin(tilt.symbol[k])
        across = c * X.symbol[0, :] + s * X.symbol[2, :]
        image = size.symbol[k] * cs.vertcat(across, X.symbol[1, :])
        rows.append(cs.vec(image + beside(shift.symbol[:, k], 6)))
    at = {
        "markers": rng.normal(size=(6, 3)),
        "tilts": np.linspace(-1.0, 1.0, 6) + 0.1 * rng.normal(size=6),
        "shifts": rng.normal(size=(6, 2)),
        "magnifications": rng.uniform(0.9, 1.1, size=6),
    }
    return problem_of(all_of(rows, 0.01, "nm"), X, tilt, shift, size), at


def markers_on_two_segments() -> tuple[Problem, Values]:
    """Motion capture: markers on two segments with a ball joint, in frames that are their own.

    Both frames may be chosen at will: six numbers of each.
    """
    rng = np.random.default_rng(832)
    upper, lower = Block("upper", (4, 3), "m"), Block("lower", (4, 3), "m")
    joint, end = Block("joint_in_upper", (3,), "m"), Block("joint_in_lower", (3,), "m")
    blocks, rows = [upper, lower, joint, end], []
    at = {"upper": rng.normal(size=(4, 3)), "lower": rng.normal(size=(4, 3))}
    at |= {joint.name: rng.normal(size=3), end.name: rng.normal(size=3)}
    for f in range(4):
        turn, bend = Block(f"frame{f}/turn", (3,), "rad"), Block(f"frame{f}/bend", (3,), "rad")
        place = Block(f"frame{f}/place", (3,), "m")
        blocks += [turn, place, bend]
        at |= {b.name: rng.normal(scale=0.6, size=3) for b in (turn, place, bend)}
        middle = turned(turn.symbol, joint.symbol) + place.symbol
        away = turned(bend.symbol, lower.symbol - beside(end.symbol, 4))
        rows.append(cs.vec(turned(turn.symbol, upper.symbol) + beside(place.symbol, 4)))
        rows.append(cs.vec(away + beside(middle, 4)))
    return problem_of(all_of(rows, 0.001, "m"), *blocks), at


def body_and_its_markers() -> tuple[Problem, Values]:
    """Joints of a body in a fixed pose and markers off them: its place and two betas are hidden."""
    rng = np.random.default_rng(833)
    body = smpl_like_body()
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    markers = Block("offsets", (24, 3), "m")
    seen = Residual("markers", cs.vec(joints.symbol + markers.symbol), 0.01, "m", points=(joints,))
    at = body.start() | {
        "pose": rng.normal(scale=0.3, size=(24, 3)),
        "offsets": rng.normal(scale=0.05, size=(24, 3)),
    }
    return Problem((seen,), ("trans", "betas[0:2]", "offsets"), blocks=(markers,)), at


def wheels_against_a_compass() -> tuple[Problem, Values]:
    """Turns of a robot by the ticks of its two wheels: radii and track have no unit."""
    rng = np.random.default_rng(834)
    radius, track = Block("radii", (2,), "m"), Block("track", (), "m")
    rows = [
        (radius.symbol[1] * right - radius.symbol[0] * left) / track.symbol
        for left, right in rng.uniform(1, 5, size=(8, 2))
    ]
    at = {"radii": np.array([0.1, 0.11]), "track": np.array(0.4)}
    return problem_of(all_of(rows, 0.01, "rad"), radius, track), at


def cluster_of_earthquakes() -> tuple[Problem, Values]:
    """Arrivals of plane waves from a cluster: T_i + p_j x_i + c_j, with terms of the stations.

    The cluster may be anywhere and at any time, if these terms follow.
    """
    rng = np.random.default_rng(835)
    X, T = Block("places", (5, 3), "km"), Block("times", (5,), "s")
    term = Block("station_terms", (8,), "s")
    p = cs.DM(rng.normal(scale=0.2, size=(3, 8)))
    rows = [
        T.symbol[i] + cs.dot(p[:, j], X.symbol[:, i]) + term.symbol[j]
        for i in range(5)
        for j in range(8)
    ]
    at = {
        "places": rng.normal(size=(5, 3)),
        "times": rng.normal(size=5),
        "station_terms": rng.normal(scale=0.1, size=8),
    }
    return problem_of(all_of(rows, 0.01, "s"), X, T, term), at


def stock_of_unknown_strength() -> tuple[Problem, Values]:
    """Langmuir's isotherms of three solids in known dilutions of an unknown stock."""
    most, K, stock = Block("capacity", (3,)), Block("affinity", (3,)), Block("stock", ())
    rows = []
    for s in range(3):
        for part in (0.05, 0.1, 0.2, 0.5, 1.0):
            x = K.symbol[s] * part * stock.symbol
            rows.append(most.symbol[s] * x / (1 + x))
    return problem_of(all_of(rows), most, K, stock), {
        "capacity": np.array([1.0, 2.0, 1.5]),
        "affinity": np.array([0.5, 2.0, 5.0]),
        "stock": np.array(1.3),
    }


def mixture_by_softmax() -> tuple[Problem, Values]:
    """A density of three equal bells, whose shares are a softmax: a level of logits, an order."""
    logit, mean = Block("logit", (3,)), Block("mean", (3,))
    share = cs.exp(logit.symbol) / cs.sum1(cs.exp(logit.symbol))
    rows = [cs.dot(share, cs.exp(-2 * (x - mean.symbol) ** 2)) for x in np.linspace(-2, 4, 14)]
    at = {"logit": np.array([0.3, -0.5, 0.8]), "mean": np.array([-0.7, 0.9, 2.6])}
    return problem_of(all_of(rows), logit, mean), at


def embeddings_with_biases() -> tuple[Problem, Values]:
    """w_i c_j + b_i + d_j: a matrix between words and contexts, and five levels.

    A vector added to all words is undone by the biases of contexts, and the other way round.
    """
    rng = np.random.default_rng(836)
    w, c = Block("words", (6, 2)), Block("contexts", (5, 2))
    b, d = Block("word_biases", (6,)), Block("context_biases", (5,))
    table = w.symbol.T @ c.symbol + cs.repmat(b.symbol, 1, 5) + cs.repmat(d.symbol.T, 6, 1)
    at = {"words": rng.normal(size=(6, 2)), "contexts": rng.normal(size=(5, 2))}
    at |= {"word_biases": rng.normal(size=6), "context_biases": rng.normal(size=5)}
    return problem_of([observed("table", table, 0.1, "1")], w, c, b, d), at


def circular_orbit_by_velocities() -> tuple[Problem, Values]:
    """Velocities of a star along the line of sight: size against tilt, time against phase."""
    drift, rate = Block("drift", (), "km/s"), Block("rate", (), "1/d")
    size, tilt = Block("size", (), "km"), Block("inclination", (), "rad")
    passage, phase = Block("passage", (), "d"), Block("argument", (), "rad")
    rows = [
        drift.symbol
        + size.symbol
        * rate.symbol
        * cs.sin(tilt.symbol)
        * cs.cos(rate.symbol * (t - passage.symbol) + phase.symbol)
        for t in np.linspace(0.0, 7.0, 15)
    ]
    return problem_of(all_of(rows, 0.1, "km/s"), drift, rate, size, tilt, passage, phase), {
        "drift": np.array(0.4),
        "rate": np.array(1.1),
        "size": np.array(2.0),
        "inclination": np.array(0.9),
        "passage": np.array(0.6),
        "argument": np.array(0.3),
    }


def crystal_from_intensities() -> tuple[Problem, Values]:
    """Equal atoms from intensities of diffraction: all may move together, and be exchanged."""
    rng = np.random.default_rng(837)
    atom = Block("atoms", (4, 2))
    rows = []
    for h in range(3):
        for k in range(-2, 3):
            if h > 0 or k > 0:
                phase = 2 * np.pi * (h * atom.symbol[0, :] + k * atom.symbol[1, :])
                rows.append(cs.sum2(cs.cos(phase)) ** 2 + cs.sum2(cs.sin(phase)) ** 2)
    return problem_of(all_of(rows), atom), {"atoms": rng.uniform(0, 1, size=(4, 2))}


def tracks_through_planes() -> tuple[Problem, Values]:
    """Straight tracks through detectors of unknown place and shift: a_t + b_t z_k - s_k.

    Levels of a, of b and of z may be undone by the others, and b has no unit against z.
    """
    rng = np.random.default_rng(838)
    a, b = Block("intercepts", (7,), "mm"), Block("slopes", (7,))
    z, s = Block("z", (5,), "mm"), Block("shifts", (5,), "mm")
    rows = [
        a.symbol[t] + b.symbol[t] * z.symbol[k] - s.symbol[k] for t in range(7) for k in range(5)
    ]
    at = {"intercepts": rng.normal(size=7), "slopes": rng.normal(size=7)}
    at |= {"z": np.arange(5.0) + 0.1 * rng.normal(size=5), "shifts": rng.normal(scale=0.1, size=5)}
    return problem_of(all_of(rows, 0.01, "mm"), a, b, z, s), at


def planes_seen_by_a_scanner() -> tuple[Problem, Values]:
    """Scans from three places of five planes, which are unit normals and distances."""
    rng = np.random.default_rng(839)
    normal, away = Block("normals", (5, 3)), Block("distances", (5,), "m")
    n = rng.normal(size=(5, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    blocks, rows = [normal, away], []
    at = {"normals": n, "distances": rng.uniform(1, 2, size=5)}
    for f in range(3):
        turn, place = Block(f"scan{f}/turn", (3,), "rad"), Block(f"scan{f}/place", (3,), "m")
        blocks += [turn, place]
        at |= {turn.name: rng.normal(scale=0.5, size=3), place.name: rng.normal(size=3)}
        for p in range(5):
            X = turned(turn.symbol, cs.MX(cs.DM(rng.normal(size=(3, 4))))) + beside(place.symbol, 4)
            rows.append((normal.symbol[:, p].T @ X).T - away.symbol[p])
    lengths = cs.vertcat(*(cs.dot(normal.symbol[:, p], normal.symbol[:, p]) for p in range(5)))
    seen = [*all_of(rows, 0.01, "m"), observed("lengths", lengths - 1, 1e-3, "1")]
    return problem_of(seen, *blocks), at


def fishery_of_known_catches() -> tuple[Problem, Values]:
    """Catch for effort q B, with B growing to K and less by known catches: these tell its size."""
    rate, K = Block("rate", (), "1/yr"), Block("K", (), "t")
    start, q = Block("start", (), "t"), Block("catchability", ())
    stock, rows = start.symbol, []
    for caught in (0.1, 0.3, 0.25, 0.1, 0.4, 0.2, 0.05, 0.3):
        rows.append(q.symbol * stock)
        stock = stock + rate.symbol * stock * (1 - stock / K.symbol) - caught
    return problem_of(all_of(rows), rate, K, start, q), {
        "rate": np.array(0.6),
        "K": np.array(2.0),
        "start": np.array(1.2),
        "catchability": np.array(0.5),
    }


NINTH_ZOO = (
    Specimen(pipes_under_three_loads, {"translation": 3, "scale": 1}, 4, 2),
    Specimen(tilt_series, {"offset": 3, "rotation": 1, "scale": 1}, 5, 2),
    Specimen(markers_on_two_segments, {"translation": 6, "rotation": 6}, 12, 2),
    Specimen(body_and_its_markers, {"translation": 3, "trade-off": 2}, 5, 2),
    Specimen(wheels_against_a_compass, {"scale": 1}, 1, 1),
    Specimen(cluster_of_earthquakes, {"translation": 3, "offset": 1}, 4, 2),
    Specimen(stock_of_unknown_strength, {"scale": 1}, 1, 1),
    Specimen(mixture_by_softmax, {"offset": 1}, 1, 1, exchanged=("logit", "mean")),
    Specimen(embeddings_with_biases, {"offset": 5, "scale": 2, "mixing": 2}, 9, 5),
    Specimen(circular_orbit_by_velocities, {"trade-off": 2}, 2, 2),
    Specimen(crystal_from_intensities, {"offset": 2}, 2, 1, exchanged=("atoms",)),
    Specimen(tracks_through_planes, {"offset": 3, "scale": 1}, 4, 4),
    Specimen(planes_seen_by_a_scanner, {"translation": 3, "rotation": 3}, 6, 1),
    Specimen(fishery_of_known_catches, {}, 0, 0),
)
