"""Checks of lecture 17, and the mistakes that they tell apart."""

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spsolve

from workbench.course import check, equal, holds, mistake
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.lec17_sequences import solutions

RNG = np.random.default_rng(17)

# smooth_residual

PATH = RNG.standard_normal((7, 3))
SPEED = RNG.standard_normal(3)


@check("smooth_residual", points=1)
def is_blind_to_what_it_should_be(smooth_residual):
    """order 1 is zero at rest, order 2 at constant speed, and neither is zero otherwise"""
    still = np.tile(SPEED, (6, 1))
    steady = SPEED + np.arange(6)[:, None] * SPEED
    equal(smooth_residual(still, 0.1, 1), np.zeros(15), "order 1 of what stands still")
    equal(smooth_residual(steady, 0.1, 2), np.zeros(12), "order 2 of constant speed")
    equal(
        smooth_residual(steady, 0.5, 1),
        np.tile(SPEED, 5) / 0.5,
        "order 1 of constant speed, sigma 0.5",
    )


@check("smooth_residual", points=1)
def is_the_differences(smooth_residual):
    """it is the differences in sigmas, frame by frame"""
    for order in (1, 2):
        for sigma in (0.02, 3.0):
            came = smooth_residual(PATH, sigma, order)
            right = solutions.smooth_residual(PATH, sigma, order)
            equal(came, right, f"order {order}, sigma {sigma}")


@mistake("smooth_residual", "the middle frame counts twice: x[t + 2] - 2 x[t + 1] + x[t]")
def with_the_middle_once(x, sigma, order):
    if order == 1:
        return solutions.smooth_residual(x, sigma, 1)
    return (x[2:] - x[1:-1] + x[:-2]).ravel() / sigma


@mistake(
    "smooth_residual",
    "this is x[t + 2] - x[t], a difference of order 1 over two frames: it pays for speed",
)
def over_two_frames(x, sigma, order):
    return (x[order:] - x[:-order]).ravel() / sigma


@mistake("smooth_residual", "sigma is missing: this is in the unit of x")
def in_the_unit_of_x(x, sigma, order):
    return solutions.smooth_residual(x, 1.0, order)


@mistake("smooth_residual", "this is x[t] minus x[t + 1]; the later frame comes first")
def earlier_minus_later(x, sigma, order):
    return (-1) ** order * solutions.smooth_residual(x, sigma, order)


@mistake(
    "smooth_residual", "the order: all numbers of one difference stand together, frame by frame"
)
def number_by_number(x, sigma, order):
    return np.diff(x, order, axis=0).T.ravel() / sigma


# worth


def series(T, bias, rho):
    """The correlations of a constant part and an AR(1)."""
    return np.where(np.arange(T) == 0, 1.0, bias + (1 - bias) * rho ** np.arange(T))


@check("worth", points=1)
def has_its_limits(worth):
    """white noise is worth T frames, and errors that are always the same are worth one"""
    for T in (2, 30):
        equal(worth(series(T, 0.0, 0.0)), T, f"what {T} frames of white noise are worth")
        equal(worth(np.ones(T)), 1, f"what {T} frames of one and the same error are worth")


@check("worth", points=1)
def is_the_formula(worth):
    """AR(1) errors have about T (1 - rho) / (1 + rho), and a bias b never more than 1 / b"""
    came = worth(series(4000, 0.0, 0.8))
    holds(
        abs(came / (4000 * 0.2 / 1.8) - 1) < 0.01,
        "what 4000 frames of AR(1) errors with rho = 0.8 are worth",
        "about 444",
        came,
    )
    came = worth(series(4000, 0.25, 0.8))
    holds(came < 4, "the same with a bias of 0.25", "below 4", came)
    for T, bias, rho in ((10, 0.0, 0.5), (25, 0.3, 0.9)):
        r = series(T, bias, rho)
        equal(worth(r), solutions.worth(r), f"{T} frames, a bias of {bias}, rho {rho}")


@mistake("worth", "every pair of different frames counts in both orders: a factor of 2")
def without_the_two(r):
    T, k = len(r), np.arange(1, len(r))
    return T / (1 + np.sum((1 - k / T) * r[1:]))


@mistake("worth", "there are only T - k pairs that are k apart: r[k] counts 1 - k / T")
def without_the_pairs(r):
    return len(r) / (1 + 2 * np.sum(r[1:]))


@mistake("worth", "r[0] is the 1 already; the sum begins with k = 1")
def with_lag_zero_again(r):
    T, k = len(r), np.arange(len(r))
    return T / (1 + 2 * np.sum((1 - k / T) * r))


@mistake("worth", "this says how many frames are as good as one: divide T by it")
def frames_for_one(r):
    return len(r) / solutions.worth(r)


@mistake("worth", "this is AR(1)'s limit; take all correlations, which need not be powers")
def by_the_first_lag(r):
    return len(r) * (1 - r[1]) / (1 + r[1])


# worth_of_errors

BIAS = RNG.standard_normal((1, 40))
WALKS = RNG.standard_normal((30, 40))
for t in range(1, 30):
    WALKS[t] = 0.7 * WALKS[t - 1] + 0.5 * WALKS[t]


@check("worth_of_errors", points=1)
def hears_a_bias(worth_of_errors):
    """errors that hardly change are worth one frame, whatever their size and their signs"""
    noise = 1e-3 * WALKS
    for scale in (1.0, 50.0):
        came = worth_of_errors(scale * (BIAS + noise))
        equal(came, 1, f"30 frames of nearly constant errors, {scale:g} sigmas", 1e-2)


@check("worth_of_errors", points=1)
def pools_the_series(worth_of_errors):
    """it is the formula, with sums over all pairs and all series"""
    for some in (WALKS, WALKS + 0.5 * BIAS, WALKS[:9, :5] * [1, 2, 3, 4, 50]):
        pairs = np.einsum("ts,us->tu", some, some)
        T = len(some)
        r = [np.trace(pairs, k) / (T - k) * T / np.trace(pairs) for k in range(T)]
        equal(worth_of_errors(some), solutions.worth(np.array(r)), f"{T} frames", 1e-7)


@mistake(
    "worth_of_errors",
    "the mean was subtracted, and with it the bias, which is what makes frames alike: correlations are "
    "about zero",
)
def about_the_mean(errors):
    x = errors - errors.mean(axis=0)
    T = len(x)
    r = np.array([np.sum(x[k:] * x[: T - k]) for k in range(T)]) / np.sum(x**2)
    first = int(np.argmax(r < 0))
    return T / (1 + 2 * np.sum(r[1:first]))


@mistake(
    "worth_of_errors",
    "this is a mean of ratios, in which a series with a small sum counts most: first sum, then divide",
)
def mean_over_series(errors):
    return len(errors) * np.mean(np.sum(errors**2, axis=0) / errors.sum(axis=0) ** 2)


@mistake(
    "worth_of_errors", "the series were added up: errors of different keypoints cancel each other"
)
def added_up(errors):
    return len(errors) * np.sum(errors**2) / np.sum(errors) ** 2


@mistake("worth_of_errors", "T is missing: this is n / T")
def as_a_share(errors):
    return solutions.worth_of_errors(errors) / len(errors)


# arrow_solve


def arrow(T, k, b):
    """D, B, C, f, g of a random J'J with T frames."""
    draw = np.random.default_rng(T)
    J, Js = draw.standard_normal((T, k + b, k)), draw.standard_normal((T, k + b, b))
    D, B = (np.einsum("tmi,tmj->tij", J, other) for other in (J, Js))
    C = np.einsum("tmi,tmj->ij", Js, Js) + np.eye(b)
    return D, B, C, draw.standard_normal((T, k)), draw.standard_normal(b)


@check("arrow_solve", points=2)
def solves_all_rows(arrow_solve):
    """x and s solve the rows of all frames and those of what is shared"""
    for sizes in ((4, 3, 2), (9, 2, 4)):
        D, B, C, f, g = arrow(*sizes)
        x, s = arrow_solve(D, B, C, f, g)
        rows = np.einsum("tij,tj->ti", D, x) + B @ s
        name = "{} frames of {} unknowns, {} shared".format(*sizes)
        equal(rows, f, f"the rows of the frames, {name}", 1e-6)
        equal(np.einsum("tki,tk->i", B, x) + C @ s, g, f"the rows of what is shared, {name}", 1e-6)


@check("arrow_solve", points=1)
def is_the_dense_one(arrow_solve):
    """with a single frame it is what a dense solution of the whole matrix gives"""
    D, B, C, f, g = arrow(1, 4, 3)
    whole = np.block([[D[0], B[0]], [B[0].T, C]])
    right = np.linalg.solve(whole, np.append(f, g))
    x, s = arrow_solve(D, B, C, f, g)
    equal(s, right[4:], "s", 1e-6)
    equal(x[0], right[:4], "x", 1e-6)


@mistake("arrow_solve", "the frames must follow: x[t] = D[t]^-1 (f[t] - B[t] s)")
def without_the_way_back(D, B, C, f, g):
    _, s = solutions.arrow_solve(D, B, C, f, g)
    return np.linalg.solve(D, f[..., None])[..., 0], s


@mistake("arrow_solve", "S is C minus what is lost to the poses, not plus")
def with_a_plus(D, B, C, f, g):
    lost = np.einsum("tki,tkj->ij", B, np.linalg.solve(D, B))
    return solutions.arrow_solve(D, B, C + 2 * lost, f, g)


@mistake(
    "arrow_solve",
    "this takes C for S, as if the poses were known, so that the shape is told nothing about them",
)
def with_poses_known(D, B, C, f, g):
    s = np.linalg.solve(C, g)
    return np.linalg.solve(D, (f - B @ s)[..., None])[..., 0], s


@mistake(
    "arrow_solve", "the right-hand side is eliminated too: g minus the sum of B[t]' D[t]^-1 f[t]"
)
def with_g_as_it_is(D, B, C, f, g):
    _, s = solutions.arrow_solve(D, B, C, np.zeros_like(f), g)
    return np.linalg.solve(D, (f - B @ s)[..., None])[..., 0], s


# carried

REST = np.array([[0.1, 0.2, 0.0], [0.16, 0.22, 0.01], [0.12, 0.27, -0.01]])
MARKER = REST[0] + [0.01, 0.02, 0.009]
TURNS = matrix_from_vector(np.array([[0.3, -1.2, 0.4], [2.0, 0.5, -0.7]]))
SHIFTS = np.array([[0.3, 0.0, -1.0], [-0.2, 0.5, 0.1]])


@check("carried", points=1)
def moves_rigidly(carried):
    """where the vertices move rigidly, the marker moves with them"""
    equal(carried(REST, REST, MARKER), MARKER, "the marker at rest")
    for R, t in zip(TURNS, SHIFTS, strict=True):
        came = carried(REST, REST @ R.T + t, MARKER)
        equal(came, R @ MARKER + t, "the marker after a rotation and a translation")


@check("carried", points=1)
def keeps_its_distance(carried):
    """where the skin stretches, the marker keeps its coordinates in metres"""
    stretched = REST[0] + (REST - REST[0]) * [[1.0], [1.3], [0.8]]
    sheared = REST + np.array([[0, 0, 0], [0, 0, 0], [0.02, 0.0, 0.015]])
    for name, corners in (("stretched", stretched), ("sheared", sheared)):
        for R, t in zip(TURNS, SHIFTS, strict=True):
            posed = corners @ R.T + t
            came = carried(REST, posed, MARKER)
            equal(came, solutions.carried(REST, posed, MARKER), f"the marker on {name} skin")


@mistake("carried", "the axes have to turn as well: this only moves the marker along with a")
def only_along(rest, posed, marker):
    return marker + posed[0] - rest[0]


@mistake(
    "carried",
    "first into the coordinates at rest, with the transpose of the axes at rest, then out by the posed ones",
)
def axes_exchanged(rest, posed, marker):
    return posed[0] + solutions.axes(rest) @ solutions.axes(posed).T @ (marker - rest[0])


def edges(corners):
    a, b, c = corners
    return np.column_stack([b - a, c - a, np.cross(b - a, c - a)])


@mistake(
    "carried", "axes that are as long as the edges stretch with the skin: a marker has one distance"
)
def by_edges(rest, posed, marker):
    return posed[0] + edges(posed) @ np.linalg.solve(edges(rest), marker - rest[0])


@mistake(
    "carried", "the second axis points along c - a here, which is not at right angles to the first"
)
def with_slanted_axes(rest, posed, marker):
    slanted = [edges(one) / np.linalg.norm(edges(one), axis=0) for one in (rest, posed)]
    return posed[0] + slanted[1] @ np.linalg.solve(slanted[0], marker - rest[0])


@mistake("carried", "the origin is the first vertex, not the middle of the triangle")
def about_the_middle(rest, posed, marker):
    turned = solutions.axes(posed) @ solutions.axes(rest).T
    return posed.mean(axis=0) + turned @ (marker - rest.mean(axis=0))


# filled


def measured(T, seed):
    """A noisy path with gaps, (T,) m, NaN in the gaps."""
    draw = np.random.default_rng(seed)
    y = np.sin(np.arange(T) / 9) + 0.05 * draw.standard_normal(T)
    y[T // 3 : T // 3 + 6] = np.nan
    y[draw.random(T) < 0.1] = np.nan
    return y


def slope_of_cost(x, y, sigma, tau):
    """Half of the derivative of the sum of squares by each x[t], in units of 1 / m."""
    there = np.isfinite(y)
    bend = np.diff(x, 2) / tau**2
    slope = np.where(there, x - np.where(there, y, 0), 0.0) / sigma**2
    for k, share in enumerate((1, -2, 1)):
        slope[k : len(x) - 2 + k] += share * bend
    return slope


@check("filled", points=2)
def is_the_minimum(filled):
    """the sum of squares has no slope there"""
    for T, sigma, tau in ((40, 0.05, 0.01), (40, 0.05, 0.1), (3000, 0.05, 0.02)):
        y = measured(T, T)
        x = filled(y, sigma, tau)
        slope = np.abs(slope_of_cost(x, y, sigma, tau)).max() * sigma**2
        holds(
            slope < 1e-5,
            f"the slope of the cost, {T} frames, sigma {sigma} m, tau {tau} m, times sigma^2",
            "below 1e-5 m",
            slope,
        )


@check("filled", points=1)
def goes_straight_through_gaps(filled):
    """what lies on a straight line stays there, gaps and ends included"""
    line = 0.3 + 0.02 * np.arange(30)
    y = line.copy()
    y[[0, 1, 8, 9, 10, 11, 12, 29]] = np.nan
    for sigma, tau in ((0.01, 0.01), (0.1, 0.01)):
        equal(filled(y, sigma, tau), line, f"a straight line, sigma {sigma} m, tau {tau} m", 1e-6)


def minimum(y, there, sigma, tau, order=2):
    """The least sum of squares, with differences of an order."""
    T = len(y)
    coefficients = {1: [-1.0, 1.0], 2: [1.0, -2.0, 1.0]}[order]
    bend = diags_array(coefficients, offsets=list(range(order + 1)), shape=(T - order, T))
    A = diags_array(there / sigma**2) + bend.T @ bend / tau**2
    return spsolve(csc_array(A), np.where(there, y, 0.0) / sigma**2)


@mistake("filled", "a gap is no measurement of zero: give it the weight 0")
def gaps_as_zeros(y, sigma, tau):
    return minimum(np.nan_to_num(y), np.ones(len(y), dtype=bool), sigma, tau)


@mistake("filled", "these are differences of order 1, which pull the path towards standing still")
def of_order_one(y, sigma, tau):
    return minimum(y, np.isfinite(y), sigma, tau, order=1)


@mistake(
    "filled",
    "the gap was filled by straight lines that then counted as measurements; nothing was measured there",
)
def interpolated_first(y, sigma, tau):
    t, there = np.arange(len(y)), np.isfinite(y)
    lined = np.interp(t, t[there], y[there])
    return minimum(lined, np.ones(len(y), dtype=bool), sigma, tau)


@mistake("filled", "the sum has 1 / sigma^2 and 1 / tau^2: both are squared with the residual")
def without_squares(y, sigma, tau):
    return minimum(y, np.isfinite(y), np.sqrt(sigma), np.sqrt(tau))


@mistake("filled", "the frames in the gap are missing: time goes on while nothing is seen")
def joined_up(y, sigma, tau):
    there = np.isfinite(y)
    some = minimum(y[there], np.ones(int(there.sum()), dtype=bool), sigma, tau)
    return np.interp(np.arange(len(y)), np.flatnonzero(there), some)
