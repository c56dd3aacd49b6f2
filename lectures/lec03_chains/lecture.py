# %% [markdown]
# # Kinematic chains
#
# **How do 24 rotations place 24 bones?**
#
# A body has parts that hardly change their form: forearms, shins, a head. We begin by giving each
# part a place and a rotation of its own, watch the body fall apart, and tie the parts together: a
# chain of rotations in which each joint turns all that hangs on it. Then we find out how a skin is
# bound to such a chain. Lengths are in metres, angles in radians. The body is made up, so that the
# truth is known.

# %%
from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.bodies.forward.kinematics import binding_motions, world_motions
from workbench.course import Picture, source
from workbench.course.shapes.separate_parts import SeparateParts
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.plots import house_style, sheet
from workbench.plots.body import Figurine, line_up

# %% [markdown]
# ## Each part for itself
#
# Somebody wears four markers on each of the 24 parts of the body, and we see them with noise. A part is
# rigid: it has a rotation $R_k$ and a place $p_k$, and moves a point $v$ from rest to
# $R_k (v - j_k) + p_k$, where $j_k$ is the place of the part's joint at rest and $p_k$ its place now.
# The best $R_k$ and $p_k$ for four points have a closed form (lecture 2's nearest rotation), so the fit
# of the whole body is 24 small ones: $24 \times 6 = 144$ numbers.

# %%
body = wb.load_body("default")
parts = SeparateParts(body)
joints, parents, names = body.joints(), np.array(body.parents), body.joint_names
rng = np.random.default_rng(0)
truth = 0.3 * rng.standard_normal((24, 3))
exact = parts.articulated(truth)  # where each rigid part truly is
where = parts.vertices(exact["turns"], exact["places"])
markers = np.array(
    [rng.choice(np.flatnonzero(parts.part == k), 4, replace=False) for k in range(24)]
)


def each_for_itself(seen):
    """Turns and places (24, 3) that fit the markers of each part (24, 4, 3) best."""
    turns, places = [], []
    for k in range(24):
        best = procrustes(body.template[markers[k]], seen[k])
        turns.append(vector_from_matrix(best.R))
        places.append(best(joints[k]))
    return np.array(turns), np.array(places)


seen = where[markers] + 0.01 * rng.standard_normal((24, 4, 3))  # 10 mm of noise
turns, places = each_for_itself(seen)
torn = parts.vertices(turns, places)
print(
    f"markers are met to {1e3 * np.sqrt(np.mean((torn[markers] - seen) ** 2)):.0f} mm a coordinate"
)
gaps = parts.gaps(turns, places)
widest = np.argmax(gaps)
print(
    f"joints are torn by {1e3 * gaps.mean():.0f} mm on average, "
    f"the {names[1 + widest]} by {1e3 * gaps[widest]:.0f} mm"
)

# %% [markdown]
# The markers are met to within their noise. But at a joint two parts meet, and each has its own opinion of
# where that joint is. The distance between the two is the **gap**. It is no error of the fit: nothing
# in 144 free numbers says that an arm hangs on a shoulder.
#
# ## The same with a chain
#
# Now the parts hang together: 24 rotations, each relative to the part that it hangs on, and one place
# of the whole body, $72 + 3 = 75$ numbers. (The rest of this lecture says how.) We use the same markers
# with the same noise:

# %%
rigid = without_pose_blend_shapes(parts.rigid)  # rigid parts on a chain, and nothing else
flat = markers.ravel()
seen_block = wb.Block("seen", (len(flat), 3), "m")
points = rigid.points(*(block.symbol for block in rigid.blocks()), vertices=flat)
chain = wb.Problem(
    [wb.residuals.vertices(points, seen_block.symbol, sigma=0.01)],
    ["pose", "trans"],
    blocks=[seen_block],
)
solution = wb.solve(chain, rigid.start() | {"seen": seen.reshape(-1, 3)})
fitted = parts.articulated(solution.values["pose"], solution.values["trans"])
whole = parts.vertices(fitted["turns"], fitted["places"])
print(f"unknowns: {solution.values['pose'].size + solution.values['trans'].size}")
print(f"joints are torn by at most {parts.gaps(fitted['turns'], fitted['places']).max():.0e} m")
for name, v in (("each for itself", torn), ("a chain", whole)):
    off = np.linalg.norm(v - where, axis=1)
    print(f"{name:16} surface off the truth by {1e3 * np.sqrt(np.mean(off**2)):.1f} mm")

# %%
sigmas = np.array([1, 2, 5, 10, 20]) * 1e-3  # m
torn_by = []
for sigma in sigmas:
    drawn = [
        parts.gaps(*each_for_itself(where[markers] + sigma * rng.standard_normal((24, 4, 3))))
        for _ in range(5)
    ]
    torn_by.append(1e3 * np.array([np.mean(drawn), np.max(drawn)]))


def bones_drawn(ax, turns, places, shift, name):
    """Each part's bones as it has them itself, seen from the front, and the gaps between them."""
    R = matrix_from_vector(turns)
    for k in range(1, 24):
        above = parents[k]
        end = R[above] @ (joints[k] - joints[above]) + places[above]  # where the parent has joint k
        x, y = np.array([places[above], end, places[k]]).T[:2]
        ax.plot(x[:2] + shift, y[:2], color="0.35", lw=2, solid_capstyle="round")
        ax.plot(x[1:] + shift, y[1:], "C1", lw=3, label="gap" if name and k == 1 else None)
    ax.text(shift, -1.1, name or "a chain", ha="center")


with house_style():
    figure, (left, right) = sheet(10.5, 4.8, columns=2)
    bones_drawn(left, turns, places, 0.0, "each for itself")
    bones_drawn(left, fitted["turns"], fitted["places"], 1.4, "")
    left.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", ylim=(-1.2, 1.3))
    left.legend(loc="upper left")
    right.loglog(1e3 * sigmas, np.array(torn_by)[:, 0], "o-", label="each for itself, mean")
    right.loglog(1e3 * sigmas, np.array(torn_by)[:, 1], "s--", label="the widest of five draws")
    right.set(xlabel="noise of the markers (mm)", ylabel="gap at a joint (mm)")
    right.legend()
Picture(
    figure,
    "Left: the bones as 24 parts have them, and as a chain has them, from the same markers, seen from "
    "the front; where two parts disagree about their joint, the gap is orange. Right: the "
    "gaps grow with the noise; those of the chain are zero and cannot be drawn here.",
)

# %% [markdown]
# Fewer numbers, and a better answer: what the forearm's markers say about the elbow now helps the
# upper arm. A model that cannot do what bodies cannot do needs less data.
#
# ## Rigid motions
#
# A part moves by $v \mapsto R v + t$. We write this as a $4 \times 4$ matrix that acts on $(v, 1)$:
#
# $$ G = \begin{pmatrix} R & t \\ 0 & 1 \end{pmatrix}, $$
#
# Then one motion after another is a product of matrices, in which the one that is done first stands on
# the right, and a motion is undone by the inverse matrix: $x = R^\top (y - t)$.
#
# ## The chain
#
# Each joint $k$ but the root hangs on a **parent** $p(k)$. At rest no joint is turned, and the bone to
# joint $k$ is $j_k - j_{p(k)}$. Let joint $k$ carry a frame of axes. Relative to the frame of its
# parent, it is turned by $R_k$ and stands at the end of the bone:
#
# $$
# G_k = G_{p(k)} \begin{pmatrix} R_k & j_k - j_{p(k)} \\ 0 & 1 \end{pmatrix}, \qquad
# G_0 = \begin{pmatrix} R_0 & j_0 \\ 0 & 1 \end{pmatrix}.
# $$
#
# A point with coordinates $q$ in the frame of the wrist is at $G_{\text{wrist}}\, q$ in the world:
# from the wrist's frame into the elbow's, from that into the shoulder's, and so on. Since parents come
# before their children in the list, one loop does it:


# %%
def chained(R, joints):
    """G_k (24, 4, 4) of rotations (24, 3, 3) and joints at rest (24, 3) m."""
    world = []
    for k, up in enumerate(parents):
        local = np.eye(4)
        local[:3, :3] = R[k]
        local[:3, 3] = joints[k] - (joints[up] if k else 0)
        world.append(world[up] @ local if k else local)
    return np.array(world)


R = matrix_from_vector(truth)
G = chained(R, joints)
print(f"off the library's joints by {np.abs(G[:, :3, 3] - body.joints(truth)).max():.0e} m")

# %% [markdown]
# The library's loop is the same, with symbols in the place of numbers:

# %%
source(world_motions)

# %% [markdown]
# Two mistakes are easily made. One is the **order**: with $R_k R_{p(k)}$ in the place of $R_{p(k)} R_k$
# a joint turns about axes of the world, and not about its own. The other one is the **bone**: it is
# turned by the parent and by all joints above that, and not by joint $k$ itself. (A wrist does not move
# when it turns.) Both keep the lengths of all bones, so a test of lengths notices neither:


# %%
def other_order(R, joints):
    """Where the joints are if rotations are multiplied the wrong way round."""
    world, at = [R[0]], [joints[0]]
    for k in range(1, 24):
        world.append(R[k] @ world[parents[k]])
        at.append(at[parents[k]] + world[parents[k]] @ (joints[k] - joints[parents[k]]))
    return np.array(at)


def own_rotation(R, joints):
    """Where the joints are if each bone is turned by the joint at its end."""
    world, at = [R[0]], [joints[0]]
    for k in range(1, 24):
        world.append(world[parents[k]] @ R[k])
        at.append(at[parents[k]] + world[k] @ (joints[k] - joints[parents[k]]))
    return np.array(at)


up = parents[1:]
for name, f in (
    ("right", lambda R, j: chained(R, j)[:, :3, 3]),
    ("order", other_order),
    ("bone", own_rotation),
):
    at = f(R, joints)
    bones = np.linalg.norm(at[1:] - at[up], axis=1) - np.linalg.norm(
        joints[1:] - joints[up], axis=1
    )
    off = np.linalg.norm(at - body.joints(truth), axis=1).max()
    print(f"{name:6} bones off by {np.abs(bones).max():.0e} m, joints by {1e3 * off:.0f} mm")

# %% [markdown]
# ## The root turns about the pelvis
#
# The root is no special joint: it turns about its own place $j_0$, the pelvis, and not about the
# origin. So if the root alone turns, the surface $V$ at rest goes to
#
# $$ R_0 (V - j_0) + j_0 . $$
#
# With the origin in its place the result is off by $(R_0 - I)\, j_0$, a common surprise when recordings
# of two programs are compared.

# %%
alone = np.zeros((24, 3))
alone[0] = [0, 0, np.pi / 2]
R0 = matrix_from_vector(alone[0])
ground = [0, body.template[:, 1].min(), 0]
for name, drawn in (
    ("as it is drawn", body),
    ("on the ground", replace(body, template=body.template - ground)),
):
    V, j0 = drawn.template, drawn.joints()[0]
    turned = drawn.vertices(alone)
    about_pelvis = np.linalg.norm(turned - ((V - j0) @ R0.T + j0), axis=1).max()
    about_origin = np.linalg.norm(turned - V @ R0.T, axis=1).max()
    print(
        f"{name:16} pelvis at {1e3 * j0.round(4) + 0.0} mm; a quarter turn, taken about the pelvis: "
        f"off by {1e3 * about_pelvis:.0e} mm, about the origin: {1e3 * about_origin:.1f} mm"
    )

# %% [markdown]
# This body has its pelvis at the origin, whatever its shape, and there the mistake does not show.
# Others stand on the ground. A test with this body alone would let the mistake pass.

# %% [markdown]
# ## Binding the skin
#
# $G_k$ takes points from the frame of joint $k$ to the world. But the template is drawn in the world,
# with all vertices at their places at rest. Applied to those, $G_k$ adds the joint once more:

# %%
part = parts.part
rest4 = np.column_stack([body.template, np.ones(body.n_vertices)])
twice = np.einsum(
    "nij,nj->ni", chained(matrix_from_vector(np.zeros((24, 3))), joints)[part], rest4
)[:, :3]
print(
    f"nobody turned, and vertices moved by up to {np.linalg.norm(twice - body.template, axis=1).max():.2f} m"
)

# %% [markdown]
# So we first go the other way, from the world into the frame of the joint *at rest*, and then out again
# by the posed frame. This is the **binding matrix**
#
# $$ G'_k = G_k(\theta)\, G_k(\theta^*)^{-1}, $$
#
# where $\theta^*$ is the pose that the template is drawn in. At $\theta = \theta^*$ it is the identity.
# With a template in T-pose, $\theta^* = 0$, it has the rotation of $G_k$ and the offset
# $t_k - R^{\text{world}}_k j_k$.

# %%
bound = G @ np.linalg.inv(chained(matrix_from_vector(np.zeros((24, 3))), joints))
skin = np.einsum("nij,nj->ni", bound[part], rest4)[:, :3]
with house_style():
    figure, (ax,) = sheet(9, 4.2)
    shown = [
        Figurine("at rest", body.template),
        Figurine("at rest, not bound", twice),
        Figurine("posed, bound", skin),
    ]
    line_up(shown, body.faces, ax=ax)
Picture(
    figure,
    "Left: the template. Middle: what G makes of it although no joint is turned: every part is "
    "moved by its own joint once more. Right: the template, bound and posed. Each vertex follows a"
    " single joint here, which shows in the skin at the joints; the next lecture improves on that.",
)

# %%
source(binding_motions)

# %% [markdown]
# Templates are not always drawn in a T-pose. Suppose that this one is drawn with its arms lowered by 45
# degrees. Then it comes out as drawn if the pose is that one, and not if the pose is zero:

# %%
lowered = np.zeros((24, 3))
lowered[names.index("left_shoulder")] = [0, 0, -np.pi / 4]
lowered[names.index("right_shoulder")] = [0, 0, np.pi / 4]
in_a_pose = replace(body, bound_in=lowered)
print(f"in its own pose: off by {np.abs(in_a_pose.vertices(lowered) - body.template).max():.0e} m")
print(
    f"in the pose 0: vertices moved by up to "
    f"{np.linalg.norm(in_a_pose.vertices(np.zeros((24, 3))) - body.template, axis=1).max():.2f} m"
)

# %% [markdown]
# ## Where are the posed joints?
#
# They are at the offsets of the $G_k$, which are sums along the path from the root to joint $k$:
#
# $$
# J'_k = j_0 + \sum_{c \,\in\, \text{path}(k)} R^{\text{world}}_{p(c)} \left( j_c - j_{p(c)} \right) .
# $$
#
# In the sources of this course one also finds the posed joint called $G'_k$, the name of the binding
# matrix. They are not the same. $G'_k$ takes the skin along, so its offset is where it takes the
# *origin*: $J'_k - R^{\text{world}}_k j_k$, which at rest is the origin itself, for every joint, and in
# any pose is off by as much as $j_k$ is from the origin. The posed joint is the offset of $G_k$; it is
# also $G'_k\, j_k$, the joint at rest, taken along. All three:

# %%
joints4 = np.column_stack([joints, np.ones(24)])
named = {
    "offset of G": lambda G, bound: G[:, :3, 3],
    "G' times the joint at rest": lambda G, bound: np.einsum("kij,kj->ki", bound, joints4)[:, :3],
    "offset of G'": lambda G, bound: bound[:, :3, 3],
}
still = chained(matrix_from_vector(np.zeros((24, 3))), joints)
for name, f in named.items():
    at_rest, in_pose = f(still, still @ np.linalg.inv(still)), f(G, bound)
    off_rest = 1e3 * np.linalg.norm(at_rest - joints, axis=1)
    off_pose = 1e3 * np.linalg.norm(in_pose - body.joints(truth), axis=1)
    print(
        f"{name:26}: joints at rest off by up to {off_rest.max():3.0f} mm, posed by up to "
        f"{off_pose.max():3.0f} mm"
    )
with house_style():
    figure, axes = sheet(9, 4.0, columns=2)
    for ax, name in zip(axes, ("offset of G", "offset of G'"), strict=True):
        for points, style, label in (
            (named[name](still, still @ np.linalg.inv(still)), "s--", "at rest"),
            (named[name](G, bound), "o-", "posed"),
        ):
            for k in range(1, 24):
                x, y = points[[k, parents[k]], :2].T
                look = {"color": "0.6", "zorder": 3} if label == "at rest" else {"color": "C0"}
                ax.plot(x, y, style, ms=4, label=label if k == 1 else None, **look)
        ax.set(title=name, xlabel="x (m)", ylabel="y (m)", aspect="equal")
        ax.set(xlim=(-1.0, 1.3), ylim=(-1.0, 1.3))
    axes[0].legend(loc="lower left")
Picture(
    figure,
    "Joints, tied to their parents, seen from the front. Left: offsets of G are the skeleton, at rest "
    "and posed. Right: offsets of the binding matrices G' are no skeleton; at rest all 24 are at the "
    "origin.",
)

# %% [markdown]
# There is another answer that looks as good. The joints at rest are found from the rest surface by a
# matrix, $J = \mathcal J\, T$: each joint is a weighted mean of vertices around it. Why not apply the
# same $\mathcal J$ to the posed surface? Because there the skin around a joint has bent:

# %%
posed = body.vertices(truth)
regressed = body.J_regressor @ posed
gap = 1e3 * np.linalg.norm(regressed - body.joints(truth), axis=1)
at_rest = 1e3 * np.linalg.norm(body.J_regressor @ body.template - joints, axis=1)
print(
    f"at rest: {at_rest.max():.0e} mm; posed: {gap.mean():.1f} mm on average, "
    f"{gap.max():.0f} mm at the {names[np.argmax(gap)]}"
)
turned = body.vertices(alone)  # the mean person
print(
    f"if the root alone turns: {1e3 * np.abs(body.J_regressor @ turned - body.joints(alone)).max():.0e} mm"
)

with house_style():
    figure, (ax,) = sheet(8, 3.6)
    order = np.argsort(-gap)
    ax.bar(range(24), gap[order])
    ax.set_xticks(range(24), [names[k].replace("_", " ") for k in order], rotation=60, ha="right")
    ax.set(ylabel="from the chain's joint (mm)")
Picture(
    figure,
    "How far the joints regressed from the posed skin are from those of the chain, in a random pose. "
    "The skin of a bent joint is no longer where its weighted mean finds the joint.",
)

# %% [markdown]
# A rotation of the whole body does no harm: the rows of $\mathcal J$ sum to one, so the joints turn
# with it. Bending does. The regressor is for the rest surface; posed joints come from the chain. When
# you compare with joints from another program, ask which of the two they are.
#
# ## What to remember
#
# - 24 free parts are 144 numbers and fall apart; a chain has 75 and cannot.
# - $G_k = G_{p(k)} [R_k,\, j_k - j_{p(k)}]$: the parent on the left, the bone turned by the parent.
# - The root turns about the pelvis.
# - The skin is drawn in the world: $G'_k = G_k(\theta)\, G_k(\theta^*)^{-1}$ takes it along, and is the
#   identity in the pose that it is drawn in.
# - Posed joints are the offsets of the chain, $G_k$ and not $G'_k$, and not $\mathcal J$ times the posed skin.
