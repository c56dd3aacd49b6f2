"""The measurements of a person that a tailor takes: heights, lengths and girths of a body at rest.

Each is a function of the body's shape alone, differentiable, and made of points P_k that stay where
they are on the mesh: vertices, joints, or (1 - t_k) v_i + t_k v_j on the edge between two vertices.
They are found once, on the template:

    a height   y of the first point - y of the last
    a length   sum_k |P_k+1 - P_k|
    a girth    the same along a closed path, around which a tape would lie

A girth is where a plane cuts the template, without the hollows that a tape passes over (the convex
hull of the cut). On another shape a new cut at the same level differs by a few millimetres
(`tests/fitting/test_measures.py`). Names and levels are those of ISO 8559-1:2017 and ISO
7250-1:2017 as far as a mesh shows them; levels that these find by touch, such as the lowest rib,
are replaced by the narrowest or widest place.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csr_array, kron, vstack
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import why_not_skinned
from workbench.bodies.forward.kinematics import ancestors
from workbench.diagnostics.design import Quantity
from workbench.errors import BadArgument, NotFinite, TooLarge
from workbench.fitting.images import Z90
from workbench.problem import Problem
from workbench.sampling import Posterior, contraction

GIRTH_LEVELS = 25  # at which a girth is looked for
BELOW_CROTCH = 0.03  # of the way from the crotch to the knee: the highest place of a thigh
ARMPIT_RATIO = 1.3  # times as far out as the shoulder joints: wider cuts are of the arms as well
ON_THE_PLANE = 1e-9  # m
UNDETERMINED = 1e-6  # of the length of a gradient: a part in the null space that is not rounding
UP, ACROSS = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
ARM = ("wrist", "elbow", "shoulder")
PERSON_JOINTS = ("pelvis", "spine3", "neck", "head") + tuple(
    f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", *ARM)
)


@dataclass(frozen=True, eq=False)
class MeasuredPath:
    """P points of the surface at rest of which a measurement is made, by weights (P, N) of
    vertices; a path through them that may be closed, or of which the height alone counts.
    """

    weights: csr_array
    closed: bool = False
    vertical: bool = False

    def length(self, points: cs.MX) -> cs.MX:
        """The measurement in m, of the points (3, P)."""
        if self.vertical:
            return points[1, 0] - points[1, -1]
        ahead = cs.horzcat(points[:, 1:], points[:, 0]) if self.closed else points[:, 1:]
        return cs.sum2(cs.sqrt(cs.sum1((ahead - points[:, : ahead.shape[1]]) ** 2)))


def measures(body: SkinnedBody) -> dict[str, Quantity]:
    """The measurements of a body with the joints of a person, by name, in m, symbols of its betas.

    Stature, inseam (crotch height), arm span (along the joints, so that arms need not be
    stretched), shoulder width (between the places above the joints); girths of chest, waist, hips,
    thigh, upper arm and neck, limbs on the right. Raises
    BadArgument for a body that is not skinned, of which joints have other names, or whose surface
    is not a person's.
    """
    quantities, paths, betas = {}, _paths(body), body.blocks()[1]
    shapes = body.shapedirs.reshape(-1, body.n_betas)
    for name, path in paths.items():
        rows = kron(path.weights, np.eye(3), format="csr")
        rest = cs.DM(rows @ body.template.ravel()) + cs.DM(rows @ shapes) @ betas.symbol
        expression = path.length(cs.reshape(rest, 3, path.weights.shape[0]))
        quantities[name] = Quantity(name, expression, "m", blocks=(betas,))
    return quantities


def measured(body: SkinnedBody, betas: ArrayLike) -> dict[str, Array]:
    """The measurements (...) m of bodies with betas (..., B). Raises what `measures` raises.

    >>> from workbench import load_body
    >>> body = load_body("small")
    >>> found = measured(body, np.zeros(body.n_betas))
    >>> f"{found['stature']:.2f}", f"{found['waist']:.2f}"  # m
    ('1.68', '0.82')
    """
    betas = np.asarray(betas, dtype=float)
    quantities = measures(body)
    symbol = body.blocks()[1].symbol
    function = cs.Function("measures", [symbol], [q.expression for q in quantities.values()])
    columns = function(betas.reshape(-1, body.n_betas).T)
    return {
        name: np.asarray(column).reshape(betas.shape[:-1])
        for name, column in zip(quantities, columns, strict=True)
    }


@dataclass(frozen=True)
class Measurement:
    """A measurement of a fitted body.

    Attributes:
        name: such as `waist`.
        value: in m.
        sd: its standard deviation in m, infinite where nothing determines it.
        prior_sd: the same of the priors without the data; infinite where these say nothing.
    """

    name: str
    value: float
    sd: float
    prior_sd: float = np.inf

    @property
    def contraction(self) -> float:
        """1 - sd / (sd of the prior): near 0, the data do not determine the measurement."""
        return float(contraction(np.array(self.sd), np.array(self.prior_sd)))

    @property
    def interval(self) -> tuple[float, float]:
        """The central interval of 90 %, in m."""
        return self.value - Z90 * self.sd, self.value + Z90 * self.sd


def measured_at(
    problem: Problem, values: Values, quantities: Mapping[str, Quantity]
) -> dict[str, tuple[float, float]]:
    """Each quantity at a point and its standard deviation by Laplace's approximation.

    With the Jacobian g (n,) of a quantity, its variance is g' (J'J)^-1 g. It is infinite where g
    has a part in the null space of J: nothing determines the quantity.
    """
    s, V = problem.linearize(values).spectrum.determined
    # a problem may have a residual of the same name, such as that of a known stature
    rows = [replace(q.residual, name=f"measured {name}") for name, q in quantities.items()]
    here = problem.variant([*problem.residuals, *rows], problem.free.spelled()).linearize(values)
    estimates = {}
    for name, value, g in zip(
        quantities, here.residual[-len(rows) :], here.dense[-len(rows) :], strict=True
    ):
        parts = V @ g
        undetermined = np.linalg.norm(g - parts @ V) > UNDETERMINED * np.linalg.norm(g)
        sd = np.inf if undetermined else float(np.linalg.norm(parts / s))
        estimates[name] = float(value), sd
    return estimates


def measurements(
    body: object, problem: Problem, values: Values, priors: Sequence[str]
) -> tuple[Measurement, ...]:
    """Those of the body that a problem fits, at its solution.

    `priors` names the residuals that are no data. There are none of what is not a person's body,
    and none where its betas are not free.
    """
    person = person_of(body, problem)
    if person is None:
        return ()
    data = [r.name for r in problem.residuals if r.name not in priors]
    try:
        quantities = measures(person)
        estimates = measured_at(problem, values, quantities)
        before = measured_at(problem.without(*data), values, quantities) if priors else {}
    except (BadArgument, TooLarge, NotFinite):  # a surface of no person, or free vertices
        return ()
    return tuple(
        Measurement(name, value, sd, before[name][1] if before else np.inf)
        for name, (value, sd) in estimates.items()
    )


def person_of(body: object, problem: Problem) -> SkinnedBody | None:
    """The body that a problem fits, if it is a person's and its betas are free."""
    if not isinstance(body, SkinnedBody) or not set(PERSON_JOINTS) <= set(body.joint_names):
        return None
    return body if body.blocks()[1].name in problem.free.names else None


def measured_in(posterior: Posterior, body: SkinnedBody, count: int = 4000) -> dict[str, Array]:
    """The measurements (count,) m of random draws of a posterior, what is integrated out included.

    `numpy.quantile` of each gives its intervals. Raises what `measures` raises.
    """
    name = body.blocks()[1].name
    return measured(body, [values[name] for values in posterior.values(count)])


@lru_cache(maxsize=8)
def _paths(body: SkinnedBody) -> dict[str, MeasuredPath]:
    """The points of each measurement, found on the template at rest."""
    if reason := why_not_skinned(body, "a measurement", "measure its vertices"):
        raise BadArgument(reason)
    if missing := [name for name in PERSON_JOINTS if name not in body.joint_names]:
        raise BadArgument(
            f"measurements are those of a person, and body {body.name!r} has no joint called "
            f"{', '.join(missing)}"
        )
    person = _Person(body)
    joints, y = person.joints, body.template[:, 1]
    top, bottom = person.at_vertex(int(np.argmax(y))), person.at_vertex(int(np.argmin(y)))
    crotch = person.farthest(person.cut(joints["pelvis"], ACROSS), -UP)
    low, middle, high = (crotch @ body.template)[0, 1], joints["pelvis"][1], joints["spine3"][1]
    trunk = [person.horizontal(y, "pelvis") for y in np.linspace(low, middle, GIRTH_LEVELS)[1:]]
    waists = [person.horizontal(y, "pelvis") for y in np.linspace(middle, high, GIRTH_LEVELS)]
    waist = min(waists, key=person.girth)
    necks = [person.across("neck", "head", share) for share in np.linspace(0, 1, GIRTH_LEVELS)]
    shoulders = [
        person.farthest(person.cut(joints[f"{side}_shoulder"], ACROSS), UP)
        for side in ("left", "right")
    ]
    thigh = low - BELOW_CROTCH * (low - joints["right_knee"][1])
    girths = {
        "chest": person.chest((waist @ body.template)[0, 1]),
        "waist": waist,
        "hips": max(trunk, key=person.girth),
        "thigh": person.horizontal(thigh, "right_hip"),
        "upper arm": person.across("right_shoulder", "right_elbow", 0.5),
        "neck": min(necks, key=person.girth),
    }
    return {
        "stature": MeasuredPath(vstack([top, bottom]), vertical=True),
        "inseam": MeasuredPath(vstack([crotch, bottom]), vertical=True),
        "arm span": MeasuredPath(person.span()),
        "shoulder width": MeasuredPath(vstack(shoulders)),
        **{name: MeasuredPath(path, closed=True) for name, path in girths.items()},
    }


class _Person:
    """The template of a body, its joints (3,) at rest by name, and where planes cut it."""

    def __init__(self, body: SkinnedBody) -> None:
        self.v, self.faces = body.template, body.faces
        self.regressor = csr_array(body.J_regressor)
        self.number = {name: k for k, name in enumerate(body.joint_names)}
        rest = self.regressor @ self.v
        self.joints = {name: rest[k] for name, k in self.number.items()}
        self.parents, self.follows = body.parents, np.argmax(body.vertex_weights, axis=1)

    def at_vertex(self, place: int) -> csr_array:
        """The weights (1, N) of a vertex."""
        return csr_array(([1.0], ([0], [place])), shape=(1, len(self.v)))

    def cut(self, origin: Array, normal: Array) -> csr_array:
        """Points (P, N) in a row, around the loop of a plane's cut that is nearest to the origin.

        Those in hollows, over which a tape would pass, are left out.
        """
        d = (self.v - origin) @ normal
        d[abs(d) < ON_THE_PLANE] = ON_THE_PLANE  # so that each edge is cut, or not
        ends = self.faces[:, [[0, 1], [1, 2], [2, 0]]]
        crossed = d[ends[..., 0]] * d[ends[..., 1]] < 0  # (F, 3): two edges of a face, or none
        ends = np.sort(ends[crossed.any(axis=1)][crossed[crossed.any(axis=1)]], axis=-1)
        edges, pairs = np.unique(ends, axis=0, return_inverse=True)
        i, j = edges.T
        share = d[i] / (d[i] - d[j])
        rows = np.arange(len(edges))
        weights = csr_array(
            (np.concatenate([1 - share, share]), (np.tile(rows, 2), np.concatenate([i, j]))),
            shape=(len(edges), len(self.v)),
        )
        one, other = pairs.reshape(-1, 2).T
        joined = coo_array((np.ones(len(one)), (one, other)), shape=(len(edges), len(edges)))
        _, loop = connected_components(joined, directed=False)
        points = weights @ self.v
        centres = [points[loop == k].mean(axis=0) for k in range(loop.max() + 1)]
        chosen = np.flatnonzero(loop == np.argmin(np.linalg.norm(centres - origin, axis=1)))
        across = np.linalg.svd(normal[None])[2][1:]  # two directions in the plane
        if len(chosen) < 4:
            raise BadArgument(
                f"measurements are those of a person; the surface at {np.round(origin, 3)} m has "
                "no girth there"
            )
        return weights[chosen[ConvexHull(points[chosen] @ across.T).vertices]]

    def horizontal(self, y: float, joint: str) -> csr_array:
        """The horizontal cut at a height around a joint."""
        x, _, z = self.joints[joint]
        return self.cut(np.array([x, y, z]), UP)

    def across(self, start: str, end: str, share: float) -> csr_array:
        """The cut across the line between two joints."""
        axis = self.joints[end] - self.joints[start]
        return self.cut(self.joints[start] + share * axis, axis / np.linalg.norm(axis))

    def girth(self, weights: csr_array) -> float:
        """The length in m of a closed path on the template."""
        points = weights @ self.v
        return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())

    def farthest(self, cut: csr_array, direction: Array) -> csr_array:
        """The point (1, N) of a cut that is farthest in a direction."""
        return cut[[int(np.argmax(cut @ self.v @ direction))]]

    def chest(self, waist: float) -> csr_array:
        """The cut where the torso reaches farthest to the front, below the armpits."""
        shoulder = self.joints["right_shoulder"]
        cuts = [self.horizontal(y, "spine3") for y in np.linspace(waist, shoulder[1], GIRTH_LEVELS)]
        points = [cut @ self.v for cut in cuts]
        armpit = ARMPIT_RATIO * abs(shoulder[0])
        torso = [k for k, cut_points in enumerate(points) if abs(cut_points[:, 0]).max() < armpit]
        return cuts[max(torso, key=lambda k: points[k][:, 2].max())]

    def fingertip(self, side: str) -> int:
        """The vertex of a hand that is farthest from its wrist."""
        wrist = self.number[f"{side}_wrist"]
        below = ancestors(self.parents)[:, wrist] > 0
        of_hand = np.flatnonzero(below[self.follows])
        away = np.linalg.norm(self.v[of_hand] - self.joints[f"{side}_wrist"], axis=1)
        return int(of_hand[np.argmax(away)])

    def span(self) -> csr_array:
        """From fingertip to fingertip, through the joints of both arms."""
        chain = [f"left_{joint}" for joint in ARM] + [f"right_{joint}" for joint in reversed(ARM)]
        return csr_array(
            vstack(
                [
                    self.at_vertex(self.fingertip("left")),
                    *(self.regressor[[self.number[joint]]] for joint in chain),
                    self.at_vertex(self.fingertip("right")),
                ]
            )
        )
