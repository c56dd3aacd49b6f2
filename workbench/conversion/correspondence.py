"""Where each vertex of one body lies on the surface of another.

Two meshes of the same triangles correspond vertex by vertex. Otherwise one body is brought into
the rest pose and the shape of the other, first by the joints that both have, and then by the
closest places on the surface, as in ICP (Besl and McKay, 1992). There each of its vertices has a
closest place, which is a mean of three corners of a triangle and moves with them ever after.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, eye_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Block, Values
from workbench.bodies.body import Body, regressed
from workbench.errors import BadArgument, some_of
from workbench.fitting.body_priors import shape_prior
from workbench.fitting.placing import moved
from workbench.geometry.rigid import procrustes
from workbench.geometry.solids import vertex_normals
from workbench.geometry.surface_tree import SurfaceTree, barycentric_weights
from workbench.problem import Problem
from workbench.residuals import Residual, gaussian, landmarks, vertices
from workbench.solvers import TrustRegion

FEWEST_COMMON = 3  # joints that two bodies have in common, by which one is placed on the other
JOINT_SIGMA = 0.01  # m, of a joint of one body beside that of another
SURFACE_SIGMA = 0.005  # m, of a vertex beside the closest place on another surface
POSE_SIGMA = 0.3  # rad, between the rest poses of two bodies
CLOSEST_ROUNDS = 8  # of closest places and a fit to them
SAMPLED_VERTICES = 1200  # vertices by which one surface is brought onto the other
LEAST_FACING = 0.3  # cosine between the normals of a vertex and of its place
FARTHEST_PLACE = 0.05  # m: a vertex farther than this from the other surface has no place there
FEWEST_OF_JOINT = 20  # vertices of each joint, or all that it has: six numbers place a rigid part

Said = Callable[[str], object]


def sampled_vertices(body: Body, count: int) -> Index:
    """About `count` vertices, in order, evenly over those that follow each joint most.

    Those that follow one joint are taken at equal steps in the order of the mesh; each joint has
    its share of all vertices, but `FEWEST_OF_JOINT` of them or all that it has.
    """
    N, owner = body.n_vertices, body.vertex_weights.argmax(axis=1)
    chosen: list[int] = []
    for k in range(body.n_joints):
        own = np.flatnonzero(owner == k)
        many = min(len(own), max(FEWEST_OF_JOINT, round(count * len(own) / N)))
        if many:
            chosen += own[np.linspace(0, len(own) - 1, many).round().astype(int)].tolist()
    return np.array(sorted(chosen), dtype=np.int64)


def counted(body: Body, chosen: Index) -> Array:
    """How many of all vertices each chosen one stands for, (n,), divided by their mean."""
    owner = body.vertex_weights.argmax(axis=1)
    of_all = np.bincount(owner, minlength=body.n_joints)
    of_chosen = np.bincount(owner[chosen], minlength=body.n_joints)
    weights = of_all[owner[chosen]] / of_chosen[owner[chosen]]
    return np.asarray(weights / weights.mean())


@dataclass(frozen=True, eq=False)
class Correspondence:
    """The places of a target's N vertices on the surface of a source of M vertices.

    Attributes:
        places: (N, M) rows that sum to one: each place as a mean of the source's vertices.
        matched: (N,) whether the vertex has a place that faces as it does and is not far from it.
        distances: (N,) m from the vertex to its place, in the rest pose of the source.
        rest: pose, betas and trans at which the target lies on the source's rest pose.
        same: whether both meshes have the same triangles, so that vertices correspond.
    """

    places: csr_array
    matched: Mask
    distances: Array
    rest: Values
    same: bool

    def of(self, surface: Array) -> Array:
        """The places (..., N, 3) m on a source's surface (..., M, 3) m, in whatever pose."""
        return regressed(self.places, surface)

    def __str__(self) -> str:
        if self.same:
            return f"the same triangles: {len(self.matched)} vertices correspond one to one"
        known = self.distances[self.matched]
        return (
            f"{self.matched.sum()} of {len(self.matched)} vertices have a place on the other "
            f"surface, {1e3 * known.mean():.1f} mm away on average at rest"
        )


def correspond(source: Body, target: Body, said: Said = lambda text: None) -> Correspondence:
    """Find the places of a target's vertices on a source, in the source's rest pose.

    The result serves all motions of the source. Raises BadArgument if their triangles
    differ and fewer than three joints have the same names.
    """
    N = target.n_vertices
    if source.n_vertices == N and np.array_equal(source.faces, target.faces):
        every, none = np.ones(N, dtype=bool), np.zeros(N)
        return Correspondence(csr_array(eye_array(N)), every, none, target.start(), True)
    surface = source.vertices()
    tree = SurfaceTree(surface, source.faces)
    said("the joints of one body are brought onto those of the other")
    values = _by_joints(source, target)
    chosen = sampled_vertices(target, SAMPLED_VERTICES)
    problem = _to_places(target, chosen)
    solver = TrustRegion(max_iterations=10, gradient_tolerance=1e-3)
    said(f"closest places are found, and the body fitted to them, {CLOSEST_ROUNDS} times")
    for _ in range(CLOSEST_ROUNDS):
        posed = _vertices(target, values)
        places, seen, _ = _closest(tree, posed, target.faces, chosen)
        start = values | {"observed": places, "seen": seen.astype(float)}
        values |= {
            name: value
            for name, value in solver.solve(problem, start).values.items()
            if name in values
        }
    posed = _vertices(target, values)
    _, matched, distances = _closest(tree, posed, target.faces, np.arange(N))
    return Correspondence(
        barycentric_weights(surface, source.faces, posed), matched, distances, values, False
    )


def _vertices(body: Body, values: Values) -> Array:
    return body.vertices(*(values[block.name] for block in body.blocks()))


def _closest(
    tree: SurfaceTree, posed: Array, faces: Index, chosen: Index
) -> tuple[Array, Mask, Array]:
    """The places (n, 3) of some vertices, which of them are right, and how far they are, in m."""
    closest = tree.closest(posed[chosen])
    facing = (vertex_normals(posed, faces)[chosen] * closest.normals).sum(axis=1)
    distances = np.abs(closest.distances)
    return (
        closest.points,
        np.asarray((facing > LEAST_FACING) & (distances < FARTHEST_PLACE)),
        distances,
    )


def _by_joints(source: Body, target: Body) -> Values:
    """The target with its joints where those of the same names of the source are at rest."""
    shared = [name for name in target.joint_names if name in source.joint_names]
    if len(shared) < FEWEST_COMMON:
        raise BadArgument(
            f"bodies {source.name!r} and {target.name!r} have {len(shared)} joints of the same "
            f"names, and one is placed on the other by {FEWEST_COMMON} or more; the joints are "
            f"{some_of(source.joint_names)} and {some_of(target.joint_names)}; rename those that "
            "are the same"
        )
    ours = [source.joint_names.index(name) for name in shared]
    theirs = [target.joint_names.index(name) for name in shared]
    observed = np.zeros((target.n_joints, 3))
    observed[theirs] = source.joints()[ours]
    seen = np.zeros(target.n_joints)
    seen[theirs] = 1.0
    pose, betas, trans = target.blocks()
    points = target.joint_points(pose.symbol, betas.symbol, trans.symbol)
    data = landmarks(points, observed, sigma=JOINT_SIGMA, name="joints")
    problem = Problem(
        [replace(data, weights=seen), rest_pose_prior(target, POSE_SIGMA), shape_prior(target)],
        (trans.name, pose.name, betas.name),
    )
    at_rest = target.joints()
    motion = procrustes(at_rest[theirs], observed[theirs])
    start = target.start() | moved(target, motion.R, motion.t)
    return {**start, **TrustRegion(max_iterations=50).solve(problem, start).values}


def rest_pose_prior(body: Body, sigma: float) -> Residual:
    """Each joint but the root is as at rest, with `sigma` in rad about each axis."""
    pose, mean = body.blocks()[0].symbol[:, 1:], body.bind_pose[1:]
    return gaussian(pose, mean=mean, covariance=sigma**2, unit="rad", name="rest pose")


def _to_places(body: Body, chosen: Index) -> Problem:
    """A fit of some vertices of a body to places, which may be others each time."""
    pose, betas, trans = body.blocks()
    points = body.points(pose.symbol, betas.symbol, trans.symbol, vertices=chosen)
    place, seen = Block("observed", (len(chosen), 3), "m"), Block("seen", (len(chosen),))
    data = vertices(points, place.symbol, sigma=SURFACE_SIGMA, name="surface")
    return Problem(
        [replace(data, weights=seen.symbol), rest_pose_prior(body, POSE_SIGMA), shape_prior(body)],
        (trans.name, pose.name, betas.name),
        blocks=(place, seen),
    )
