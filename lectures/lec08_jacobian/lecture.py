# %% [markdown]
# # The Jacobian: what cannot be seen
#
# **All 24 joints are known exactly. Is the pose?**
#
# The pose of a body is 24 rotation vectors, 72 numbers. Motion capture gives us the places of the 24
# joints, again 72 numbers. As many equations as unknowns: let us solve them. Angles are in radians,
# lengths in metres; the body is made up, so that the truth is known.

# %%
import numpy as np

import workbench as wb
from workbench.course import Picture, source
from workbench.diagnostics.rank_law import law_in_words, rank_of_observed_joints
from workbench.plots import (
    caption_sparsity,
    house_style,
    plot_distances,
    plot_singular_values,
    plot_sparsity,
    sheet,
)

body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
observed = wb.Block("observed", (24, 3), "m")
joints = body.joint_points(pose, betas, trans)
problem = wb.Problem(
    [wb.residuals.landmarks(joints, observed.symbol, sigma=0.01)], ["pose"], blocks=[observed]
)
rng = np.random.default_rng(0)
truth = 0.3 * rng.standard_normal((24, 3))
given = body.start() | {"observed": body.joints(truth)}

# %% [markdown]
# ## Solve, and look
#
# The residual is the joints of the body minus those that were seen, divided by 1 cm. (A residual
# divided by its sigma, the size that it usually has, is called **whitened**. It has no unit.) We solve
# twice, from two starts.

# %%
answers = {}
for name, start in (
    ("from rest", np.zeros((24, 3))),
    ("from elsewhere", truth + 0.4 * rng.standard_normal((24, 3))),
):
    solution = wb.solve(problem, given | {"pose": start})
    found = answers[name] = solution.values["pose"]
    joints_off = np.linalg.norm(body.joints(found) - body.joints(truth), axis=1).max()
    skin_off = np.linalg.norm(body.vertices(found) - body.vertices(truth), axis=1).max()
    print(
        f"{name:15}{solution.status.name}: joints off by {1e3 * joints_off:.0e} mm, "
        f"pose by up to {np.abs(found - truth).max():.2f} rad, skin by up to {1e3 * skin_off:.0f} mm"
    )

# %% [markdown]
# Both converged, both meet every joint, and both poses are wrong. So is the skin:

# %%
off = {
    name: 1e3 * np.linalg.norm(body.vertices(found) - body.vertices(truth), axis=1)
    for name, found in answers.items()
}
with house_style():
    figure, (ax,) = sheet(7.5, 5.0)
    plot_distances(body.vertices(answers["from rest"]), off["from rest"], body.faces, ax=ax)
Picture(
    figure,
    "The answer from rest, front and back, coloured by how far each vertex is from where it truly is. "
    "Every joint is met, and the skin is not: brightest is the crown of the head, then the left upper "
    "arm, which is turned about its bone, then both hands.",
)

# %% [markdown]
# No solver is to blame: there are many poses with these joints, and it found one. Counting equations
# did not show this. What does?
#
# ## A direction that nobody notices
#
# Take a step $p$ from the truth. To first order the residual changes by $J p$. If $J p = 0$, no
# equation notices. Such $p$ form the **null space** of the Jacobian, and the number of directions
# that *are* noticed is its **rank**. Singular values tell: $J = U S V^\top$, and a unit step along
# column $v_i$ of $V$ changes the residual by $s_i$.

# %%
there = given | {"pose": truth}
here = problem.linearize(there)
diagnosis = wb.diagnose(problem, there)
s = diagnosis.singular_values
print("the Jacobian:", here.jacobian.shape)
print("singular values 39 to 42:", *(f"{one:.1e}" for one in s[38:42]))
print("rank:", here.rank, "of", len(s))

# %%
with house_style():
    figure, (ax,) = sheet(8, 4.2)
    plot_singular_values(diagnosis, ax=ax)
Picture(
    figure,
    f"The {len(s)} singular values, largest first: how much the whitened residuals change for a step of "
    "one radian in that direction. Those below the dashed line, the tolerance, are drawn hollow: they "
    "are zero but for rounding. Along these directions, named on the right, the pose can change and no "
    "joint moves.",
)

# %% [markdown]
# Forty, and then a cliff of more than twelve decades. Which singular values count as zero, when numbers
# are rounded? The library asks how large rounding can make a singular value that ought to be zero:
# about as large as the largest one times the machine's precision times the size of the matrix. It first
# scales every column to the length 1, so that the unit of an unknown does not matter.

# %%
source(wb.Linearization.tolerance)

# %% [markdown]
# ## Why forty
#
# No computer is needed for that number. Turn joint $k$ by a small $\omega$: each joint $c$ that hangs
# on it moves by $\omega \times (x_c - x_k)$. Walk the tree from the leaves:
#
# - A **leaf** (a hand, a foot, the head) has nothing hanging on it. Its rotation moves no joint:
#   $0$ of $3$ are seen.
# - A joint with **one child** can turn about the bone $e$ to it, for $\omega \times e = 0$ where
#   $\omega \parallel e$. That turns the rest of the limb too; but the child can turn back. So $2$ are
#   seen.
# - A joint with **several children** has no axis that leaves all of them in place, unless the bones to
#   them lie on one line: $3$.
#
# If the body may move as a whole, $3$ more are seen.

# %%
print(law_in_words(body.parents, translation=False))
K = len(body.parents)
predicted = rank_of_observed_joints(body.parents, body.joints(truth), range(K), translation=False)
print("by walking the tree with the bones of this pose:", predicted)
ends = [15, 20, 21]
rank = rank_of_observed_joints(body.parents, body.joints(truth), ends, translation=False)
print(f"if only {', '.join(body.joint_names[k] for k in ends)} are seen: {rank} of 72")

# %% [markdown]
# (In the last line three points are seen, and each can be moved alone in all three directions by the
# joints above it: three times three.) The workbench does not stop at the number: it says which
# directions these are. The singular vectors are a basis of the null space that mixes all of them. The
# workbench looks in small named subspaces, the smallest first, so that each twist is found by itself.

# %%
print(diagnosis)

# %% [markdown]
# Try one. A twist of the left elbow, undone at the wrist, moves no joint and yet the forearm's skin:

# %%
twist = next(d for d in diagnosis.null_directions if d.joints == ("left_elbow", "left_wrist"))
for angle in (1e-3, 1e-2, 1e-1):
    turned = truth + angle * twist.vector.reshape(24, 3)
    moved = np.abs(body.joints(turned) - body.joints(truth)).max()
    skin = np.abs(body.vertices(turned) - body.vertices(truth)).max()
    print(f"{angle:5} rad: joints by {1e3 * moved:.1e} mm, skin by {1e3 * skin:.1e} mm")

# %% [markdown]
# A step that is ten times as long moves the skin ten times as far, and the joints a hundred times: to
# first order they do not move. (The exact path on which they stay is curved; the null space is its
# tangent.)
#
# ## Dense or sparse?
#
# A joint depends on the rotations above it and on no others. So most entries of this Jacobian are
# zero whatever the pose, and that pattern is known before anything is computed:

# %%
with house_style():
    figure, (ax,) = sheet(7.5, 5.2)
    plot_sparsity(diagnosis, ax=ax)
Picture(
    figure,
    caption_sparsity(diagnosis)
    + " Rows are the joints that move, three each, in the order of the columns. The five empty groups of "
    "columns are the leaves; the top three rows, the pelvis, move with nothing.",
)

# %%
print(f"{diagnosis.nonzeros} of {72 * 72} entries: {diagnosis.density:.1%}")
print("rank that the pattern alone allows:", diagnosis.structural_rank)
print("rank of these numbers:", diagnosis.rank)
largest = 6890 * 3 * (72 + 10)
print(
    f"a fit of SMPL to 6,890 vertices, with 72 + 10 unknowns: {largest:,} entries, "
    f"{8e-6 * largest:.0f} MB if all are kept"
)

# %% [markdown]
# The pattern knows of the leaves: 15 columns are empty, so the rank is at most 57. It does not know
# of the twists, which are a matter of numbers. That is why both are looked at. The pattern
# alone shows columns of zeros, a warning worth having before any solver is started.
#
# So, dense or sparse? The Jacobian of joints is sparse by nature. That of SMPL's vertices is not: its
# pose blend shapes (lecture 5) let every vertex depend on 23 rotations. But it has only 82 columns, and its 14 MB
# are easily kept as a dense matrix. With so few unknowns the pattern is worth more for what it tells
# than for the zeros that it saves; with thousands of them it is the other way round.
#
# ## Hardly seen
#
# Rank is a matter of yes or no. In practice much is seen, but only just. With noise of one sigma in
# every residual, the covariance of the answer is, to first order,
#
# $$ C = (J^\top J)^{-1} = V S^{-2} V^\top : $$
#
# a direction with singular value $s_i$ is known to $1/s_i$. Here we look at vertices instead of
# joints, every one to 1 cm. Now all is seen:

# %%
seen = wb.Block("seen", (body.n_vertices, 3), "m")
on_skin = wb.Problem(
    [wb.residuals.vertices(body.points(pose, betas, trans), seen.symbol, sigma=0.01)],
    ["pose"],
    blocks=[seen],
)
skin = on_skin.linearize(there | {"seen": body.vertices(truth)})
sigma = np.sqrt(np.diag(skin.covariance)).reshape(24, 3).max(axis=1)
print("rank:", skin.rank, f"  condition: {skin.svd[1][0] / skin.svd[1][-1]:.0f}")
for k in (*np.argsort(sigma)[:3], *np.argsort(sigma)[-3:]):
    hang = int((body.weights.argmax(axis=1) == k).sum())
    print(
        f"  {body.joint_names[k]:15} known to {np.degrees(sigma[k]):5.2f} degrees (1 sigma), "
        f"{hang:2} vertices hang on it most of all"
    )

# %% [markdown]
# (Of the three numbers of a joint, the least well known is given.) With this centimetre the pelvis is
# known to less than 1 degree, because a turn of the pelvis moves the whole body. The feet are known to
# no better than 10 degrees: only 6 of the 369 vertices hang on a foot, and all of them are so near to
# its joint that they hardly move when it turns.
#
# This covariance must not be believed where the rank is not full. A pseudo-inverse gives a number for
# everything there, and the smallest number of all for what is not seen at all. With the 24 joints
# alone:

# %%
J_plus = np.linalg.pinv(here.jacobian)
naive = np.sqrt(np.diag(J_plus @ J_plus.T)).reshape(24, 3)
honest = np.sqrt(np.diag(here.covariance)).reshape(24, 3)
for name in ("left_hand", "left_elbow", "left_hip"):
    k = body.joint_names.index(name)
    print(f"{name:11} by pinv {naive[k].round(4)}, by the library {honest[k].round(4)} rad")

# %% [markdown]
# ## What to do about it
#
# Three things help. The diagnosis says where help is needed, and the choice is ours: see more (a marker
# off the bone's axis ends a twist), free less (leave the leaves fixed), or believe something. A prior is
# further residuals, which here say that each number of the pose is about 0.3 rad from zero:

# %%
prior = wb.residuals.gaussian(pose, mean=0.0, covariance=0.3**2)
with_prior = wb.Problem([*problem.residuals, prior], ["pose"], blocks=[observed])
regular = wb.diagnose(with_prior, there, priors=[prior.name])
print("rank with a prior:", regular.rank)
known = regular.identifiability
print(
    f"directions that the data decide: {known.effective:.1f}, by the formula below: "
    f"{np.sum(s**2 / (s**2 + 0.3**-2)):.1f}"
)
for name in ("left_hand", "left_elbow", "pelvis"):
    left = known.shrinkage.reshape(24, 3)[body.joint_names.index(name)]
    print(f"{name:11} sigma with the data over sigma of the prior alone: {left.round(2)}")
solution = wb.solve(with_prior, given | {"pose": np.zeros((24, 3))})
print(f"pose off by up to {np.abs(solution.values['pose'] - truth).max():.2f} rad")

# %% [markdown]
# Now every solver is content, the rank is full, and the answer is unique. A direction with singular
# value $s$ is known from the data to $1/s$ and from the prior to $\sigma = 0.3$ rad, and information,
# one over the variance, adds up. So the data's share in what is known of it is
# $s^2 / (s^2 + \sigma^{-2})$, between 0 and 1. The sum of all shares counts the directions that the
# data decide. It is 35 and not 40, since some are seen so little that the prior has its share in them.
#
# And the answer is not right: the prior has put zero where nothing was known. (It is off by as much as
# the answer from rest was, for the same reason: the number that is furthest off is one that no joint
# depends on, and both leave it at zero.) That may be just what one wants, provided that one knows which
# numbers came from the data and which from the prior.
#
# ## What to remember
#
# - Count ranks, not equations. 24 joints tell 40 of 72 numbers: $3$, $2$ or $0$ for each joint with
#   several children, one, or none.
# - The pattern bounds the rank and costs nothing; singular values give the rank; named directions say
#   what to do.
# - $1/s$ is how well a direction is known. A pseudo-inverse hides what is not.
# - A prior makes the rank full, and answers for what the data do not say.
