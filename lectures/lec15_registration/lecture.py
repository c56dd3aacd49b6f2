# %% [markdown]
# # Registering scans
#
# **How does a template get onto a scan that nobody labelled?**
#
# A **scan** is a list of points on somebody's skin, measured from outside. It does not say which point
# is the elbow. A **template** is a mesh whose vertices mean something: number 200 is the same place on
# everybody. To **register** a scan is to bring the template's vertices to where they are on the person
# who was scanned. Everything that is learned from people (lecture 13) begins with that. We begin with a
# scan that only has to be turned and moved, then let the body bend, and at last let every vertex go where
# it wants. Each step fails in its own way. The scans are simulated, so that the truth is known: the solver
# never sees it, but we do. Lengths are in metres and errors in millimetres, angles in radians, or in
# degrees where the text says so.

# %%
from dataclasses import replace

import casadi as cs
import numpy as np
from scipy.spatial import cKDTree

import workbench as wb
from workbench.course import Picture, source
from workbench.fitting import pose_prior, shape_prior
from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.lectures.material.basins import basin_map, caption_basins, plot_basins
from workbench.plots import house_style, plot_differences, sheet
from workbench.plots.body import Figurine, back, front, line_up_coloured, painted
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import (
    VERTEX_STAGES,
    FitStage,
    FreeVertices,
    GemanMcClure,
    Icp,
    LeastSquares,
    VertexStage,
    by_edges,
    by_vertices,
    distance_gauss_newton,
    doubts,
    fit_model,
    point_to_plane,
    point_to_point,
    random_surface_points,
    scan_starts,
    support,
)
from workbench.registration.icp_steps import gauss_newton_directions
from workbench.residuals import Residual, distance, geman_mcclure, offset, scaled, scan_to_model
from workbench.solvers import GaussNewton, TrustRegion
from workbench.synthetic import Clutter, HalfSpace, Holes, Noise, people, scan, scanners

# %%
SEED, NOISE, OWN = 2, 0.002, 0.01  # NOISE and OWN in m
NAMES = ("pose", "betas", "trans")

body = wb.load_body("small")  # 369 vertices, 24 joints
rng = np.random.default_rng(SEED)
(person,) = people(
    body, draw_poses(shipped_gaussian(), 1, np.random.default_rng(SEED)), 1, SEED, own_shape=OWN
)
skin = person.vertices  # (369, 3) m: the truth


def mean_distance(found, truth):
    """How far points are from where they belong, on average, mm."""
    return 1e3 * np.linalg.norm(found - truth, axis=-1).mean()


# %% slide [markdown]
# ## A scan does not say where the elbow is
#
# - **Scan**: points on somebody's skin. **Template**: a mesh whose vertices mean something
# - **Register**: bring the template's vertices to where they are on the person.
# - First a statue, then a body that bends, then every vertex free

# %% [markdown]
# ## If somebody had labelled it
#
# Suppose that only the place is unknown. A statue was scanned, 1000 points with a noise of 2 mm, in the
# coordinates of the scanner, and we have a mesh of the statue. Which rigid motion $x \mapsto R x + t$
# brings the points onto the mesh? If we know for each point $p_i$ the place $q_i$ on the mesh that it
# shows, this is Procrustes' problem (lecture 9),
#
# $$ \min_{R, t} \sum_i \| R p_i + t - q_i \|^2 , $$
#
# and it has a solution in closed form (Umeyama, [*Least-squares estimation of transformation parameters between two
# point patterns*](https://doi.org/10.1109/34.88573), 1991). For a given $R$ the best $t$ makes the mean of the
# differences zero, so that
# $t = \bar q - R \bar p$, where bars are means. Let $p_i' = p_i - \bar p$ and $q_i' = q_i - \bar q$. What is left is
#
# $$ \sum_i \| R p_i' - q_i' \|^2 = \sum_i \| p_i' \|^2 + \sum_i \| q_i' \|^2 - 2 \sum_i q_i'^\top R p_i' , $$
#
# because a rotation changes no length. Only the last sum depends on $R$. It is the trace of $R^\top \Sigma$ with
# $\Sigma = \sum_i q_i' p_i'^\top$, and the rotation of the largest trace is the one that is nearest to $\Sigma$: with
# $\Sigma = U S V^\top$, it is $R = U \operatorname{diag}(1, 1, \pm 1)\, V^\top$, where the sign makes the determinant
# one (lecture 9). The pairs $(p_i, q_i)$ are called **correspondences**. We try three cases. In the first one the pairs
# are right. In the second one the scanner counted one axis the wrong way round, so that the points are mirrored. In the
# third one the pairs are right but nobody wrote them down, and we take the points in the order in which they come.

# %% slide [markdown]
# ## If somebody had labelled it: a closed form
#
# $$ \min_{R, t} \sum_i \| R p_i + t - q_i \|^2 \quad\Rightarrow\quad R = U \operatorname{diag}(1, 1, \pm 1)\, V^\top $$
#
# - $\Sigma = \sum_i q_i' p_i'^\top = U S V^\top$, means taken away
# - The sign makes $\det R = 1$.

# %%
tree = SurfaceTree(skin, body.faces)
places, _ = random_surface_points(skin, body.faces, 1000, rng)  # (1000, 3) m, on the surface
measured = places + NOISE * rng.standard_normal(places.shape)
moved = Similarity(matrix_from_vector([0.1, 0.5, 0.2]), np.array([0.1, 0.05, -0.1]))
points = moved(measured)  # in the coordinates of the scanner
back_again = moved.inverse()  # the motion that we look for
MIRROR = np.array([1.0, 1.0, -1.0])

cases = {
    "right pairs": (points, places),
    "mirrored points": (points * MIRROR, places),
    "order of arrival": (points, rng.permutation(places)),
}
landed = {}
for name, (p, q) in cases.items():
    motion = procrustes(p, q)
    landed[name] = motion(p)
    print(
        f"{name:17} det R = {np.linalg.det(motion.R):+.0f}, "
        f"points end {mean_distance(motion(p), places):6.1f} mm from their places"
    )
p, q = cases["mirrored points"]
U, _, Vt = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
Q = U @ Vt
print(
    f"mirrored, det free: det Q = {np.linalg.det(Q):+.0f}, "
    f"points end {mean_distance((p - p.mean(axis=0)) @ Q.T + q.mean(axis=0), places):6.1f} mm away"
)

with house_style():
    figure, axes = sheet(10, 4.2, columns=3)
    for ax, (name, ends) in zip(axes, landed.items(), strict=True):
        ax.add_collection(painted(skin[:, :2], skin, body.faces))
        ax.plot(*ends[::4].T[:2], ".", color="C0", ms=3)
        ax.set(title=name, xlabel="x (m)", aspect="equal")
        ax.set(xlim=(-0.85, 0.45), ylim=(-1.0, 0.9), xticks=(-0.8, -0.4, 0, 0.4))
    axes[0].set_ylabel("y (m)")
Picture(
    figure,
    "Every fourth point of the scan, where the best rotation and translation take it, and the mesh, seen along z. "
    "With right pairs the points lie on the mesh. No rotation takes mirrored points there. With pairs that are wrong "
    "they end anywhere.",
)

# %% slide [markdown]
# ## Right pairs, mirrored points, no pairs
#
# - Off by {{ mean_distance(landed['right pairs'], places):.0f}} mm (the noise),
#   {{ mean_distance(landed['mirrored points'], places):.0f}} mm, and
#   {{ mean_distance(landed['order of arrival'], places):.0f}} mm
# - $\det = -1$ would hide that left and right are exchanged.

# %% [markdown]
# With the right pairs the only error left is the
# noise{{ abs(mean_distance(landed['right pairs'], places) - 2 * np.sqrt(8 / np.pi)) < 0.3 }}. For mirrored points the
# last line looks just as
# good. But its matrix has the determinant $-1$, and no statue can be moved like that: this answer
# would hide that left and right are exchanged. The library insists on a rotation and therefore stays
# {{ mean_distance(landed['mirrored points'], places):.0f}} mm off, which tells us that something is wrong with the
# data. The third line is our problem: without labels, a closed form is of no
# use{{ mean_distance(landed['order of arrival'], places) > 200 and np.isclose(np.linalg.det(Q), -1) }}.
#
# ## The closest place
#
# If the scan were nearly in place, a point would be near to the place that it shows. So take the closest
# place on the surface. On a triangle with corners $v_1, v_2, v_3$ it is $s = \sum_k b_k v_k$ with shares
# $b_k \ge 0$ whose sum is one: inside the triangle, on an edge (one share is zero) or at a corner (two
# are). A point with its closest place is a **contact**. `SurfaceTree` finds the contact of a point by a
# tree of boxes, without asking all triangles. Then alternate: find the contacts, move the points by Procrustes'
# motion onto them, find the new contacts, and so on. This is the method of **iterated closest points**, ICP (Besl and
# McKay, [*A method for registration of 3-D shapes*](https://doi.org/10.1109/34.121791), 1992).


# %% slide [markdown]
# ## No labels: take the closest place
#
# - **Contact**: a point with its closest place on the surface
# - **ICP**: contacts, best motion onto them, new contacts, ...
# - No label is needed, only a tree of boxes that finds contacts quickly.


# %%
def alternate(points, steps):
    """The points after each of the steps: contacts, then the best motion onto them."""
    found = [points]
    for _ in range(steps):
        closest = tree.closest(found[-1]).points
        found.append(procrustes(found[-1], closest)(found[-1]))
    return found


ways = alternate(points, 60)
to_surface = [1e3 * np.sqrt(np.mean(tree.closest(p).distances ** 2)) for p in ways]
for k in (0, 1, 5, 20, 60):
    print(
        f"step {k:2}: distance from the surface {to_surface[k]:5.1f} mm (root mean square), "
        f"from their own places {mean_distance(ways[k], places):6.1f} mm"
    )

with house_style():
    figure, axes = sheet(10, 4.4, columns=3)
    for ax, k in zip(axes, (0, 5, 60), strict=True):
        ax.add_collection(painted(skin[:, :2], skin, body.faces))
        shown = ways[k][::8]
        onto = tree.closest(shown).points
        for a, b in zip(shown, onto, strict=True):
            ax.plot(*np.transpose([a, b])[:2], "-", color="C1", lw=0.8)
        ax.plot(*shown.T[:2], ".", color="C0", ms=3)
        ax.set(title=f"after {k} steps", xlabel="x (m)", aspect="equal")
        ax.set(xlim=(-0.85, 0.45), ylim=(-1.0, 0.9), xticks=(-0.8, -0.4, 0, 0.4))
    axes[0].set_ylabel("y (m)")
Picture(
    figure,
    "Every eighth point of the scan (blue) with its contact on the mesh (orange lines), seen along z. "
    "The contacts are wrong at first, and yet they pull the points the right way.",
)

# %% slide [markdown]
# ## Wrong contacts pull the right way
#
# - From their own places: {{ mean_distance(ways[0], places):.0f}} mm at first,
#   {{ mean_distance(ways[5], places):.0f}} after 5 steps, {{ mean_distance(ways[60], places):.0f}} after 60

# %% [markdown]
# It works although most of the first contacts are
# wrong{{ (np.linalg.norm(tree.closest(points).points - places, axis=1) > 0.03).mean() > 0.6 }}. There is a reason for
# it that does not depend on
# the example. Let $D$ be the sum of squared distances of the points from their contacts. The points move by the
# motion that is best for these contacts, so that $D$ does not grow. Then each point takes its closest place, which is
# no farther away than the contact that it had, so that $D$ does not grow either. So neither half of a step can raise
# the sum of squared distances from the surface{{ (np.diff(to_surface) <= 1e-9).all() }}. But the method can stop at a
# motion that is wrong, and it is slow:
# after 5 steps the points are still {{ mean_distance(ways[5], places):.0f}} mm from their own places. (In the end
# they are {{ mean_distance(ways[60], places):.0f}} mm from them, which is the length of their own noise.)

# %% slide [markdown]
# ## Neither half of a step raises the distance
#
# - The best motion *for these contacts*: the sum of squares cannot grow.
# - The closest place is no farther than the old contact: it cannot grow either.
# - But it may stop at a wrong motion, and it is slow.

# %% [markdown]
# ## Let points slide
#
# Why is it slow? Think of a point of a flat back that ought to slide 1 cm along the back. Its contact is
# right below it, and "stay where you are" is what the contact says. All contacts together allow the
# motion to slide only by a little in every step.
#
# The repair is to ask for less. Chen and Medioni ([*Object modelling by registration of multiple range
# images*](https://doi.org/10.1016/0262-8856%2892%2990066-C), 1992) measure the distance from the plane that touches the
# surface at the contact, $n^\top (p - s)$ with the unit normal $n$. This form is called **point to plane**. Along the
# plane a point may slide as it likes. There is no closed form for the best motion any more, but a small motion takes
# $p$ to $p + \omega \times p + v$, with a rotation vector $\omega$ and a translation $v$ (lecture 2), and for this the
# distance from the plane is linear in the six unknowns:
#
# $$ n^\top (p + \omega \times p + v - s) = n^\top (p - s) + (p \times n)^\top \omega + n^\top v . $$
#
# (The triple product $n^\top (\omega \times p)$ is $\omega^\top (p \times n)$.) So each point gives a row
# $((p \times n)^\top, n^\top)$ of a linear least-squares problem. The third form takes the distance from the surface
# itself, $d(p) = \min_s \|p - s\|$, and makes a Gauss-Newton step on it. We shall see below that this only puts the
# direction $u = (p - s) / \|p - s\|$ in place of the normal. Inside a triangle the two directions agree up to the sign;
# they differ at edges and corners. In the library's lines, `u` are these directions, or the normals where a point
# lies on the surface, and `_linear_step` solves the rows for $\omega$ and $v$:

# %% slide [markdown]
# ## Let points slide
#
# $$ n^\top (p + \omega \times p + v - s) = n^\top (p - s) + (p \times n)^\top \omega + n^\top v $$
#
# - A contact says "stay where you are": points of a flat back can hardly slide.
# - **Point to plane** (Chen and Medioni): measure along the normal, linear in six unknowns

# %%
source(gauss_newton_directions, distance_gauss_newton)

# %%
STEPS = {
    "point to point": point_to_point,
    "point to plane": point_to_plane,
    "distance": distance_gauss_newton,
}
rigid = {
    name: Icp(step, max_iterations=300, tolerance=1e-5).align(points, tree)
    for name, step in STEPS.items()
}
gone = {
    name: np.array([mean_distance(one.motion(points), measured) for one in found.trace])
    for name, found in rigid.items()
}
for name, found in rigid.items():
    print(
        f"{name:15} {found.iterations:3} steps until no point moves by more than 0.01 mm; "
        f"motion off by {gone[name][-1]:.2f} mm"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (name, off), mark in zip(gone.items(), ("o-", "s--", "^:"), strict=True):
        ax.semilogy(off, mark, ms=4, label=name)
    ax.set(xlabel="step", ylabel="points off by (mm, mean)")
    ax.legend()
Picture(
    figure,
    "How far the points are from where the true motion puts them, noise left out. All three "
    f"forms end at the same place, {gone['distance'][-1]:.1f} mm off because of the noise. The "
    "two that let points slide are there after a few steps.",
)

# %% slide [markdown]
# ## Where points may slide, a few steps suffice
#
# - Steps: {{ rigid['point to point'].iterations}} point to point, {{ rigid['point to plane'].iterations}}
#   point to plane, {{ rigid['distance'].iterations}} with the distance itself
# - The motion is off by {{ gone['distance'][-1]:.1f}} mm: 1000 points average the noise away.

# %% [markdown]
# The motion is {{ mean_distance(landed['right pairs'], places) / gone['distance'][-1]:.0f}} times as good as a single
# point: 1000 points average the noise away, as in lecture
# 9{{ max(rigid[name].iterations for name in ('point to plane', 'distance')) <= 12 < 25 < rigid['point to point'].iterations }}.
#
# ## What is held, and what is not
#
# The third form needs the derivative of a distance whose other end moves: if $p$ changes, so does the
# closest place $s$. Did we not forget that? Let us look at it where it will be needed, on a body. What
# moves is now the surface: the **transformation** of the template is $M(\theta, \beta) + t$, SMPL with its
# pose, shape and place (lecture 1), instead of $R x + t$, and the scan stands still. `scan_to_model` is a
# residual with a row for each point of the scan,
#
# $$ r_i(\theta, \beta, t) = \min_{s \in M(\theta, \beta) + t} \| p_i - s \| , $$
#
# which is counted as negative behind the surface. If the normals of the scan are known (a depth camera sees how the
# surface lies), only triangles that face the same way can be in contact, so that the front of a hand does not
# stick to its back; and points that are farther away than `within` have no contact. The residual looks for the
# contacts at every linearization and holds them, and the direction $u$, while it takes the derivative.

# %% slide [markdown]
# ## On a body: the distance from a surface that moves
#
# $$ r_i(\theta, \beta, t) = \min_{s \in M(\theta, \beta) + t} \| p_i - s \| $$
#
# - Contacts are looked for at every linearization, and held for the derivative.
# - Did we not forget that $s$ moves?

# %% [markdown]
# What is the derivative? The distance is $r = u^\top (p - s)$, with the contact $s = \sum_k b_k v_k$. Let the corners $v_k$
# move a little, by $dv_k$. In general, the direction $u$ and the shares $b_k$ change as well, by $du$ and $db_k$:
#
# $$ dr = du^\top (p - s) - u^\top \sum_k b_k\, dv_k - u^\top \sum_k db_k\, v_k . $$
#
# The first term is zero. For $p - s = r u$, and $u$ always has length one, so that $u^\top du = 0$. The third term is
# zero as well: $\sum_k db_k\, v_k$ is the way on which the contact slides *along the triangle*, and at the closest place
# $u$ is perpendicular to every way on which the contact can slide. (On an edge it can slide along the edge only, and
# at a corner not at all.) The second term is left, which is the derivative with the shares and the direction held:
#
# $$ \frac{\partial r}{\partial v_k} = - b_k\, u . $$
#
# That is all, and it is exact. (In general it is called the **envelope theorem**; for minima over a set it is due to
# Danskin, [*The theory of max-min*](https://doi.org/10.1007/978-3-642-46092-0) (1967). It fails only where two places
# are equally close: there the distance has a kink.) So choosing the contacts anew at every linearization is no
# alternation: it is Gauss-Newton on the true cost. We check it against central differences, for which contacts are
# chosen anew at both ends. Beside it we put the form `offset`, which has the three coordinates of $p - s$ in place of
# the distance, as point to point does. Half of its sum of squares is the same cost.

# %% slide [markdown]
# ## Nothing is forgotten
#
# $$ r = u^\top (p - s), \quad s = \sum_k b_k v_k \qquad\Rightarrow\qquad \frac{\partial r}{\partial v_k} = - b_k\, u $$
#
# - $u^\top du = 0$, and contacts slide perpendicular to $u$: the **envelope theorem**
# - So this is Gauss-Newton on the true cost, and no alternation.

# %%
truth = person.values
reached = body.vertices(**truth)  # the same pose and betas: a shape that the betas can express
draw = np.random.default_rng(5)
some, outward = random_surface_points(reached, body.faces, 600, draw)
some = some + NOISE * draw.standard_normal(some.shape)
STIRRED = 0.05  # rad
begun = truth | {"pose": truth["pose"] + STIRRED * draw.standard_normal((24, 3))}
pose, betas, trans = (block.symbol for block in body.blocks())
priors = (pose_prior(body), shape_prior(body))


def scanned(form):
    """The distances of the points from the body in one form, and the priors of lecture 10."""
    data = scan_to_model(
        body.points(pose, betas, trans),
        body.faces,
        some,
        sigma=0.005,
        normals=outward,
        within=0.3,
        form=form,
        name="scan",
    )
    return wb.Problem((data, *priors), NAMES)


problems = {"distance": scanned(distance), "offset": scanned(offset)}
wrong_by, slopes = {}, {}
for name, problem in problems.items():
    x, fixed = problem.split(begun)
    along, h = np.random.default_rng(0).standard_normal(len(x)), 1e-6

    def at(share, problem=problem, x=x, fixed=fixed, along=along):
        return problem.linearize(problem.values(x + share * along, fixed))

    here, ahead, behind = at(0.0), at(h), at(-h)
    rows = problem.rows["scan"]
    held = np.asarray(here.jacobian @ along)[rows]
    quotient = (ahead.residual - behind.residual)[rows] / (2 * h)
    wrong_by[name] = np.linalg.norm(held - quotient) / np.linalg.norm(quotient)
    slopes[name] = (
        here.gradient @ along,
        (np.sum(ahead.residual**2) - np.sum(behind.residual**2)) / (4 * h),
    )
    print(
        f"{name:8} {len(held):4} rows; derivative with the contacts held off by "
        f"{100 * wrong_by[name]:.1g} %; "
        f"slope of the cost {slopes[name][0]:.6g}, by differences {slopes[name][1]:.6g}"
    )

# %% slide [markdown]
# ## The offset's rows are wrong, its slope is right
#
# - Contacts held, by differences: distance right{{ wrong_by['distance'] < 1e-5 }}, offset $p - s$ off by
#   {{ 100 * wrong_by['offset']:.0f}} %
# - What is missing is along the surface, perpendicular to $p - s$.
# - Its $J^\top J$ charges for sliding, which costs nearly nothing: steps creep.

# %% [markdown]
# The rows of the distance are right{{ wrong_by['distance'] < 1e-5 }}. Those of the offset are off by
# {{ 100 * wrong_by['offset']:.0f}} %: $s$ slides when the
# body moves, and with the contact held it does not. And yet both have the right slope of the *cost*{{ all(abs(held / quotient - 1) < 1e-5 for held, quotient in slopes.values()) }}:
# the
# missing part is along the surface, and $p - s$ is perpendicular to it. So both go downhill, and both
# stop where the true gradient is zero.
#
# What differs is the length of the step. $J^\top J$ of the offset
# contains, for each point, what it would cost to slide along the surface, which in truth is nearly nothing. In
# lecture 6, every step of Gauss-Newton multiplied the error by the part of the Hessian that was left out over the part
# that was kept. Here the kept part is too large in the directions in which points slide: what is to be taken away from
# it is nearly all of it, so that the factor is nearly one, and the steps creep.
#
# `Problem.frozen` holds the contacts not for a derivative but for good. The problem is then an ordinary
# one, with an expression of its own:

# %%
source(wb.Problem.frozen)

# %% [markdown]
# Solve it to the end, choose contacts, solve again: this is ICP with a body in place of a rigid motion.
# Now fit pose, shape and place in these three ways. The start is off by 0.05 rad in each number of
# the pose.


# %%
def cost_of(problem, values):
    """Half the sum of squares, with the contacts as they are at these values."""
    return 0.5 * np.sum(problem.linearize(values).residual ** 2)


solver = TrustRegion(max_iterations=150, gradient_tolerance=1e-3)
solved = {name: solver.solve(problem, begun) for name, problem in problems.items()}
costs = {name: np.array([one.cost for one in end.trace]) for name, end in solved.items()}
values, steps, costs["offset, contacts held"] = begun, [0], [costs["offset"][0]]
inner = TrustRegion(max_iterations=20, gradient_tolerance=1e-2)
for _ in range(20):
    end = inner.solve(problems["offset"].frozen(values), values)
    values = values | end.values
    steps.append(steps[-1] + len(end.trace) - 1)
    costs["offset, contacts held"].append(cost_of(problems["offset"], values))

goal = 1.1 * costs["distance"][-1]
needed = {name: int(np.argmax(np.array(costs[name]) < goal)) for name in problems}
for name, needs in needed.items():
    surface = body.vertices(**{key: solved[name].values[key] for key in NAMES})
    print(
        f"{name:8} {needs:3} iterations until the cost is within a tenth of {goal / 1.1:.0f}; "
        f"in the end vertices are off by {mean_distance(surface, reached):.1f} mm"
    )
print(f"20 rounds with the contacts held: cost {costs['offset, contacts held'][-1]:.0f}")

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    ax.semilogy(costs["distance"], "o-", ms=4, label="distance, contacts chosen anew")
    ax.semilogy(costs["offset"], "--", label="offset, contacts chosen anew")
    ax.semilogy(steps, costs["offset, contacts held"], "s:", ms=4, label="offset, contacts held")
    ax.set(xlabel="iteration", ylabel="cost", xlim=(0, 100))
    ax.legend()
Picture(
    figure,
    "The same cost, minimised in three ways. With the contacts held (squares: each is one round, solved "
    "to its end) and with the offset it creeps. Gauss-Newton on the distance needs a few iterations.",
)

# %% slide [markdown]
# ## The same cost in three ways
#
# - {{ needed['distance']}} iterations with the distance, {{ needed['offset']}} with the offset; with contacts
#   held even more

# %% [markdown]
# The distance needs {{ needed['distance']}} iterations, and the offset
# {{ needed['offset']}}{{ needed['offset'] > 3 * needed['distance'] and costs['offset, contacts held'][-1] > 1.3 * costs['distance'][-1] }}.
# From here on we take the distance.

# %% slide [markdown]
# ## Where may it begin? Basins
#
# - Turn the statue by half a turn: its back lies on its front, each point is near something.
# - **Basin**: the starts from which a method ends at the truth

# %% [markdown]
# ## Where it may begin
#
# The cost only counts distances from *some* part of the surface. Turn the statue by half a turn, and its
# back lies on its front: each point is near to something. The set of starts from which a method ends at
# the truth is its **basin**. We turn the right motion about each of three axes, in steps of 30 degrees,
# and start there:

# %%
few = points[:200]
maps = [
    basin_map(lambda start: Icp().align(few, tree, start), few, back_again, (axis,), 30.0)
    for axis in ("y", "x", "z")
]
for one in maps:
    print(
        f"about {one.axes[0]}: all starts up to {one.reach:.0f} degrees end at the truth, "
        f"{one.found.sum()} of {len(one.found)} altogether"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 4.4)
    plot_basins(maps, ax=ax)
Picture(figure, caption_basins(maps))

# %% slide [markdown]
# ## Within {{ min(one.reach for one in maps):.0f}} degrees every start ends at the truth
#
# - At a wrong end the gradient is zero, too: begin more than once, keep the lowest cost.

# %% [markdown]
# Most of those that fail end turned by more than
# {{ np.quantile(np.concatenate([one.turned[~one.found] for one in maps]), 0.3):.0f}} degrees. No solver can know that
# it is in the wrong
# basin: the gradient there is zero, as it should be. What helps is to begin more than once, and to keep
# the end with the lowest cost. Every start within {{ min(one.reach for one in maps):.0f}} degrees ends at the truth,
# so that a few starts are
# enough, and not hundreds.
#
# ## Points that belong to nobody
#
# A scanner also sees the floor, a chair and the operator. Such points are called **clutter**. We add 250
# points, anywhere in a box around the statue, and register all {{ 1000 + 250 }} twice: by least squares, and with the
# loss of Geman and McClure (*Statistical methods for tomographic image reconstruction*, 1987), which levels
# off (lecture 10).

# %% slide [markdown]
# ## Points that belong to nobody
#
# - Floor, chair, operator: **clutter**, 250 points for 1000
# - Geman and McClure: $\rho(d) = d^2 / (1 + (d / c)^2)$, which levels off at $c^2$
# - One length, $c$ = 3 cm: from there on a point is hardly believed.

# %%
box = np.array([0.8, 0.9, 0.5])  # m, to either side
clutter = skin.mean(axis=0) + box * rng.uniform(-1, 1, (250, 3))
everything = np.concatenate([points, moved(clutter)])
losses = {"least squares": LeastSquares(), "Geman-McClure": GemanMcClure(0.03)}
cluttered = {
    name: Icp(distance_gauss_newton, loss).align(everything, tree) for name, loss in losses.items()
}
stray = {name: mean_distance(end.motion(points), measured) for name, end in cluttered.items()}
for name, off in stray.items():
    print(f"{name:13} the statue's points are off by {off:.1f} mm")

with house_style():
    figure, axes = sheet(8, 4.6, columns=2)
    for ax, (name, end) in zip(axes, cluttered.items(), strict=True):
        ax.add_collection(painted(skin[:, :2], skin, body.faces))
        placed = end.motion(everything)
        ax.plot(*placed[1000:].T[:2], ".", color="C1", ms=3, label="clutter")
        ax.plot(*placed[:1000:3].T[:2], ".", color="C0", ms=3, label="statue")
        ax.set(title=name, xlabel="x (m)", aspect="equal", xlim=(-1.2, 0.9), ylim=(-1.1, 1.3))
        ax.set_xticks((-1, -0.5, 0, 0.5))
    axes[0].set_ylabel("y (m)")
    axes[1].legend(loc="upper right", bbox_to_anchor=(1.1, 1.05))
Picture(
    figure,
    "A scan with clutter, registered twice, seen along z. Least squares turn the statue, so that the "
    "clutter comes a little nearer to the surface; the loss that levels off gives it up.",
)

# %% slide [markdown]
# ## Least squares turn the statue
#
# - The statue's points are off by {{ stray['least squares']:.0f}} mm, with the loss that levels off by
#   {{ stray['Geman-McClure']:.1f}} mm.

# %% [markdown]
# Least squares leave the statue's points {{ stray['least squares']:.0f}} mm off, and this loss
# {{ stray['Geman-McClure']:.1f}} mm. The loss is $\rho(d) = d^2 / (1 + (d / c)^2)$. A point with $d$ much smaller
# than $c$ costs $d^2$, as in least squares,
# and one with $d$ much larger costs $c^2$, wherever it is. So there is one length, the scale $c$, here 3 cm, from which
# on a point is hardly believed.
#
# ## Bodies bend
#
# People are no statues. From now on a person is scanned by four depth cameras, with 2 mm of noise, with
# holes (hair and shiny things give no points), and with clutter, which is a fifth of the points. This
# person has a shape of their own: smooth bumps of 1 cm, root mean square, that no betas can express. And
# nobody says which way the person faces.

# %%
middle = skin.mean(axis=0)


def seen_by(n, **other):
    """What n cameras around the person see."""
    around = scanners(n, target=middle, size=(75, 100), focal=82.0, turn=other.pop("turn", 0.0))
    return scan(
        skin,
        body.faces,
        around,
        seed=SEED,
        noise=Noise(growth=0.0, floor=NOISE),
        holes=Holes(),
        clutter=Clutter(0.2),
        steepest=np.radians(80),
        **other,
    )


simulated = seen_by(4)
seen, hidden = simulated.seen, ~simulated.seen
print(
    f"{simulated.scan.n_points} points, {100 * simulated.clutter.mean():.0f} % of them clutter; "
    f"{100 * hidden.mean():.0f} % of the vertices were seen by no camera"
)

# %% slide [markdown]
# ## Bodies bend
#
# - Four depth cameras, 2 mm of noise, holes, a fifth clutter: {{ simulated.scan.n_points:,}} points;
#   {{ 100 * hidden.mean():.0f}} % of the vertices unseen
# - Bumps of 1 cm that no betas express, and nobody says which way the person faces
# - Eight ways to face; a coarse fit from each: 300 points, a loss that levels off at 10 cm

# %% [markdown]
# The transformation is again $M(\theta, \beta) + t$. `scan_starts` proposes eight ways to face, 45 degrees
# apart, with the feet of the body at those of the scan. From each of them we make a coarse fit: 300 points, and a loss
# that levels off late, at 10 cm.

# %%
coarse = (FitStage(points=300, sigma=0.05, reach=0.10, starts=1, iterations=20),)
facings = scan_starts(body, simulated.scan, yaws=8, arms=(1.2,))
ends = [
    fit_model(body, simulated.scan, starts=lambda *_, it=one: [it], stages=coarse)
    for one in facings
]
apart = np.array([mean_distance(end.vertices(), skin) for end in ends])
prices = np.array([end.cost for end in ends])
for k, end in enumerate(ends):
    print(f"facing {45 * k:3} degrees: cost {end.cost:5.1f}, vertices off by {apart[k]:3.0f} mm")
rough = ends[int(prices.argmin())]

with house_style():
    figure, axes = sheet(9, 3.6, columns=2)
    for ax, numbers, label in zip(
        axes, (prices, apart), ("cost", "vertices off by (mm, mean)"), strict=True
    ):
        ax.bar(range(8), numbers, color="C0")
        ax.set(xlabel="facing of the start (degrees)", ylabel=label)
        ax.set_xticks(range(8), [f"{45 * k}" for k in range(8)])
Picture(
    figure,
    "Eight coarse fits of one scan. Their costs, which need no truth (left), tell those that found the body "
    "from those that face the wrong way (right).",
)

# %% slide [markdown]
# ## Costs tell who found the body
#
# - Left: what can be measured. Right: what is true

# %% [markdown]
# The fits with low costs are those near the truth{{ prices[apart < 100].max() < 0.9 * prices[apart > 200].min() }}.
# `fit_model` does this in stages: all starts with a
# few points, and then only the best of them, with more points and a shorter scale. It returns all ends that
# differ, as **hypotheses**.

# %%
fit = fit_model(body, simulated.scan)
for k, hypothesis in enumerate(fit.hypotheses):
    off = mean_distance(fit.vertices(k), skin)
    print(f"hypothesis {k + 1}: cost {hypothesis.cost:6.0f}, vertices off by {off:3.0f} mm")

# %% slide [markdown]
# ## In stages, with hypotheses
#
# - All starts with a few points; the best with more, and a shorter scale
# - First hypothesis: vertices off by {{ mean_distance(fit.vertices(0), skin):.0f}} mm
# - Every end that differs is returned.

# %% [markdown]
# ## A length for the noise, and one for outliers
#
# In the form of lecture 10, Geman and McClure's loss has a single number, its sigma. In a scan two
# lengths are at work: how exact a good point is, which decides how much the data count beside the priors, and
# where bad points begin. Put one number in the place of both, and try several:


# %%
chosen = np.random.default_rng(0).permutation(simulated.scan.n_points)[:800]


def with_loss(sigma, kernel):
    """Fitted to 800 points from the rough fit: how far vertices are off on average, mm."""
    data = scan_to_model(
        body.points(pose, betas, trans),
        body.faces,
        simulated.scan.points[chosen],
        sigma=sigma,
        kernel=kernel,
        normals=simulated.scan.normals[chosen],
        within=0.4,
        name="scan",
    )
    tries = TrustRegion(max_iterations=60, gradient_tolerance=1e-3)
    found = tries.solve(wb.Problem((data, *priors), NAMES), rough.values).values
    return mean_distance(body.vertices(**{key: found[key] for key in NAMES}), skin)


sigmas = np.array([0.1, 0.03, 0.01, 0.005, 0.003])  # m
as_one = np.array([with_loss(sigma, geman_mcclure) for sigma in sigmas])
as_two = with_loss(0.005, scaled(geman_mcclure, 6))  # the scale is six sigmas, 3 cm
for sigma, off in zip(sigmas, as_one, strict=True):
    print(f"one number of {1e3 * sigma:3.0f} mm: vertices off by {off:4.1f} mm")
print(f"sigma 5 mm and a scale of 30 mm: vertices off by {as_two:.1f} mm")

with house_style():
    figure, (ax,) = sheet(6.5, 3.6)
    ax.semilogx(1e3 * sigmas, as_one, "o-", label="one number for both")
    ax.axhline(as_two, color="C1", ls="--", label="sigma 5 mm, scale 30 mm")
    ax.set(xlabel="sigma (mm)", ylabel="vertices off by (mm, mean)", ylim=(0, None))
    ax.set_xticks(1e3 * sigmas, [f"{1e3 * sigma:g}" for sigma in sigmas])
    ax.minorticks_off()
    ax.legend()
Picture(
    figure,
    "Geman and McClure's loss with one number for noise and outliers, and with two. A large one believes "
    "the priors in place of the data, a small one takes good points for outliers.",
)

# %% slide [markdown]
# ## Two lengths: noise, and where outliers begin
#
# - One number: {{ as_one[0]:.0f}} mm (10 cm, priors win) to {{ as_one[-1]:.0f}} mm (3 mm, good points become
#   outliers); two numbers: {{ as_two:.1f}} mm

# %% [markdown]
# Two numbers leave {{ as_two:.1f}} mm, the largest single one {{ as_one[0]:.1f}} mm and the smallest
# {{ as_one[-1]:.1f}}
# mm{{ as_one[0] > 1.5 * as_two and as_one[-1] > 1.2 * as_two and as_one.min() < 0.8 * min(as_one[0], as_one[-1]) }}.
# A large number hardly believes the data, so that the priors win; with a small one most good points are outliers,
# because the bumps of the person are larger than that. `scaled(geman_mcclure, 6)` keeps the two
# apart: sigma is 5 mm, and outliers begin at six sigmas.
#
# ## What betas cannot say
#
# The best fit of the model is off by {{ mean_distance(fit.vertices(), skin):.0f}} mm, although the noise is 2 mm and
# there are
# thousands of points. It cannot be better: the person's own bumps are not in the shape space. Should we give up the
# model, and let all vertices be free? The distance from the scan is then the only thing that counts, and there
# is a quick way to make it zero: move every vertex to the point of the scan that is closest to it.

# %% slide [markdown]
# ## What betas cannot say
#
# - The model ends {{ mean_distance(fit.vertices(), skin):.0f}} mm off, with noise of 2 mm: the person's bumps
#   are not in the shape space.
# - Free all vertices, then? Move each to the closest point of the scan.

# %%
near_points = simulated.scan.points
nearest = cKDTree(near_points).query(fit.vertices())[1]
snapped = near_points[nearest]
free = wb.Block("vertices", skin.shape, "m")
alone = wb.Problem(
    [scan_to_model(free.symbol, body.faces, near_points, sigma=NOISE, within=0.05, name="scan")],
    ["vertices"],
    blocks=[free],
)
J = alone.linearize({"vertices": fit.vertices()}).jacobian
unread = int(np.sum(np.abs(J).sum(axis=0) == 0))


def told(name, vertices):
    """Print how far vertices are off where they were seen and where not, mm."""
    a, b = (mean_distance(vertices[which], skin[which]) for which in (seen, hidden))
    print(f"{name:33} seen vertices off by {a:4.1f} mm, hidden ones by {b:4.1f} mm")


told("the model:", fit.vertices())
told("every vertex at its closest point:", snapped)
print(f"{len(nearest)} vertices have taken {len(set(nearest))} different points")
print(f"{unread} of the {J.shape[1]} numbers of all vertices are read by no contact")

# %% slide [markdown]
# ## Distance zero, and a worse answer
#
# - Hidden vertices: {{ mean_distance(snapped[hidden], skin[hidden]):.0f}} mm off in place of
#   {{ mean_distance(fit.vertices()[hidden], skin[hidden]):.0f}}; they go to the rim of what was seen.
# - {{ len(nearest) - len(set(nearest))}} of {{ len(nearest)}} share a point with another.
# - {{ unread}} of {{ J.shape[1]:,}} numbers are read by no row.

# %% [markdown]
# The answer is worse, and worst where nothing was
# seen{{ mean_distance(snapped[hidden], skin[hidden]) > 1.5 * mean_distance(fit.vertices()[hidden], skin[hidden]) and mean_distance(snapped[hidden], skin[hidden]) > 1.3 * mean_distance(snapped[seen], skin[seen]) }}:
# hidden vertices go to the rim of what was seen.
# Several vertices have taken the same point ({{ len(nearest) - len(set(nearest))}} of {{ len(nearest)}} are left
# without one of their own), so that triangles between them have collapsed. Lecture 8 would
# have warned us: {{ unread}} of the {{ J.shape[1]}} numbers are read by no row of the Jacobian, and a vertex that
# slides along the
# surface changes hardly any. Which of the transformations has how many unknowns?
#
# | transformation | unknowns | what it cannot do |
# | --- | --: | --- |
# | $R x + t$ | 6 | bend |
# | $M(\theta, \beta) + t$ | 85 | be somebody whom the betas do not express |
# | all vertices $V$ | {{ skin.size }} | know anything about what was not seen |

# %% slide [markdown]
# ## Three transformations
#
# | | unknowns | cannot |
# | --- | --- | --- |
# | $R x + t$ | 6 | bend |
# | $M(\theta, \beta) + t$ | {{ 72 + 10 + 3 }} | be somebody whom betas do not express |
# | all vertices | {{ skin.size:,}} | know what was not seen |

# %% [markdown]
# ## Coupled edges
#
# Free vertices need the model after all, not as their place, but as their shape. Keep both: the
# vertices $V$ and the model $M$, and ask that the *edges* of $V$ be like those of $M$. With the matrix $A$
# that takes vertices to the differences along all edges (a row of $A$ has a $1$ at one end of an edge, a $-1$ at the
# other one, and zeros elsewhere), the **coupling** is
#
# $$ E_C = \frac{1}{\sigma_C^2} \| A V - A M(\theta, \beta) \|^2
#    = \frac{1}{\sigma_C^2} \sum_{(i, j)} \| (V_i - V_j) - (M_i - M_j) \|^2 . $$
#
# (This is the coupling of Hirshberg, Loper, Rachlin and Black,
# [*Coregistration*](https://doi.org/10.1007/978-3-642-33783-3_18) (2012), who couple triangles, and of Bogo, Romero,
# Loper and Black, [*FAUST*](https://doi.org/10.1109/CVPR.2014.491) (2014).) It does not see a translation of all
# vertices, since $A$ takes it away. If the scan moves a vertex outwards, its neighbours are taken along, also those
# that nobody saw.

# %% slide [markdown]
# ## Coupled edges
#
# $$ E_C = \frac{1}{\sigma_C^2} \sum_{(i, j)} \| (V_i - V_j) - (M_i - M_j) \|^2 $$
#
# - Edges of the free mesh are like those of the model; shifts cost nothing.
# - A vertex that the scan moves takes its neighbours along, also unseen ones.

# %%
source(by_edges)

# %% [markdown]
# How strong should it be? If the coupling is infinite, then $V = M$, and this is the fit of the model. If
# it is weak, the scan decides. We go from one to the other in stages: the model alone, a strong coupling
# with a $\sigma_C$ of 2 mm, a weak one with 10 mm. From the second on, vertices and model are free together, so
# that the model can follow. The priors on pose and shape have led the model to the scan; there, they only hold it back
# from a pose or a shape that is rare. So a last stage **relaxes** them: their standard deviations are 30 times as large.
# All stages have the same terms. We begin at the rough fit, the best of the eight above:

# %% slide [markdown]
# ## From the model to the scan, in stages
#
# - $\sigma_C$: infinite (model alone), 2 mm (strong), 10 mm (weak)
# - Vertices and model are free together, so that the model can follow.
# - **Relaxed**: priors have led the model there; now 30 times as wide

# %%
registration = FreeVertices(body, simulated.scan)
model_alone = tuple(one for one in VERTEX_STAGES if one.coupling == 0)
together, follows = (*NAMES, "vertices"), TrustRegion(max_iterations=30)
coupled = (
    VertexStage("strong", together, 0.002, solver=follows),
    VertexStage("weak", together, 0.01, solver=follows),
    VertexStage("relaxed", together, 0.01, solver=follows, prior_scale=30.0),
)
model_held = (
    VertexStage("strong", ("vertices",), 0.002),
    VertexStage("weak", ("vertices",), 0.01),
)
fitted = registration.register(rough.values, model_alone)
registered = registration.register(fitted.values, coupled)
by_stage = {"start": rough.vertices()} | {
    one.stage.name: one.vertices for one in (*fitted.stages, *registered.stages)
}
for name, vertices in by_stage.items():
    told(f"{name}:", vertices)

with house_style():
    figure, (ax,) = sheet(10.5, 4.6)
    three = {"model": fit.vertices(), "snapped": snapped, "registered": registered.vertices}
    plot_differences(skin, three, body.faces, ax=ax, name="the truth", most=40)
Picture(
    figure,
    "The person who was scanned, and three answers, coloured by how far each vertex is from its true "
    "place; the scale ends at 40 mm. Snapped to the scan, the mesh is torn.",
)

# %% slide [markdown]
# ## Model, snapped, registered
#
# - Seen vertices: {{ mean_distance(fitted.vertices[seen], skin[seen]):.1f}} mm (model),
#   {{ mean_distance(registered.vertices[seen], skin[seen]):.1f}} mm (registered)

# %% [markdown]
# Every stage comes nearer to the truth, in what was seen and in what was
# not{{ (np.diff([[mean_distance(v[which], skin[which]) for which in (seen, hidden)] for v in by_stage.values()], axis=0) < 0).all() }}.
# In the end, seen vertices are off by {{ mean_distance(registered.vertices[seen], skin[seen]):.1f}} mm, and with the
# model alone by {{ mean_distance(fitted.vertices[seen], skin[seen]):.1f}} mm.
#
# Are the stages necessary? From the same start, we first leave out the strong coupling, and then all stages
# but the last one: once with the model free, and once with the model held where it is, which is quicker and is
# done for large meshes.

# %%
at_once = {
    "all stages": registered,
    "without strong": registration.register(fitted.values, coupled[1:]),
    "weak at once, model free": registration.register(rough.values, coupled[1:]),
    "weak at once, model held": registration.register(rough.values, model_held[1:]),
}
for name, one in at_once.items():
    told(f"{name}:", one.vertices)
ends_off = {name: mean_distance(one.vertices, skin) for name, one in at_once.items()}  # mm

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for which, name, mark in ((seen, "seen", "o-"), (hidden, "hidden", "s--")):
        errors = [mean_distance(v[which], skin[which]) for v in by_stage.values()]
        ax.plot(range(len(errors)), errors, mark, label=f"{name} vertices")
    for (name, one), mark in zip([*at_once.items()][1:], ("D", "^", "v"), strict=True):
        at_end = mean_distance(one.vertices, skin)
        ax.plot(len(errors) - 0.7, at_end, f"C2{mark}", ms=7, mfc="none", label=name)
    ax.set(ylabel="vertices off by (mm, mean)", ylim=(0, None))
    ax.set_xticks(range(len(errors)), list(by_stage))
    ax.legend()
Picture(
    figure,
    "The error after each stage, and (green, mean over all vertices) that of three registrations from the same "
    "start that leave out stages.",
)

# %% slide [markdown]
# ## Are the stages necessary?
#
# - All: {{ ends_off['all stages']:.1f}} mm. Without the strong one: {{ ends_off['without strong']:.1f}}. Weak
#   at once with the model held: {{ ends_off['weak at once, model held']:.0f}}

# %% [markdown]
# With the model held, all vertices together are {{ ends_off['weak at once, model held']:.0f}} mm off in place of
# {{ ends_off['all stages']:.0f}} mm{{ ends_off['weak at once, model held'] > 2 * ends_off['all stages'] }}. They
# cannot leave a place that is centimetres off: the coupling keeps the edges
# of a body in the wrong pose, and points beyond 5 cm have no contact. With the model free they end
# {{ ends_off['weak at once, model free']:.1f}} mm off, and without the strong stage alone
# {{ ends_off['without strong']:.1f}}
# mm{{ ends_off['all stages'] < min(ends_off['without strong'], ends_off['weak at once, model free']) }}. (One person
# is no statistics. Change `SEED`, run the lecture again, and see which of these differences stay.)
#
# ## The wrong judge
#
# How would we have chosen all of this without the truth? The obvious judge is the distance of the scan from
# the result. Compare the coupling by edges with the one that comes to mind first, $\|V - M\|^2$, which draws
# every vertex to its own place on the model. Both begin at the fitted model, which is held. With vertices we try
# two strengths.


# %%
own = simulated.scan.points[~simulated.clutter]


def from_scan(vertices):
    """The mean distance of the person's own points from a surface, mm."""
    return 1e3 * np.abs(SurfaceTree(vertices, body.faces).closest(own).distances).mean()


tied = replace(registration, couple=by_vertices)
judged = {
    "the truth": skin,
    "model": fitted.vertices,
    "edges, 10 mm": registration.register(fitted.values, model_held).vertices,
}
for sigma in (0.005, 0.01):
    stages = (model_held[0], replace(model_held[1], coupling=sigma))
    judged[f"vertices, {1e3 * sigma:g} mm"] = tied.register(fitted.values, stages).vertices
table = {name: (from_scan(v), mean_distance(v, skin)) for name, v in judged.items()}
for name, (scan_distance, true_error) in table.items():
    print(f"{name:15} scan off by {scan_distance:.2f} mm, vertices off by {true_error:4.1f} mm")

with house_style():
    figure, (ax,) = sheet(6.5, 3.8)
    for (name, (a, b)), mark in zip(table.items(), "*osD^", strict=True):
        ax.plot(a, b, mark, ms=8, label=name)
    ax.set(xlabel="scan off the surface by (mm, mean)", ylabel="vertices off by (mm, mean)")
    ax.set(ylim=(-0.5, None))
    ax.legend(loc="center right")
Picture(
    figure,
    "What can be measured without the truth, across, and what we want to know, upwards. Coupled vertices "
    "with 10 mm come nearest to the scan, and are farther from the truth than coupled edges.",
)

# %% slide [markdown]
# ## The wrong judge: distance from the scan
#
# - Coupled vertices are nearest to the scan ({{ table['vertices, 10 mm'][0]:.1f}} mm; edges
#   {{ table['edges, 10 mm'][0]:.1f}}), and farther from the truth ({{ table['vertices, 10 mm'][1]:.1f}} mm;
#   {{ table['edges, 10 mm'][1]:.1f}}).

# %% [markdown]
# By the scan's distance, vertices with 10 mm are the best, {{ table['vertices, 10 mm'][0]:.2f}} mm from the scan, and
# edges {{ table['edges, 10 mm'][0]:.2f}} mm. Their error is larger, {{ table['vertices, 10 mm'][1]:.1f}} mm in place
# of {{ table['edges, 10 mm'][1]:.1f}}
# mm{{ table['vertices, 10 mm'][0] == min(a for a, _ in table.values()) and table['vertices, 10 mm'][1] > 1.1 * table['edges, 10 mm'][1] }}.
# A vertex can slide along the surface as far as it likes, and the distance never knows; and
# it can take in noise. The truth itself is {{ table['the truth'][0]:.2f}} mm from its noisy scan, so anything below
# that is no merit. What
# does judge a registration? Landmarks that were not fitted, simulated scans with a truth, or a known
# pattern on the skin, as FAUST's people have it.
#
# ## What was not seen
#
# At last the same person is seen by a single camera in front, from behind a table, which hides all below
# the middle. `fit_model` returns a whole body all the same. `support` says what in it the scan supports.
# From $J^\top J$ at the end, with the contacts held, it computes the posterior standard deviation of each
# vertex (lecture 8; lecture 12 says when that can be trusted).

# %%
facing = person.values["pose"][0, 1]  # rad, about the vertical
upper = seen_by(1, turn=facing, region=HalfSpace(tuple(middle), (0, 1, 0)))
half = fit_model(body, upper.scan)
known = support(half)
away = np.linalg.norm(half.vertices() - skin, axis=1)
for name, which in (("supported", known.seen), ("the others", ~known.seen)):
    print(
        f"{name:10} {100 * which.mean():3.0f} % of the vertices: standard deviation "
        f"{1e3 * known.sd[which].mean():4.0f} mm, off by {1e3 * away[which].mean():4.0f} mm"
    )
for doubt in doubts(half, known, camera=upper.scanners[0].place):
    print("warning:", doubt)

with house_style():
    figure, (ax,) = sheet(9, 4.6)
    line_up_coloured(
        [
            (Figurine("one side", half.vertices(), front), 1e3 * known.sd),
            (Figurine("the other side", half.vertices(), back), 1e3 * known.sd),
        ],
        body.faces,
        150,
        "posterior standard deviation (mm)",
        ax=ax,
        before=[Figurine("the person", skin, front)],
    )
Picture(
    figure,
    "A person of whom one camera saw the front above the middle, and the body that was fitted, coloured by "
    "how far each vertex may be off. Legs and feet rest on the prior alone.",
)

# %% slide [markdown]
# ## What was not seen rests on the prior
#
# - Not supported: deviation {{ known.sd[~known.seen].mean() / known.sd[known.seen].mean():.0f}} times as
#   large, error {{ away[~known.seen].mean() / away[known.seen].mean():.0f}} times

# %% [markdown]
# The legs are somebody's legs in a common pose, not this person's. That is what a prior is for, and the
# numbers say so: the standard deviation of what the scan does not support is
# {{ known.sd[~known.seen].mean() / known.sd[known.seen].mean():.0f}} times as large, and its error
# {{ away[~known.seen].mean() / away[known.seen].mean():.0f}} times. `doubts` turns this into a sentence without the
# truth. Note that where the scan *does* support the body, the error is larger than its standard
# deviation{{ away[known.seen].mean() > known.sd[known.seen].mean() }}: the posterior takes the shape space
# for complete, and knows nothing of bumps that are not in it.

# %% [markdown]
# ## Many scans of the same people
#
# No scan shows everything, but another scan of the same person may show what this one hides. To use that, do not
# register scans one after the other: let the person's template be unknown too. For scans $j$ of a person with the
# template $T$, free vertices $V_j$, and the pose held for a moment, the joint cost is
#
# $$ E(V_1, \dots, V_J, T) = \sum_j \Big[ E_S(V_j) + \frac{1}{\sigma_C^2} \| V_j - T \|^2 \Big] + E_T(T) . $$
#
# To find all of them together is called **coregistration** (Hirshberg, Loper, Rachlin and Black, *Coregistration:
# Simultaneous alignment and modeling of articulated 3D shape*, 2012). `workbench coregister` does it with poses,
# joints and pose blend shapes, and `--model blend-scape` with triangles as that paper does. Here we take the least that shows what happens: the outline of a trunk, seen from
# above, 40 vertices in a plane. The person is wider than the first template, and forward and to the side of it. Each of
# five scans sees nearly half of the outline, and of a vertex that it sees it knows one number, the distance across the skin.

# %% slide [markdown]
# ## Many scans of one person: coregistration
#
# $$ E = \sum_j \Big[ E_S(V_j) + \frac{1}{\sigma_C^2} \| V_j - T \|^2 \Big] + E_T(T) $$
#
# - The template is unknown, too. In the plane: 40 vertices, five scans, each sees half

# %%
N, SCANS, COUPLING, EDGES = 40, 5, 0.003, 0.004  # COUPLING and EDGES in m
angle = 2 * np.pi * np.arange(N) / N
first = np.stack([0.16 * np.cos(angle), 0.11 * np.sin(angle)], axis=1)  # (40, 2) m
trunk = first + np.stack([0.010 + 0.006 * np.cos(angle), 0.008 + 0.003 * np.sin(3 * angle)], axis=1)
along = np.roll(trunk, -1, axis=0) - np.roll(trunk, 1, axis=0)
across = np.stack([along[:, 1], -along[:, 0]], axis=1)
across /= np.linalg.norm(across, axis=1, keepdims=True)  # unit normals

template = wb.Block("template", (N, 2), "m")
surfaces = [wb.Block(f"scan {j}", (N, 2), "m") for j in range(SCANS)]
looks = 2 * np.pi * (np.arange(SCANS) + 0.25) / SCANS
facing_it = np.stack(
    [across @ [np.cos(a), np.sin(a)] > 0.1 for a in looks]
)  # (5, 40) who sees what
draw = np.random.default_rng(3)
pulls, couplings = [], []
for j, V in enumerate(surfaces):
    rows = np.flatnonzero(facing_it[j])
    off = cs.sum1(across[rows].T * (V.symbol[:, rows.tolist()] - trunk[rows].T)).T
    noise = NOISE * draw.standard_normal(len(rows))
    pulls.append(Residual(f"E_S of scan {j}", off - noise, NOISE, "m"))
    gap = cs.vec(V.symbol - template.symbol)
    couplings.append(Residual(f"E_C of scan {j}", gap, COUPLING, "m"))

data = (*pulls, *couplings)
scans = tuple(V.name for V in surfaces)
all_names = (*scans, "template")
nothing_known = wb.Problem(data, all_names).linearize(dict.fromkeys(all_names, trunk))
print(f"{nothing_known.shape[1]} unknowns, rank {nothing_known.rank} without E_T")

# %% [markdown]
# The data leave {{ nothing_known.shape[1] - nothing_known.rank}} directions open, one for each vertex: the template
# and all registrations together can slide
# along the skin, and nothing notices. So $E_T$ decides how they do. Two ways come to mind: hold every vertex near its place
# in the first template, or hold the *edges*, as above. And there are two ways to go down. Since a problem is a
# choice of which names are free, the alternation of the sources is two problems in turn: all scans with the
# template held, then the template with the scans held. Or let everything be free.

# %%
beyond = template.symbol - first.T
next_one = np.roll(np.arange(N), -1).tolist()
PRIORS = {
    "vertices held": Residual("E_T", cs.vec(beyond), 0.01, "m"),
    "edges held": Residual(
        "E_T", cs.vec(cs.horzcat(beyond[:, next_one] - beyond, 0.01 * beyond)), EDGES, "m"
    ),  # the second part, with a sigma of 0.4 m, says where the template is as a whole
}
one_step = GaussNewton()  # every residual is linear
begun_at = dict.fromkeys(all_names, first)
by_itself = begun_at | one_step.solve(wb.Problem(data, scans), begun_at).values


def off_by(values):
    """How far vertices of the registrations are off on average, mm: seen ones, and hidden ones."""
    away = 1e3 * np.linalg.norm(np.stack([values[name] for name in scans]) - trunk, axis=2)
    return away[facing_it].mean(), away[~facing_it].mean()


def in_turn(residuals, rounds):
    """The values after each round: the scans, then the template."""
    values = [begun_at]
    by_turns = [wb.Problem(residuals, scans), wb.Problem(residuals, ("template",))]
    for _ in range(rounds):
        found = values[-1]
        for problem in by_turns:
            found = found | one_step.solve(problem, found).values
        values.append(found)
    return values


ROUNDS, turns, at_last = 12, {}, {}
print("apart:                        seen {:.1f} mm, hidden {:.1f} mm".format(*off_by(by_itself)))
for name, prior in PRIORS.items():
    joint = wb.Problem((*data, prior), all_names)
    turns[name] = in_turn((*data, prior), ROUNDS)
    at_last[name] = one_step.solve(joint, begun_at).values
    for how, values in ((f"{ROUNDS} rounds", turns[name][-1]), ("together", at_last[name])):
        print(
            f"{name + ', ' + how + ':':29} seen {off_by(values)[0]:.1f} mm, "
            f"hidden {off_by(values)[1]:.1f} mm; cost {joint.linearize(values).cost:.1f}"
        )

slid = turns["edges held"][-1]["template"] - trunk
trunk_across = 1e3 * np.abs(np.sum(slid * across, axis=1)).mean()  # mm

with house_style():
    figure, axes = sheet(10.5, 4.4, columns=2)
    axes[0].plot(*(100 * first[[*range(N), 0]]).T, "k:", lw=1, label="first template")
    axes[0].plot(*(100 * trunk).T, "k.", ms=4, label="the person")
    for values, name, colour in (
        (turns["edges held"][-1], "edges held, in turn", "C1"),
        (at_last["edges held"], "edges held, together", "C0"),
    ):
        ends = 100 * np.stack([trunk, values["template"]])
        axes[0].plot(*np.moveaxis(ends, 2, 0), color=colour, lw=2)
        axes[0].plot(*ends[1].T, "o", color=colour, ms=4, mfc="none", label=name)
    axes[0].set(xlabel="x (cm)", ylabel="y (cm)", aspect="equal")
    axes[0].legend(loc="center", fontsize="small")
    for (name, values), mark in zip(turns.items(), ("^-", "s-"), strict=True):
        hidden_by = [off_by(one)[1] for one in values[1:]]
        (line,) = axes[1].plot(range(1, ROUNDS + 1), hidden_by, mark, label=f"{name}, in turn")
        axes[1].axhline(off_by(at_last[name])[1], color=line.get_color(), ls="--")
    axes[1].set(xlabel="round", ylabel="hidden vertices off by (mm, mean)", ylim=(0, None))
    axes[1].legend()
Picture(
    figure,
    "Left: the outline, and lines from the person's vertices to those of two templates. In turn (orange, after "
    "12 rounds) the outline is right, and vertices have slid along it. Right: the error of hidden vertices after each "
    "round, and (dashed) where it ends with everything free.",
)

# %% slide [markdown]
# ## In turn, vertices slide and stay there
#
# - Hidden vertices: {{ off_by(by_itself)[1]:.0f}} mm apart, {{ off_by(turns['edges held'][-1])[1]:.1f}} mm
#   after twelve rounds, {{ off_by(at_last['edges held'])[1]:.1f}} mm with everything free

# %% [markdown]
# Apart, a hidden vertex stays on the first template, {{ off_by(by_itself)[1]:.0f}} mm off. The alternation brings
# hidden vertices across the
# skin to where other scans saw them. Then it hardly moves any more, whatever holds the template, and what is left is
# nearly all along the
# skin{{ all(0.9 < off_by(values[-1])[1] / off_by(values[-5])[1] < 1 for values in turns.values()) and trunk_across < 1.5 }}.
# With vertices held, this is the minimum: nothing speaks for sliding. With edges held, the minimum is nearer to the
# truth, {{ off_by(at_last['edges held'])[1]:.1f}} mm in place of {{ off_by(turns['edges held'][-1])[1]:.1f}}
# mm{{ off_by(at_last['edges held'])[1] < off_by(turns['edges held'][-1])[1] / 4 and off_by(at_last['vertices held'])[1] > 0.99 * off_by(turns['vertices held'][-1])[1] }}.
# (Front, back and sides look into different directions, and a template
# that may not stretch has to move as a whole.) But twelve rounds have not got there. In each of them, the scans keep
# what the template says along the skin, and then the template keeps what the scans repeat.
#
# So a registration is no observation: the part of it that the scan did not see is an echo of the model. What a scan does
# say of a vertex is left when the vertex is eliminated. Let us do so along one direction. The scan alone would put the
# vertex at $t$ with the precision $L$ (which is zero along the skin, and everywhere if the vertex is hidden), and the
# coupling puts it at $T$ with the precision $\kappa = \sigma_C^{-2}$. Together they cost
# $L\,(V - t)^2 + \kappa\,(V - T)^2$. The derivative by $V$ is zero at the weighted mean
#
# $$ V = \frac{L t + \kappa T}{L + \kappa} , \qquad V - t = \frac{\kappa\,(T - t)}{L + \kappa} , \qquad
#    V - T = - \frac{L\,(T - t)}{L + \kappa} . $$
#
# Put into the cost, this leaves $L \kappa\,(\kappa + L)\,(T - t)^2 / (L + \kappa)^2$, or
#
# $$ \min_V \; L\,(V - t)^2 + \kappa\,(V - T)^2 = \kappa\, C\,(T - t)^2 , \qquad C = \frac{L}{L + \kappa} . $$
#
# This is a cost of the template alone, with the weight $C$ that was missing: nearly one where the scan knows the vertex
# well, and zero where it does not see it. `workbench coregister` gives such weights, a
# matrix for each vertex, to the training of the model (lecture 13), and holds templates by their edges.
#
# ## What to remember
#
# - Without labels, take the closest place on the surface. Alternating between contacts and the best
#   motion never raises the cost, but creeps: contacts keep points from sliding.
# - The derivative of a distance with the contact held is the derivative of the distance. Choosing contacts
#   anew at every linearization is Gauss-Newton on the true cost.
# - There are many basins. Begin more than once, and keep the lowest cost.
# - Clutter needs a loss that levels off. Keep its scale apart from sigma.
# - First fit the model; then free the vertices, coupled to it by edges.
# - Scans of the same people fill in what each of them hides, if the template is free too. A registration repeats
#   the model where nothing was seen: weigh it by what the scan says, and hold templates by their edges.
# - The distance from the scan is not the error. What was not seen rests on the prior: ask for its standard
#   deviation.

# %% slide [markdown]
# ## A registration is no observation
#
# $$ \min_V \; L\,(V - t)^2 + \kappa\,(V - T)^2 = \kappa\, C\,(T - t)^2, \qquad C = \frac{L}{L + \kappa} $$
#
# - Where nothing was seen it echoes the model: $C = 0$.
# - `workbench coregister` gives these weights to training.

# %% slide [markdown]
# ## What to remember
#
# - Closest places, distance in place of offset, more than one start, a loss that levels off
# - First the model; then free vertices, coupled by edges
# - The distance from the scan is not the error: ask for standard deviations.
