"""Checks of lecture 14, and the mistakes that they tell apart."""

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec14_triangles import solutions

RNG = np.random.default_rng(14)
TRIANGLES = [0.05 * RNG.standard_normal((3, 3)) for _ in range(3)]
TURNS = Rotation.random(3, rng=RNG).as_matrix()
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
POINTS = RNG.standard_normal((4, 3))
STRIP = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4]])


# frame


@check("frame", points=1)
def has_the_edges(frame):
    """its columns are the edges and what is at right angles to them"""
    for T in TRIANGLES:
        E = frame(T)
        equal(E[:, :2], np.column_stack([T[2] - T[0], T[1] - T[0]]), "the first two columns")
        equal(E[:, :2].T @ E[:, 2], [0, 0], "edges times third axis", 1e-12)
        twice_the_area = np.linalg.norm(np.cross(T[1] - T[0], T[2] - T[0]))
        equal(E[:, 2] @ E[:, 2], twice_the_area, "the third axis's length, squared", 1e-12)


@check("frame", points=1)
def turns_and_grows_along(frame):
    """it turns and grows with the triangle"""
    for T, R in zip(TRIANGLES, TURNS, strict=True):
        equal(
            frame(3 * T @ R.T),
            3 * R @ frame(T),
            "the frame of the triangle, turned and 3 x as large",
        )
        equal(frame(T)[:, 2], solutions.frame(T)[:, 2], "the third axis")


@mistake("frame", "the edges stand in rows; an X that acts on columns needs them as columns")
def edges_in_rows(T):
    return solutions.frame(T).T


@mistake("frame", "a third axis of length 1 does not grow with the triangle: divide n by sqrt(|n|)")
def with_a_unit_normal(T):
    E = solutions.frame(T)
    E[:, 2] /= np.linalg.norm(E[:, 2])
    return E


@mistake("frame", "n itself grows with the square of the triangle: divide it by sqrt(|n|)")
def with_the_cross_product(T):
    E = solutions.frame(T)
    E[:, 2] = np.cross(E[:, 1], E[:, 0])
    return E


@mistake("frame", "n is e_1 x e_0; this is e_0 x e_1, which points to the other side")
def on_the_other_side(T):
    return solutions.frame(T) * [1, 1, -1]


@mistake("frame", "e_0 is T_2 - T_0, and e_1 is T_1 - T_0: they have changed places")
def edges_swapped(T):
    return solutions.frame(T[[0, 2, 1]])


# deformation


@check("deformation", points=1)
def finds_what_was_done(deformation):
    """of a rotation and a scaling it finds both"""
    for T, R in zip(TRIANGLES, TURNS, strict=True):
        equal(deformation(T, T), np.eye(3), "X of a triangle that stays", 1e-8)
        equal(
            deformation(T, 1.5 * T @ R.T + 7),
            1.5 * R,
            "X of a triangle turned, 1.5 x as large, moved",
        )


@check("deformation", points=1)
def goes_on(deformation):
    """one after the other is their product, and back is the inverse"""
    T, V, W = TRIANGLES
    first, then = deformation(T, V), deformation(V, W)
    equal(deformation(T, W) / 10, then @ first / 10, "X from T to W, a tenth of it", 1e-6)
    edges = np.column_stack([T[2] - T[0], T[1] - T[0]])
    equal(first @ edges, np.column_stack([V[2] - V[0], V[1] - V[0]]), "X times the edges of T")


@mistake("deformation", "X frame(T) = frame(V): the inverse stands on the right")
def inverse_on_the_left(T, V):
    return np.linalg.inv(solutions.frame(T)) @ solutions.frame(V)


@mistake("deformation", "this leads from V back to T")
def the_way_back(T, V):
    return solutions.deformation(V, T)


@mistake(
    "deformation",
    "two edges leave the normal open, and a pseudo-inverse flattens it: take the frame",
)
def from_two_edges(T, V):
    return solutions.frame(V)[:, :2] @ np.linalg.pinv(solutions.frame(T)[:, :2])


@mistake("deformation", "X is transposed: edges are columns, and X stands before them")
def deformation_transposed(T, V):
    return solutions.deformation(T, V).T


# edge_matrix


@check("edge_matrix", points=1)
def gives_the_edges(edge_matrix):
    """A V are the edges of every face"""
    for faces, N in ((TETRAHEDRON, 4), (STRIP, 5)):
        V = np.random.default_rng(N).standard_normal((N, 3))
        found = edge_matrix(faces, N) @ V
        for f, (a, b, c) in enumerate(faces):
            equal(found[2 * f], V[c] - V[a], f"row {2 * f} of A V, e_0 of face {f}")
            equal(found[2 * f + 1], V[b] - V[a], f"row {2 * f + 1} of A V, e_1 of face {f}")


@check("edge_matrix", points=1)
def sees_differences_only(edge_matrix):
    """where the mesh is, it does not see; all else it does"""
    A = edge_matrix(STRIP, 5)
    equal(A @ np.ones(5), np.zeros(6), "A times (1, 1, ..., 1)")
    equal(np.linalg.matrix_rank(A), 4, "the rank of A for 5 vertices in one piece")
    equal(A[0], [-1, 0, 1, 0, 0], "the first row")


@mistake("edge_matrix", "the signs: an edge is where it leads to minus where it begins, T_2 - T_0")
def backwards(faces, N):
    return -solutions.edge_matrix(faces, N)


@mistake("edge_matrix", "the two edges of each face have changed places: e_0 is T_2 - T_0")
def in_the_other_order(faces, N):
    return solutions.edge_matrix(faces[:, [0, 2, 1]], N)


@mistake(
    "edge_matrix", "rows 2 f and 2 f + 1 belong to face f; here all e_0 come first, then all e_1"
)
def all_of_one_kind_first(faces, N):
    A = solutions.edge_matrix(faces, N)
    return np.vstack([A[::2], A[1::2]])


# stitch


@check("stitch", points=1)
def puts_a_mesh_together(stitch):
    """edges of a mesh give that mesh"""
    A = solutions.edge_matrix(TETRAHEDRON, 4)
    for V in (POINTS, POINTS + 5):
        equal(stitch(A, A @ V), V - V.mean(axis=0), "the vertices of a tetrahedron, from its edges")


@check("stitch", points=1)
def is_nearest(stitch):
    """of edges that do not fit, it is the nearest, about the origin"""
    A = solutions.edge_matrix(STRIP, 5)
    e = np.random.default_rng(1).standard_normal((6, 3))
    V = stitch(A, e)
    equal(A.T @ (A @ V - e), np.zeros((5, 3)), "A'(A V - e)")
    equal(V.mean(axis=0), np.zeros(3), "the mean of the vertices")


@mistake("stitch", "the first vertex is at the origin here; asked is the mean of all")
def pinned_at_the_first(A, e):
    V = solutions.stitch(A, e)
    return V - V[0]


@mistake(
    "stitch", "the edges are not met best: this follows the first face that reaches each vertex"
)
def edge_by_edge(A, e):
    V, known = np.zeros((A.shape[1], 3)), {0}
    for _ in range(A.shape[1]):
        for row, edge in zip(A, e, strict=True):
            begin, end = int(np.argmin(row)), int(np.argmax(row))
            if begin in known and end not in known:
                V[end] = V[begin] + edge
                known.add(end)
            elif end in known and begin not in known:
                V[begin] = V[end] - edge
                known.add(begin)
    return V - V.mean(axis=0)


@mistake("stitch", "A'e is what the edges pull at each vertex; A'A V = A'e has yet to be solved")
def without_solving(A, e):
    pulled = A.T @ e
    return pulled - pulled.mean(axis=0)


@mistake(
    "stitch",
    "A'A has no inverse: edges do not say where the mesh is. Solve by least squares, and take the mean off",
)
def by_an_inverse(A, e):
    raise np.linalg.LinAlgError("Singular matrix")


@mistake("stitch", "the edges are met, but the mean is not at the origin: take it off in the end")
def where_they_were(A, e):
    return solutions.stitch(A, e) + 1


# blend_volume


@check("blend_volume", points=1)
def is_one_where_nothing_is_blended(blend_volume):
    """one rotation alone keeps volumes, and so do two that are alike"""
    for w, alpha in ((0.0, 2.0), (1.0, 2.0), (0.3, 0.0), (0.5, 2 * np.pi)):
        equal(blend_volume(w, alpha), 1, f"the volume for w = {w}, alpha = {alpha:.3f}")
    equal(blend_volume(0.5, np.pi), 0, "the volume halfway, half a turn apart")


@check("blend_volume", points=1)
def is_the_determinant(blend_volume):
    """it is the determinant of w I + (1 - w) R"""
    for w, alpha in ((0.5, 1.0), (0.5, 2.0), (0.25, 2.5), (0.8, 3.0)):
        R = Rotation.from_rotvec([0, 0, alpha]).as_matrix()
        expected = np.linalg.det(w * np.eye(3) + (1 - w) * R)
        equal(blend_volume(w, alpha), expected, f"the volume for w = {w}, alpha = {alpha}")


@mistake(
    "blend_volume",
    "this is how much a radius shrinks; a volume shrinks in two directions: its square",
)
def of_the_radius(w, alpha):
    return np.sqrt(solutions.blend_volume(w, alpha))


@mistake("blend_volume", "this is right for w = 1/2 alone; it has to depend on w")
def for_a_half(w, alpha):
    return np.cos(alpha / 2) ** 2


@mistake(
    "blend_volume", "a rotation by the mean angle keeps all volumes; a mean of matrices does not"
)
def of_the_mean_angle(w, alpha):
    return 1.0


# explained

PEOPLE = np.random.default_rng(3).standard_normal((30, 8)) * [5, 3, 2, 1, 1, 0.5, 0.3, 0.1] + 10


@check("explained", points=1)
def goes_from_none_to_all(explained):
    """none explain nothing, all explain all, and more explain more"""
    shares = [explained(PEOPLE, k) for k in range(9)]
    equal(shares[0], 0, "the share of no directions")
    equal(shares[8], 1, "the share of as many as there are")
    holds((np.diff(shares) > 0).all(), "shares for k = 0 to 8", "rising", np.array(shares))
    away = explained(PEOPLE + 1000, 2)
    equal(away, shares[2], "the share of two, everybody 1000 further away", 1e-7)


@check("explained", points=2)
def is_the_most(explained):
    """no other directions explain more, and some explain so much"""
    centred = PEOPLE - PEOPLE.mean(axis=0)
    for k in (1, 3):
        Q = np.linalg.svd(centred, full_matrices=False)[2][:k].T
        share = np.sum((centred @ Q) ** 2) / np.sum(centred**2)
        equal(explained(PEOPLE, k), share, f"the share of {k} directions")


@mistake(
    "explained",
    "the mean has to be taken off first: else the first direction is where everybody is",
)
def about_zero(people, k):
    s = np.linalg.svd(people, compute_uv=False)
    return np.sum(s[:k] ** 2) / np.sum(s**2)


@mistake("explained", "variance is the square: this is a share of singular values themselves")
def of_deviations(people, k):
    s = np.linalg.svd(people - people.mean(axis=0), compute_uv=False)
    return np.sum(s[:k]) / np.sum(s)


@mistake("explained", "those are the k largest coordinates; directions may lie askew to them")
def of_coordinates(people, k):
    variance = np.sort(people.var(axis=0))[::-1]
    return np.sum(variance[:k]) / np.sum(variance)


@mistake("explained", "this is what is left over: the share that is not explained")
def left_over(people, k):
    return 1 - solutions.explained(people, k)
