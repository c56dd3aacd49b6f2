# %% [markdown]
# # The Jacobian: what cannot be seen
#
# **All 24 joints are known exactly. Is the pose?**
#
# The pose of a body is 24 rotation vectors, 72 numbers. Motion capture gives us the places of the 24
# joints, again 72 numbers. There are as many equations as unknowns, so it seems that we only have to solve
# them. Angles are in radians and lengths in metres. The person is synthetic, so that the truth is known.

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
from workbench.problem.linearization import covariance_without

# %%
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

# %% slide [markdown]
# ## As many equations as unknowns
#
# - The pose: 24 rotation vectors, 72 numbers
# - Motion capture: 24 joints, 72 numbers
# - So we only have to solve?

# %% [markdown]
# ## Solve, and look
#
# The residual is the joints of the body minus those that were seen, divided by 1 cm. (A residual that is
# divided by its standard deviation sigma is called **whitened**. It has no unit.) We solve twice, once from
# the body at rest, and once from a pose that differs from the truth at random.

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

# %% slide [markdown]
# ## Two starts, two answers, both exact
#
# - Both fits meet every joint, to
#   rounding.{{ all(np.allclose(body.joints(one), body.joints(truth), atol=1e-8) for one in answers.values()) }}
# - From rest the pose is off by up to {{ np.abs(answers["from rest"] - truth).max():.2f}} rad, from elsewhere
#   by {{ np.abs(answers["from elsewhere"] - truth).max():.2f}}.

# %% [markdown]
# Both fits converged, and both meet every joint. Yet both poses are wrong, and so is the
# skin{{ all(np.allclose(body.joints(one), body.joints(truth), atol=1e-8) and np.abs(one - truth).max() > 0.1 for one in answers.values()) }}:

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
    "Every joint is met, and the skin is not: brightest is the crown of the head (seen from behind, because the head is bent back), then the left upper "
    "arm, which is turned about its bone, then both hands.",
)

# %% slide [markdown]
# ## Every joint is met, and the skin is wrong
#
# - Off by up to {{ off['from rest'].max():.0f}} mm
# - Brightest: the crown of the head, the left upper arm, the hands
# - Many poses have these joints; the solver found one.

# %% [markdown]
# The skin is off by up to {{ off['from rest'].max():.0f}} mm. The solver is not to blame. There are many poses with
# these joints, and it found one of them. To count the
# equations was not enough to see this. What is?
#
# ## A direction that nobody notices
#
# Take a step $p$ from the truth. To first order the residual changes by $J p$. If $J p = 0$, no equation
# notices the step. The steps with this property form the **null space** of the Jacobian, and the number of
# independent directions that *are* noticed is its **rank**. The singular value decomposition
# $J = U S V^\top$ shows both: a step of length one along the column $v_i$ of $V$ changes the residual by
# $J v_i = s_i u_i$, whose length is $s_i$. So the null space is spanned by the columns whose singular value is
# zero.

# %% slide [markdown]
# ## A direction that nobody notices
#
# $$ J = U S V^\top, \qquad J v_i = s_i u_i $$
#
# - $J p = 0$: no equation notices the step. These $p$ are the **null space**.
# - **Rank**: how many independent directions are noticed

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
    "one radian in that direction. Those below the dashed line, the tolerance of this matrix, are drawn hollow: they "
    "are zero but for rounding. Along these directions, named on the right, the pose can change and no "
    "joint moves.",
    lambda: wb.show(diagnosis, body=body),
)

# %% slide still [markdown]
# ## A cliff of {{ np.log10(s[39] / s[40]):.0f}} decades
#
# - {{ here.rank}} of {{ len(s)}} singular values are large; the others would be zero without rounding.

# %% slide [markdown]
# ## Along each of these, no joint moves
#
# - Pick a direction, and move along it: the skin turns, the joints stay.

# %% [markdown]
# There are {{ here.rank}} large singular values, and then a cliff of {{ np.log10(s[39] / s[40]):.0f}} decades. The others
# would be zero if
# computers did not round. Which singular values should count as zero, then? The library asks how large rounding
# can make a singular value that ought to be zero: about as large as the largest one, times the machine's
# precision, times the size of the matrix. (In the figure this is done for the Jacobian as it is.) For its verdict it
# first scales every column to the length 1, so that the unit of an unknown does not matter, and the tolerance is
# another number. Whatever is below this **tolerance** counts as zero:

# %%
columns = here.jacobian / np.where(here.column_norms > 0, here.column_norms, 1)
scaled = np.linalg.svd(columns, compute_uv=False)
tolerance = np.finfo(float).eps * max(columns.shape) * scaled[0]
print(f"of columns with length 1: the largest singular value is {scaled[0]:.1f},")
print(f"the tolerance {tolerance:.0e}, and {np.sum(scaled > tolerance)} are above it")

# %% slide [markdown]
# ## Which singular values count as zero?
#
# - Tolerance: the largest, times the machine's precision, times the size of the matrix
# - Columns are scaled to length 1 first, so that units do not matter: {{ tolerance:.0e}}

# %% [markdown]
# ## Why forty?
#
# We need no computer for that number{{ here.rank == 40 == np.sum(scaled > tolerance) }}. Let joint $k$ turn by a
# small rotation vector $\omega$. Then each joint
# $c$ below it moves by $\omega \times (x_c - x_k)$, where $x_c$ and $x_k$ are the places of the two joints. Now
# we go through the tree, beginning at the ends of the limbs, and count for each joint how many of the three
# numbers of $\omega$ are seen:
#
# - A **leaf** (a hand, a foot, the head) has no joint below it. Its rotation moves no joint, so $0$ of the $3$
#   numbers are seen.
# - A joint with **one child** can turn about the bone $e$ that leads to the child, because
#   $\omega \times e = 0$ where $\omega$ is parallel to $e$. This also turns everything beyond the child about
#   the same line, but the child can turn back by the same angle. So $2$ numbers are seen.
# - A joint with **several children** has several bones to them. No axis is parallel to all of these bones, unless
#   they lie on one line. So all $3$ numbers are seen.
#
# These counts may be added. Each number that is not seen has a null direction of its own, so the rank is at most their
# sum. And the bones that leave a joint are turned by this joint and by those above it, never by those below. So,
# beginning at the root, nothing that is seen of a joint can be undone by the joints that follow: the rank is also at
# least the sum.
#
# If the body may also move as a whole, $3$ more numbers are seen.

# %% slide [markdown]
# ## Why forty? Count along the tree
#
# - A **leaf** moves no joint: 0 of 3
# - **One child**: the turn about the bone is not seen: 2 of 3
# - **Several children**: all 3

# %%
print(law_in_words(body.parents, translation=False))
K = len(body.parents)
predicted = rank_of_observed_joints(body.parents, body.joints(truth), range(K), translation=False)
print("by walking the tree with the bones of this pose:", predicted)
ends = [15, 20, 21]
rank = rank_of_observed_joints(body.parents, body.joints(truth), ends, translation=False)
print(f"if only {', '.join(body.joint_names[k] for k in ends)} are seen: {rank} of 72")

# %% slide [markdown]
# ## By the law and by the matrix: {{ predicted }}
#
# - 72 numbers, 72 equations, rank {{ here.rank }}{{ here.rank == predicted }}: {{ 72 - here.rank }}
#   directions are free.
# - If only head and wrists are seen: {{ rank }} of 72

# %% [markdown]
# (In the last line three points are seen, and each can be moved alone in all three directions by the joints above it:
# three times three{{ rank == 9 and predicted == 40 }}.)
#
# The number says that something is not seen, but not what. The singular vectors do not say it either, because
# each of them mixes several null directions. So the workbench looks for null directions in small subspaces that
# have names, such as the numbers of one joint or of two neighbours. It begins with the smallest subspaces, so
# that it finds each twist by itself:

# %% slide [markdown]
# ## Null directions with names
#
# - Singular vectors mix several null directions.
# - Look in small subspaces first: one joint, then two neighbours. Each twist is found by itself.
# - {{ len(diagnosis.null_directions) }} directions, each with the joints that it turns

# %%
print(diagnosis)

# %% [markdown]
# We try one of them. A twist of the left elbow that is undone at the left wrist should move no joint, and yet
# move the skin of the forearm:

# %%
twist = next(d for d in diagnosis.null_directions if d.joints == ("left_elbow", "left_wrist"))
moves = []  # m: joints, skin
for angle in (1e-3, 1e-2, 1e-1):
    turned = truth + angle * twist.vector.reshape(24, 3)
    moved = np.abs(body.joints(turned) - body.joints(truth)).max()
    skin = np.abs(body.vertices(turned) - body.vertices(truth)).max()
    moves.append((moved, skin))
    print(f"{angle:5} rad: joints by {1e3 * moved:.1e} mm, skin by {1e3 * skin:.1e} mm")
moves = np.array(moves)

# %% slide [markdown]
# ## A twist of the elbow, undone at the wrist
#
# | step | skin moves by | joints by |
# | --- | --- | --- |
# | 0.001 rad | {{ 1e3 * moves[0, 1]:.1e}} mm | {{ 1e3 * moves[0, 0]:.1e}} mm |
# | 0.01 rad | {{ 1e3 * moves[1, 1]:.1e}} mm | {{ 1e3 * moves[1, 0]:.1e}} mm |
# | 0.1 rad | {{ 1e3 * moves[2, 1]:.1e}} mm | {{ 1e3 * moves[2, 0]:.1e}} mm |
#
# - Ten times as far: skin {{ (moves[1:] / moves[:-1])[:, 1].mean():.0f}} times, joints
#   {{ (moves[1:] / moves[:-1])[:, 0].mean():.0f}} times. To first order they do not move.

# %% [markdown]
# A step that is ten times as long moves the skin {{ (moves[1:] / moves[:-1])[:, 1].mean():.0f}} times as far, and the
# joints {{ (moves[1:] / moves[:-1])[:, 0].mean():.0f}} times: to first
# order they do not move. (They would not move at all on a path that is slightly curved. The null space is the
# tangent of that path.)
#
# ## Dense or sparse?
#
# The place of a joint depends on the rotations of the joints above it and on no others. So most entries of this
# Jacobian are zero whatever the pose is. We know the pattern of these zeros before we compute anything:

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

# %% slide [markdown]
# ## The pattern of zeros is known before any number
#
# - A joint depends on the joints above it alone: {{ diagnosis.density:.0%}} of the entries are not zero.
# - Empty columns are the leaves.

# %%
print(f"{diagnosis.nonzeros} of {72 * 72} entries: {diagnosis.density:.1%}")
print("rank that the pattern alone allows:", diagnosis.structural_rank)
print("rank of these numbers:", diagnosis.rank)
largest = 6890 * 3 * (72 + 10)
print(
    f"a fit of SMPL to 6,890 vertices, with 72 + 10 unknowns: {largest:,} entries, "
    f"{8e-6 * largest:.0f} MB if all are kept"
)

# %% slide [markdown]
# ## The pattern bounds the rank
#
# - Pattern alone: at most {{ diagnosis.structural_rank}}. Numbers: {{ diagnosis.rank}}
# - It shows the leaves and not the twists, which depend on the numbers.
# - It costs nothing, and warns before any solver starts.

# %% [markdown]
# The pattern shows the leaves: {{ (~here.jacobian.any(axis=0)).sum()}} columns are empty, so the rank is at most
# {{ diagnosis.structural_rank}}. It does not show the twists,
# because they depend on the numbers. That is why the workbench looks at both. The pattern costs nothing, and a
# column of zeros is a warning worth having before any solver is started.
#
# Should such a Jacobian be stored as a dense or as a sparse matrix? That of the joints is sparse by nature. That
# of SMPL's vertices is not: its pose blend shapes (lecture 5) let every vertex depend on {{ body.n_joints - 1 }}
# rotations. But it has only {{ 72 + 10 }} columns, and its {{ 8e-6 * largest:.0f}} MB are easily kept as a dense
# matrix. With so few unknowns, the
# pattern is worth
# more for what it tells than for the zeros that it saves. With thousands of unknowns, as in a video, it is the
# other way round.

# %% slide [markdown]
# ## Dense or sparse?
#
# - SMPL's vertices depend on {{ body.n_joints - 1}} rotations through pose blend shapes: dense by nature.
# - 6,890 vertices, {{ 72 + 10 }} unknowns: {{ 8e-6 * largest:.0f}} MB, easily kept
# - Videos have thousands of unknowns: there it is the other way round.

# %% [markdown]
# ## Hardly seen
#
# Rank is a matter of yes or no. In practice much is seen, but only just. How uncertain is a fit? Let every
# whitened residual have noise with a standard deviation of one, and collect the noise in a vector $n$. To first
# order the fit goes where $\|J p - n\|^2$ is least, which is $p = (J^\top J)^{-1} J^\top n$. The covariance of $n$
# is the identity, so the covariance of $p$ is that matrix times its transpose. With $J = U S V^\top$ it becomes
#
# $$ C = (J^\top J)^{-1} = V S^{-2} V^\top . $$
#
# In words: a direction with the singular value $s_i$ is known up to a standard deviation of $1/s_i$. Now we
# observe vertices instead of joints, every one to 1 cm. With them everything is seen. (`skin.svd` holds $U$, the
# singular values, and $V^\top$; the condition number is the largest singular value over the smallest, as in lecture 6.)

# %% slide [markdown]
# ## Hardly seen: how uncertain is a fit?
#
# $$ C = (J^\top J)^{-1} = V S^{-2} V^\top $$
#
# - Whitened noise of one: a direction with the singular value $s_i$ is known up to $1/s_i$.

# %%
seen = wb.Block("seen", (body.n_vertices, 3), "m")
on_skin = wb.Problem(
    [wb.residuals.vertices(body.points(pose, betas, trans), seen.symbol, sigma=0.01)],
    ["pose"],
    blocks=[seen],
)
skin = on_skin.linearize(there | {"seen": body.vertices(truth)})
sigma = np.sqrt(np.diag(skin.covariance)).reshape(24, 3).max(axis=1)
hanging = np.bincount(body.weights.argmax(axis=1), minlength=24)  # vertices by joint
feet = [body.joint_names.index(name) for name in ("left_foot", "right_foot")]
print("rank:", skin.rank, f"  condition: {skin.svd[1][0] / skin.svd[1][-1]:.0f}")
for k in (*np.argsort(sigma)[:3], *np.argsort(sigma)[-3:]):
    print(
        f"  {body.joint_names[k]:15} known to {np.degrees(sigma[k]):5.2f} degrees (1 sigma), "
        f"{hanging[k]:2} vertices hang on it most of all"
    )

# %% slide [markdown]
# ## Every vertex to 1 cm: everything is seen
#
# - Pelvis: {{ np.degrees(sigma[0]):.1f}} degrees. Feet: {{ np.degrees(sigma[feet].min()):.0f}} degrees at best
# - {{ hanging[feet[0]]}} of {{ body.n_vertices}} vertices hang on a foot, all near its joint.

# %% [markdown]
# (A joint has three numbers, and the table gives the one that is known least well.) With this centimetre the pelvis
# is known to {{ np.degrees(sigma[0]):.1f}} degrees, because a turn of the pelvis moves the whole body. The feet are
# known to {{ np.degrees(sigma[feet].min()):.0f}} degrees at best: only {{ hanging[feet[0]]}} of the
# {{ body.n_vertices}} vertices hang on a
# foot{{ hanging[feet[0]] == hanging[feet[1]] and skin.rank == 72 and set(np.argsort(sigma)[-2:]) == set(feet) }}, and
# all of them are so near to
# its joint that they hardly move when it turns.
#
# What if the rank is not full? Then $J^\top J$ has no inverse. It is tempting to take the pseudo-inverse, which
# replaces $1/s_i$ by zero wherever $s_i$ is zero. But this says of a direction that is not seen at all that it is known
# exactly. With the 24 joints alone it gives the smallest standard deviation to the rotations that nobody sees, those of
# the leaves. The library gives them an infinite one.

# %% slide [markdown]
# ## A pseudo-inverse calls the unknown exact
#
# - It replaces $1/s_i$ by 0 where $s_i = 0$: standard deviation **zero** for what nobody sees.
# - The library says infinite, and its covariance with other unknowns is no number.

# %% [markdown]
# Here are its lines. They work with the scaled Jacobian $J D^{-1}$,
# whose columns were divided by their `lengths`, the diagonal of $D$ (1 for a column of zeros); `s` and the rows of `Vt`
# are its singular values above the tolerance and their directions. With $J D^{-1} = U S V^\top$, seen directions only,
# `half @ half.T` is $D^{-1} V S^{-2} V^\top D^{-1}$. Like the pseudo-inverse, this leaves out what is not seen. It is
# right for an unknown that has no part in the null space, because for it nothing is missing. For the others it is
# wrong, and is overwritten.
#
# Which unknowns are these? (A null vector $v$ of $J D^{-1}$ gives the null vector $D^{-1} v$
# of $J$, which is zero in the same entries. So the scaled Jacobian answers this too.) Seen and unseen directions
# together are an orthonormal basis, the columns of a matrix $Q$ with $Q Q^\top = I$: its diagonal says that for each
# unknown the squares of its entries in all directions add up to one. If those in the seen directions add up to less,
# the rest is the unknown's part in the null space. Its variance is infinite, and its covariance with other unknowns is
# no number (NaN), because it can be made anything by going along the null space:

# %%
source(covariance_without)

# %%
J_plus = np.linalg.pinv(here.jacobian)
naive = np.sqrt(np.diag(J_plus @ J_plus.T)).reshape(24, 3)
honest = np.sqrt(np.diag(here.covariance)).reshape(24, 3)
for name in ("left_hand", "left_elbow", "left_hip"):
    k = body.joint_names.index(name)
    print(f"{name:11} by pinv {naive[k].round(4)}, by the library {honest[k].round(4)} rad")

# %% slide [markdown]
# ## The same joint, by both
#
# | | by `pinv` | by the library |
# | --- | --- | --- |
# | left hand | {{ naive[body.joint_names.index("left_hand")].max():.4f}} rad | {{ honest[body.joint_names.index("left_hand")].max()}} |
# | left elbow | {{ naive[body.joint_names.index("left_elbow")].max():.4f}} rad | {{ honest[body.joint_names.index("left_elbow")].max()}} |
# | left hip | {{ naive[body.joint_names.index("left_hip")].max():.4f}} rad | {{ honest[body.joint_names.index("left_hip")].max()}} |

# %% [markdown]
# Of the hand the pseudo-inverse says that it is known
# exactly{{ np.allclose(naive[body.joint_names.index('left_hand')], 0) and np.isinf(honest[[body.joint_names.index(name) for name in ('left_elbow', 'left_hip')]]).all() }}.
# Of the hip only the twist about the thigh is not seen; the elbow, besides its own twist, can undo that of the
# shoulder. The bones are parallel to no axis, so that these turns change all numbers of a joint, and none of them is
# determined.

# %%
worst_naive = np.degrees(naive.max(axis=1))
leaves = [k for k in range(24) if k not in body.parents]
order = np.argsort(sigma)
with house_style():
    figure, (left, right) = sheet(10, 5.2, columns=2)
    left.barh(range(24), np.degrees(sigma[order]))
    right.barh(range(24), worst_naive[order], color=["C1" if k in leaves else "C0" for k in order])
    for ax, title in (
        (left, "every vertex is seen to 1 cm"),
        (right, "joints alone, by the pseudo-inverse"),
    ):
        ax.set_yticks(range(24), [body.joint_names[k].replace("_", " ") for k in order], fontsize=7)
        ax.set(title=title, xlabel="standard deviation (degrees)")
Picture(
    figure,
    "How well each joint's rotation is known (the least known of its three numbers). Left: from vertices; "
    "the feet are known least. Right: what the pseudo-inverse says if only joints are seen. The five leaves, "
    "of which nothing is seen, get a standard deviation of zero, and so have no bar.",
)

# %% slide [markdown]
# ## Five bars are missing
#
# - Right: the five leaves, of which nothing is seen, have no bar.

# %% [markdown]
# ## What to do about it
#
# Three things help, and the diagnosis says where help is needed. We can see more: a marker that is not on the
# axis of a bone ends its twist. We can free less, and leave the leaves fixed. Or we can say what we believed
# before we saw anything. Such a **prior** is a set of further residuals. Here they say that each number of the
# pose is usually about 0.3 rad from zero:

# %% slide [markdown]
# ## Three things help
#
# - **See more**: a marker off the axis of a bone ends its twist.
# - **Free less**: leave the leaves fixed.
# - **Believe something**: a prior is a set of further residuals.

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
furthest = np.abs(solution.values["pose"] - truth).argmax()  # the number of the pose
print(f"pose off by up to {np.abs(solution.values['pose'] - truth).max():.2f} rad")

# %% slide [markdown]
# ## A prior: each number about 0.3 rad from zero
#
# $$ \text{share of the data} = \frac{s^2}{s^2 + \sigma^{-2}} $$
#
# - Rank {{ regular.rank}}: the answer is unique.
# - Directions that the data decide: {{ known.effective:.0f}}, not {{ here.rank}}; some are seen so little
#   that the prior has its share.

# %% [markdown]
# Now the rank is full, and the answer is unique{{ regular.rank == 72 }}. Which part of it comes from the data? A
# direction with the
# singular value $s$ is known from the data up to $1/s$, and from the prior up to $\sigma = 0.3$ rad. The
# information about it, which is one over the variance, is $s^2$ from the data and $\sigma^{-2}$ from the prior,
# and the two add up. So the share of the data is $s^2 / (s^2 + \sigma^{-2})$, between 0 and 1. The sum of all
# shares counts the directions that the data decide. It is {{ known.effective:.0f}} and not {{ here.rank}}, because
# some directions are seen so
# little that the prior has its share in them.
#
# The answer is unique, but it is not right: the prior has put zero where nothing was known. (It is off by as much
# as the answer from rest was, for the same reason: the number that is furthest off is one that no joint depends
# on, and both leave it at
# zero{{ furthest == np.abs(answers['from rest'] - truth).argmax() and abs(solution.values['pose'].ravel()[furthest]) < 1e-9 }}.)
# That may be just what one wants, provided that one knows which numbers came from
# the data and which from the prior.

# %% slide [markdown]
# ## Unique is not right
#
# - The pose is still off by up to {{ np.abs(solution.values['pose'] - truth).max():.2f}} rad: zero was put
#   where nothing was known.
# - Know which numbers came from the data, and which from the prior.

# %% [markdown]
# ## What to remember
#
# - Count ranks, not equations. 24 joints tell 40 of 72 numbers: $3$, $2$ or $0$ for each joint with
#   several children, one, or none.
# - The pattern of zeros bounds the rank and costs nothing. Singular values give the rank, and named null
#   directions say what to do.
# - A direction is known up to $1/s$. A pseudo-inverse hides that a direction is not known at all.
# - A prior makes the rank full, and it decides what the data leave open.

# %% slide [markdown]
# ## What to remember
#
# - Count ranks, not equations: 24 joints tell 40 of 72 numbers.
# - A direction is known up to $1/s$; a pseudo-inverse hides that it is not known at all.
# - A prior makes the rank full, and decides what the data leave open.
