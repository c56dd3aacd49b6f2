# %% [markdown]
# # Kinematic chains
#
# **How do 24 rotations place 24 bones?**
#
# A body has parts that hardly change their form: forearms, shins, a head. We begin by giving each part a
# position and a rotation of its own, and watch the body fall apart. Then we tie the parts together by a
# chain of rotations, in which each joint turns everything that hangs on it. At the end we bind a skin to
# this chain. Lengths are in metres, angles in radians. The body and its pose are synthetic, so that the
# truth is known.

# %%
from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.bodies.forward.kinematics import binding_motions, world_motions
from workbench.course import Picture, source
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.lectures.material.separate_parts import SeparateParts
from workbench.plots import house_style, sheet
from workbench.plots.body import Figurine, line_up

# %% [markdown]
# ## Every part on its own
#
# Somebody wears four markers on each of the 24 parts of the body, and we see the markers with noise. A
# part is rigid: it has a rotation $R_k$ and a position $p_k$, and a point that lies at $v$ when the body
# is at rest moves to $R_k (v - j_k) + p_k$. Here $j_k$ is where the part's joint is at rest, and $p_k$
# is where it is now. The best $R_k$ and $p_k$ for four points have a closed form (from the nearest
# rotation of lecture 2), so fitting the whole body consists of 24 small fits, with $24 \times 6 = 144$
# numbers in all.

# %% slide [markdown]
# ## Every part on its own: 24 small fits
#
# - Four markers on each of 24 parts, seen with 10 mm of noise
# - Each part: a rotation $R_k$ and a position $p_k$, in closed form (Procrustes)
# - $24 \times 6 = 144$ numbers in all

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
    """Rotation vectors and positions (24, 3) that fit the markers of each part (24, 4, 3) best."""
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
    f"markers are fitted to {1e3 * np.sqrt(np.mean((torn[markers] - seen) ** 2)):.0f} mm per coordinate"
)
gaps = parts.gaps(turns, places)
widest = np.argmax(gaps)
print(
    f"joints are torn by {1e3 * gaps.mean():.0f} mm on average, "
    f"the {names[1 + widest]} by {1e3 * gaps[widest]:.0f} mm"
)

# %% slide [markdown]
# ## The markers are met, and the body is torn
#
# - Fitted to {{ 1e3 * np.sqrt(np.mean((torn[markers] - seen) ** 2)):.0f}} mm per coordinate
# - Gaps at the joints: {{ 1e3 * gaps.mean():.0f}} mm on average, {{ 1e3 * gaps[widest]:.0f}} mm at the
#   {{ names[1 + widest].replace("_", " ")}}
# - No mistake of the solver: nothing in 144 free numbers says that an arm hangs on a shoulder.

# %% [markdown]
# The fit reproduces the markers to within their noise{{ np.sqrt(np.mean((torn[markers] - seen) ** 2)) < 0.01 }}. But
# two parts meet at each joint, and the two
# disagree about where that joint is. The distance between their answers is the **gap**. The solver made
# no mistake: nothing in the 144 free numbers says that an arm hangs on a shoulder.
#
# ## The parts on a chain
#
# Now the parts hang together: there are 24 rotations, each relative to the part that it hangs on, and
# one position of the whole body, $72 + 3 = 75$ numbers. (The rest of this lecture explains how.) We use
# the same markers with the same noise. `Block`, `Problem` and `solve` are explained in lecture 9; here it is enough
# that they find the 75 numbers that fit the markers best:

# %% slide [markdown]
# ## The parts on a chain: 75 numbers
#
# - One rotation for each part, relative to the part that it hangs on: 72
# - One position of the whole body: 3
# - The same markers, the same noise

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
rms = {}  # m
for name, v in (("on its own", torn), ("a chain", whole)):
    rms[name] = np.sqrt(np.mean(np.linalg.norm(v - where, axis=1) ** 2))
    print(f"{name:10} surface {1e3 * rms[name]:.1f} mm from the truth (root mean square)")

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
    """The bones as each part places them, seen from the front, and the gaps between them."""
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
    bones_drawn(left, turns, places, 0.0, "on its own")
    bones_drawn(left, fitted["turns"], fitted["places"], 1.4, "")
    left.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", ylim=(-1.2, 1.3))
    left.legend(loc="upper left")
    right.loglog(1e3 * sigmas, np.array(torn_by)[:, 0], "o-", label="on its own, mean")
    right.loglog(
        1e3 * sigmas, np.array(torn_by)[:, 1], "s--", label="on its own, the widest of five draws"
    )
    right.set(xlabel="noise of the markers (mm)", ylabel="gap at a joint (mm)")
    right.legend()
Picture(
    figure,
    "Left: the bones where 24 separate parts put them and where a chain puts them, both fitted to the "
    "same markers and seen from the front. Where two parts disagree about their joint, the gap is "
    "orange. Right: the gaps grow with the noise of the markers; those of the chain are zero, which a "
    "logarithmic axis cannot show.",
)

# %% slide [markdown]
# ## A chain cannot be torn, and it is nearer to the truth
#
# - Surface off by {{ 1e3 * rms['a chain']:.1f}} mm in place of {{ 1e3 * rms['on its own']:.1f}}: fewer
#   numbers, a better answer
# - Gaps grow with the noise; the chain's are zero.

# %% [markdown]
# Fewer numbers, and a better answer, {{ 1e3 * rms['a chain']:.1f }} mm from the truth in place of
# {{ 1e3 * rms['on its own']:.1f }}{{ rms['a chain'] < 0.8 * rms['on its own'] and (np.diff(torn_by, axis=0) > 0).all() and parts.gaps(fitted['turns'], fitted['places']).max() < 1e-14 }}:
# what the forearm's markers say about the elbow now helps to place
# the upper arm as well. A model that excludes what no body can do needs fewer data, because none of them is
# spent on learning that arms hang on shoulders.

# %% slide [markdown]
# ## What cannot happen need not be learned
#
# - The forearm's markers say where the elbow is, and so help to place the upper arm.
# - A model that excludes what no body can do needs fewer data.

# %% [markdown]
# ## Rigid motions
#
# A part moves by $v \mapsto R v + t$. We write this as a $4 \times 4$ matrix that acts on $(v, 1)$:
#
# $$ G = \begin{pmatrix} R & t \\ 0 & 1 \end{pmatrix} . $$
#
# Multiplied by $(v, 1)$ it gives $(R v + t, 1)$. Then doing one motion after another is a product of matrices, in
# which the motion that is done first stands on the right. The inverse matrix undoes a motion: from $y = R x + t$
# follows $x = R^\top (y - t)$.

# %% slide [markdown]
# ## A rigid motion is a matrix
#
# $$ G = \begin{pmatrix} R & t \\ 0 & 1 \end{pmatrix}, \qquad G \begin{pmatrix} v \\ 1 \end{pmatrix} = \begin{pmatrix} R v + t \\ 1 \end{pmatrix} $$
#
# - One motion after the other is a product; what is done first stands on the right.
# - Undo it: $x = R^\top (y - t)$

# %% [markdown]
# ## The chain
#
# Each joint $k$ except the root hangs on another joint, its **parent** $p(k)$. *At rest* means: in the pose in which
# the template was drawn. Until we say otherwise this is a T-pose, in which no joint is turned, and the bone to joint
# $k$ is $j_k - j_{p(k)}$. Each joint carries a **frame**: three axes that
# turn with it and begin at the joint. Relative to the frame of its parent, the frame of joint $k$ is
# turned by $R_k$ and sits at the end of the bone:
#
# $$
# G_k = G_{p(k)} \begin{pmatrix} R_k & j_k - j_{p(k)} \\ 0 & 1 \end{pmatrix}, \qquad
# G_0 = \begin{pmatrix} R_0 & j_0 \\ 0 & 1 \end{pmatrix}.
# $$
#
# A point with coordinates $q$ in the frame of the wrist is at $G_{\text{wrist}}\, (q, 1)$ in the world, which
# is the fixed frame in which the body stands: the product takes it from the wrist's frame into the
# elbow's, from there into the shoulder's, and so on. Since parents come before their children in the
# list of joints, a single loop computes all $G_k$:


# %% slide [markdown]
# ## The chain: parent first, from the left
#
# $$ G_k = G_{p(k)} \begin{pmatrix} R_k & j_k - j_{p(k)} \\ 0 & 1 \end{pmatrix}, \qquad G_0 = \begin{pmatrix} R_0 & j_0 \\ 0 & 1 \end{pmatrix} $$
#
# - Each joint has a frame that turns with it, at the end of the bone from its parent.
# - The product leads from the wrist's frame to the elbow's, the shoulder's, ..., the world.


# %%
def chained(R, joints):
    """G_k (24, 4, 4), from rotations (24, 3, 3) and joints at rest (24, 3) m."""
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

# %% slide [markdown]
# ## One loop, because parents come before their children
#
# ```python
# for k, up in enumerate(parents):
#     local = np.eye(4)
#     local[:3, :3] = R[k]
#     local[:3, 3] = joints[k] - (joints[up] if k else 0)
#     world.append(world[up] @ local if k else local)
# ```
#
# - The same joints as the library's, to rounding{{ np.abs(G[:, :3, 3] - body.joints(truth)).max() < 1e-14 }}

# %% [markdown]
# The loop in the library is the same{{ np.abs(G[:, :3, 3] - body.joints(truth)).max() < 1e-14 }}, with symbols in
# place of numbers:

# %%
source(world_motions)

# %% [markdown]
# Two mistakes are easily made. One is the **order**: with $R_k R_{p(k)}$ in place of $R_{p(k)} R_k$, a
# joint turns about axes of the world, and not about its own. The other is the **bone**: the bone to
# joint $k$ is turned by the parent and all joints above the parent, and not by joint $k$ itself. (A
# wrist does not move when it turns.) Both mistakes keep the lengths of all bones, so a test of lengths
# notices neither:


# %% slide [markdown]
# ## Two mistakes that are easily made
#
# - **Order**: with $R_k R_{p(k)}$ a joint turns about the world's axes, not its own.
# - **Bone**: the bone *to* joint $k$ is turned by the parent, not by $k$. (A wrist does not move when it
#   turns.)
# - Both keep every bone's length.


# %%
def other_order(R, joints):
    """Where the joints are if rotations are multiplied the wrong way round."""
    world, at = [R[0]], [joints[0]]
    for k in range(1, 24):
        world.append(R[k] @ world[parents[k]])
        at.append(at[parents[k]] + world[parents[k]] @ (joints[k] - joints[parents[k]]))
    return np.array(at)


def own_rotation(R, joints):
    """Where the joints are if each bone is turned by the joint at its far end."""
    world, at = [R[0]], [joints[0]]
    for k in range(1, 24):
        world.append(world[parents[k]] @ R[k])
        at.append(at[parents[k]] + world[k] @ (joints[k] - joints[parents[k]]))
    return np.array(at)


up = parents[1:]
off_by = {}  # m: bones, joints
for name, f in (
    ("right", lambda R, j: chained(R, j)[:, :3, 3]),
    ("order", other_order),
    ("bone", own_rotation),
):
    at = f(R, joints)
    bones = np.linalg.norm(at[1:] - at[up], axis=1) - np.linalg.norm(
        joints[1:] - joints[up], axis=1
    )
    off_by[name] = np.abs(bones).max(), np.linalg.norm(at - body.joints(truth), axis=1).max()
    print(
        f"{name:6} bones too long or short by {off_by[name][0]:.0e} m, "
        f"joints off by {1e3 * off_by[name][1]:.0f} mm"
    )

# %% slide [markdown]
# ## A test of lengths notices neither
#
# | | bones off by | joints off by |
# | --- | --- | --- |
# | right | rounding | {{ 1e3 * off_by['right'][1]:.0f}} mm |
# | wrong order | rounding | {{ 1e3 * off_by['order'][1]:.0f}} mm |
# | wrong bone | rounding{{ max(bones for bones, _ in off_by.values()) < 1e-14 }} | {{ 1e3 * off_by['bone'][1]:.0f}} mm |

# %% [markdown]
# The bones are right in both, and the joints are off by up to {{ 1e3 * off_by['order'][1]:.0f }} and
# {{ 1e3 * off_by['bone'][1]:.0f }}
# mm{{ max(bones for bones, _ in off_by.values()) < 1e-14 and off_by['right'][1] < 1e-14 }}.
#
# ## The root turns about the pelvis
#
# The root turns like every other joint: about its own position $j_0$, the pelvis, and not about the
# origin. So if the root alone turns, the surface at rest, $V$, moves to
#
# $$ R_0 (V - j_0) + j_0 . $$
#
# If it is turned about the origin instead, the result is off by $(R_0 - I)\, j_0$. This is a common
# surprise when recordings from two programs are compared.

# %% slide [markdown]
# ## The root turns about the pelvis
#
# $$ R_0 (V - j_0) + j_0 $$
#
# - Turned about the origin instead, everything is off by $(R_0 - I)\, j_0$.
# - A common surprise between two programs' recordings

# %%
alone = np.zeros((24, 3))
alone[0] = [0, 0, np.pi / 2]
R0 = matrix_from_vector(alone[0])
ground = [0, body.template[:, 1].min(), 0]
for name, drawn in (
    ("as it comes", body),
    ("on the ground", replace(body, template=body.template - ground)),
):
    V, j0 = drawn.template, drawn.joints()[0]
    turned = drawn.vertices(alone)
    about_pelvis = np.linalg.norm(turned - ((V - j0) @ R0.T + j0), axis=1).max()
    about_origin = np.linalg.norm(turned - V @ R0.T, axis=1).max()
    print(
        f"{name:16} pelvis at {1e3 * j0.round(4) + 0.0} mm; a quarter turn about the pelvis is "
        f"off by {1e3 * about_pelvis:.0e} mm, one about the origin by {1e3 * about_origin:.1f} mm"
    )

# %% [markdown]
# This body has its pelvis at the origin, whatever its shape, so the mistake does not show. Other bodies stand on the
# ground, and one whose pelvis is {{ j0[1]:.2f }} m above it is off by {{ about_origin:.2f }}
# m{{ np.allclose(body.joints(betas=np.ones(body.n_betas))[0], 0, atol=1e-5) and about_pelvis < 1e-12 }}. A test with
# this body alone would let the mistake pass.

# %% slide [markdown]
# ## A test body can hide the mistake
#
# - This body's pelvis is at the origin: both rules agree.
# - Stand it on the ground, {{ j0[1]:.2f}} m below, and a quarter turn is off by {{ about_origin:.2f}} m.

# %% [markdown]
# ## Binding the skin
#
# $G_k$ takes points from the frame of joint $k$ to the world. But the vertices of the template are given
# in the coordinates of the world, at rest. If $G_k$ is applied to them, it adds the position of the
# joint once more:

# %%
part = parts.part
rest4 = np.column_stack([body.template, np.ones(body.n_vertices)])
twice = np.einsum(
    "nij,nj->ni", chained(matrix_from_vector(np.zeros((24, 3))), joints)[part], rest4
)[:, :3]
print(
    f"no joint is turned, and yet vertices moved by up to "
    f"{np.linalg.norm(twice - body.template, axis=1).max():.2f} m"
)

# %% slide [markdown]
# ## Binding: vertices are given in the world, not in a frame
#
# - $G_k$ takes points from the *frame* of joint $k$ to the world.
# - Applied to the template it adds the joint's position once more: no joint turned, vertices moved by
#   {{ np.linalg.norm(twice - body.template, axis=1).max():.2f}} m.

# %% [markdown]
# So we first go the other way{{ np.linalg.norm(twice - body.template, axis=1).max() > 0.5 }}, from the world into the
# frame of the joint *at rest*, and then back into
# the world by the frame of the *posed* joint. Together this is the **binding matrix**
#
# $$ G'_k = G_k(\theta)\, G_k(\theta^*)^{-1}, $$
#
# where $\theta^*$ is the pose in which the template was drawn. At $\theta = \theta^*$ it is the
# identity. Of the upper three rows of such a matrix the first three columns are its rotation, and the last column is
# its **offset**.
# With $R^{\text{world}}_k$ and $t_k$ for the rotation and the offset of $G_k$, and for a template in the
# T-pose, $\theta^* = 0$, the binding matrix has the rotation $R^{\text{world}}_k$ and the offset
# $t_k - R^{\text{world}}_k j_k$.

# %% slide [markdown]
# ## The binding matrix goes back first
#
# $$ G'_k = G_k(\theta)\, G_k(\theta^*)^{-1} $$
#
# - $\theta^*$: the pose in which the template was drawn; there $G'_k$ is the identity.
# - In the T-pose: the rotation $R^{\text{world}}_k$ and the offset $t_k - R^{\text{world}}_k j_k$

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
    "Left: the template. Middle: what G alone makes of the template although no joint is turned: each "
    "part is moved once more by the position of its joint. Right: the template, bound and posed. Each "
    "vertex follows a single joint here, which tears the skin at the joints; the next lecture improves "
    "on that.",
)

# %% slide [markdown]
# ## Bound and not bound
#
# - Middle: $G$ alone, no joint turned. Right: bound, and posed

# %%
source(binding_motions)

# %% [markdown]
# Templates are not always drawn in a T-pose. Suppose that this one were drawn with its arms lowered by {{ 45 }}
# degrees. Then the body looks like the template in the pose with lowered arms, and not in the pose zero.
#
# At rest joints are turned now: the $j_k$ are joints of the template as it was drawn, and between them are bones that
# have been turned by $\theta^*$. In $G_k$ they have to be turned back first, so that in place of $j_k - j_{p(k)}$ it has
#
# $$ R^{\text{world}}_{p(k)}(\theta^*)^\top \left( j_k - j_{p(k)} \right) . $$

# %% slide [markdown]
# ## The template need not be a T-pose
#
# - Drawn with arms lowered by 45 degrees, it looks like itself in *that* pose ...
# - ... and in the pose zero its arms are up.
# - $G_k$ has the bone $R^{\text{world}}_{p(k)}(\theta^*)^\top ( j_k - j_{p(k)} )$: first turned back.

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
drawn = chained(matrix_from_vector(lowered), joints)[:, :3, :3]  # rotations in the world, as drawn
straight = joints.copy()  # joints in the pose 0, where bones are turned back
for k in range(1, 24):
    bone = drawn[parents[k]].T @ (joints[k] - joints[parents[k]])
    straight[k] = straight[parents[k]] + bone
joints_off = {
    name: np.linalg.norm(chained(R, start)[:, :3, 3] - in_a_pose.joints(truth), axis=1).max()
    for name, start in (("bones turned back", straight), ("bones as drawn", joints))
}
for name, off in joints_off.items():
    print(f"joints in a random pose, {name}: off by up to {off:.0e} m")

# %% slide [markdown]
# ## Its own pose is the fixed point
#
# - In its own pose: off by rounding{{ np.allclose(in_a_pose.vertices(lowered), body.template, atol=1e-13) }}
# - In the pose 0: vertices moved by up to
#   {{ np.linalg.norm(in_a_pose.vertices(np.zeros((24, 3))) - body.template, axis=1).max():.2f}} m

# %% [markdown]
# ## Where are the posed joints?
#
# The offset of $G_k$ is the position of the posed
# joint{{ np.allclose(in_a_pose.vertices(lowered), body.template, atol=1e-13) and np.linalg.norm(in_a_pose.vertices(np.zeros((24, 3))) - body.template, axis=1).max() > 0.1 and joints_off['bones turned back'] < 1e-14 < 0.1 < joints_off['bones as drawn'] }}.
# For a template in the T-pose, to which we return, it is a sum along the path from the root to
# joint $k$:
#
# $$
# J'_k = j_0 + \sum_{c \,\in\, \text{path}(k)} R^{\text{world}}_{p(c)} \left( j_c - j_{p(c)} \right) .
# $$
#
# Two offsets are easily confused here, that of $G_k$ and that of the binding matrix $G'_k$. The
# offset of $G'_k$ is not the posed joint. It is the point to which $G'_k$ moves the *origin*,
# $J'_k - R^{\text{world}}_k j_k$. At rest this is the origin itself, for every joint. In every pose its
# distance from the posed joint is the distance of $j_k$ from the origin. The posed joint is the offset of
# $G_k$. It is also $G'_k\, (j_k, 1)$, the point to which $G'_k$ moves the joint at rest. We compare the three:

# %% slide [markdown]
# ## Where are the posed joints?
#
# $$ J'_k = j_0 + \sum_{c \,\in\, \text{path}(k)} R^{\text{world}}_{p(c)} \left( j_c - j_{p(c)} \right) $$
#
# - It is the offset of $G_k$, and also $G'_k\, (j_k, 1)$.
# - The offset of $G'_k$ is something else: where the *origin* goes.

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

# %% slide [markdown]
# ## Offsets of $G$ are a skeleton, offsets of $G'$ are not
#
# - At rest all 24 offsets of $G'$ are at the origin; posed, they are up to
#   {{ printed("offset of G'")[-1]:.0f}} mm away.

# %% [markdown]
# The first two agree, and the offset of $G'_k$ is up to {{ printed("offset of G'")[-1]:.0f }} mm
# away{{ np.allclose(named["G' times the joint at rest"](G, bound), G[:, :3, 3]) and np.allclose(off_pose, 1e3 * np.linalg.norm(joints, axis=1)) }}.
#
# There is another way to compute posed joints, and it looks just as good. The joints at rest are computed
# from the surface at rest, $T$, by a matrix, the **regressor** $\mathcal J$: $J = \mathcal J\, T$ makes each
# joint a weighted mean of vertices around it. Why not apply the same $\mathcal J$ to the posed surface?
# Because there the skin around a joint has been bent:

# %% slide [markdown]
# ## Another way that looks just as good
#
# - At rest, joints are weighted means of vertices: $J = \mathcal J\, T$.
# - Why not apply the same $\mathcal J$ to the *posed* surface?

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
    ax.set(ylabel="distance from the chain's joint (mm)")
Picture(
    figure,
    "The distance between the joints that the regressor computes from the posed skin and those of the "
    "chain, in a random pose. Once the skin around a joint is bent, its weighted mean is no longer at "
    "the joint.",
)

# %% slide [markdown]
# ## Bent skin is no place to look for joints
#
# - At rest exact; posed off by {{ gap.mean():.0f}} mm on average, {{ gap.max():.0f}} mm at the
#   {{ names[np.argmax(gap)].replace("_", " ")}}
# - When programs disagree about joints, ask which of the two they return.

# %% [markdown]
# A rotation of the whole body does no
# harm{{ np.allclose(body.J_regressor @ turned, body.joints(alone), atol=1e-13) and at_rest.max() < 1e-10 }}: each row
# of $\mathcal J$ sums to one, so the joints turn
# with the body. Bending does harm, {{ gap.mean():.0f }} mm on average. The regressor is for the surface at rest;
# posed joints come from the
# chain. When you compare them with joints from another program, ask which of the two that program
# returns.
#
# ## What to remember
#
# - 24 free parts have 144 numbers and fall apart; a chain has 75 numbers and cannot fall apart.
# - $G_k = G_{p(k)} [R_k,\, j_k - j_{p(k)}]$: the parent's matrix stands on the left, and the parent
#   turns the bone.
# - The root turns about the pelvis.
# - The template is given in the coordinates of the world: $G'_k = G_k(\theta)\, G_k(\theta^*)^{-1}$
#   moves it, and is the identity in the pose in which the template was drawn.
# - Posed joints are the offsets of the chain's matrices $G_k$. They are neither the offsets of $G'_k$ nor
#   $\mathcal J$ times the posed skin.

# %% slide [markdown]
# ## What to remember
#
# - 24 free parts, 144 numbers, fall apart; a chain, 75 numbers, cannot.
# - $G_k = G_{p(k)} [R_k,\, j_k - j_{p(k)}]$: the parent stands on the left, and the parent turns the bone.
# - Skin moves by $G'_k = G_k(\theta)\, G_k(\theta^*)^{-1}$; posed joints are the offsets of $G_k$.
