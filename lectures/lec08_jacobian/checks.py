"""Checks of lecture 8, and the mistakes that they tell apart."""

from functools import cache

import numpy as np

import workbench as wb
from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec08_jacobian import solutions

RNG = np.random.default_rng(8)
SMPL = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
TREES = {
    "one bone": [-1, 0],
    "three joints in a row": [-1, 0, 1],
    "a fork": [-1, 0, 1, 1],
    "a star with four bones": [-1, 0, 0, 0, 0],
    "SMPL": SMPL,
}


def of_rank(m, n, r, scale=1.0):
    return scale * RNG.standard_normal((m, r)) @ RNG.standard_normal((r, n))


MATRICES = [of_rank(9, 6, 4), of_rank(5, 7, 5), of_rank(8, 5, 5), of_rank(12, 6, 2)]


# rank


@check("rank", points=1)
def counts_what_is_noticed(rank):
    """it counts directions, not equations"""
    for J, r in ((np.eye(4)[:3], 3), (np.zeros((3, 5)) + np.eye(3, 5) * [1, 1, 0, 0, 0], 2)):
        equal(rank(J), r, f"the rank of a matrix {J.shape} with {r} ones on its diagonal")
    for J, r in zip(MATRICES, (4, 5, 5, 2), strict=True):
        equal(rank(J), r, f"the rank of a random matrix {J.shape}")


@check("rank", points=1)
def does_not_mind_units(rank):
    """another unit changes no rank"""
    for scale in (1e-14, 1e-3, 1e9):
        for J, r in zip(MATRICES, (4, 5, 5, 2), strict=True):
            equal(rank(scale * J), r, f"the rank of {scale} times a matrix of rank {r}")


@mistake(
    "rank",
    "rounding leaves no singular value exactly 0: compare with the largest, times about 1e-16 max(m, n)",
)
def of_exact_zeros(J):
    return int(np.sum(np.linalg.svd(J, compute_uv=False) > 0))


@mistake(
    "rank",
    "a fixed limit goes wrong in other units: make it relative to the largest singular value",
)
def with_a_fixed_border(J):
    return int(np.sum(np.linalg.svd(J, compute_uv=False) > 1e-10))


@mistake(
    "rank", "the number of equations or unknowns is only a bound: some equations may say the same"
)
def of_the_shape(J):
    return min(J.shape)


# null_space


@check("null_space", points=1)
def is_not_noticed(null_space):
    """J N = 0, and there are as many columns as directions are missing"""
    for J in MATRICES:
        N = null_space(J)
        equal(J @ N, np.zeros((len(J), N.shape[1])), "J N", 1e-9)


@check("null_space", points=1)
def is_orthonormal(null_space):
    """N'N = I"""
    for J in MATRICES[:2] + MATRICES[3:]:
        N = null_space(J)
        equal(N.T @ N, np.eye(N.shape[1]), "N'N", 1e-9)
        holds(np.linalg.norm(J @ N) < 1e-9, "J N", "zero", f"{np.linalg.norm(J @ N):.1e}")


@mistake(
    "null_space",
    "these directions are the ones that the residual notices most: singular values descend, so the directions "
    "that it does not notice are the last rows of V', from row r on",
)
def of_the_first_rows(J):
    _, _, Vt = np.linalg.svd(J, full_matrices=True)
    return Vt[: J.shape[1] - solutions.rank(J)].T


@mistake(
    "null_space",
    "these are columns of V'. The directions are its rows: np.linalg.svd returns V transposed; take the rows from "
    "r on, and transpose these",
)
def of_the_columns(J):
    _, _, Vt = np.linalg.svd(J, full_matrices=True)
    return Vt[:, solutions.rank(J) :]


@mistake(
    "null_space",
    "directions are missing: with full_matrices=False, V' has only min(m, n) rows, so that a J with fewer rows than "
    "columns loses what is beyond. Ask for full_matrices=True",
)
def of_the_thin_svd(J):
    _, _, Vt = np.linalg.svd(J, full_matrices=False)
    return Vt[solutions.rank(J) :].T


@mistake(
    "null_space",
    "this picks rows of V' by a mask of the singular values, of which there are only min(m, n), while V' has n "
    "rows. For a J with fewer rows than columns the mask is too short: take all rows from the rank on",
)
def by_a_mask_of_the_values(J):
    _, s, Vt = np.linalg.svd(J, full_matrices=True)
    return Vt[s < 1e-10 * s.max()].T


@mistake("null_space", "these are rows: the transpose has a direction in every column")
def as_rows(J):
    return solutions.null_space(J).T


@mistake("null_space", "the directions are right, but columns have to have length 1")
def not_of_length_one(J):
    return 2 * solutions.null_space(J)


# depends


@check("depends", points=1)
def is_that_of_short_chains(depends):
    """it is right for chains that can be looked at"""
    equal(depends([-1, 0, 1]), [[0, 0, 0], [1, 0, 0], [1, 1, 0]], "three joints in a row")
    equal(depends([-1, 0, 1, 1]), [[0] * 4, [1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 0, 0]], "a fork")


@check("depends", points=1)
def is_that_of_smpl(depends):
    """it is the pattern of SMPL's joints, three by three"""
    pattern = depends(SMPL)
    equal(9 * pattern.sum(), 9 * solutions.depends(SMPL).sum(), "entries that are not zero, 9 each")
    equal(pattern, solutions.depends(SMPL), "the pattern")


@mistake("depends", "a joint turns about its own place: it does not move itself")
def itself_as_well(parents):
    return solutions.depends(parents) + np.eye(len(parents), dtype=int)


@mistake("depends", "rows are the joints that move, columns the joints that turn")
def the_other_way_round(parents):
    return solutions.depends(parents).T


@mistake("depends", "not the parent alone: all the way up to the root")
def of_the_parent_alone(parents):
    pattern = np.zeros((len(parents), len(parents)), dtype=int)
    for i, parent in enumerate(parents):
        if parent >= 0:
            pattern[i, parent] = 1
    return pattern


@mistake(
    "depends",
    "all ancestors, not the parent alone; and the root's parent, -1, indexes the last joint",
)
def of_the_parent_and_the_last(parents):
    pattern = np.zeros((len(parents), len(parents)), dtype=int)
    for i, parent in enumerate(parents):
        pattern[i, parent] = 1
    return pattern


# rank_of_tree


@check("rank_of_tree", points=1)
def is_right_for_small_trees(rank_of_tree):
    """it is right for trees that can be counted by hand"""
    for (name, parents), r in zip(TREES.items(), (2, 4, 5, 3), strict=False):
        equal(rank_of_tree(parents), r, f"the rank of {name}")


@check("rank_of_tree", points=1)
def is_forty(rank_of_tree):
    """it is that of SMPL"""
    equal(rank_of_tree(SMPL), 40, "the rank of SMPL's 24 joints by 72 numbers")


@mistake(
    "rank_of_tree", "a joint with one child can turn about the bone unseen: it counts 2, not 3"
)
def with_twists(parents):
    return sum(3 for k in range(len(parents)) if k in parents)


@mistake("rank_of_tree", "nothing hangs on a leaf: none of its three numbers is seen")
def with_leaves(parents):
    return solutions.rank_of_tree(parents) + 3 * sum(k not in parents for k in range(len(parents)))


@mistake("rank_of_tree", "the root stays in its place: there are no 3 for the translation")
def with_translation(parents):
    return 3 + solutions.rank_of_tree(parents)


@mistake("rank_of_tree", "two bones that are not on one line leave no axis: 3 for each such joint")
def two_for_everybody(parents):
    return sum(2 for k in range(len(parents)) if k in parents)


# sigmas


@check("sigmas", points=1)
def is_the_root_of_the_covariance(sigmas):
    """it is the root of the diagonal of (J'J)^-1 where that exists"""
    equal(sigmas(np.diag([2.0, 0.1])), [0.5, 10], "sigmas for J = diag(2, 0.1)")
    J = MATRICES[2]
    equal(sigmas(J), np.sqrt(np.diag(np.linalg.inv(J.T @ J))), "sigmas of a random problem", 1e-7)


@check("sigmas", points=2)
def is_infinite_where_nothing_is_seen(sigmas):
    """it is infinite for what takes part in a null direction, and for that alone"""
    J = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 4.0]])
    finite = ["finite" if one else "infinite" for one in np.isfinite(sigmas(J))]
    expected = ["infinite", "infinite", "finite"]
    holds(
        finite == expected,
        "the sigmas of x, y, z, if x + y and z are seen",
        ", ".join(expected),
        ", ".join(finite),
    )
    equal(sigmas(J)[2], 0.25, "the sigma of z")


@mistake("sigmas", "these are variances: the root is missing")
def variances(J):
    return solutions.sigmas(J) ** 2


@mistake(
    "sigmas",
    "1 / |J_i| is how well x_i is known if all others are; they are not, and their doubt adds to it",
)
def as_if_the_others_were_known(J):
    return 1 / np.linalg.norm(J, axis=0)


@mistake(
    "sigmas",
    "a pseudo-inverse gives small numbers for what is not seen at all: there, the answer is infinite",
)
def by_the_pseudo_inverse(J):
    P = np.linalg.pinv(J)
    return np.sqrt(np.diag(P @ P.T))


@mistake(
    "sigmas",
    "J'J has no inverse where a direction is not seen, and that is the point: look at the singular "
    "values first, and answer infinity there",
)
def by_the_inverse(J):
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


@mistake("sigmas", "not all are infinite: an unknown that no null direction touches is known")
def all_of_them(J):
    return solutions.sigmas(J) if solutions.rank(J) == J.shape[1] else np.full(J.shape[1], np.inf)


# markers


@cache
def seen_by(seed):
    body = wb.load_body("small")
    pose = 0.3 * np.random.default_rng(seed).standard_normal((24, 3))
    return solutions.derivatives(body, pose)


@check("markers", points=3)
def tell_all(markers):
    """there are at most 24, and with the joints they tell all 72 numbers"""
    chosen = markers()
    holds(len(chosen) <= 24, "how many vertices", "at most 24", len(chosen))
    within = all(float(v).is_integer() and 0 <= v < 369 for v in chosen)
    holds(
        within,
        "vertices of the body",
        "whole numbers from 0 to 368",
        ", ".join(f"{v:g}" for v in chosen),
    )
    vertices = np.asarray(chosen, dtype=int)
    for seed in (1, 2):
        by_joints, by_vertices = seen_by(seed)
        some = by_vertices.reshape(-1, 3, 72)[vertices].reshape(-1, 72)
        _, s, Vt = np.linalg.svd(np.vstack([by_joints, some]), full_matrices=True)
        found = int(np.sum(s > 1e-9 * s[0]))
        unseen = np.linalg.norm(Vt[found:].reshape(-1, 24, 3), axis=(0, 2))
        names = np.array(wb.load_body("small").joint_names)[unseen > 0.1]
        told = f"{found}; a turn is left that nothing notices, of {', '.join(names)}"
        holds(found == 72, "the rank of joints and these vertices", "72", told)


@mistake(
    "markers",
    "eleven are enough only if each tells three numbers that no other does; of these some tell the same. You "
    "may take up to 24, or choose each for what is left",
)
def eleven_by_number():
    return list(range(0, 369, 34))


@mistake("markers", "no vertices: the joints alone tell 40")
def none():
    return []


@mistake(
    "markers",
    "those are too many: 32 directions are left and a vertex tells at most 3, so 11 may do, if each is "
    "chosen for what the others do not tell; 24 leave room",
)
def all_vertices():
    return list(range(369))


@mistake(
    "markers",
    "vertices are not spread over the body in the order of their numbers: some limb has none here",
)
def the_first():
    return list(range(24))
