# %% [markdown]
# # Rotations
#
# **Which numbers do we hand to an optimizer that has to turn a joint?**
#
# A body model has a rotation in every joint. An optimizer changes numbers, one step after the other,
# and knows nothing of rotations. So we have to decide which numbers stand for a rotation. We begin with
# the nine numbers of a matrix, watch them fail, and end with the three that SMPL uses. Angles are in
# radians, lengths in metres.

# %%
import casadi as cs
import numpy as np
import scipy.linalg

import workbench as wb
from workbench.course import Picture, source
from workbench.geometry.rotation import matrix_from_vector, nearest_rotation, rodrigues
from workbench.lectures.material.replays import recorded_side_by_side
from workbench.plots import house_style, sheet

# %% [markdown]
# ## Nine numbers
#
# A forearm carries markers at places $x_n$ that we know, and after it has turned we see them at
# $y_n = R x_n$, with some noise. Which $R$? If its nine entries may be anything, this is a linear
# least-squares problem, and NumPy solves it in a line:
#
# $$\min_M \sum_n \|M x_n - y_n\|^2 .$$

# %% slide [markdown]
# ## Nine numbers: a linear problem
#
# - Eight markers on a forearm: known places $x_n$, seen at $y_n = R\,x_n$ plus noise
# - Let all nine entries be free, and NumPy solves it in a line.
#
# $$ \min_M \sum_n \|M x_n - y_n\|^2 $$

# %%
rng = np.random.default_rng(0)
markers = rng.uniform([-0.02, -0.03, -0.03], [0.24, 0.03, 0.03], size=(8, 3))  # m, in the forearm
truth = matrix_from_vector([0.2, -0.4, 1.1])
seen = markers @ truth.T + 0.005 * rng.standard_normal(markers.shape)  # 5 mm of noise


def nine_numbers(x, y):
    """The matrix M that is least in the sum of |M x_n - y_n|^2."""
    return np.linalg.lstsq(x, y, rcond=None)[0].T


M = nine_numbers(markers, seen)
print(f"markers are met to {1e3 * np.sqrt(np.mean((markers @ M.T - seen) ** 2)):.1f} mm")
print("lengths of the columns of M:", np.linalg.norm(M, axis=0).round(3))
print(f"det M = {np.linalg.det(M):.3f}")

# %% slide [markdown]
# ## It fits, and it is no rotation
#
# - The markers are met to {{ printed("markers are met to")[0]:g }} mm, better than their noise of 5 mm.
# - Columns have the lengths {{ np.linalg.norm(M[:, 0]):.2f }}, {{ np.linalg.norm(M[:, 1]):.2f }} and
#   {{ np.linalg.norm(M[:, 2]):.2f }}; a rotation's have 1.
# - $\det M$ = {{ np.linalg.det(M):.2f }}: this matrix stretches.

# %% [markdown]
# The noise is 5 mm in each coordinate, and the markers are met to {{ printed("markers are met to")[0]:g }}
# mm{{ printed("markers are met to")[0] < 5 }}. (This is no merit, because
# the nine numbers have fitted a part of the noise.) But the columns of a rotation have length 1, and
# its determinant is 1. Neither is so here: the first column has length {{ np.linalg.norm(M[:, 0]):.2f }}, the last
# one {{ np.linalg.norm(M[:, 2]):.2f }}, and $\det M$ is {{ np.linalg.det(M):.2f }}: this matrix stretches. Along the
# forearm, where the markers are far apart, that hardly shows{{ abs(np.linalg.norm(M[:, 0]) - 1) < 0.01 }}. It shows
# at the hand, which is at the end of the
# same forearm and carries no marker:

# %%
outline = np.array([[0, -1], [1, -1], [2, 0], [1, 1], [0, 1], [0, -1]])  # of a hand, roughly
hand = np.array([0.26, 0, 0]) + 0.09 * outline[:, [0, 0, 1]] * [1, 0, 0.5]  # m
pairs = [(i, j) for i in range(5) for j in range(i)]


def stretch(M):
    """The largest and the smallest factor by which M multiplies a distance in the hand."""
    ratio = [
        np.linalg.norm(M @ (hand[i] - hand[j])) / np.linalg.norm(hand[i] - hand[j])
        for i, j in pairs
    ]
    return max(ratio), min(ratio)


print("distances in the hand are multiplied by {:.2f} to {:.2f}".format(*stretch(M)[::-1]))
sigmas = np.array([0.5, 1, 2, 5, 10, 20]) * 1e-3  # m


def mean_stretch(sigma, n=8, draws=200):
    """These two factors, averaged over draws of n markers and their noise."""
    found = []
    for _ in range(draws):
        x = rng.uniform([-0.02, -0.03, -0.03], [0.24, 0.03, 0.03], size=(n, 3))
        found.append(nine_numbers(x, x @ truth.T + sigma * rng.standard_normal(x.shape)))
    return np.mean([stretch(one) for one in found], axis=0)


spread = [mean_stretch(sigma) for sigma in sigmas]
for n in (8, 16, 32):
    print(
        "{:2} markers, 5 mm of noise: multiplied by {:.2f} to {:.2f} in the mean".format(
            n, *mean_stretch(0.005, n)[::-1]
        )
    )

with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    for shape, name in ((hand, "the hand"), (hand @ M.T @ truth, "by nine numbers")):
        left.plot(1e2 * shape[:, 0], 1e2 * shape[:, 2], label=name)
    back = seen @ truth  # turned back
    left.plot(1e2 * back[:, 0], 1e2 * back[:, 2], "k.", label="markers seen")
    left.set(xlabel="along the forearm (cm)", ylabel="across it (cm)", aspect="equal")
    left.set_ylim(-12, 22)
    left.legend(loc="upper left")
    for shown, name, mark in zip(np.transpose(spread), ("longest", "shortest"), "^v", strict=True):
        right.semilogx(1e3 * sigmas, shown, f"k{mark}-", label=f"{name} of its distances")
    right.axhline(1, color="0.5", lw=0.8)
    right.legend(loc="upper left")
    right.set(xlabel="noise of the markers (mm)", ylabel="factor on distances in the hand")
Picture(
    figure,
    "Left: the hand as it is, and as the fit of nine free numbers makes it with 5 mm of noise, "
    "both turned back. Right: the largest and the smallest factor by which distances in the hand "
    "change (means of 200 draws of eight markers and their noise). The more noise there is, the "
    "more the hand is stretched.",
)

# %% slide [markdown]
# ## Noise stretches the hand
#
# - At the end of the forearm, where no marker is, distances change by factors of {{ stretch(M)[1]:.2f }} to
#   {{ stretch(M)[0]:.2f }}.
# - More markers help slowly: with 32 still up to {{ printed("32 markers")[-1]:.2f }} in the mean

# %% [markdown]
# A bone does not stretch, so nine free numbers are too
# many.{{ (np.diff(np.transpose(spread)[0]) > 0).all() }}{{ printed("32 markers")[-1] < printed("16 markers")[-1] < printed(" 8 markers")[-1] }}
# A matrix is a rotation if
#
# $$R^\top R = I, \qquad \det R = 1,$$
#
# and since $R^\top R$ is symmetric the first of these is **six equations**. The second only chooses a
# sign: from $R^\top R = I$ follows $\det R = \pm 1$. Nine minus six leaves three, so a rotation is described by three
# numbers.

# %% slide [markdown]
# ## Nine minus six leaves three
#
# $$ R^\top R = I, \qquad \det R = 1 $$
#
# - $R^\top R$ is symmetric: **six equations** for nine numbers
# - $\det R = \pm 1$ follows from them; the second equation only chooses the sign.

# %% [markdown]
# ## Back to a rotation
#
# One way out is to fit the nine numbers freely, and to replace $M$ by the nearest rotation afterwards:
# the $R$ that minimises $\|R - M\|_F$. With the singular values $M = U \Sigma V^\top$ that is
# $U V^\top$, and if this happens to be a reflection, the direction of the smallest singular value is
# turned around. The library does it in these lines:

# %%
source(nearest_rotation)

# %% slide [markdown]
# ## A repair: the nearest rotation
#
# - $M = U \Sigma V^\top$: set all singular values to one; a reflection is turned around.
#
# ```python
# U, _, Vt = np.linalg.svd(np.asarray(M, dtype=float))
# signs = np.ones(U.shape[:-1])
# signs[..., 2] = np.linalg.det(U @ Vt)
# return np.asarray((U * np.sign(signs)[..., None, :]) @ Vt)
# ```

# %%
R = nearest_rotation(M)
print("distances in the hand are multiplied by {:.2f} to {:.2f}".format(*stretch(R)[::-1]))
print(f"R'R = I to {np.abs(R.T @ R - np.eye(3)).max():.0e}, det R = {np.linalg.det(R):.6f}")
mirrored = np.diag([1.0, 1.0, -1.0])
U, _, Vt = np.linalg.svd(mirrored)
print(
    f"of a mirror, without the sign: det = {np.linalg.det(U @ Vt):+.0f};"
    f" with it: {np.linalg.det(nearest_rotation(mirrored)):+.0f}"
)

# %% [markdown]
# As a repair this is right{{ np.allclose(stretch(R), 1) and np.abs(R.T @ R - np.eye(3)).max() < 1e-13 }}, and we
# shall use it: it also solves Procrustes' problem, to find the
# rotation that best carries one set of points to another. But an optimizer that walks in nine
# dimensions and is thrown back to a three-dimensional surface after every step does not know where it
# is going. We want three numbers, all of which may be changed freely.

# %% slide [markdown]
# ## Right as a repair, wrong for an optimizer
#
# - Distances in the hand are right again: factors of {{ stretch(R)[1]:.2f }} to {{ stretch(R)[0]:.2f }}.
# - It also solves Procrustes' problem: which rotation carries one set of points onto another?
# - But steps in nine dimensions that are thrown back to a surface of three lead nowhere in particular.

# %% [markdown]
# ## Three numbers
#
# Turn a point $v$ about an axis, with angular velocity $w$. Its velocity is $w \times v$, which is
# linear in $v$, so it is a matrix times $v$:
#
# $$
# \dot v = w \times v = [w]_\times v, \qquad
# [w]_\times = \begin{pmatrix} 0 & -w_z & w_y \\ w_z & 0 & -w_x \\ -w_y & w_x & 0 \end{pmatrix}.
# $$
#
# This is a linear differential equation, and after one unit of time its solution is the **matrix
# exponential**: $v(1) = \exp([w]_\times)\, v(0)$ with $\exp(A) = I + A + A^2/2 + A^3/6 + \dots$ So any
# three numbers $w$ give a rotation, by the angle $t = \|w\|$ about the axis $w / t$. In the pose of
# SMPL there are {{ 24 }} of these **rotation vectors**.
#
# The matrix $[w]_\times$ itself is not a rotation matrix: it gives the velocity of a rotation. It takes its own axis
# to zero, so its determinant is zero, whereas its exponential keeps that axis.
#
# The series need not be summed term by term. Let $n = w/t$ be the unit axis. For any vector $v$, the vector
# $n \times (n \times v)$ is $-v$ without the part along $n$, and a third product with $n$ turns that into
# $-\,n \times v$. So $[n]_\times^3 = -[n]_\times$, and from then on the powers repeat with alternating signs. The
# odd ones in the series for $\exp(t\, [n]_\times)$ gather to $(t - t^3/6 + \dots)\, [n]_\times$, which is
# $\sin t\; [n]_\times$, and the even ones to $(t^2/2 - t^4/24 + \dots)\, [n]_\times^2$, which is
# $(1 - \cos t)\; [n]_\times^2$. This is **Rodrigues' formula**:
#
# $$ R = I + \sin t\; [n]_\times + (1 - \cos t)\; [n]_\times^2 . $$
#
# In the code below, `hat(w)` is $[w]_\times$.


# %% slide [markdown]
# ## Three numbers: an angular velocity
#
# $$ \dot v = w \times v = [w]_\times v, \qquad [w]_\times = \begin{pmatrix} 0 & -w_z & w_y \\ w_z & 0 & -w_x \\ -w_y & w_x & 0 \end{pmatrix} $$
#
# - After one unit of time: $v(1) = \exp([w]_\times)\, v(0)$
# - Any $w$ is a rotation, by $t = \|w\|$ about $w / t$; SMPL's pose has 24 of them.

# %% slide [markdown]
# ## Rodrigues' formula
#
# - With the unit axis $n = w/t$: $[n]_\times^3 = -[n]_\times$, so the series has two sums only.
# - The odd powers gather to $\sin t$, the even ones to $1 - \cos t$.
#
# $$ R = I + \sin t\; [n]_\times + (1 - \cos t)\; [n]_\times^2 $$


# %%
def hat(w):
    """The matrix of v -> w x v."""
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def textbook(w):
    """Rodrigues' formula as it is written above."""
    t = np.linalg.norm(w)
    n = hat(w / t)
    return np.eye(3) + np.sin(t) * n + (1 - np.cos(t)) * n @ n


w = np.array([0.2, -0.4, 1.1])
print(
    f"Rodrigues' formula is off the matrix exponential by {np.abs(textbook(w) - scipy.linalg.expm(hat(w))).max():.0e}"
)
print(f"w is its own axis: R w - w is at most {np.abs(textbook(w) @ w - w).max():.0e}")
for name, matrix in (("skew matrix", hat(w)), ("exponential", scipy.linalg.expm(hat(w)))):
    print(
        f"{name}: |A'A - I| = {np.linalg.norm(matrix.T @ matrix - np.eye(3)):.3f}, "
        f"det A = {np.linalg.det(matrix):.3f}, |A w| = {np.linalg.norm(matrix @ w):.3f}"
    )

# %% slide [markdown]
# ## In three lines, and equal to the exponential
#
# - Off SciPy's matrix exponential by {{ np.abs(textbook(w) - scipy.linalg.expm(hat(w))).max():.0e}}:
#   rounding{{ np.allclose(textbook(w), scipy.linalg.expm(hat(w))) }}
# - $[w]_\times$ itself is no rotation: its determinant is zero.
#
# ```python
# t = np.linalg.norm(w)
# n = hat(w / t)
# return np.eye(3) + np.sin(t) * n + (1 - np.cos(t)) * n @ n
# ```

# %% [markdown]
# ## Two misprints
#
# The formula is easily
# misprinted{{ np.allclose(hat(w) @ w, 0) and np.allclose(textbook(w) @ w, w) and np.allclose(textbook(w), scipy.linalg.expm(hat(w))) }}.
# The course notes *SMPL and SMPLify* print $+\,[n]_\times^2 \cos t$ where the factor
# must be $1 - \cos t$. *Body Models II* (Pons-Moll and Swoboda, 2018) has the cosine right, but writes $[w]_\times$
# where the matrix of the *unit* axis belongs, $[n]_\times$. Both forms look plausible. One property shows both errors
# without the right answer at hand: a rotation satisfies $R^\top R = I$.


# %% slide [markdown]
# ## Two misprints in print
#
# - *SMPL and SMPLify*: $\cos t$ where $1 - \cos t$ belongs
# - *Body Models II*: $[w]_\times$ where the unit axis, $[n]_\times$, belongs
# - Both look plausible. Which test finds them without the right answer?


# %%
def misprinted_cosine(w):
    """With cos t in the place of 1 - cos t."""
    t = np.linalg.norm(w)
    n = hat(w / t)
    return np.eye(3) + np.sin(t) * n + np.cos(t) * n @ n


def misprinted_axis(w):
    """With w in the place of the unit axis."""
    t = np.linalg.norm(w)
    return np.eye(3) + np.sin(t) * hat(w) + (1 - np.cos(t)) * hat(w) @ hat(w)


axis = np.array([0.6, 0.0, 0.8])
angles = np.sort([*np.linspace(0.01, 2 * np.pi, 300), 1, np.pi / 3, 5 * np.pi / 3])  # rad
formulas = {
    "1 - cos t, unit axis": textbook,
    "cos t": misprinted_cosine,
    "no unit axis": misprinted_axis,
}
failure = {
    name: [np.linalg.norm(f(t * axis).T @ f(t * axis) - np.eye(3)) for t in angles]
    for name, f in formulas.items()
}
right_at = {
    name: [round(t, 3) for t, off in zip(angles, found, strict=True) if t > 0.5 and off < 1e-9]
    for name, found in failure.items()
}
off_by = {
    name: [
        np.linalg.norm(f(t * axis).T @ f(t * axis) - np.eye(3)) for t in (0.1, 1.0, np.pi / 3, 3.0)
    ]
    for name, f in formulas.items()
}
for name, at in off_by.items():
    print(f"{name:22} |R'R - I| at t = 0.1, 1, pi/3, 3: ", *(f"{one:.0e}" for one in at))

with house_style():
    figure, (ax,) = sheet(7, 3.6)
    for (name, found), dash in zip(failure.items(), ("-", "--", ":"), strict=True):
        ax.semilogy(angles, np.maximum(found, 1e-17), dash, label=name)
    for at in (1, np.pi / 3, 5 * np.pi / 3):
        ax.axvline(at, color="0.7", lw=0.8, zorder=0)
    ax.set(xlabel="angle t (rad)", ylabel="|R'R - I|", ylim=(1e-17, 1e4))
    ax.set_xticks(
        [0, 1, np.pi / 3, np.pi, 5 * np.pi / 3, 2 * np.pi],
        ["0", "1   ", "   π/3", "π", "5π/3", "2π"],
    )
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 0.25))
Picture(
    figure,
    "How far from a rotation three formulas are. The right one is off by rounding alone. The one "
    "with cos t is right at π/3 and 5π/3 (60 and 300 degrees) alone; the one without a unit axis "
    "at 1 rad, at full turns, and nearly so for small angles. Grey lines mark these angles.",
)

# %% slide [markdown]
# ## $R^\top R = I$ finds both, at almost every angle
#
# - At 3 rad: off by {{ off_by["cos t"][-1]:.1f }} and by {{ off_by["no unit axis"][-1]:.0f }}
# - At π/3 the first passes; at 1 rad, the second

# %% [markdown]
# Note at which angles the wrong formulas are
# right.{{ right_at["cos t"] == [1.047, 5.236] and right_at["no unit axis"] == [1.0, 6.283] }} A test at 60 degrees
# ($\pi/3$) would let the first
# one pass, and a test at 1 rad or at small angles the second one. At 3 rad $|R^\top R - I|$ is
# {{ off_by["cos t"][-1]:.1f }} and
# {{ off_by["no unit axis"][-1]:.0f }}{{ max(failure["1 - cos t, unit axis"]) < 1e-13 }}. A single number is no test;
# a property that is tried at many angles is one.

# %% slide [markdown]
# ## A number is no test; a property at many angles is one
#
# - 60 degrees and 1 rad are the angles that one tries first.
# - Without a unit axis the formula is nearly right for all small angles, where fits spend most of their time.

# %% [markdown]
# ## At zero
#
# The textbook formula divides by $t$. A body at rest has $t = 0$ in every joint, and that is where
# every fit begins. The workbench writes its formulas in CasADi, a library that keeps them as
# expressions and differentiates them exactly. So we see what an optimizer would see: the value, and
# the derivatives.

# %% slide [markdown]
# ## At zero: where every fit begins
#
# - The textbook's formula divides by $t$, and at rest $t = 0$ in all 24 joints.
# - An optimizer needs the value *and* the derivatives.

# %%
v = cs.SX.sym("w", 3)


def in_casadi(t):
    """Rodrigues' formula with this expression for the angle."""
    n = cs.skew(v / t)
    return cs.SX.eye(3) + cs.sin(t) * n + (1 - cs.cos(t)) * n @ n


def derivatives(R):
    """Functions of w: R, its first derivatives (9, 3), and its second ones (27, 3)."""
    J = cs.jacobian(cs.vec(R), v)
    return [cs.Function("f", [v], [one]) for one in (R, J, cs.jacobian(cs.vec(J), v))]


ways = {
    "as in the textbook": in_casadi(cs.norm_2(v)),
    "1e-8 added to w in |w|": in_casadi(cs.norm_2(v + 1e-8)),
    "the library's": rodrigues(v),
}
tiny = 1e-8 * axis  # rad
beginning = cs.SX.eye(3) + cs.skew(v) + cs.skew(v) @ cs.skew(v) / 2  # of the series: right at 0
hessian = np.asarray(derivatives(beginning)[2](0))
orthogonal, finite, hessian_off = {}, {}, {}
for name, R in ways.items():
    value, jacobian, second = (
        np.asarray(f(at)) for f, at in zip(derivatives(R), (w, 0, tiny), strict=True)
    )
    orthogonal[name] = np.abs(value.T @ value - np.eye(3)).max()
    finite[name] = np.isfinite(jacobian).all()
    hessian_off[name] = np.abs(second - hessian).max()
    print(f"{name}:")
    print(f"  R'R - I at a random w    {orthogonal[name]:.0e}")
    print(f"  Jacobian at 0 is finite  {finite[name]}")
    print(f"  Hessian at 1e-8 rad, off by up to {hessian_off[name]:.2g}")

# %% slide [markdown]
# ## The usual cure hides the NaN
#
# | | Jacobian at 0 | $R^\top R - I$ | second derivative off by |
# | --- | --- | --- | --- |
# | textbook | {{ "finite" if finite["as in the textbook"] else "NaN" }} | {{ orthogonal["as in the textbook"]:.0e }} | {{ hessian_off["as in the textbook"]:.2g }} |
# | $10^{-8}$ added | {{ "finite" if finite["1e-8 added to w in |w|"] else "NaN" }} | {{ orthogonal["1e-8 added to w in |w|"]:.0e }} | {{ hessian_off["1e-8 added to w in |w|"]:.2g }} |
# | a series | {{ "finite" if finite["the library's"] else "NaN" }} | {{ orthogonal["the library's"]:.0e }} | {{ hessian_off["the library's"]:.0e }} |

# %% [markdown]
# The textbook's form has no derivative at rest: NaN{{ not finite["as in the textbook"] }}. Near rest it has one that
# is finite and wrong: at
# $t = 10^{-8}$ the number $\cos t$ is rounded to 1, so $1 - \cos t$ and all that follows from it is
# lost, and second derivatives are off by {{ hessian_off["as in the textbook"]:.0f }}, their own
# size{{ np.isclose(np.abs(hessian).max(), 1) }}. The usual cure is to add a small number before
# the norm is taken (the function `batch_rodrigues` of the package smplx adds $10^{-8}$). It makes the NaN go away, but
# it leaves a matrix that is orthogonal to {{ orthogonal["1e-8 added to w in |w|"]:.0e }} only and whose second
# derivative near zero is
# wrong{{ finite["1e-8 added to w in |w|"] and hessian_off["1e-8 added to w in |w|"] > 0.01 }}. The right cure costs
# nothing: near zero{{ orthogonal["the library's"] < 1e-13 and hessian_off["the library's"] < 1e-7 }}, take the
# functions
#
# $$
# a = \frac{\sin t}{t} = 1 - \frac{t^2}{6} + \dots, \qquad
# b = \frac{1 - \cos t}{t^2} = \frac12 - \frac{t^2}{24} + \dots
# $$
#
# as series in $t^2$, and write $R = I + a\,[w]_\times + b\,[w]_\times^2$, which divides by nothing. Both
# functions are smooth; only the way of writing them was not. In the library's own lines, `_series(t2, k)`
# sums eight or nine terms of these series (cosine, $a$, $b$ for $k = 0, 1, 2$),
# and `SERIES_BELOW = 0.25` rad² is where it changes over to the closed forms.

# %% slide [markdown]
# ## The right cure costs nothing
#
# $$ a = \frac{\sin t}{t} = 1 - \frac{t^2}{6} + \dots, \qquad b = \frac{1 - \cos t}{t^2} = \frac12 - \frac{t^2}{24} + \dots $$
#
# - $R = I + a\,[w]_\times + b\,[w]_\times^2$ divides by nothing.
# - Near zero, $a$ and $b$ are series in $t^2$: the functions were smooth all along.

# %%
source(rodrigues)

# %% [markdown]
# ## How far apart are two rotations?
#
# One law is worth remembering. If a turn by the angle $t$ leads from one rotation to another, the
# distance of their matrices (the root of the sum of all nine squared differences) is
#
# $$ \| R_1 - R_2 \|_F = 2 \sqrt 2 \left| \sin \tfrac t2 \right| . $$
#
# To see it, multiply out the square: it is the trace of $R_1^\top R_1 + R_2^\top R_2 - 2 R_1^\top R_2$. The first two are
# the identity, whose trace is three. The third contains the turn by $t$ that leads from one to the other, and the
# trace of a turn is $1 + 2 \cos t$, as one sees about the axis $z$. So the square is
# $6 - 2\,(1 + 2 \cos t) = 4\,(1 - \cos t) = 8 \sin^2 \tfrac t2$.
#
# For a small angle $t$ that is $\sqrt 2\, t$.

# %% slide [markdown]
# ## How far apart are two rotations?
#
# $$ \| R_1 - R_2 \|_F = 2 \sqrt 2 \left| \sin \tfrac t2 \right| $$
#
# - $t$ is the angle of the turn that leads from one to the other.
# - The square is $6 - 2 \operatorname{tr}(R_1^\top R_2)$, and the trace of a turn is $1 + 2 \cos t$.
# - For small angles it is $\sqrt 2\, t$.

# %%
turns = np.linspace(0, 2.2 * np.pi, 200)
distance = [np.linalg.norm(matrix_from_vector(t * axis) - np.eye(3)) for t in turns]
off = np.abs(distance - 2 * np.sqrt(2) * np.abs(np.sin(turns / 2))).max()
print(f"distances |R(t) - I| of 200 angles are off this law by up to {off:.0e}")

# %% [markdown]
# ## At a full turn
#
# Describing a rotation by three numbers has a price. How fast does $R$ change with $w$? The singular
# values of the $9 \times 3$ derivative of $R$ say so. For a change of $w$ along the axis the value is always
# $\sqrt 2$, and in the two directions across it
#
# $$ \sqrt 2\; \left| \frac{2 \sin(t/2)}{t} \right| , $$
#
# because two rotations by the same angle $t$ about axes that differ by a little $\delta$ are an angle
# of $|2 \sin(t/2)|\, \delta$ apart, and to turn the axis by $\delta$ takes a change of $t\,\delta$ in
# $w$. The $\sqrt 2$ is that of the law above.

# %% slide [markdown]
# ## The price of three numbers: how fast does $R$ change with $w$?
#
# $$ \text{along the axis } \sqrt 2, \qquad \text{across it } \sqrt 2\, \left| \frac{2 \sin(t/2)}{t} \right| $$
#
# - To turn the axis by $\delta$ takes a change of $t\,\delta$ in $w$ ...
# - ... and moves the rotation by $|2 \sin(t/2)|\,\delta$ only.

# %%
_, jacobian, _ = derivatives(rodrigues(v))
values = np.array([np.linalg.svd(np.asarray(jacobian(t * axis)), compute_uv=False) for t in turns])
law = np.sqrt(2) * np.abs(np.sinc(turns / (2 * np.pi)))
print(f"the second singular value is off its law by up to {np.abs(values[:, 1] - law).max():.0e}")
at_full = np.linalg.svd(np.asarray(jacobian(2 * np.pi * axis)), compute_uv=False)
print("singular values of dR/dw at t = 2 pi:", at_full.round(9))

person = wb.load_body("small")
other = matrix_from_vector([0, 0.6, 0]) @ axis


def turned(n):
    """The person, turned about the axis n by an angle."""
    return lambda t: person.template @ matrix_from_vector(t * n).T


def apart(t):
    """A sentence on how far apart both turns are."""
    R, S = matrix_from_vector(t * axis), matrix_from_vector(t * other)
    off = 2 * np.arcsin(min(1, np.linalg.norm(R - S) / np.sqrt(8)))
    return f"Turned by {t:.2f} rad; the two are {off:.2f} rad apart."


with house_style():
    figure, (ax,) = sheet(7, 3.4)
    ax.plot(turns, values[:, 0], label="along the axis")
    ax.plot(turns, values[:, 1], label="across it (two equal values)")
    ax.plot(turns[::12], law[::12], "k.", label="the law")
    ax.set(xlabel="angle t (rad)", ylabel="singular value of dR/dw (1/rad)")
    ax.set_xticks([0, np.pi, 2 * np.pi], ["0", "π", "2π"])
    ax.legend()
Picture(
    figure,
    "How much R changes with w. At a full turn, 2π, only a change along the axis has an effect: "
    "two of three directions are lost, and an optimizer that gets there cannot turn the axis.",
    lambda: recorded_side_by_side(
        person.faces,
        np.arange(0, 2.21 * np.pi, np.pi / 24),
        {"turns": {"about an axis": turned(axis), "about another axis": turned(other)}},
        "A body turned about two axes by the same angle. Move the slider to a full turn: the two "
        "come to the same, so that there the axis cannot be told from what is seen.",
        say=apart,
        opens=0.45,
    ),
)

# %% slide still [markdown]
# ## At a full turn two of three directions are lost
#
# - Singular values of $dR/dw$ at $2\pi$: {{ at_full[0]:.2f }}, 0, 0{{ (at_full[1:] < 1e-9).all() }}
# - A fit that wanders there gets stuck, and no data are to blame.

# %% slide [markdown]
# ## Two axes, one full turn
#
# - Both bodies turn by the same angle, about different axes.
# - At $2\pi$ they coincide: the axis cannot be told from what is seen.

# %% [markdown]
# At $t = 2\pi$ every axis gives the same rotation, the identity, so no change of the axis is
# felt.{{ np.isclose(at_full[0], np.sqrt(2)) and (at_full[1:] < 1e-9).all() }}{{ max(off, np.abs(values[:, 1] - law).max()) < 1e-13 }}
# A
# fit that has wandered there sees a Jacobian of rank {{ (at_full > 1e-9).sum() }} and gets stuck, and nothing in its
# data is to
# blame. The way out: $w$ and $w\,(1 - 2\pi/t)$ are the same rotation, and for $t$ up to $3\pi$ one of
# them is at most half a turn long; from a longer $w$ one takes off as many whole turns as necessary.
# The workbench's solvers replace the longer by the shorter between two iterations.
#
# ## What to remember
#
# - A rotation is three numbers. Nine free ones stretch bones, and the more so the noisier and the
#   fewer the data.
# - The rotation nearest to a matrix has the same singular vectors, and all singular values set to one
#   (the last one to the sign of the determinant).
# - The exponential map takes any $w$ to a rotation; Rodrigues' formula has $1 - \cos t$ and the
#   **unit** axis. $R^\top R = I$ finds both misprints.
# - At zero the formula needs a series, or derivatives are NaN or wrong. At a full turn the map
#   itself loses two directions; keep $w$ within half a turn.

# %% slide [markdown]
# ## The way out: take the shorter way round
#
# - $w$ and $w\,(1 - 2\pi/t)$ are the same rotation.
# - One of them is at most half a turn long; solvers replace the longer by the shorter between iterations.

# %% slide [markdown]
# ## What to remember
#
# - Nine free numbers stretch bones; a rotation is three.
# - $R^\top R = I$ at many angles finds both misprints of Rodrigues' formula.
# - At zero take a series; at a full turn two directions are lost, so keep $w$ within half a turn.
