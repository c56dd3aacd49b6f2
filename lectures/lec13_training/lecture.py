# %% [markdown]
# # Training a body model
#
# **Where do the model's own numbers come from?**
#
# SMPL has a template, shape directions, pose blend shapes, weights and a joint regressor: millions of numbers
# that nobody set by hand. They were found by least squares on **registrations**, meshes of many people in
# many poses, all with the same vertices. We make such data up from a small body whose numbers we know, so
# we can see what comes back. Lengths are in metres, angles in radians; nothing here was measured on people.

# %%
import numpy as np

from workbench.course import Picture, source
from workbench.geometry.rotation import nearest_rotation
from workbench.plots import house_style, sheet
from workbench.training.made_up import draw_registrations, random_smpl, worm
from workbench.training.posing import Posing
from workbench.training.simplex import shares_to_zero
from workbench.training.unposing import unpose

# %% [markdown]
# ## Made-up registrations
#
# The body is a worm of 66 vertices and 6 joints, with three shape directions and random arrays. Six subjects
# stand in twelve poses each: $V_j$, with poses $\theta_j$ that training would have to find as well. To see one
# thing at a time we take the poses as given, until the last section.

# %%
guess = worm(11, 6)
body = random_smpl(guess, 3, seed=0)
registrations, truth = draw_registrations(body, 6, 12, seed=1)
meshes = registrations.read(slice(0, 72)).vertices  # (72, 66, 3) m
subject = registrations.subject
print("registrations", meshes.shape, "of", subject.max() + 1, "subjects; pose features:",
      9 * (body.n_joints - 1))  # fmt: skip

# %% [markdown]
# ## Shape directions, the naive way
#
# Lecture 5 has shape directions as principal components: the main ways in which people differ. So take the
# components of the meshes:


# %%
def components(meshes):
    """Deviations from the mean, their singular values, and scores along the components."""
    flat = meshes.reshape(len(meshes), -1)
    U, s, _ = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    return s, U * s


def between(scores):
    """How much of the variance of a score is between subjects; the rest is within, from pose."""
    means = np.array([scores[subject == k].mean() for k in range(6)])
    return np.var(means[subject]) / np.var(scores)


centred = meshes - meshes.mean(axis=1, keepdims=True)
s, scores = components(centred)
print(
    f"the first three components hold {100 * np.sum(s[:3] ** 2) / np.sum(s**2):.0f} % of the variance"
)
print("of each, between subjects:", *(f"{100 * between(scores[:, k]):.0f} %" for k in range(3)))

# %% [markdown]
# The components are poses. A person who bends differs more from himself than from others. So poses have to be
# taken out first.
#
# ## Un-posing is linear
#
# Skinning takes the rest vertex $t_i$, with its pose blend shape, to $v_i = M_i\,(t_i + P_i f(\theta)) + \dots$,
# where $M_i = \sum_k w_{ik} R_k$ is the blend of the rotations. At a given pose all of it is linear in the rest
# surface, the joints included, for they are a linear function of it. With $D_m = R_{\text{parent}(m)} - R_m$ and
# $c_{im}$ the weight that hangs below joint $m$,
#
# $$ v_i = M_i\,(t_i + P_i f) + \sum_m c_{im} D_m j_m + \text{trans}, \qquad j = \mathcal J\, t . $$
#
# One linear solve goes back. (Not $M_i^\top$ in the place of $M_i^{-1}$: a blend of rotations is no rotation.)

# %%
source(unpose)

# %%
at_rest = np.array([
    unpose(body, pose, mesh - trans).vertices
    for pose, mesh, trans in zip(truth.poses, meshes, truth.trans, strict=True)
])  # fmt: skip
s_rest, scores_rest = components(at_rest)
print(
    f"one person un-posed from 12 poses: vertices differ by {np.ptp(at_rest[subject == 0], axis=0).max():.0e} m"
)
print(f"the first three components hold {100 * np.sum(s_rest[:3] ** 2) / np.sum(s_rest**2):.1f} %")
print(
    "of each, between subjects:", *(f"{100 * between(scores_rest[:, k]):.0f} %" for k in range(3))
)

with house_style():
    figure, axes = sheet(10, 3.6, columns=2)
    for ax, found, title in zip(
        axes, (scores, scores_rest), ("as registered", "un-posed"), strict=True
    ):
        for k in range(6):
            ax.plot(*found[subject == k, :2].T, "osD^vP"[k], ms=5, label=f"subject {k + 1}")
        ax.set(title=title, xlabel="first component (m)", ylabel="second component (m)")
    axes[1].legend(fontsize=7, ncols=2)
Picture(
    figure,
    "Every registration by its first two components. Left: poses, with everybody all over the place. "
    "Right: un-posed, the twelve of each subject fall on one point, and the components are shape.",
)

# %% [markdown]
# ## Pose blend shapes: who is taught by what
#
# What skinning gets wrong in pose $j$ is $d_j$, three numbers for each vertex. With the features $f_j = f(\theta_j)$
# as rows of $X$, and the $d_j$ as rows of $D$, the pose blend shapes are least squares, with a price:
#
# $$ \min_P \|X P - D\|^2 + \lambda \|P\|_F^2
#    \quad\Longleftrightarrow\quad (X^\top X + \lambda I)\, P = X^\top D . $$
#
# (The price is the *squared* norm. Where the sources define $\|\cdot\|_F$ they print the root; without the square
# the problem would not be linear.) Why a price? Count poses. SMPL's features are 207, here 45; with fewer poses than features
# there are many $P$ that meet the data exactly, noise and all.

# %%
rng = np.random.default_rng(3)


def lesson(poses, noise=0.002):
    """Features (n, 45) of random poses, and what skinning gets wrong there (n, 198) m, with noise."""
    axes = rng.standard_normal((poses, 6, 3))
    X = Posing.of(0.8 * axes / np.linalg.norm(axes, axis=2, keepdims=True), body.parents).features
    D = X @ body.posedirs.reshape(-1, X.shape[1]).T
    return X, D + noise * rng.standard_normal(D.shape)


def ridge(X, D, damping):
    """The P (F, 198) of above."""
    return np.linalg.solve(X.T @ X + damping * np.eye(X.shape[1]), X.T @ D)


few, many = lesson(30), lesson(400, noise=0.0)
prices = np.logspace(-6, 2, 33)
errors = np.array([
    [1e3 * np.sqrt(np.mean((X @ P - D) ** 2)) for X, D in (few, many)]
    for P in (ridge(*few, price) for price in prices)
])  # fmt: skip
sizes = [np.linalg.norm(ridge(*few, price)) for price in prices]
best = np.argmin(errors[:, 1])
for k, said in ((0, "hardly any price"), (best, "the best price"), (-1, "a high price")):
    print(f"{said:16}: lambda {prices[k]:7.1e}, |P| {sizes[k]:.3f} m, on its 30 poses "
          f"{errors[k, 0]:.2f} mm, on 400 others {errors[k, 1]:.2f} mm")  # fmt: skip

with house_style():
    figure, (ax,) = sheet(7.5, 3.6)
    ax.semilogx(prices, errors[:, 0], "--", label="the 30 poses it was taught")
    ax.semilogx(prices, errors[:, 1], label="400 others")
    ax.plot(prices[best], errors[best, 1], "k*", ms=10)
    ax.set(xlabel="price λ of pose blend shapes", ylabel="rms error (mm)")
    ax.legend()
Picture(
    figure,
    "With 45 features and 30 poses the data can be met exactly, noise included, and other poses pay for "
    "it. A price on |P|² makes the taught poses worse and others better; too high a one spoils both.",
)

# %% [markdown]
# SMPL was trained on two sets: a **multi-pose** set (few people, many poses) and a **multi-shape** set (many
# people, one pose). Which teaches what? One of the sources has it the wrong way round. The rank of the features
# decides:

# %%
one_pose = np.repeat(0.1 * rng.standard_normal((1, 6, 3)), 200, axis=0)
features = Posing.of(one_pose, body.parents).features
print("rank of the features, 200 people in one pose:", np.linalg.matrix_rank(features), "of 45")
print("rank of the features, 6 people in 12 poses:  ",
      np.linalg.matrix_rank(Posing.of(truth.poses, body.parents).features), "of 45")  # fmt: skip
print("shape directions that 6 people can show: at most", 6 - 1)

# %% [markdown]
# One pose shows one combination of pose blend shapes, for any number of people. So the multi-pose set trains $P$,
# the weights $W$ and the regressor $\mathcal J$; the multi-shape set the template $\bar T$ and the shape
# directions $S$, once its people are un-posed with the $P$, $W$ and $\mathcal J$ of the other.
#
# ## The joint regressor: shares
#
# For a new person the joints have to come from the surface: $j = \mathcal J t$, a row of numbers for each joint.
# Plain least squares finds a row that gives the joints of the people it saw. A joint is *within* the body,
# though. If it is a mean of vertices, with **shares** $w_i \ge 0$ and $\sum_i w_i = 1$, it can never leave their
# convex hull, whoever the person is, and it moves with the body.

# %%
source(shares_to_zero)


# %%
def people(count, seed):
    """Rest surfaces (P, 66, 3) m and their joints, which were found to 2 mm."""
    rng = np.random.default_rng(seed)
    betas = rng.standard_normal((count, 3))
    surfaces = np.array([body.template + body.shapedirs @ beta for beta in betas])
    joints = np.array([body.J_regressor @ surface for surface in surfaces])
    return surfaces, joints + 0.002 * rng.standard_normal(joints.shape)


seen, seen_joints = people(6, 4)
new, new_joints = people(200, 5)
k = 1
plain = np.linalg.lstsq(
    seen.transpose(0, 2, 1).reshape(-1, 66), seen_joints[:, k].ravel(), rcond=None
)[0]
shares = shares_to_zero((seen - seen_joints[:, None, k]).transpose(0, 2, 1).reshape(-1, 66))
for name, w in (("plain least squares", plain), ("shares", shares)):
    off = (
        np.linalg.norm(w @ seen - seen_joints[:, k], axis=1),
        np.linalg.norm(w @ new - new_joints[:, k], axis=1),
    )
    there = np.linalg.norm(w @ (new + [1, 0, 0]) - new_joints[:, k] - [1, 0, 0], axis=1)
    print(f"{name:20} {np.sum(np.abs(w) > 1e-9):2} vertices, sum {w.sum():+.3f}: off by "
          f"{1e3 * off[0].mean():.1f} mm on 6 people, {1e3 * off[1].mean():.1f} mm on 200 others, "
          f"{1e3 * there.mean():.1f} mm if these stand 1 m further on")  # fmt: skip

# %% [markdown]
# As long as people stand where those of the data stood, both do alike. But the numbers of plain least squares sum to
# 0.72, so the joint stays 28 cm behind when the body moves on by a metre. The shares are few, though nobody asked
# for few: most of the conditions $w_i \ge 0$ end as equations. That is why SMPL's regressor is sparse.
#
# ## All at once: alternation
#
# In truth poses are unknown too. With the poses known, surfaces are a linear problem; with surfaces known, each
# pose is a small fit of its own. So one goes back and forth. In the smallest example a stiff thing was scanned ten
# times, and its shape $T$ and the rotations $R_j$ are both unknown:
#
# $$ E(T, R) = \sum_j \|T R_j^\top - V_j\|^2 . $$
#
# Best $R_j$ for a given $T$: the nearest rotation of lecture 2, of $V_j^\top T$. Best $T$ for given $R_j$: the mean
# of the scans turned back.

# %%
thing = at_rest[0] - at_rest[0].mean(axis=0)
turns = np.array([nearest_rotation(m) for m in rng.standard_normal((10, 3, 3))])
scans = thing @ turns.transpose(0, 2, 1) + 0.02 * rng.standard_normal((10, *thing.shape))


def energy(T, R):
    """E, m^2."""
    return np.sum((T @ R.transpose(0, 2, 1) - scans) ** 2)


T, falls = scans.mean(axis=0), []
for _ in range(12):
    R = np.array([nearest_rotation(scan.T @ T) for scan in scans])
    after_poses = energy(T, R)
    T = (scans @ R).mean(axis=0)
    falls += [after_poses, energy(T, R)]
print("E after each half of a round:", *(f"{e:.3f}" for e in falls[:10]), "... m^2")
print(
    "never rises:",
    bool((np.diff(falls) < 1e-12).all()),
    f"; E at the truth: {energy(thing, turns):.3f} m^2",
)

# %% [markdown]
# Every half of a round solves its part exactly, so the energy cannot rise: whoever programs this should assert it,
# and the workbench does. It can be slow, and it can end beside the best answer; the workbench ends with all names
# at once. The whole of training is this, with five terms,
#
# $$ E = E_D + \lambda_Y E_Y + \lambda_J E_J + \lambda_P E_P + \lambda_W E_W : $$
#
# data, symmetry, joints near the borders of parts, small pose blend shapes, weights near their first guess.
# `workbench train` runs it.
#
# ## What to remember
#
# - Take poses out first; the components of posed meshes are poses.
# - With poses and weights given, training is linear: un-posing, pose blend shapes with a price, shapes.
# - Many poses teach $P$, $W$, $\mathcal J$; many people teach $\bar T$ and $S$. Ranks say so.
# - Joints are shares of vertices: within the body, and few.
# - Alternate between what is easy alone. The energy never rises; check that.
