# %% [markdown]
# # Skinning and its failures
#
# **What does the skin do between two bones?**
#
# Lecture 3 ended with a matrix $G'_k$ for each bone, which takes a point from its place at rest to the
# place to which that bone carries it. A vertex in the middle of the forearm follows one bone, and that
# matrix is all it needs. A vertex at the elbow lies between two bones and has to follow both of them
# somehow. We first let every vertex follow a single bone and see the skin tear. Then we blend the bones,
# which mends the tear, and find out what blending costs. Most of this happens on a tube, because there
# we can work everything out by hand. Lengths are in metres.

# %%
from dataclasses import replace

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.bodies.forward.skinning import (
    blend_points,
    blended,
    dual_quaternion_blend,
    linear_blend,
)
from workbench.course import Picture, source
from workbench.geometry.solids import heat, volume
from workbench.lectures.material.by_angle import plot_by_angle
from workbench.lectures.material.limbs import Limb
from workbench.lectures.material.replays import recorded_side_by_side
from workbench.lectures.material.tubes import (
    linear_radius,
    tube,
    volume_lost_bent,
    volume_lost_twisted,
)
from workbench.plots import house_style, sheet
from workbench.plots.body import Figurine, front, line_up
from workbench.training.estimate import Sigmas
from workbench.training.first_guess import Start

# %% [markdown]
# ## One bone for each vertex
#
# A tube of 60 cm lies along $x$, with a bone in each half and a joint in the middle. The simplest rule is
# that each vertex follows the bone that is nearer to it. We bend it by 90 degrees.

# %%
pipe = tube()  # radius 5 cm; weights blend over a zone of 10 cm around the joint
rigid = without_blend_weights(pipe)  # here: one bone for each vertex
BEND, TWIST = [0, 0, 1], [1, 0, 0]  # axes
right_angle = np.radians([90])
longest = Limb(rigid, "joint").stretches(BEND, right_angle)[1][0]
print(f"the longest edge is {longest:.1f} times as long as at rest")


def profile(body, angle, axis=BEND):
    """Upper and lower line of the tube in its plane, (2, rings, 2) m; turned by `angle` rad."""
    (posed,) = Limb(body, "joint").posed(axis, [angle])
    rings = posed[:-2].reshape(-1, 32, 3)  # rings of 32 vertices; last, the centres of both ends
    return np.array([rings[:, 0, :2], rings[:, 16, :2]])


with house_style():
    figure, axes = sheet(9.5, 3.8, columns=2)
    for ax, (name, body) in zip(
        axes, {"one bone for each vertex": rigid, "blended": pipe}.items(), strict=True
    ):
        for line in profile(body, np.pi / 2):
            ax.plot(*(1e2 * line).T, ".-", color="C0", ms=4, lw=1)
        ax.set(title=name, xlabel="x (cm)", ylabel="y (cm)", aspect="equal")
Picture(
    figure,
    "The tube, bent by 90 degrees, cut along its middle; dots are vertices. Left: on the outside of the "
    "bend the skin is torn open (one edge spans the gap), and on the inside it runs into itself. Right: "
    "the same with blended weights.",
)

# %% slide [markdown]
# ## One bone for each vertex tears the skin
#
# - Bent by 90 degrees, the longest edge is {{ longest:.0f}} times as long.
# - All of the stretch happens in one row of edges; blending (right) shares it.

# %% [markdown]
# Each half keeps its form exactly, so all of the stretch has to happen in the one row of edges between the halves,
# which become {{ longest:.0f }} times as long{{ longest > 5 }}. A better rule lets the vertices near the joint share
# the stretch.
#
# ## Linear blend skinning
#
# The picture on the right was made with such a rule. Each vertex $i$ has **weights** $w_{ik}$, one for
# each bone. We ask where each bone would take the vertex, and put it at the weighted mean of these places:
#
# $$ t'_i = \sum_k w_{ik}\, G'_k\, t_i, \qquad w_{ik} \ge 0, \quad \sum_k w_{ik} = 1 . $$
#
# Here $t_i$ is the vertex at rest and $t'_i$ the same vertex in the pose. The rule is called **linear
# blend skinning**, and it is the one that SMPL uses, with at most four weights for each vertex that are
# not zero. Since $t_i$ is the same in all terms, it can be taken out of the sum: it makes no difference
# whether we blend the places or first blend the matrices and then move the vertex once. The library
# blends the matrices, in `blend_points`. The 1.0 is the fourth coordinate of each point, which the offset in the last
# column of a matrix is multiplied by:

# %% slide [markdown]
# ## Linear blend skinning
#
# $$ t'_i = \sum_k w_{ik}\, G'_k\, t_i, \qquad w_{ik} \ge 0, \quad \sum_k w_{ik} = 1 $$
#
# - Where would each bone take the vertex? Take the weighted mean of these places.
# - Blending places is blending matrices. SMPL: at most four weights for each vertex

# %%
source(linear_blend)

# %%
source(blend_points)

# %% slide [markdown]
# ## In code: blend matrices, then move once
#
# ```python
# stacked = cs.vertcat(*[cs.vec(G).T for G in motions])  # (K, 12)
# M = weights @ stacked  # (N, 12): a (3, 4) per vertex, column by column
# columns = cs.horzsplit(M, 3)  # what multiplies x, y, z and the mass, each (N, 3)
# x, y, z = (points[axis, :].T for axis in range(3))
# ```

# %% [markdown]
# Why must the weights sum to one? Suppose that all bones move by the same offset $d$ and do not turn.
# Each bone takes the vertex to $t_i + d$, so the blend takes it to $(t_i + d) \sum_k w_{ik}$. If the sum
# is one, that is $t_i + d$, as it should be. With a sum of 0.98 the vertex lags behind the body by 2 % of
# the way that the body has gone, and even at rest it is drawn towards the origin:

# %%
short = 0.98 * pipe.weights
lag = []  # m
for d in (0.0, 1.0, 10.0):
    expected = pipe.template + [d, 0, 0]
    M = np.einsum("nk,kij->nij", short, np.tile(np.column_stack([np.eye(3), [d, 0, 0]]), (2, 1, 1)))
    came = np.einsum("nij,nj->ni", M[:, :, :3], pipe.template) + M[:, :, 3]
    lag.append(np.linalg.norm(came - expected, axis=1).max())
    print(f"all bones moved by {d:4.0f} m: vertices off by up to {1e3 * lag[-1]:.0f} mm")
try:
    replace(pipe, weights=short)
except wb.WorkbenchError as error:
    print("the library:", error)

# %% slide [markdown]
# ## Weights have to sum to one
#
# - All bones moved by $d$: the vertex goes to $(t_i + d) \sum_k w_{ik}$.
# - With a sum of 0.98 it lags behind by {{ 100 * (lag[1] - lag[0]):.0f}} % of the way.

# %% [markdown]
# From one row to the next the vertices lag behind by {{ 100 * (lag[1] - lag[0]):.0f }} % of the way{{ lag[0] > 1e-3 }}.
#
# ## Twist it
#
# Now we turn the second bone about the tube's own axis by the angle $\alpha$, as a hand turns at the wrist.
# Take a ring of vertices whose weight for the second bone is $w$, so that its weight for the first one is
# $1 - w$. In the plane across the tube we write points as complex numbers $z$, because then a turn by
# $\alpha$ is a multiplication by $e^{i \alpha}$. The first bone leaves the point at $z$, and the second one
# takes it to $z e^{i \alpha}$. Linear blending takes it to the mean,
#
# $$ (1 - w)\, z + w\, z e^{i \alpha} = c\, z, \qquad c = 1 - w + w e^{i\alpha} . $$
#
# So the radius of the ring is multiplied by $|c|$. The real part of $c$ is $1 - w + w \cos \alpha$ and the
# imaginary part is $w \sin \alpha$. We add their squares and use $\cos^2 \alpha + \sin^2 \alpha = 1$:
#
# $$ |c|^2 = (1 - w)^2 + w^2 + 2 w (1 - w) \cos \alpha = 1 - 2 w (1 - w) (1 - \cos \alpha) . $$
#
# (In the last step, $(1 - w)^2 + w^2 = 1 - 2 w (1 - w)$.) Finally $1 - \cos \alpha = 2 \sin^2 \tfrac\alpha2$,
# so that
#
# $$ |c|^2 = 1 - 4 w (1 - w) \sin^2 \tfrac\alpha2 . $$
#
# This is never more than 1. One can see why without a formula: the mean of two points on a circle lies on
# the chord between them, which is *inside* the circle. In the middle of the zone, where $w = \tfrac12$, the
# share $|\cos \tfrac\alpha2|$ of the radius is left, and at half a turn nothing:

# %% slide [markdown]
# ## Twist it: a ring shrinks by $|c|$
#
# $$ c = 1 - w + w e^{i\alpha}, \qquad |c|^2 = 1 - 4 w (1 - w) \sin^2 \tfrac\alpha2 $$
#
# - The mean of two points on a circle lies on a chord, *inside* the circle.
# - In the middle, $w = \tfrac12$: the share $|\cos \tfrac\alpha2|$ is left, at half a turn nothing.

# %%
angles = np.radians(np.arange(0, 181, 10))
middle = pipe.weights[:, 1] == 0.5


def radius(body):
    """The radius of the middle ring by angle of the twist, a share."""
    posed = Limb(body, "joint").posed(TWIST, angles)
    return np.linalg.norm(posed[:, middle, 1:], axis=2).mean(axis=1) / 0.05


thin = radius(pipe)
print(f"off |cos(angle / 2)| by {np.abs(thin - np.abs(np.cos(angles / 2))).max():.0e}")
for degrees in (45, 90, 135, 180):
    print(
        f"twisted by {degrees:3} degrees: {linear_radius(0.5, np.radians(degrees)):.2f} of the radius"
    )

with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    for angle, dash in ((0, ":"), (90, "--"), (180, "-")):
        (posed,) = Limb(pipe, "joint").posed(TWIST, [np.radians(angle)])
        rings = posed[:-2].reshape(-1, 32, 3)
        reach = np.linalg.norm(rings[:, :, 1:], axis=2).mean(axis=1)
        for sign in (1, -1):
            left.plot(
                1e2 * rings[:, 0, 0],
                sign * 1e2 * reach,
                dash,
                color="C0",
                label=f"{angle}°" if sign > 0 else None,
            )
    left.set(xlabel="x (cm)", ylabel="outline (cm)", xlim=(-12, 12), ylim=(-6, 9))
    left.legend(loc="upper center", ncols=3, title="twisted by")
    for w in (0.1, 0.25, 0.5):
        right.plot(np.degrees(angles), linear_radius(w, angles), label=f"w = {w}")
    right.plot(np.degrees(angles), thin, "k.", label="the middle ring")
    right.set(xlabel="twist (degrees)", ylabel="radius (share)")
    right.legend()
Picture(
    figure,
    "The candy wrapper. Left: the tube's outline around the joint, twisted by 0, 90 and 180 degrees. "
    "Right: the radius that is left, by weight; dots are measured on the tube.",
)

# %% slide [markdown]
# ## The candy wrapper
#
# - Left by the middle ring: {{ linear_radius(0.5, np.radians(90)):.2f}} at 90 degrees,
#   {{ linear_radius(0.5, np.radians(135)):.2f}} at 135, {{ abs(linear_radius(0.5, np.pi)):.2f}} at 180
# - Dots, measured on the tube, lie on the law.{{ np.allclose(thin, np.abs(np.cos(angles / 2)), atol=1e-13) }}

# %% [markdown]
# ## Bend it
#
# Now we bend the tube, as an elbow bends{{ np.allclose(thin, np.abs(np.cos(angles / 2)), atol=1e-13) }}. In the plane
# of the bend we again write points as complex numbers,
# with the joint as the origin: a point at the distance $s$ along the tube and at the height $y$ above its axis
# is $s + i y$. The second bone turns it by $\alpha$ about the joint, so linear blending takes it to
# $c\,(s + i y)$, with the same $c$ as before. The skin near the joint is therefore pulled towards the joint.

# %%
two_bends = np.radians([90, 150])
lines = [profile(pipe, bend) for bend in two_bends]
ring = len(lines[0][0]) // 2  # the one at the joint
line_lengths = [np.linalg.norm(upper[ring] - lower[ring]) for upper, lower in lines]  # m
with house_style():
    figure, axes = sheet(9.5, 3.8, columns=2)
    for ax, bend, (upper, lower) in zip(axes, two_bends, lines, strict=True):
        for line in (upper, lower):
            ax.plot(*(1e2 * line).T, "-", color="C0", lw=1.5)
        ax.plot(*(1e2 * np.array([upper[ring], lower[ring]])).T, "o-", color="C1", ms=4)
        ax.set(title=f"bent by {np.degrees(bend):.0f} degrees", aspect="equal")
        ax.set(xlabel="x (cm)", ylabel="y (cm)", xlim=(-18, 16), ylim=(-8, 18))
Picture(
    figure,
    "The collapsing elbow: the tube bent by 90 and by 150 degrees with linear blending, cut along its "
    "middle. The orange line joins the upper and the lower vertex of the ring at the joint. At rest it is "
    "10 cm long; the further the tube is bent, the shorter the line is.",
)

# %% slide [markdown]
# ## Bend it: the elbow collapses
#
# - The same $c$ pulls the skin towards the joint.
# - The orange line, 10 cm at rest: {{ 100 * line_lengths[0]:.1f}} cm at 90 degrees,
#   {{ 100 * line_lengths[1]:.1f}} at 150

# %% [markdown]
# How much volume does the tube lose{{ line_lengths[0] > line_lengths[1] }}? Let the weight rise in a straight line
# from 0 to 1 over a zone of length $l$, from
# $s = -l/2$ to $s = l/2$, and let $A$ be the area of the tube's cross-section. To get the volume of the bent zone, sum
# up its volume at rest piece by piece, each small piece multiplied by the factor by which the map
# $s + i y \mapsto c\,(s + i y)$ enlarges its area $ds\, dy$ in the plane of the bend.

# %% slide [markdown]
# ## How much volume is lost?
#
# $$ \text{in a bend: } \tfrac13 A\, l \sin^2 \tfrac\alpha2 $$
#
# - $A$: the cross-section; $l$: the zone in which weights go from 0 to 1
# - Multiply each small piece by the factor by which the map enlarges its area, and integrate.

# %% [markdown]
# A small step along the tube is
# taken to the step times $u = c + \frac{dc}{ds} (s + i y)$, and one across it to the step times $v = i c$. The area
# between two complex numbers $u$ and $v$ is the imaginary part of $\bar u\, v$, where $\bar u$ is $u$ with the opposite
# sign of $i$. The imaginary part of $i$ times a number is its real part, so the area is
#
# $$ \operatorname{Im}(\bar u\, v) = \operatorname{Re}(\bar u\, c)
#    = |c|^2 + s \operatorname{Re}\left( \frac{d\bar c}{ds}\, c \right) + y\, (\dots)
#    = |c|^2 + \tfrac12 s\, \frac{d |c|^2}{ds} + y\, (\dots) , $$
#
# because the derivative of $|c|^2 = \bar c\, c$ is twice the real part of $\frac{d\bar c}{ds}\, c$. This area has a
# sign. On the inside of a sharp bend, where the skin is folded through itself, it is negative, and so it counts as
# negative volume, in our integral and in the volume that is measured on the mesh. The last term is in proportion to
# $y$, and cancels between the upper and the lower half of the tube. What is left depends on $s$ alone. We multiply it
# by $A$ and integrate it over the zone. The term with the derivative is integrated by parts, and at both ends of the
# zone $|c|^2 = 1$:
#
# $$
# \int \tfrac12 s\, \frac{d |c|^2}{ds}\, ds = \tfrac12 l - \tfrac12 \int |c|^2\, ds, \qquad
# \text{so the volume is } \tfrac12 A \left( l + \int |c|^2\, ds \right) .
# $$
#
# At rest it was $A\, l$. So $\tfrac12 A \int (1 - |c|^2)\, ds$ is lost, where
# $1 - |c|^2 = 4 w (1 - w) \sin^2 \tfrac\alpha2$, and $w (1 - w)$ integrates to $l/6$ over the zone. Together:
#
# $$ \text{lost in a bend: } \tfrac13 A\, l \sin^2 \tfrac\alpha2 . $$
#
# In a twist things are simpler. Every cross-section stays where it is and shrinks by the factor $|c|$ in both of
# its directions, so that the tube loses $\int A\, (1 - |c|^2)\, ds$. To work this out is an exercise. We compare
# both laws with volumes that are measured on a mesh with finer rings:

# %%
area = 16 * 0.05**2 * np.sin(2 * np.pi / 32)  # m^2, of the tube's 32-gon
full = volume(pipe.template, pipe.faces)
finer = tube(rings=121)
volumes = {}  # cm^3: measured, by the law
for name, axis, law in (("bent", BEND, volume_lost_bent), ("twisted", TWIST, volume_lost_twisted)):
    posed = Limb(finer, "joint").posed(axis, np.radians([90, 180]))
    lost = 1e6 * (
        volume(finer.template, finer.faces) - np.array([volume(v, finer.faces) for v in posed])
    )
    said = 1e6 * law(area, 0.1, np.radians([90, 180]))
    volumes[name] = lost, said
    print(
        f"{name:8} by 90 and 180 degrees: {lost[0]:.0f} and {lost[1]:.0f} cm^3 lost; "
        f"the laws say {said[0]:.0f} and {said[1]:.0f}"
    )
print(f"(the zone itself holds {1e6 * area * 0.1:.0f} cm^3)")

# %% [markdown]
# ## The idea: blend motions instead of points

# %% slide [markdown]
# ## The law, and the mesh
#
# | | lost at 90 degrees | the law | at 180 | the law |
# | --- | --- | --- | --- | --- |
# | bent | {{ volumes["bent"][0][0]:.0f}} cm³ | {{ volumes["bent"][1][0]:.0f}} | {{ volumes["bent"][0][1]:.0f}} cm³ | {{ volumes["bent"][1][1]:.0f}} |
# | twisted | {{ volumes["twisted"][0][0]:.0f}} cm³ | {{ volumes["twisted"][1][0]:.0f}} | {{ volumes["twisted"][0][1]:.0f}} cm³ | {{ volumes["twisted"][1][1]:.0f}} |
#
# - The zone itself holds {{ 1e6 * area * 0.1:.0f}} cm³.

# %% [markdown]
# Both failures have the same cause{{ all(abs(lost / said - 1).max() < 0.01 for lost, said in volumes.values()) }}:
# the mean of two rotation matrices is not a rotation, because it shrinks.
# We could replace it by the nearest rotation, as in lecture 2, but that needs a singular value decomposition
# for every vertex. There is a cheaper way. A rotation by $\alpha$ about the unit axis $n$ can also be written
# as four numbers, the **quaternion** $q = (\cos \tfrac\alpha2,\, n \sin \tfrac\alpha2)$, whose length is one.
# Every quaternion of length one is a rotation. So we average the quaternions of the bones and divide the mean
# by its length, and what we get is a rotation again:
#
# $$ q = \frac{\sum_k w_k\, s_k\, q_k}{\left\| \sum_k w_k\, s_k\, q_k \right\|} . $$
#
# The signs $s_k$ (which have nothing to do with the length $s$ along the tube) are needed because $q$ and $-q$ are the
# same rotation: their mean would be zero although nothing has turned. Before the quaternions are added, each one is
# therefore given the sign with which it is nearer to the one that has the largest weight.

# %% slide [markdown]
# ## The idea: blend motions instead of points
#
# $$ q = \frac{\sum_k w_k\, s_k\, q_k}{\left\| \sum_k w_k\, s_k\, q_k \right\|}, \qquad q_k = (\cos \tfrac\alpha2,\, n \sin \tfrac\alpha2) $$
#
# - The mean of rotation matrices shrinks; a mean of quaternions, brought to length one, is a rotation.
# - $q$ and $-q$ are the same rotation: the signs $s_k$ bring them to one side.

# %% [markdown]
# Bones also move from place to
# place, and four more numbers hold the offset $t$: they are $\tfrac12 t\, q$, half the product of the quaternion
# $(0, t)$ with $q$. The eight numbers together are a **dual quaternion**. Their average in the same way, with all eight
# divided by the length of the first four, gives a rigid motion for every vertex.
#
# Why does it keep joints in place?
# Quaternions are multiplied so that $R p = q\, p\, q^{-1}$ for a point $p$, which is written as the quaternion
# $(0, p)$. A motion that takes the joint $p$ to $p'$ has the offset $t = p' - R p$, so that its last four numbers are
# $\tfrac12 t\, q = \tfrac12 (p' q - q\, p)$. That is one linear function of $q$ for all motions that take $p$ to $p'$,
# and so their average takes it there too (Kavan, Collins, Žára and O'Sullivan, [*Geometric Skinning with Approximate
# Dual Quaternion Blending*](https://doi.org/10.1145/1409625.1409627), 2008).
#
# In the library two short functions say this. They call three others:
# `dual_quaternions` writes each motion as eight numbers, `heaviest` marks the largest weight of each vertex, and
# `moved` divides by that length and moves the vertices:

# %% slide [markdown]
# ## Dual quaternions: eight numbers for a rigid motion
#
# - The second four are $\tfrac12 t\, q$, with the offset $t$.
# - For all motions that take $p$ to $p'$: $\tfrac12 t\, q = \tfrac12 (p' q - q\, p)$, linear in $q$
# - So their average takes $p$ to $p'$ too: joints stay in place.

# %%
source(dual_quaternion_blend)

# %%
source(blended)

# %% slide [markdown]
# ## The signs, in the library
#
# ```python
# q = Q[:4, :]
# side = 1 - 2 * (q.T @ q < 0)  # (K, K)
# return ((weights * (heaviest(weights) @ side)) @ Q.T).T
# ```
#
# - `side`: which quaternions point away from each other; `heaviest`: the bone that decides

# %%
dual = replace(pipe, skinning=wb.dual_quaternion_blend)
print(f"twisted by 180 degrees, the middle ring keeps {radius(dual)[-1]:.6f} of its radius")
hard = replace(rigid, skinning=wb.dual_quaternion_blend)
gap = np.abs(
    Limb(hard, "joint").posed(BEND, angles[:-1]) - Limb(rigid, "joint").posed(BEND, angles[:-1])
)
print(f"with one bone for each vertex it is linear blending: off by {gap.max():.0e} m")

# %% slide [markdown]
# ## Every ring stays round
#
# - Twisted by 180 degrees, the middle ring keeps {{ radius(dual)[-1]:.0%}} of its radius.
# - With one bone for each vertex it is linear blending, to rounding.{{ gap.max() < 1e-13 }}

# %% [markdown]
# ## What it costs
#
# Dual quaternions keep every ring round{{ np.isclose(radius(dual)[-1], 1) and gap.max() < 1e-13 }}. They have four
# disadvantages.
#
# **The angle is not in proportion.** We would like a vertex with the weight $w$ to turn by $w \alpha$. Let
# one bone stay, with the quaternion $(1, 0)$, and let the other one turn by $\alpha$ about $n$. The mean is
# $(1 - w + w \cos \tfrac\alpha2,\; w\, n \sin \tfrac\alpha2)$. A quaternion holds the cosine and the sine of
# *half* of its angle, so the tangent of half of the angle is the second part over the first, and the vertex
# turns by
#
# $$ 2 \arctan \frac{w \sin (\alpha/2)}{1 - w + w \cos (\alpha/2)} . $$
#
# This is equal to $w \alpha$ at $w = 0, \tfrac12, 1$, and close to it elsewhere:

# %%
w = np.linspace(0, 1, 100001)
turn = 2 * np.arctan2(w, 1 - w)  # for half a turn
off = np.degrees(np.abs(turn - np.pi * w))
print(
    f"at half a turn it is off by at most {off.max():.3f} degrees, at w = {w[np.argmax(off)]:.3f}"
)

# %% [markdown]
# (Kavan and others, who proposed the method, give 8.15
# degrees{{ round(off.max(), 2) == 8.15 and off[[0, 50_000, -1]].max() < 1e-9 }}.)

# %% slide [markdown]
# ## Cost 1: the angle is not in proportion
#
# $$ 2 \arctan \frac{w \sin (\alpha/2)}{1 - w + w \cos (\alpha/2)} $$
#
# - We would like $w \alpha$. It is equal at $w = 0, \tfrac12, 1$.
# - At half a turn it is off by at most {{ off.max():.2f}} degrees.

# %% [markdown]
# **The outside bulges.** A ring near the joint is turned rigidly about the joint. On the outside of a bend it
# therefore stays at its full distance from the joint, and the skin there has to become longer.
#
# **At half a turn it jumps.** There the two ways round are equally long, and the sign $s_k$ decides between
# them. Just before and just after half a turn, the vertex is on opposite sides:

# %%
pose = np.zeros((2, 2, 3))
pose[:, 1, 0] = np.radians([179.9, 180.1])
before, after = dual.vertices(pose)
jump = np.linalg.norm(after - before, axis=1)
print(
    f"from 179.9 to 180.1 degrees a vertex moves by up to {1e2 * jump.max():.1f} cm (the tube is 10 cm thick)"
)
before, after = pipe.vertices(pose)
print(f"with linear blending by {1e2 * np.linalg.norm(after - before, axis=1).max():.3f} cm")

ways = {"linear blending": pipe, "dual quaternions": dual}
thirds = np.flatnonzero(np.abs(pipe.weights[:, 1] - 0.3) < 0.01)  # a ring with the weight 0.3
round_it = np.radians(np.arange(0, 360, 5))


def ring_turned(body):
    """By how much that ring is turned, by angle of the twist, degrees from -180 to 180."""
    posed = Limb(body, "joint").posed(TWIST, round_it)[:, thirds[0], 1:] @ [1, 1j]
    return np.degrees(np.angle(posed / (pipe.template[thirds[0], 1:] @ [1, 1j])))


turned_by = {name: ring_turned(body) for name, body in ways.items()}
largest_step = {n: np.abs((np.diff(t) + 180) % 360 - 180).max() for n, t in turned_by.items()}
motions = (("twist", TWIST), ("bend", BEND))
skinnings = (("one bone each", rigid), *ways.items())


def turned(body, axis):
    """The tube with its joint turned about an axis by an angle."""
    return lambda angle: Limb(body, "joint").posed(axis, [angle])[0]


with house_style():
    figure, (left, right) = sheet(10, 4.0, columns=2)
    for (name, body), dash in zip(ways.items(), ("-", "--"), strict=True):
        for k, line in enumerate(profile(body, np.radians(120))):
            label = name if k == 0 else None
            left.plot(*(1e2 * line).T, dash, label=label, color=f"C{list(ways).index(name)}")
        right.plot(np.degrees(round_it), turned_by[name], ".", ms=4, label=name)
    left.set(xlabel="x (cm)", ylabel="y (cm)", aspect="equal", xlim=(-18, 12), ylim=(-12, 14))
    left.legend(loc="lower left", fontsize=8)
    right.set(xlabel="twist of the second bone (degrees)", ylabel="turn of the ring (degrees)")
    right.legend(fontsize=8)
Picture(
    figure,
    "Left: the tube bent by 120 degrees, cut along its middle. With linear blending the elbow collapses, "
    "and with dual quaternions its outside bulges. Right: how far a ring with the weight 0.3 is turned "
    "when the second bone is twisted. At half a turn dual quaternions jump from one side to the other.",
    lambda: recorded_side_by_side(
        pipe.faces,
        np.radians(np.arange(0, 241, 10)),
        {name: {way: turned(body, axis) for way, body in skinnings} for name, axis in motions},
        "The tube by three skinnings. Twist it: linear blending makes a candy wrapper of it, and dual "
        "quaternions jump at half a turn. Bend it: it tears, collapses or bulges.",
        opens=0.75,
    ),
)

# %% slide still [markdown]
# ## Costs 2 and 3: it bulges, and it jumps
#
# - A rigid ring keeps its distance from the joint: the outside of a bend bulges.
# - At half a turn a ring of weight 0.3 jumps by {{ largest_step['dual quaternions']:.0f}} degrees.

# %% slide [markdown]
# ## Twist it, bend it
#
# - Twist: a candy wrapper (linear), a jump at half a turn (dual quaternions)
# - Bend: torn, collapsed, or bulging

# %% [markdown]
# A ring with the weight 0.3 jumps by {{ largest_step['dual quaternions']:.0f }} degrees with dual
# quaternions{{ largest_step['linear blending'] < 90 and jump.max() > 0.099 }}. The next figure measures both methods
# at all angles.

# %%
lost = {
    name: 1e6
    * np.array([volume(v, body.faces) - full for v in Limb(body, "joint").posed(BEND, angles)])
    for name, body in ways.items()
}
stretch = {name: Limb(body, "joint").stretches(BEND, angles)[1] for name, body in ways.items()}
more = stretch["dual quaternions"] > stretch["linear blending"] * (1 + 1e-9)
crossing = np.flatnonzero(~more)[-1] + 1
finest = replace(finer, skinning=wb.dual_quaternion_blend)
(half_turn,) = Limb(finest, "joint").posed(BEND, [np.pi])
finer_lost = 1e6 * (volume(finest.template, finest.faces) - volume(half_turn, finest.faces))
with house_style():
    figure, axes = sheet(13, 3.8, columns=3)
    plot_by_angle(
        angles, {n: radius(b) for n, b in ways.items()}, "radius, twisted (share)", ax=axes[0]
    )
    plot_by_angle(angles, lost, "volume gained, bent (cm³)", ax=axes[1], at_rest=0)
    plot_by_angle(angles, stretch, "longest edge, bent (share)", ax=axes[2])
Picture(
    figure,
    "The tube, by angle. Left: the twisted middle ring. Centre: the bent tube's volume. Right: "
    "the longest edge of the bent tube over its length at rest; beyond "
    f"{np.degrees(angles[crossing]):.0f} degrees dual quaternions stretch the outside more.",
)

# %% slide [markdown]
# ## All angles
#
# - Linear: thin and light. Dual quaternions: round, and beyond {{ np.degrees(angles[crossing]):.0f}} degrees
#   more stretched

# %% [markdown]
# **It is not linear in the weights.** With linear blending, the posed vertices are linear in the weights, so
# that weights can be learned by linear least squares (lecture 13). With dual quaternions they are not, because of the
# division by the length, and from {{ np.degrees(angles[crossing]):.0f }} degrees on they stretch the outside more
# than linear blending does. CasADi keeps the expression of the posed vertices and can prove both:

# %%
linear_in_weights = {}
for name, body in ways.items():
    free = body.freed("weights")
    p, betas, trans = (block.symbol for block in free.blocks())
    posed = free.points(p, betas, trans).source.expression
    linear_in_weights[name] = cs.is_linear(posed, free.free["weights"].symbol)
    print(f"{name:17} linear in the weights: {linear_in_weights[name]}")

# %% slide [markdown]
# ## Cost 4: no longer linear in the weights
#
# - Linear blending: posed vertices are linear in the weights, so weights are learned by linear least squares
#   (lecture 13).
# - Dual quaternions divide by a length, and are
#   not.{{ linear_in_weights == {'linear blending': True, 'dual quaternions': False} }}
# - CasADi keeps the expression and proves both.

# %% [markdown]
# ## On the body
#
# The wrist and the elbow of a real template are no tubes, but they behave in the same way. SMPL keeps linear
# blending in spite of what it loses, and repairs the loss in another way, with the *pose blend shapes* of the
# next lecture: they add to the surface at rest what blending is going to take
# away{{ linear_in_weights == {'linear blending': True, 'dual quaternions': False} }}. First we look at the
# weights of such a template.

# %%
whole = wb.load_body("default")
shown = {
    name: whole.weights[:, whole.joint_names.index(name)][whole.faces].mean(axis=1)  # (F,)
    for name in ("left_shoulder", "left_elbow", "spine1", "left_knee")
}
pale, red = np.array([0.87, 0.87, 0.87]), np.array([0.75, 0.1, 0.1])
with house_style():
    figure, (ax,) = sheet(11, 4.2)
    line_up(
        [
            Figurine(name, whole.template, front, pale + share[:, None] * (red - pale))
            for name, share in shown.items()
        ],
        whole.faces,
        ax=ax,
    )
Picture(
    figure,
    "Blend weights of four joints on the surface: grey is 0, full red is 1. Each joint moves the part "
    "up to the next joint, and shares a zone with its neighbours. The joints of the back are close to "
    "each other: no face follows spine1 alone.",
)

# %% slide [markdown]
# ## The weights of a body
#
# - Each joint moves the part up to the next one, and shares a zone with its neighbours.
# - No face follows spine1 alone.

# %%
linear = without_pose_blend_shapes(whole)
on_body = {
    "linear blending": linear,
    "dual quaternions": replace(linear, skinning=wb.dual_quaternion_blend),
    "SMPL (linear, and blend shapes)": whole,
}
some = angles[::3]
wrist = {name: Limb(body, "left_wrist").radii(some) for name, body in on_body.items()}
bends = np.radians(np.arange(0, 151, 30))
elbow = {
    name: Limb(body, "left_elbow").volumes([0, -1, 0], bends) for name, body in on_body.items()
}
elbow = {name: 1e6 * (v - v[0]) for name, v in elbow.items()}  # cm^3
for name in on_body:
    print(
        f"{name:32} wrist at 90 degrees {wrist[name][3]:.2f} of its radius; "
        f"arm bent by 90 degrees {elbow[name][3]:+.0f} cm^3"
    )
finer_dual = replace(
    without_pose_blend_shapes(wb.load_body("full")), skinning=wb.dual_quaternion_blend
)
for name, body in (("default", on_body["dual quaternions"]), ("full", finer_dual)):
    there, back = (
        1e6 * np.diff(Limb(body, "left_elbow").volumes([0, sign, 0], [0, np.pi / 2]))[0]
        for sign in (-1, 1)
    )
    print(
        f"dual quaternions, body {name!r}: arm bent by 90 degrees {there:+.0f} cm^3, "
        f"to the other side {back:+.0f} cm^3"
    )
with house_style():
    figure, axes = sheet(10, 3.8, columns=2)
    plot_by_angle(some, wrist, "radius of the twisted wrist (share)", ax=axes[0])
    plot_by_angle(bends, elbow, "volume of the bent arm (cm³ gained)", ax=axes[1], at_rest=0)
Picture(
    figure,
    "The same on a body. Left: the wrist. Right: the skin of upper arm and forearm. Blend shapes "
    "give back a part of what is lost, but where the arm is bent a little, it has even less volume"
    " with them. They were learned from poses that people take, and nobody's wrist turns by 180 "
    "degrees.",
)

# %% slide [markdown]
# ## The same on a body
#
# - Wrist at 90 degrees: {{ wrist['linear blending'][3]:.2f}} of its radius (linear),
#   {{ wrist['dual quaternions'][3]:.2f}} (dual quaternions)
# - The arm bent by 90 degrees loses {{ -elbow['linear blending'][3]:.0f}} cm³, and
#   {{ -elbow['dual quaternions'][3]:.0f}} with dual quaternions too.

# %% [markdown]
# At 90 degrees the arm loses {{ -elbow['linear blending'][3]:.0f }} cm³ with linear blending and
# {{ -elbow['SMPL (linear, and blend shapes)'][3]:.0f }} with blend
# shapes{{ elbow['SMPL (linear, and blend shapes)'][1] < elbow['linear blending'][1] }}, but
# {{ -elbow['dual quaternions'][3]:.0f }} with dual quaternions too. They keep rings rigid, so why does the arm lose
# volume with them? There are two reasons. The first is the place of the joint. Rings are turned
# about it. On the tube it lies in the middle of the rings, and what the bend gains on the outside it loses on the
# inside. In the arm the joint of the elbow lies 1 cm behind the middle, so that a bend to the front has more of the
# arm on its inside. Bent to the other side, the arm should gain about as much as it has lost, and on the finer body
# it does{{ abs(there + back) < 20 < 100 < back }}.
#
# The second reason is the mesh, whose straight edges cut the
# corner. This is why the coarse body loses volume
# both ways: only a few long edges lead around its elbow. And it is why, in the figure of volumes, the tube that is
# bent by half a turn loses {{ -lost['dual quaternions'][-1]:.0f }} cm³ with dual quaternions; with twice as many
# rings it loses {{ finer_lost:.0f }}.

# %% slide [markdown]
# ## Why does the arm lose volume with rigid rings?
#
# - The joint lies 1 cm behind the middle of the arm: bent to the front, more of it is inside.
# - Bent to the other side on a finer body, it gains {{ back:.0f}} cm³.{{ abs(there + back) < 20 < 100 < back }}
# - A coarse mesh cuts the corner: its straight edges lose volume both ways.

# %% [markdown]
# ## Without blend weights
#
# What would SMPL look like without its blend weights? The lecture *Body Models II* by Pons-Moll and Swoboda
# (2018) shows a body with "no blend weights". Something has to stand for $w_{ik}$ in
# $\sum_k w_{ik} G'_k t_i$, so we try four ways to read this, at rest and in a pose, and compare them with the
# weights as they are:

# %%
dance = np.zeros((24, 3))
for joint, degrees in {
    "left_shoulder": (0, 0, -40),
    "left_elbow": (0, -100, 0),
    "right_shoulder": (0, 0, 65),
    "right_elbow": (0, 70, 0),
    "left_hip": (-75, 0, 0),
    "left_knee": (100, 0, 0),
}.items():
    dance[whole.joint_names.index(joint)] = np.radians(degrees)


def skinned(weights, pose):
    """The template in a pose, blended with any weights (N, 24), whatever they sum to."""
    G = whole.kinematics.motion(pose, np.zeros(whole.n_betas)).G  # (24, 3, 4)
    M = np.einsum("nk,kij->nij", weights, G)
    return np.einsum("nij,nj->ni", M[:, :, :3], whole.template) + M[:, :, 3]


ones = np.ones_like(whole.weights)
readings = {
    "as they are": whole.weights,
    "all weights 0": 0 * ones,
    "all weights 1": ones,
    "all weights 1/24": ones / 24,
    "one bone for each": without_blend_weights(whole).weights,
}
meant = skinned(whole.weights, dance)
for name, weights in readings.items():
    at_rest = np.linalg.norm(skinned(weights, 0 * dance) - whole.template, axis=1)
    in_pose = np.linalg.norm(skinned(weights, dance) - meant, axis=1)
    print(
        f"{name:17} {np.ptp(skinned(weights, 0 * dance)[:, 1]):5.2f} m tall at rest; off by "
        f"{1e3 * at_rest.mean():5.0f} mm at rest, by {1e3 * in_pose.mean():5.1f} mm in the pose"
    )
with house_style():
    figure, (ax,) = sheet(11, 4.0)
    drawn = ("as they are", "all weights 1/24", "one bone for each")
    line_up([Figurine(name, skinned(readings[name], dance)) for name in drawn], whole.faces, ax=ax)
Picture(
    figure,
    "One pose with the weights as they are, with equal weights, and with one bone for each vertex. "
    "Equal weights keep the body together, but no limb follows its bone: every vertex takes the mean "
    "of all motions. With one bone for each vertex limbs follow, and the skin is torn where they bend, "
    "most visibly at the left shoulder and the left hip.",
)

# %% slide [markdown]
# ## "No blend weights": four readings, one body
#
# - All 0: a point. All 1: {{ np.ptp(skinned(ones, 0 * dance)[:, 1]) / np.ptp(whole.template[:, 1]):.0f}}
#   times as tall. All 1/24: no limb follows its bone.
# - One bone for each vertex is what is meant; the skin is torn.

# %% [markdown]
# With weights of 0 the body is a point, and with 1 it is
# {{ np.ptp(skinned(ones, 0 * dance)[:, 1]) / np.ptp(whole.template[:, 1]):.0f }} times as tall. Neither is a body.
# With equal weights the
# whole body follows the mean of all motions. A mean of rotations shrinks, as in the twist: the body is
# {{ np.ptp(skinned(ones / 24, dance)[:, 1]):.2f }} m tall in the pose, all of it is tilted a little, and neither the
# knee nor the elbow is bent. So the last of the four is what is
# meant{{ printed('one bone for each')[-1] < 5 and printed('all weights 1/24')[-1] > 100 }}: the largest weight of
# each vertex becomes one, and its other weights become zero. The library's function does
# this:

# %%
source(without_blend_weights)

# %% [markdown]
# ## Where the first weights come from
#
# Weights are learned from scans (lecture 13), but learning has to begin somewhere. It begins with a
# **segmentation**: for each vertex, somebody says to which part of the body it belongs. That is again one
# bone for each vertex, which tears the skin. Two things are made of it.
#
# - **Rings.** Take the edges that lead from the segment of joint $k$ to the segment of its parent. The
#   vertices at their ends lie in a ring around the limb, and their mean is the first guess of joint $k$.
# - **Diffused weights.** Treat the segmentation as heat: each vertex has one unit of the heat of its own
#   segment. Let it flow along the edges of the mesh, and read what has arrived as weights.

# %% slide [markdown]
# ## Where do first weights come from?
#
# - **Segmentation**: somebody says to which part each vertex belongs.
# - **Rings**: edges between a segment and its parent's surround the limb; their mean is a first joint.
# - **Heat**: each vertex has one unit of its segment's heat; let it flow along the edges.

# %% [markdown]
# Let $W_0$ be the segmentation as an $N \times K$ matrix of zeros and ones, and $W_I$ the first weights. Heat flows by
# the equation $\frac{dW}{dt} = -L\, W$, where the matrix $L$ (the *Laplacian* of the mesh) takes the difference of each
# vertex from its neighbours. The library makes a single implicit step, of the duration $\tfrac12 b^2$: the change
# $W_I - W_0$ is the duration times $-L\, W_I$, with the weights at the *end* of the step. So
#
# $$
# \left( I + \tfrac12 b^2 L \right) W_I = W_0, \qquad
# L_{ij} = - \frac{1}{\|e_{ij}\|^2} \text{ for an edge } e_{ij}, \qquad
# L_{ii} = \sum_{j \ne i} \frac{1}{\|e_{ij}\|^2} .
# $$
#
# Here $e_{ij}$ is the edge from vertex $i$ to vertex $j$. One number says how far heat flows: the **border** $b$, a
# length. After the time $t$ the heat of one point has spread over a line with the standard deviation $\sqrt{2 t}$, and
# this is $b$ for the duration $\tfrac12 b^2$. (With many explicit steps one would have to choose their number too.)
#
# What does such a step make of a sharp seam? On a line of vertices that are close together, $L$ is the second
# derivative with the opposite sign. The weight of one bone becomes a function $w(x)$ of the place on the line, with
# $w - \tfrac12 b^2 \frac{d^2 w}{dx^2} = w_0$, where $w_0$ is 1 on one side of the seam and 0 on the other. Beyond the
# seam it says $\frac{d^2 w}{dx^2} = 2 w / b^2$. The solution that fades
# is in proportion to $e^{-\sqrt 2\, d / b}$, with $d$ the distance from the seam. At the seam both sides are
# alike, so the weight is $\tfrac12$ there, and $\tfrac12 e^{-\sqrt 2\, d / b}$ beyond it.
#
# Three properties hold for every $b$. The rows of $L$ sum to zero, so the weights of a vertex still sum to one. $L$ is
# symmetric, so no heat is lost. And no weight becomes negative: at the vertex where a bone's weight is least, all
# neighbours have as much of it or more, so that its row of $L\, W_I$ is not positive, and by the equation the weight is
# at least what it was in $W_0$. In the end each vertex keeps its four largest weights, divided by their sum, so that
# they sum to one again. (No heat is lost is then true only nearly.)

# %% slide [markdown]
# ## One implicit step of heat
#
# $$ \left( I + \tfrac12 b^2 L \right) W_I = W_0 $$
#
# - $b$, the **border**: how far heat flows, a length. On a line the weight falls as
#   $\tfrac12 e^{-\sqrt 2\, d / b}$.
# - Rows still sum to one, and no weight becomes negative.

# %%
source(heat)

# %%
source(Start.rings)

# %% [markdown]
# We need a mesh whose triangles are smaller than the border, so we take the finest of the embedded bodies.
# Nobody has drawn a segmentation on it, so we read one off its own trained weights: the segment of a vertex
# is the bone of its largest weight. This shows how the two steps work. It does not show that they would find
# weights that are unknown.

# %%
fine = wb.load_body("full")
begun = Start.of(fine)
rings, first_weights = begun.rings(), begun.weights()
middles = rings @ fine.template
misplaced = 1e3 * np.linalg.norm(middles - fine.joints(), axis=1)[1:]  # mm; the root has no ring
print(
    f"means of rings are {misplaced.mean():.0f} mm from the trained joints on average, "
    f"{misplaced.max():.0f} mm at the {fine.joint_names[1 + misplaced.argmax()]}"
)
depth = np.zeros(24, dtype=int)
for k, parent in enumerate(fine.parents[1:], start=1):
    depth[k] = depth[parent] + 1
hue = 2 * np.pi * (0.43 * np.arange(24)[:, None] - np.arange(3) / 3)
base = np.where(depth % 2, 0.5, 0.7)[:, None]
paint = base + 0.25 * np.cos(hue)  # (24, 3): a colour for each joint
in_ring = (rings.toarray()[1:] > 0).any(axis=0)[fine.faces].all(axis=1)
panels = [
    Figurine("segments", fine.template, front, paint[begun.segmentation[fine.faces[:, 0]]]),
    Figurine("rings", fine.template, front, pale + in_ring[:, None] * (red - pale)),
    Figurine(
        "diffused weights", fine.template, front, (first_weights @ paint)[fine.faces].mean(axis=1)
    ),
]
with house_style():
    figure, (ax,) = sheet(11, 4.0)
    line_up(panels, fine.faces, ax=ax)
Picture(
    figure,
    "From a segmentation to first weights. Left: each vertex belongs to one part. Centre: the rings, "
    "where a segment meets that of its parent. The front of the waist has none, because there the "
    "segments of pelvis and spine2 meet, and neither is the other's parent. Right: the weights after "
    "diffusion, drawn as mixtures of the parts' colours; borders have become zones.",
)

# %% slide [markdown]
# ## From a segmentation to weights
#
# - Means of rings are {{ misplaced.mean():.0f}} mm from the trained joints on average.
# - Borders become zones.

# %% [markdown]
# How wide should the border be? On the tube we can check the law for a line. The tube's mesh has diagonals
# as well, along which heat flows too, so the weight falls more slowly than on a line, the more so with the border of
# 10 cm, which also feels that the tube ends. On the body we
# try a row of borders, and measure how far the first weights are from the trained ones.

# %%
apart = rigid.weights.argmax(axis=1)
painted_tube = Start(pipe.template, pipe.faces, pipe.parents, pipe.joint_names, apart)
along_x = pipe.template[:-2].reshape(-1, 32, 3)[:, 0, 0]  # m, of the rings of vertices
borders = (0.01, 0.03, 0.1)  # m
spreads = {b: painted_tube.weights(b)[:-2, 1].reshape(-1, 32).mean(axis=1) for b in borders}
further = {}  # than on a line, times
for border, spread in spreads.items():
    tail = (along_x < -0.02) & (spread > 1e-3)
    slope = np.polyfit(along_x[tail], np.log(spread[tail]), 1)[0]
    further[border] = np.sqrt(2) / slope / border
    print(
        f"border {1e2 * border:3.0f} cm: on the tube a weight falls to 1/e in "
        f"{1e2 / slope:4.1f} cm; on a line the law says {1e2 * border / np.sqrt(2):4.1f} cm"
    )


def elsewhere(weights):
    """Which share of its weight a vertex has at other joints than after training: a mean, %."""
    return 50 * np.abs(weights - fine.weights).sum(axis=1).mean()


widths = np.geomspace(0.005, 0.2, 9)  # m
away = [elsewhere(begun.weights(border)) for border in widths]
nearest = widths[np.argmin(away)]
print(
    f"weight at other joints than after training: {elsewhere(np.eye(24)[begun.segmentation]):.1f} % "
    f"before diffusion, {min(away):.1f} % with a border of {1e2 * nearest:.1f} cm"
)
print(f"lambda_W = {Sigmas().lambdas['weights']:.1e} m^2: (2 mm / 0.3)^2")
with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    for border, spread in spreads.items():
        left.plot(1e2 * along_x, spread, label=f"b = {1e2 * border:.0f} cm")
    left.plot(1e2 * along_x, np.clip(0.5 + along_x / 0.1, 0, 1), "k:", label="of this lecture")
    left.set(xlabel="x (cm)", ylabel="weight of the second bone", xlim=(-25, 25))
    left.legend()
    right.semilogx(1e2 * widths, away, "o-")
    right.axvline(3, color="0.6", ls=":")
    right.set_xticks([0.5, 1, 2, 5, 10, 20], ["0.5", "1", "2", "5", "10", "20"])
    right.minorticks_off()
    right.set(xlabel="border b (cm)", ylabel="weight at other joints (%)", ylim=(0, None))
Picture(
    figure,
    "Left: weights along the tube for three borders, and the straight ramp that this lecture uses. "
    "Right: on the body, the share of a vertex's weight that is at other joints than after training. It is "
    "least near 3 cm (dotted), the library's border.",
)

# %% slide [markdown]
# ## How wide should the border be?
#
# - Least weight at the wrong joints near {{ 100 * nearest:.0f}} cm: {{ min(away):.1f}} % in place of
#   {{ elsewhere(np.eye(24)[begun.segmentation]):.1f}}
# - It proves little: training *began* with such weights, and was held near them.

# %% [markdown]
# On the tube a weight reaches {{ further[0.01]:.2f }}, {{ further[0.03]:.2f }} and {{ further[0.1]:.2f }} times as
# far as the law for a line says. On the body {{ min(away):.1f }} % of the weight are elsewhere with the best
# border{{ 0.02 < nearest < 0.05 and min(away) < elsewhere(np.eye(24)[begun.segmentation]) }}.
#
# This agreement proves less than it seems to, because training began with such weights and was held near them. What
# training minimises has a term $\lambda_W \| \mathcal W - W_I \|^2$, which pulls the weights $\mathcal W$ back to the
# diffused ones. Its factor $\lambda_W$ is the square of a ratio of two standard deviations: a registration (the body's
# mesh, laid onto a scan) may be off by 2 mm, and a weight by 0.3. With a large $\lambda_W$ training would end where it
# began.

# %% [markdown]
# ## What to remember
#
# - One bone for each vertex tears the skin; blend weights keep it together. They have to sum to one, or the
#   body lags behind.
# - Linear blending shrinks a ring by the factor $|c|$, with $|c|^2 = 1 - 4 w (1 - w) \sin^2 \tfrac\alpha2$. A
#   twisted limb becomes a candy wrapper, and a bent elbow collapses.
# - Blended quaternions that are brought to length one keep every ring rigid, provided that their signs agree.
#   They bulge, jump at half a turn, and are not linear in the weights.
# - SMPL blends linearly and repairs the surface at rest.
# - First weights are made from a segmentation that is diffused, and first joints from rings of vertices.

# %% slide [markdown]
# ## What to remember
#
# - One bone for each vertex tears; blend weights, which sum to one, keep the skin together.
# - Linear blending: $|c|^2 = 1 - 4 w (1 - w) \sin^2 \tfrac\alpha2$, candy wrappers and collapsed elbows
# - Dual quaternions: rigid rings that bulge, jump, and are not linear in the weights. SMPL blends linearly
#   and repairs the surface at rest.
