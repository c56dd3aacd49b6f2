# %% [markdown]
# # Training a body model
#
# **Where do the model's own numbers come from?**
#
# Until now the template, the blend shapes, the weights and the joint regressor were given. Somebody has learned them
# from scans. We begin with principal components of the scans as they are, and see them learn the wrong thing. Then we
# train a whole model. It is a tiny one, with 66 vertices and 6 joints, so that training takes seconds. All people are
# synthetic, so that the answer is known. Lengths are in metres and angles in radians.

# %%
from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.forward.posing import unpose
from workbench.course import Picture, source
from workbench.geometry.mirror import Mirror, find_mirror
from workbench.lectures.material.pose_in_shape import aligned, pose_share
from workbench.lectures.material.training_costs import plot_costs
from workbench.lectures.material.tubes import tube
from workbench.plots import house_style, sheet
from workbench.plots.diagnosis import plot_sparsity
from workbench.synthetic.made_up import draw_registrations, jointed_tube, limb, random_smpl
from workbench.training import blocks
from workbench.training.blocks import alternation
from workbench.training.estimate import Estimate, Sigmas, SkinningPass
from workbench.training.first_guess import Start, first_estimate
from workbench.training.objective import Objective
from workbench.training.pose_training import train_poses
from workbench.training.shape_training import learn_shape_space
from workbench.training.shares import fit_joint_regressor, shares_to_zero
from workbench.training.symbolic import SymbolicTraining

# %% [markdown]
# ## Registrations
#
# Scans have no vertices in common: vertex 100 of one scan has nothing to do with vertex 100 of another. So first a
# template is brought onto each of them. The result is a mesh that has the template's vertices and the scan's form, and
# is called a **registration** (lecture 15 makes them). [SMPL](https://doi.org/10.1145/2816795.2818013) was trained from
# two sets of registrations:
#
# - **multi-pose**: few people, each in many poses. They teach what has to do with pose: joints, weights
#   $\mathcal W$, pose blend shapes $P$.
# - **multi-shape**: many people, each in about one pose. They teach the mean $\bar T$ and the shape
#   directions $S$.
#
# (The notes on SMPL and SMPLify that this course follows exchange the two in one place. The data show which
# way round it must be: a person in one pose cannot tell how their elbow bulges, and three people cannot tell
# how thousands differ.)
#
# Our people are jointed tubes with six joints each, drawn from a random model of SMPL's form.

# %%
start = jointed_tube(11, 6)  # a mesh, its tree, and which segment each vertex belongs to
true = random_smpl(start, 3, seed=0, shape=0.005)
many, known = draw_registrations(true, 200, 1, seed=3, turn=0.3)  # multi-shape: nearly one pose
print(
    f"{true.n_vertices} vertices, {true.n_joints} joints, {true.n_betas} directions of shape; "
    f"{len(many.subject)} people"
)

# %% slide [markdown]
# ## Scans become registrations
#
# - Vertex 100 of one scan has nothing to do with vertex 100 of another: a template is brought onto each.
# - **Multi-pose**, few people: joints, weights, $P$. **Multi-shape**, many: $\bar T$, $S$
# - Here: tubes of {{ true.n_vertices}} vertices, {{ true.n_joints}} joints, {{ true.n_betas}} directions of
#   shape

# %% [markdown]
# ## Principal components of what we have
#
# We try the naive way first. We move all meshes rigidly onto each other, and take their mean and the directions in
# which they differ most. In truth there are three such directions. The people were asked to stand alike, and
# did, but for 0.06 to 0.3 rad in each joint:


# %%
def explained(people):
    """The share of the variance that the first directions explain, one after the other."""
    away = (people - people.mean(axis=0)).reshape(len(people), -1)
    s = np.linalg.svd(away, compute_uv=False)
    return np.cumsum(s**2) / np.sum(s**2)


raw = aligned(many)
shares = pose_share(raw, known.poses)
print(
    "variance explained by 3 directions:",
    f"{explained(raw)[2]:.2f},",
    "needed for 0.99:",
    1 + np.argmax(explained(raw) > 0.99),
)
print(
    "share of the first coordinates that a linear function of pose explains:",
    ", ".join(f"{share:.0%}" for share in shares),
)

# %% slide [markdown]
# ## Principal components of what we have learn poses
#
# - People stood alike but for 0.06 to 0.3 rad in each joint.
# - {{ shares[0]:.0%}} and {{ shares[1]:.0%}} of the first two coordinates are pose; three directions explain
#   {{ explained(raw)[2]:.0%}}, not all.

# %% [markdown]
# The first two directions are not shape: they are how people happened to bend, by which {{ shares[0]:.0%}} and
# {{ shares[1]:.0%}} of their coordinates are explained. With three directions only {{ explained(raw)[2]:.0%}} of the
# variance is explained. A model with
# these would make a person thinner by bending them. The meshes have to be brought to one pose first:
# **un-posed**.
#
# If the model and the pose were known, un-posing would be a linear problem. Posed vertices are linear
# in the rest vertices, joints included (they are weighted means of those), so
#
# $$ \hat T = \arg\min_T \| W(T + B_P(\theta), \mathcal J T, \theta, \mathcal W) - V \|^2 $$
#
# is one solve. The library does it with the matrices $M_i$ of lecture 5, and a small system for the
# joints:

# %% slide [markdown]
# ## Un-pose first
#
# $$ \hat T = \arg\min_T \| W(T + B_P(\theta), \mathcal J T, \theta, \mathcal W) - V \|^2 $$
#
# - For a known pose, posed vertices are linear in rest vertices, joints included: one solve

# %%
source(unpose)

# %%
people = np.stack([unpose(true, p, v) for p, v in zip(known.poses, many.vertices, strict=True)])
people -= people.mean(axis=1, keepdims=True)
print("un-posed, variance explained by 3 directions:", f"{explained(people)[2]:.6f}")
print(
    "pose in the first coordinates:",
    ", ".join(f"{share:+.0%}" for share in pose_share(people, known.poses)[:3]),
)

with house_style():
    figure, (ax,) = sheet(7.5, 3.6)
    for name, one, mark in (("as they stand", raw, "s--"), ("un-posed", people, "o-")):
        ax.plot(np.arange(1, 13), 100 * explained(one)[:12], mark, ms=4, label=name)
    ax.set(xlabel="directions", ylabel="variance explained (%)", xticks=range(1, 13))
    ax.legend(loc="center right")
Picture(
    figure,
    "200 tubes with three directions of shape. Un-posed, three directions explain all; as they stand, "
    "the first two are pose, and many more are needed.",
)

# %% slide [markdown]
# ## Un-posed, three directions explain all
#
# - As they stand, the first two are pose.

# %% [markdown]
# The library's `learn_shape_space` then finds the
# directions{{ explained(people)[2] > 0.999999 and max(pose_share(people, known.poses)[:3]) < 0.1 < 0.9 < min(shares[:2]) }}.
# The length of each is one standard deviation,
# a singular value divided by $\sqrt{n - 1}$, so that $\beta$ has variance one.

# %%
source(learn_shape_space)

# %%
space = learn_shape_space(people, true.faces, None, 3)
betas = space.betas(people)
print("variance of the people's betas:", betas.var(axis=0, ddof=1).round(6))

# %% slide [markdown]
# ## Shape directions, by convention
#
# $$ s_k = \sigma_k / \sqrt{n - 1} $$
#
# - Betas have variance one.{{ np.allclose(betas.var(axis=0, ddof=1), 1) }}
# - But un-posing needed poses, weights and $P$. To find them, we would need the people at rest.

# %% [markdown]
# But un-posing needed the poses, the weights and $P$, which are what we do not
# know{{ np.allclose(betas.var(axis=0, ddof=1), 1) }}. To find them, in turn, we would
# need the people at rest.
#
# ## What is linear
#
# With a template $\hat T_s$ and joints $\hat J_s$ for each person $s$, and $\theta_j$ the pose of
# registration $j$, everything is to be found from
#
# $$ E_D = \sum_j \| V_j - W(\hat T_{s(j)} + B_P(\theta_j; P),\; \hat J_{s(j)},\; \theta_j,\; \mathcal W) \|^2 . $$
#
# In which of its unknowns is the model linear? A map is linear (with a constant) if it takes the middle
# of two points to the middle of their images. We go from a random model to one that differs in some
# unknowns only, and look at the middle.

# %% slide [markdown]
# ## Everything at once
#
# $$ E_D = \sum_j \| V_j - W(\hat T_{s(j)} + B_P(\theta_j; P),\; \hat J_{s(j)},\; \theta_j,\; \mathcal W) \|^2 $$
#
# - In which unknowns is it linear? A linear map takes the middle of two points to the middle of their images.

# %%
few, _ = draw_registrations(true, 2, 8, seed=1)  # multi-pose: two people in eight poses each
noise = 0.001 * np.random.default_rng(2).standard_normal(few.vertices.shape)  # m
few = replace(few, vertices=few.vertices + noise)
first = first_estimate(few, start, weights=start.weights(), rings=start.rings())
rng = np.random.default_rng(0)
here = replace(
    first, poses=0.5 * rng.standard_normal((16, 6, 3)), posedirs=true.posedirs, weights=true.weights
)
other = {name: 0.1 * rng.standard_normal(array.shape) for name, array in here.arrays().items()}


def off_the_middle(*names):
    """How far points are from the middle, in mm, if these unknowns alone change."""
    change = {name: other[name] for name in names}
    begin, middle, end = (
        SkinningPass.of(here.moved(change, share), slice(0, 16), few.subject).points
        for share in (0, 0.5, 1)
    )
    return 1e3 * np.abs(middle - (begin + end) / 2).max()


for names in (
    ("templates", "joints", "posedirs"),
    ("weights",),
    ("weights", "posedirs"),
    ("poses",),
):
    print(f"{', '.join(names):28} off by {off_the_middle(*names):.0e} mm")

# %%
source(SkinningPass.points)

# %% slide [markdown]
# ## What is linear
#
# | change together | off the middle by |
# | --- | --- |
# | templates, joints, $P$ | {{ "nothing" if off_the_middle('templates', 'joints', 'posedirs') < 1e-9 else "something"}} |
# | weights | {{ "nothing" if off_the_middle('weights') < 1e-9 else "something"}} |
# | weights and $P$ | {{ off_the_middle('weights', 'posedirs'):.0f}} mm |
# | poses | {{ off_the_middle('poses'):.0f}} mm |

# %% [markdown]
# Only the pose is really nonlinear; $\mathcal W$ and $P$ are multiplied by each other, and the model is linear in
# each
# alone{{ max(off_the_middle('templates', 'joints', 'posedirs'), off_the_middle('weights')) < 1e-9 < 1 < min(off_the_middle('weights', 'posedirs'), off_the_middle('poses')) }}.
# So training can take turns:
#
# - **poses**: each registration by itself, nonlinear least squares (lectures 6 and 7);
# - **surfaces**: $\hat T$, $\hat J$ and $P$, all people at once: *one* linear least-squares problem;
# - **weights**: each vertex by itself, linear least squares over numbers that are not negative and sum
#   to one.

# %% slide [markdown]
# ## So training takes turns
#
# - **Poses**: each registration, nonlinear least squares
# - **Surfaces**: $\hat T$, $\hat J$, $P$ of all people, *one* linear problem
# - **Weights**: each vertex, linear, not negative, sum one. No turn lets the cost rise.

# %% [markdown]
# Each minimises the same cost over other unknowns, so none lets it rise.
#
# ## The other terms
#
# Data alone leave much open. SMPL's cost has four more terms,
# $E = E_D + \lambda_Y E_Y + \lambda_J E_J + \lambda_P E_P + \lambda_W E_W$:
#
# | term | what | says |
# | --- | --- | --- |
# | $E_Y$ | $\sum_s \left( \lambda_U \lVert \hat J_s - U(\hat J_s) \rVert^2 + \lVert \hat T_s - U(\hat T_s) \rVert^2 \right)$ | people are alike on both sides |
# | $E_J$ | $\sum_s \lVert \mathcal J_I \hat T_s - \hat J_s \rVert^2$ | a joint is near the middle of the ring where its segments meet |
# | $E_P$ | $\lVert P \rVert_F^2$ | blend shapes are small |
# | $E_W$ | $\lVert \mathcal W - \mathcal W_I \rVert_F^2$ | weights are near those of blurred segments |

# %% slide [markdown]
# ## Data alone leave much open
#
# | term | says |
# | --- | --- |
# | $E_Y$ | people are alike on both sides |
# | $E_J$ | a joint is near the middle of its ring |
# | $E_P = \lVert P \rVert_F^2$ | blend shapes are small |
# | $E_W$ | weights are near those of blurred segments |

# %% [markdown]
# Two mistakes are easily made here. The first concerns $E_P$: the norm $\lVert P \rVert_F$ has a root in it, and the
# term is its square. Without the square, this would not be a least-squares problem. The second concerns $U$, which is
# a mirror: it changes the sign of $x$ **and** exchanges left and right vertices. With one of the two alone, a perfectly
# symmetric body is called uneven:

# %% slide [markdown]
# ## Two mistakes that are easily made
#
# - $\lVert P \rVert_F$ has a root in it; without the square it is no least-squares term.
# - A mirror changes the sign of $x$ **and** exchanges left and right vertices.

# %%
mirror = start.mirror()
alike = start.template  # the tube before anything was random: alike on both sides
for name, U in {
    "both": mirror.points(alike),
    "x changes its sign": alike * [-1, 1, 1],
    "left and right exchanged": alike[mirror.vertices],
}.items():
    print(f"{name:25} |T - U(T)| = {np.linalg.norm(alike - U):.2f} m")

# %%
source(Mirror.points)

# %% slide [markdown]
# ## One half of a mirror calls a symmetric body uneven
#
# | $U$ | $\lVert T - U(T) \rVert$ |
# | --- | --- |
# | both | {{ np.linalg.norm(alike - mirror.points(alike)):.0f}} m |
# | $x$ changes its sign | {{ np.linalg.norm(alike - alike * [-1, 1, 1]):.2f}} m |
# | left and right exchanged | {{ np.linalg.norm(alike - alike[mirror.vertices]):.2f}} m |

# %% [markdown]
# ## Taking turns
#
# Only both together are
# right{{ np.allclose(alike, mirror.points(alike), atol=0) and not np.allclose(alike, alike[mirror.vertices], atol=0.1) }}.
# Everybody begins as the plain tube, unbent. First come the poses: each segment is turned onto its
# vertices, and then the poses are fitted to the *edges* of the mesh, because edges do not depend on
# where it stands. Then come the blocks. This is the linear one; `NormalEquations` are $J^\top J$ and
# $J^\top e$, and `solve` uses conjugate gradients, since $J^\top J$ for a real body would not fit in
# memory:

# %% slide [markdown]
# ## Taking turns, from the plain tube
#
# - Poses first, by the *edges* of the mesh: they do not depend on where it stands.
# - The linear block by conjugate gradients: $J^\top J$ of a real body does not fit into memory.

# %%
source(blocks.fit_linear)

# %% [markdown]
# The log names the blocks. `rest` fits templates and joints, with $P$ held: while poses are rough, $P$ would learn
# their errors. `surfaces` fits $P$ too. `regressor` renews $\mathcal J$, with which $E_J$ compares the joints from then
# on, and no longer with the rings. A round is `regressor`, `surfaces` and `poses`. After two rounds, `together` takes a
# few Gauss-Newton steps in all unknowns. The block `weights` comes only once, near the end; but the steps in all
# unknowns change weights as well.

# %%
model = train_poses(few, start, alternation(rounds=2))
print(f"before: cost {sum(model.log[0].before.values()):.0f}")
for entry in model.log:
    total = sum(entry.after.values())
    print(
        f"{entry.block:9} cost {total:8.1f}, E_D {entry.after['E_D']:7.1f}, E_P {entry.after['E_P']:6.1f}"
    )
print(
    f"registrations are met to {1e3 * model.objective.rms(model.estimate):.2f} mm per coordinate; noise is 1 mm"
)
W = model.estimate.weights
print(
    f"weights: least {W.min():.0f}, rows sum to 1 within {np.abs(W.sum(axis=1) - 1).max():.0e}, "
    f"at most {(W > 0).sum(axis=1).max()} for a vertex"
)

costs = [sum(model.log[0].before.values()), *(sum(one.after.values()) for one in model.log)]
falls = -np.diff(costs)  # by block
together = [one.block for one in model.log].index("together")
last_round = falls[together - 3 : together].sum()  # regressor, surfaces, poses

with house_style():
    figure, (ax,) = sheet(8, 4.4)
    plot_costs(model.log, ax=ax)
Picture(
    figure,
    "The cost of training, block by block. The first block does most; then taking turns creeps, and the "
    "block `together`, a few Gauss-Newton steps in all unknowns, goes on. The sum never rises, though "
    "single terms may.",
)

# %% slide [markdown]
# ## The first block does most, then it creeps
#
# - The last round of turns lowers the cost by {{ last_round:.1f}}, a few steps in all unknowns by
#   {{ falls[together]:.0f}}.

# %% [markdown]
# The last round of taking turns lowered the cost by {{ last_round:.1f}}, and the steps in all unknowns
# lowered it by
# {{ falls[together]:.0f}}{{ falls.argmax() == 0 and falls.min() >= -1e-9 * costs[0] and 5 * last_round < falls[together] }}.
# Why does taking turns advance so slowly? Suppose that we turn one joint a little in all poses, and let $P$ make up
# for
# it. Either change alone makes the fit worse, but both together hardly change it. Alternation cannot move along such
# a valley, because it makes one change at a time. A Gauss-Newton step in all unknowns can.

# %% slide [markdown]
# ## Why turns creep
#
# - Turn a joint a little in all poses, and let $P$ make up for it: each alone hurts, both together hardly
#   matter.
# - One change at a time cannot move along such a valley.

# %% slide [markdown]
# ## Better than the noise is no success
#
# - Met to {{ 1e3 * model.objective.rms(model.estimate):.2f}} mm; the noise is 1 mm.
# - 16 meshes for each coordinate, and 45 blend shapes and two templates to explain them

# %% [markdown]
# The fit is *better* than the noise, {{ 1e3 * model.objective.rms(model.estimate):.2f}} mm in place of 1 mm. That is
# no success. Each coordinate of each vertex has 16 meshes to
# explain, and 45 pose blend shapes and two people's templates to do it with, so it has learned the noise.
#
# ## How large may blend shapes be?
#
# In SMPL there are {{ 9 * 23 }}, and few poses cannot determine them all. The effect of $\lambda_P$ shows best when
# everything but $P$ is known. Then, with a row $f_j$ of features and a row $d_j$ of un-posed
# displacements for each of 40 meshes,
#
# $$
# \min_P \sum_j \| d_j - P f_j \|^2 + \lambda \| P \|_F^2
# \qquad\Rightarrow\qquad P^\top = (F^\top F + \lambda I)^{-1} F^\top D .
# $$


# %% slide [markdown]
# ## How large may blend shapes be?
#
# $$ P^\top = (F^\top F + \lambda I)^{-1} F^\top D $$
#
# - In SMPL there are {{ 9 * 23}}; few poses cannot determine them all.
# - 40 poses, 45 shapes, everything else known


# %%
def lesson(n, seed, noise):
    """Features (n, 45) of n poses of the mean person, and un-posed displacements (n, 3 N) m."""
    poses = 0.6 * np.random.default_rng(seed).standard_normal((n, 6, 3))
    meshes = true.vertices(poses)
    meshes += noise * np.random.default_rng(seed + 1).standard_normal(meshes.shape)
    T = true.template
    whole = Estimate(
        T[None], (true.J_regressor @ T)[None], true.posedirs, true.weights, poses, true.parents
    )
    at = SkinningPass.of(whole, slice(0, n), np.zeros(n, dtype=int))
    rest = np.linalg.solve(at.blended, (meshes - whole.subtree_weights @ at.shifts)[..., None])[
        ..., 0
    ]
    return at.features, (rest - T).reshape(n, -1)


F, D = lesson(40, seed=10, noise=0.002)
F_test, D_test = lesson(100, seed=20, noise=0.0)
lambdas = 10.0 ** np.arange(-4, 3.5, 0.5)
sizes, learned, unseen = [], [], []
for lam in lambdas:
    P = np.linalg.solve(F.T @ F + lam * np.eye(45), F.T @ D)
    sizes.append(np.linalg.norm(P))
    learned.append(1e3 * np.sqrt(np.mean((F @ P - D) ** 2)))
    unseen.append(1e3 * np.sqrt(np.mean((F_test @ P - D_test) ** 2)))
best = int(np.argmin(unseen))
for i in (0, best, -1):
    print(
        f"lambda {lambdas[i]:8.4f}: |P| {sizes[i]:.3f} m, training error {learned[i]:.2f} mm, "
        f"in unseen poses {unseen[i]:.2f} mm"
    )
print("|P| falls all the way:", bool((np.diff(sizes) < 0).all()))
print(f"no blend shapes: {1e3 * np.sqrt(np.mean(D_test**2)):.2f} mm in unseen poses")

with house_style():
    figure, (ax,) = sheet(7.5, 3.6)
    ax.semilogx(lambdas, learned, "s--", ms=4, label="training error (with noise)")
    ax.semilogx(lambdas, unseen, "o-", ms=4, label="in unseen poses (without)")
    ax.set(xlabel="lambda", ylabel="displacements off by (mm, rms)", ylim=(0, None))
    ax.legend(loc="upper center")
Picture(
    figure,
    "40 poses teach 45 shapes. The training error only rises with lambda; the error in unseen "
    "poses has a minimum. Left of it noise is learned, right of it too little.",
)

# %% slide [markdown]
# ## Choose $\lambda$ on poses that were not learned from
#
# - By the training error it should be 0.
# - In unseen poses: {{ unseen[0]:.2f}} mm with the least that was tried, {{ unseen[best]:.2f}} mm with
#   {{ lambdas[best]:.2g}}

# %% [markdown]
# By the training error alone, $\lambda$ should be
# zero{{ np.argmin(learned) == 0 and (np.diff(learned) > 0).all() and (np.diff(sizes) < 0).all() }}. In unseen poses
# {{ unseen[best]:.2f}} mm are reached with $\lambda = {{ lambdas[best]:.2g}}$, and {{ unseen[0]:.2f}} mm with the
# least{{ 0 < best < len(lambdas) - 1 and unseen[best] < 0.6 * min(unseen[0], unseen[-1]) }}. One needs poses that $P$
# was not learned from.
# (What SMPL's authors used we could not verify, and do not quote.)
#
# ## Joints from vertices
#
# Training gave every person $s$ of the multi-pose set a rest surface $\hat T_s$ and joints $\hat J_s$. (It has to be
# this set, because only poses show where a joint is.) For a new person there
# is a surface only. So for each joint find a row $r$ of $\mathcal J$, one for all people, with
# $r \hat T_s \approx \hat J_s$. First by ordinary least squares; then with $r \ge 0$ and $\sum r = 1$,
# which we call shares. Both are tried on new people, and on one person who is moved by a metre:

# %% slide [markdown]
# ## Joints from vertices: a row for each joint
#
# $$ r\, \hat T_s \approx \hat J_s, \qquad r \ge 0, \quad \sum r = 1 $$
#
# - One row for all people, so that a new person has joints
# - With and without the conditions?

# %%
rng = np.random.default_rng(1)


def persons(n):
    """Rest surfaces (n, N, 3) m and joints (n, K, 3) m, known to 2 mm."""
    T = true.template + np.moveaxis(true.shapedirs @ rng.standard_normal((3, n)), 2, 0)
    J = np.stack([true.J_regressor @ one for one in T])
    return T, J + 0.002 * rng.standard_normal(J.shape)


T, J = persons(10)
T_new, J_new = persons(100)
flat = T.transpose(0, 2, 1).reshape(30, -1)  # a row for each coordinate of each person
target = J.transpose(0, 2, 1).reshape(30, -1)
free = np.linalg.lstsq(flat, target, rcond=None)[0].T  # (K, N)
as_shares = fit_joint_regressor(T, J, start.rings()).matrix.toarray()
new_error, lag = {}, {}  # mm
for name, R in (("least squares", free), ("shares", as_shares)):
    seen, new = (
        1e3 * np.sqrt(np.mean((R @ t - j)[:, 1:] ** 2)) for t, j in ((T, J), (T_new, J_new))
    )
    away = np.linalg.norm((R @ (T[0] + [0, 1, 0]) - R @ T[0] - [0, 1, 0])[1:], axis=1)
    new_error[name], lag[name] = new, 1e3 * away.max()
    print(
        f"{name:13} known people {seen:.2f} mm, new {new:.2f} mm; moved by 1 m, joints lag by up to "
        f"{lag[name]:.1f} mm; least entry {R.min():+.2f}, {np.mean((R[1:] != 0).sum(axis=1)):.0f} of 66 "
        "entries"
    )

# %% slide [markdown]
# ## Without shares, joints stay behind
#
# - New people: {{ new_error['least squares']:.2f}} mm by least squares, {{ new_error['shares']:.2f}} mm by
#   shares
# - Somebody moved by 1 m: joints lag by {{ lag['least squares']:.0f}} mm; with shares they go
#   along.{{ lag['shares'] < 0.05 }}
# - Most shares become zero by themselves.

# %% [markdown]
# On people who stand where the others stood, the two are nearly alike: {{ new_error['least squares']:.2f}} and
# {{ new_error['shares']:.2f}} mm. But least squares has never seen anybody move, and leaves the joints up to
# {{ lag['least squares']:.0f}} mm
# behind{{ lag['shares'] < 0.05 and as_shares.min() == 0 and (as_shares[1:] != 0).sum(axis=1).mean() < 33 }}. Shares
# go along, keep joints inside the hull of the skin,
# and most of their entries become zero by themselves. The library solves it row by row, by non-negative
# least squares (NNLS, [Lawson and Hanson](https://doi.org/10.1137/1.9781611971217)):

# %%
source(fit_joint_regressor)

# %%
source(shares_to_zero)

# %% [markdown]
# NNLS knows $w \ge 0$, and nothing of a sum. How does the sum get in? Suppose first that $A w$ should be zero. We
# append to $A$ a row of ones, whose target is 1. For $w = t\, s$, with shares $s$, NNLS then minimises
# $t^2 \|A s\|^2 + (t - 1)^2$. With the best $t$ this is $\|A s\|^2 / (1 + \|A s\|^2)$, which grows with $\|A s\|$. So it
# finds the best shares, and dividing $w$ by its sum takes off the factor $t$.
#
# For a target $b$ that is not zero, this would not hold. But since $\sum_k w_k = 1$,
#
# $$ \sum_k w_k a_k - b = \sum_k w_k (a_k - b) . $$
#
# So we subtract $b$ from every column $a_k$, and the target is zero. The regressor does so with the joints.

# %% slide [markdown]
# ## Sum one, by NNLS
#
# $$ \sum_k w_k a_k - b = \sum_k w_k (a_k - b) \qquad\text{since}\qquad \sum_k w_k = 1 $$
#
# - Subtract the target from every column: now it is zero.
# - Append a row of ones, whose target is 1; divide by the sum at the end.

# %% [markdown]
# ## The whole of it in a sentence
#
# For a body as tiny as a tube with one joint, it is not necessary to take turns. Training is fitting
# with other free names: the template, and everybody's pose, shape and place, are blocks of one
# `Problem`,
#
# $$ \min_{\bar T} \sum_j \min_{\theta_j, \beta_j} \| M(\theta_j, \beta_j; \bar T) - V_j \|^2 . $$


# %%
def in_a_sentence(body: wb.SkinnedBody, meshes: np.ndarray) -> tuple[wb.Problem, wb.Values]:
    """The problem over the template and everybody's pose, betas and trans, and where it begins."""
    learning = body.freed("template")
    terms, start = [], {"template": body.template}
    for j, mesh in enumerate(meshes):
        symbols = [block.symbol for block in learning.blocks(f"scan {j}/")]
        terms.append(wb.residuals.vertices(learning.points(*symbols), mesh, sigma=0.001))
        start |= learning.start(f"scan {j}/")
        start[f"scan {j}/trans"] = mesh.mean(axis=0) - body.template.mean(axis=0)
    return wb.Problem(terms, tuple(start)), start


# %% slide [markdown]
# ## Training in a sentence: fitting with other free names
#
# $$ \min_{\bar T} \sum_j \min_{\theta_j, \beta_j} \| M(\theta_j, \beta_j; \bar T) - V_j \|^2 $$
#
# ```python
# learning = body.freed("template")
# ...
# symbols = [block.symbol for block in learning.blocks(f"scan {j}/")]
# terms.append(wb.residuals.vertices(learning.points(*symbols), mesh, sigma=0.001))
# ...
# return wb.Problem(terms, tuple(start)), start
# ```

# %%
rng = np.random.default_rng(0)
pipe = tube(rings=7, around=6)
meshes = pipe.vertices(0.6 * rng.standard_normal((5, 2, 3)), rng.standard_normal((5, 1)))
dented = replace(pipe, template=pipe.template + 0.01 * rng.standard_normal(pipe.template.shape))
problem, first = in_a_sentence(dented, meshes)
solution = wb.solve(problem, first)
values = first | solution.values
here = problem.linearize(values)
print(
    f"{len(here.gradient)} unknowns, {len(here.residual)} residuals: cost from "
    f"{solution.trace[0].cost:.0f} to {solution.cost:.1e}"
)
print(
    "rank of the Jacobian:",
    here.rank,
    "- so",
    len(here.gradient) - here.rank,
    "directions change no mesh:",
)
known = {
    f"the template moves along {axis}, everybody back": {"template": e + 0 * pipe.template}
    | {f"scan {j}/trans": -e for j in range(len(meshes))}
    for axis, e in zip("xyz", np.eye(3), strict=True)
}
known["the mean moves along the shape direction, all betas back"] = {
    "template": pipe.shapedirs[:, :, 0]
} | {f"scan {j}/betas": -np.ones(1) for j in range(len(meshes))}
unchanged = []
for name, change in known.items():
    every = {block.name: np.zeros(block.shape) for block in problem.free.blocks}
    step = problem.free.pack(every | change)
    unchanged.append(np.linalg.norm(here.jacobian @ step) / np.linalg.norm(step))
    print(f"  {name}: {unchanged[-1]:.0e}")

# %% slide [markdown]
# ## The meshes are met, the template is not determined
#
# - {{ len(here.gradient)}} unknowns, rank {{ here.rank}}: {{ len(here.gradient) - here.rank}} directions
#   change no mesh.
# - The template moves, everybody moves back; the mean moves, all betas move back.
# - Decide: a convention for the root, a prior on $\beta$.

# %% [markdown]
# The meshes are met, and yet the template is not determined: if it moves, and everybody moves back, nothing
# changes{{ solution.cost < 1e-12 and len(here.gradient) - here.rank == 5 and max(unchanged) < 1e-9 }}. In the fifth
# direction the template turns about the tube's own axis, and everybody
# turns back. Nothing in the data says where a template ought to stand, or who is the mean. This has to
# be decided: by a convention for the root, and by a prior on $\beta$.
#
# ## Every term on symbols
#
# The same can be done with all terms and all unknowns of SMPL's training. The workbench writes each term as
# residuals on symbols, and `train_poses` above minimises the same sum by blocks. For a body of 20 vertices, with a
# root and one joint for its upper half, the whole Jacobian can be looked at. Two synthetic people are
# registered in ten poses each, without noise, and we look at the Jacobian at the true values, where the
# registrations are met exactly.

# %% slide [markdown]
# ## Every term on symbols
#
# - A body of 20 vertices, two people, ten poses each
# - The whole Jacobian can be looked at, at the truth.

# %%
plain = limb(5, 4)
upper = np.where(plain.template[:, 1] > 0.05, 1, 0)
crested = Start(plain.template, plain.faces, (-1, 0), ("root", "crest"), upper)
both_sides = Mirror(find_mirror(plain.template, plain.faces), np.arange(2))
mold = random_smpl(crested, 2, seed=3)
twenty, drawn = draw_registrations(mold, 2, 10, seed=4)
bodies = mold.vertices(betas=drawn.betas)
centres = np.stack([mold.J_regressor @ one for one in bodies])
truth = Estimate(bodies, centres, mold.posedirs, mold.weights, drawn.poses, mold.parents)
terms = Objective(twenty, crested.rings(), crested.weights(), both_sides, Sigmas(), None)
form = SymbolicTraining.of(mold, terms)
at_truth = form.values(truth)
sizes = {}
for name in ("E_D", "E_Y", "E_J", "E_P", "E_W"):
    alone = form.problem([name])
    sizes[name] = alone.linearize(at_truth).shape
    kinds = dict.fromkeys(block.split("/")[-1] for block in alone.free.names)
    print(
        f"{name}: {sizes[name][0]:4} residuals of {sizes[name][1]:3} unknowns: {', '.join(kinds)}"
    )

# %%
source(SymbolicTraining.problem)

# %%
whole = wb.diagnose(form.problem(["E_D", "E_Y", "E_J", "E_P", "E_W"]), at_truth)
with house_style():
    figure, (ax,) = sheet(9.5, 6)
    plot_sparsity(whole, ax=ax)
Picture(
    figure,
    "The Jacobian of all terms, blue where an entry can differ from zero. Each registration reads its own "
    "pose and place, and its own person's template and joints; only the blend shapes and the weights, on the "
    "left, are read by all registrations. E_P and E_W are diagonal. Small terms are drawn taller than to scale.",
)

# %% slide [markdown]
# ## Two people meet in blend shapes and weights
#
# - {{ 100 * whole.density:.1f}} % of the entries can differ from zero.

# %% [markdown]
# Most of it is zero: {{ 100 * whole.density:.1f}} % of the entries can differ from zero. The two people meet only in
# the blend shapes and
# the weights.
#
# Now the rank. The diagnosis looks for the directions that change no residual and break no constraint
# (the weights of a vertex sum to one), and tries to give each a name:

# %%
data_alone = wb.diagnose(form.problem(["E_D"]), at_truth)
small_shapes = wb.diagnose(form.problem(["E_D", "E_P"]), at_truth)
for name, found in (("E_D", data_alone), ("E_D + E_P", small_shapes), ("all five", whole)):
    n = found.shape[1]
    print(f"{name:9}: {n} unknowns, rank {found.rank}, open {n - found.rank}")
print("open with E_D alone, of the first person and of all:")
for direction in data_alone.null_directions:
    if "subject 1" not in direction.name:
        print("  " + direction.name)
print("open with all five:")
for direction in whole.null_directions:
    print("  " + direction.name)


def open_in(found, words=""):
    """How many directions a diagnosis leaves open whose names hold these words."""
    return sum(words in direction.name for direction in found.null_directions)


# %% slide [markdown]
# ## What registrations alone leave open: {{ open_in(data_alone)}} directions
#
# - {{ open_in(data_alone, 'template and')}} shifts of template and joints;
#   {{ open_in(data_alone, 'joints[root]')}} moves of a root joint
# - {{ open_in(data_alone, 'a rotation about')}} rotations of everything at rest
# - {{ open_in(data_alone) - 15}} in which blend shapes push the surface along an axis

# %% [markdown]
# Registrations alone leave {{ open_in(data_alone)}} directions open:
#
# - {{ open_in(data_alone, 'template and')}} **translations**, three for each person: template and joints move, and
#   all places move back;
# - {{ open_in(data_alone, 'joints[root]')}} moves of a **root joint**: wherever the root's centre of rotation is, the
#   place of each registration
#   makes up for it;
# - {{ open_in(data_alone, 'a rotation about')}} **rotations** of everything at rest, blend shapes included, which
#   every root turns back;
# - {{ open_in(data_alone) - 15}} in which **blend shapes** push the whole surface along the joint's axis, which the
#   joint's rotation
#   leaves as it is, and which the places undo. The diagnosis has no name for
#   {{ sum(one.kind == 'mixed' for one in data_alone.null_directions)}} of them: each is a mixture of hundreds
#   of numbers.
#
# $E_P$ closes the last two kinds, since both change blend shapes, and leaves
# {{ open_in(small_shapes)}}{{ open_in(small_shapes, 'template and') == open_in(small_shapes, 'joints[root]') == 6 }}.
# $E_J$ ties the roots to the
# surface, and $E_Y$ forbids shifts along $x$, off the plane of the mirror. No term says where along $y$ and $z$ a
# person stands: {{ open_in(whole)}} directions stay open with all
# five{{ all(one.name.startswith(('a translation along y of', 'a translation along z of')) for one in whole.null_directions) }}.
# These are closed by a convention. We hold $y$ and
# $z$ of the place of one registration for each person:

# %% slide [markdown]
# ## Terms close most of them, a convention the rest
#
# - $E_P$ leaves {{ open_in(small_shapes)}}, all five terms {{ open_in(whole)}}: where a person stands along
#   $y$ and $z$.
# - Hold four numbers, and the rank is full.

# %%
anchors = ("scan 0/trans", "scan 10/trans")
every = whole.problem.free.names
held = wb.diagnose(
    whole.problem.freeing(*(f"{name}[0]" if name in anchors else name for name in every)), at_truth
)
print(f"with 4 numbers held: {held.shape[1]} unknowns, rank {held.rank}")

# %% slide [markdown]
# ## Holding what nothing determines costs nothing
#
# - {{ held.shape[1]}} unknowns, rank {{ held.rank}}, as before{{ held.rank == whole.rank }}

# %% [markdown]
# The rank is full{{ held.rank == held.shape[1] == whole.rank }}, and it is the rank from before: holding numbers that
# nothing determines takes nothing
# from what the model can explain.
#
# ## What to remember
#
# - Principal components of meshes that were not un-posed learn poses.
# - The multi-pose set teaches joints, weights and $P$, and the multi-shape set teaches $\bar T$ and $S$.
# - Rest surfaces, joints and $P$ together are one linear problem, and the weights are another. Only the poses are not
#   linear. Taking turns never raises the cost, but it is slow.
# - Penalties are chosen on held-out poses. Regressed with shares, joints stay inside the hull of the skin
#   and move along with it.
# - Some directions are not determined by any data. A diagnosis names them, and a convention closes them.

# %% slide [markdown]
# ## What to remember
#
# - Un-pose before principal components. Multi-pose teaches joints, weights and $P$; multi-shape $\bar T$ and
#   $S$.
# - Only poses are nonlinear; taking turns never raises the cost, and is slow.
# - Penalties are chosen on held-out poses; joints are shares of vertices; conventions close what no data
#   determine.
