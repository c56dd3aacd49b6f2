# %% [markdown]
# # Skinning and its failures
#
# **What does the skin do between two bones?**
#
# Lecture 3 ends with a matrix $G'_k$ for each bone, which takes points from where they are at rest to
# where that bone carries them. Between two bones a vertex has to follow both. We begin with one bone
# for each vertex, see the skin torn, blend, and find out what blending costs. Most of this happens on a
# tube, where everything can be computed by hand. Lengths are in metres.

# %%
from dataclasses import replace

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.bodies.forward.skinning import blended, dual_quaternion_blend, linear_blend
from workbench.course import Picture, source
from workbench.geometry.mesh_graph import heat
from workbench.geometry.solids import volume
from workbench.lectures.material.by_angle import plot_by_angle
from workbench.lectures.material.limbs import Limb
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
# A tube of 60 cm lies along $x$, with a bone in each half and a joint in the middle. Each vertex
# follows the bone that is nearer. We bend it by 90 degrees.

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
    rings = posed[:-2].reshape(-1, 32, 3)
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

# %% [markdown]
# Every part keeps its form, and all of the stretch is in the one edge between them.
#
# ## Linear blend skinning
#
# The picture on the right is made in this way: each vertex $i$ has **weights** $w_{ik}$, one for each
# bone, and goes to the weighted mean of where the bones would take it:
#
# $$ t'_i = \sum_k w_{ik}\, G'_k\, t_i, \qquad w_{ik} \ge 0, \quad \sum_k w_{ik} = 1 . $$
#
# This is **linear blend skinning**; SMPL does it, with at most four weights for each vertex. Since
# $t_i$ is the same in all terms, one may also blend the matrices first, as the library does:

# %%
source(linear_blend)

# %% [markdown]
# Why must weights sum to one? If all bones move by the same offset $d$, the vertex moves by
# $d \sum_k w_{ik}$. With a sum of 0.98 it lags behind, and is drawn to the origin even at rest:

# %%
short = 0.98 * pipe.weights
for d in (0.0, 1.0, 10.0):
    expected = pipe.template + [d, 0, 0]
    M = np.einsum("nk,kij->nij", short, np.tile(np.column_stack([np.eye(3), [d, 0, 0]]), (2, 1, 1)))
    came = np.einsum("nij,nj->ni", M[:, :, :3], pipe.template) + M[:, :, 3]
    print(
        f"all bones moved by {d:4.0f} m: vertices off by up to "
        f"{1e3 * np.linalg.norm(came - expected, axis=1).max():.0f} mm"
    )
try:
    replace(pipe, weights=short)
except wb.WorkbenchError as error:
    print("the library:", error)

# %% [markdown]
# ## Twist it
#
# Now turn the second bone about the tube, as a hand turns at the wrist. Take a ring of vertices whose
# weight for the second bone is $w$, and write its points as complex numbers $z$ in the plane across the
# tube. The first bone leaves a point at $z$, the second one takes it to $z e^{i \alpha}$, and linear
# blending to
#
# $$ c\, z, \qquad c = 1 - w + w e^{i\alpha}, \qquad |c|^2 = 1 - 4 w (1 - w) \sin^2 \tfrac\alpha2 . $$
#
# The mean of two points of a circle lies *inside* the circle. In the middle, where $w = \tfrac12$, the share
# $|\cos \tfrac\alpha2|$ of the radius is left, and at half a turn nothing:

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

# %% [markdown]
# ## Bend it
#
# In a bend the same $c$ multiplies points of the plane of the bend, written as complex numbers whose origin is
# the joint. It pulls the middle of the elbow towards the inside. Over a zone of length $l$ in which the weight
# goes from 0 to 1, a tube of cross-section $A$ loses the volume
#
# $$
# \text{bent: } \tfrac13 A\, l \sin^2 \tfrac\alpha2, \qquad
# \text{twisted: } \int_0^l A\, (1 - |c|^2)\, ds .
# $$
#
# Here $s$ runs along the zone, over which $w (1 - w)$ integrates to $l/6$. (To work out the second integral is
# an exercise.)

# %%
area = 16 * 0.05**2 * np.sin(2 * np.pi / 32)  # m^2, of the tube's 32-gon
full = volume(pipe.template, pipe.faces)
finer = tube(rings=121)
for name, axis, law in (("bent", BEND, volume_lost_bent), ("twisted", TWIST, volume_lost_twisted)):
    posed = Limb(finer, "joint").posed(axis, np.radians([90, 180]))
    lost = 1e6 * (
        volume(finer.template, finer.faces) - np.array([volume(v, finer.faces) for v in posed])
    )
    said = 1e6 * law(area, 0.1, np.radians([90, 180]))
    print(
        f"{name:8} by 90 and 180 degrees: {lost[0]:.0f} and {lost[1]:.0f} cm^3 lost; "
        f"the laws say {said[0]:.0f} and {said[1]:.0f}"
    )
print(f"(the zone itself holds {1e6 * area * 0.1:.0f} cm^3)")

# %% [markdown]
# ## The idea: blend motions instead of points
#
# The mean of two rotation matrices is no rotation; it shrinks. Lecture 2 would take the nearest
# rotation. There is a cheaper way. A rotation by $\alpha$ about the unit axis $n$ is also the unit
# **quaternion** $q = (\cos \tfrac\alpha2,\, n \sin \tfrac\alpha2)$. Average the four numbers, divide by
# the length of the mean, and the result is a rotation again:
#
# $$ q = \frac{\sum_k w_k\, s_k\, q_k}{\left\| \sum_k w_k\, s_k\, q_k \right\|} . $$
#
# What are the signs $s_k$? $q$ and $-q$ are the same rotation, and their mean would be zero. So before
# quaternions are added, each is given the sign with which it is nearer to the one that has the largest
# weight. A rigid motion has an offset, too. With four more numbers for it, a **dual quaternion**, the
# same average gives a rigid motion for every vertex. The library:

# %%
source(dual_quaternion_blend)

# %%
source(blended)

# %%
dual = replace(pipe, skinning=wb.dual_quaternion_blend)
print(f"twisted by 180 degrees, the middle ring keeps {radius(dual)[-1]:.6f} of its radius")
hard = replace(rigid, skinning=wb.dual_quaternion_blend)
gap = np.abs(
    Limb(hard, "joint").posed(BEND, angles[:-1]) - Limb(rigid, "joint").posed(BEND, angles[:-1])
)
print(f"with one bone for each vertex it is linear blending: off by {gap.max():.0e} m")

# %% [markdown]
# ## What it costs
#
# **The angle is not in proportion.** One would wish a vertex with weight $w$ to turn by $w \alpha$. The
# mean quaternion turns it by
#
# $$ 2 \arctan \frac{w \sin (\alpha/2)}{1 - w + w \cos (\alpha/2)} , $$
#
# which is equal to $w \alpha$ at $w = 0, \tfrac12, 1$, and close to it elsewhere:

# %%
w = np.linspace(0, 1, 100001)
turn = 2 * np.arctan2(w, 1 - w)  # for half a turn
off = np.degrees(np.abs(turn - np.pi * w))
print(
    f"at half a turn it is off by at most {off.max():.3f} degrees, at w = {w[np.argmax(off)]:.3f}"
)

# %% [markdown]
# (Kavan and others, who proposed the method, give 8.15 degrees.)
#
# **The outside bulges.** A ring at the joint is turned rigidly about the joint, so on the outside of a
# bend it stays at its full distance, and the skin there must become longer. **At half a turn it
# jumps.** There the two ways round are equally long, and the sign $s_k$ decides between them. Just
# before and just after half a turn, the vertex is on opposite sides:

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
lost = {
    name: 1e6
    * np.array([volume(v, body.faces) - full for v in Limb(body, "joint").posed(BEND, angles)])
    for name, body in ways.items()
}
stretch = {name: Limb(body, "joint").stretches(BEND, angles)[1] for name, body in ways.items()}
with house_style():
    figure, axes = sheet(13, 3.8, columns=3)
    plot_by_angle(
        angles, {n: radius(b) for n, b in ways.items()}, "radius, twisted (share)", ax=axes[0]
    )
    plot_by_angle(angles, lost, "volume gained, bent (cm³)", ax=axes[1], at_rest=0)
    plot_by_angle(angles, stretch, "longest edge, bent (share)", ax=axes[2])
Picture(
    figure,
    "The tube, by angle. Left: the twisted middle ring. Centre: the bent tube's volume. Right: the "
    "longest edge of the bent tube over its length at rest; beyond 110 degrees dual quaternions "
    "stretch the outside more.",
)

# %% [markdown]
# **It is not linear in the weights.** With linear blending, the posed vertices are linear in the weights, so
# that weights can be learned by linear least squares (lecture 13). With dual quaternions they are not. CasADi
# can prove both:

# %%
for name, body in ways.items():
    free = body.freed("weights")
    p, betas, trans = (block.symbol for block in free.blocks())
    posed = free.points(p, betas, trans).source.expression
    print(f"{name:17} linear in the weights: {cs.is_linear(posed, free.free['weights'].symbol)}")

# %% [markdown]
# ## On the body
#
# The wrist and the elbow of a real template are no tubes, but they behave in the same way. SMPL keeps
# linear blending, and repairs it in another way, with the *pose blend shapes* of the next lecture. They add
# to the rest surface what blending is going to lose.

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

# %% [markdown]
# ## Without blend weights
#
# A script of the lecture *Body Models II* draws SMPL with "no blend weights". That cannot be meant
# literally, for in $\sum_k w_{ik} G'_k t_i$ something has to stand for $w_{ik}$. Here are four ways to read
# it, at rest and in a pose, beside the weights as they are:

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

# %% [markdown]
# With weights of 0 the body is a point, and with 1 it is 24 times as tall. The last of the four must be meant:
# the largest weight of each vertex becomes one, and its other weights become zero. The library's function
# does this:

# %%
source(without_blend_weights)

# %% [markdown]
# ## Where the first weights come from
#
# Weights are learned (lecture 13), but learning has to begin somewhere. It begins with a
# **segmentation**: for each vertex, somebody says to which part of the body it belongs. That is one bone
# for each vertex again, and two things are made of it.
#
# - **Rings.** Take the edges that lead from the segment of joint $k$ to the segment of its parent. The
#   vertices at their ends lie in a ring around the limb, and their mean is the first guess of joint $k$.
# - **Diffused weights.** Treat the segmentation as heat: each vertex has one unit of the heat of its own
#   segment. Let it flow along the edges of the mesh, and read what has arrived as weights.
#
# Let $W_0$ be the segmentation as an $N \times K$ matrix of zeros and ones, and $W_I$ the first weights. The
# library makes a single implicit step of the heat equation:
#
# $$
# \left( I + \tfrac12 b^2 L \right) W_I = W_0, \qquad
# L_{ij} = - \frac{1}{\|e_{ij}\|^2} \text{ for an edge } e_{ij}, \qquad
# L_{ii} = \sum_{j \ne i} \frac{1}{\|e_{ij}\|^2} .
# $$
#
# One number says how far heat flows: the **border** $b$, a length. (With many explicit steps one would have to
# choose their number too.) On a line of vertices that are close together, $L$ is $-d^2/dx^2$. So at the
# distance $d$ beyond the seam between two segments the weight is $\tfrac12 e^{-\sqrt 2\, d / b}$. Three
# properties hold for every $b$. Rows of $L$ sum to zero, so the weights of a vertex still sum to one. $L$ is
# symmetric, so no heat is lost. And no entry of $L$ off the diagonal is positive, so no weight becomes
# negative. In the end each vertex keeps its four largest weights.

# %%
source(heat)

# %%
source(Start.weights)

# %%
source(Start.rings)

# %% [markdown]
# We need a mesh whose triangles are smaller than the border, so we take the finest of the embedded bodies.
# Its segmentation is read off its own trained weights: the segment of a vertex is that of its largest
# weight. So this shows how the steps work. It does not show that they would find weights that are unknown.

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

# %% [markdown]
# How wide should the border be? On the tube the law for a line can be checked. The tube's mesh has diagonals
# as well, along which heat flows too, so the weight falls somewhat more slowly than on a line.

# %%
apart = rigid.weights.argmax(axis=1)
painted_tube = Start(pipe.template, pipe.faces, pipe.parents, pipe.joint_names, apart)
along_x = pipe.template[:-2].reshape(-1, 32, 3)[:, 0, 0]  # m, of the rings of vertices
borders = (0.01, 0.03, 0.1)  # m
with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    for border in borders:
        spread = painted_tube.weights(border)[:-2, 1].reshape(-1, 32).mean(axis=1)
        left.plot(1e2 * along_x, spread, label=f"b = {1e2 * border:.0f} cm")
        tail = (along_x < -0.02) & (spread > 1e-3)
        slope = np.polyfit(along_x[tail], np.log(spread[tail]), 1)[0]
        print(
            f"border {1e2 * border:3.0f} cm: on the tube a weight falls to 1/e in {1e2 / slope:4.1f} cm; "
            f"on a line the law says {1e2 * border / np.sqrt(2):4.1f} cm"
        )
    left.plot(1e2 * along_x, np.clip(0.5 + along_x / 0.1, 0, 1), "k:", label="of this lecture")
    left.set(xlabel="x (cm)", ylabel="weight of the second bone", xlim=(-25, 25))
    left.legend()
    widths = np.geomspace(0.005, 0.2, 9)
    away = [
        50 * np.abs(begun.weights(border) - fine.weights).sum(axis=1).mean() for border in widths
    ]
    right.semilogx(1e2 * widths, away, "o-")
    right.axvline(3, color="0.6", ls=":")
    right.set_xticks([0.5, 1, 2, 5, 10, 20], ["0.5", "1", "2", "5", "10", "20"])
    right.minorticks_off()
    right.set(xlabel="border b (cm)", ylabel="weight at other joints (%)", ylim=(0, None))
nearest = widths[np.argmin(away)]
hard_start = 50 * np.abs(np.eye(24)[begun.segmentation] - fine.weights).sum(axis=1).mean()
print(
    f"share of a vertex's weight at other joints than after training: {hard_start:.1f} % before diffusion, "
    f"{min(away):.1f} % with a border of {1e2 * nearest:.1f} cm"
)
print(f"lambda_W = {Sigmas().lambdas['weights']:.1e} m^2: (2 mm / 0.3)^2")
Picture(
    figure,
    "Left: weights along the tube for three borders, and the straight ramp that this lecture uses. "
    "Right: on the body, the share of a vertex's weight that is at other joints than after training. It is "
    "least near 3 cm (dotted), the library's border.",
)

# %% [markdown]
# This agreement proves less than it seems to, for training began with such weights and holds on to them: the
# term $E_W = \| \mathcal W - W_I \|^2$ pulls the weights $\mathcal W$ back to the diffused ones. Its
# factor $\lambda_W$ is the square of a ratio of two standard deviations: a registration may be off by 2 mm,
# and a weight by 0.3. With a large $\lambda_W$ training would end where it began.

# %% [markdown]
# ## What to remember
#
# - One bone for each vertex tears the skin; blend weights keep it together. They have to sum to one, or the
#   body lags behind.
# - Linear blending shrinks: $|c|^2 = 1 - 4 w (1 - w) \sin^2 \tfrac\alpha2$. A twisted limb becomes a candy
#   wrapper, and a bent elbow collapses.
# - Blended quaternions, brought to length one, keep every ring rigid; mind the signs. They bulge, jump
#   at half a turn, and are not linear in the weights.
# - SMPL blends linearly and repairs the rest surface.
# - First weights are a segmentation that is diffused; rings of vertices give first joints.
