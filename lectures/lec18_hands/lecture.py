# %% [markdown]
# # Hands, and bodies with hands
#
# **What is different about a body with fingers?**
#
# Nothing in SMPL's equations knows what a hand is. MANO is SMPL with the joints of a hand, and SMPL-H is a body with 52
# joints of which 30 are in the fingers (Romero, Tzionas and Black, [*Embodied
# Hands*](https://doi.org/10.1145/3130800.3130883), 2017). But what was easy with a body becomes hard with a hand. Its
# joints turn together, many of their turns cannot be seen from joints, it comes in two sides, and its zero pose is one
# that nobody makes. This lecture goes through these one by one, and ends with a body to which hands were sewn. **No
# hand was measured**: the embedded hands and their poses are synthetic. Angles are in radians, and lengths in metres;
# errors are told in millimetres.

# %%
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

import workbench as wb
from workbench.bodies import HAND_POINTS, pose_space
from workbench.course import Picture, source
from workbench.fitting import hand_problem, hand_start
from workbench.fitting.hands import points_of
from workbench.geometry.mirror import AXIAL, REFLECTION
from workbench.plots import house_style, sheet
from workbench.plots.body import Figurine, line_up
from workbench.priors.joint_limits import hand_limits

# %%
hand, left = wb.load_body("hand"), wb.load_body("hand-left")
print(f"the hand: {hand.n_vertices} vertices, {hand.n_joints} joints, {3 * hand.n_joints} angles")


def above(vertices):
    """The view from above onto the back of the hand; the fingers point down."""
    x, y, z = vertices.T
    return np.column_stack([z, x, y])


def beside(vertices):
    """The view from the side of the thumb; the back of the hand is on the left."""
    x, y, z = vertices.T
    return np.column_stack([-y, x, z])


# %% slide [markdown]
# ## A hand is SMPL with other joints
#
# - {{ hand.n_vertices}} vertices, {{ hand.n_joints}} joints, {{ 3 * hand.n_joints}} angles
# - Its joints turn together, and do not show many of their turns; it has two sides; its zero is a pose that nobody makes.
# - No hand was measured: these are synthetic.

# %% [markdown]
# ## Forty-five angles by themselves
#
# The wrist turns the hand as a whole, and its angles are left out here. Suppose that all we know is how far each of the
# joints of the fingers turns. The naive way to make up a hand is to draw each angle by itself, with the standard
# deviation that it has in people's poses. What comes out?

# %%
space = pose_space(hand)
draw, MANY = np.random.default_rng(18), 200
spread = np.sqrt(np.einsum("c,cjk->jk", space.deviations**2, space.components**2))
alone = np.zeros((MANY, 16, 3))
alone[:, 1:] = space.mean + spread * draw.standard_normal((MANY, 15, 3))
together = space.poses(hand, space.deviations * draw.standard_normal((MANY, space.n_components)))
rule = wb.Problem([hand_limits().residual(hand, sigma=1.0)], ["pose"])  # in rad
beyond = {}
for name, poses in (("each by itself", alone), ("together", together)):
    farthest = [np.abs(rule.linearize({"pose": pose}).residual).max() for pose in poses]
    beyond[name] = np.degrees(farthest)
    many = 100 * np.mean(beyond[name] > 5)
    print(f"drawn {name}: {many:.0f} % of the hands are more than 5 degrees beyond a limit")

with house_style():
    figure, axes = sheet(9.5, 3.2, columns=2)
    for ax, (name, poses) in zip(
        axes, (("each by itself", alone), ("together", together)), strict=True
    ):
        drawn = [Figurine("", hand.vertices(pose), above) for pose in poses[:4]]
        line_up(drawn, hand.faces, ax=ax)
        ax.set(title=f"angles drawn {name}", ylabel="along the hand (m)")
Picture(
    figure,
    "Four hands whose angles were drawn each by itself, and four whose angles were drawn together. Each "
    "single angle varies by the same amount in both pictures. On the left, neighbouring fingers point in different "
    "directions; on the right, the fingers of a hand bend together.",
)

# %% slide [markdown]
# ## Forty-five angles by themselves make no hand
#
# - Beyond a limit by more than 5 degrees: {{ 100 * np.mean(beyond['each by itself'] > 5):.0f}} % of hands
#   drawn angle by angle, {{ 100 * np.mean(beyond['together'] > 5):.0f}} % of those drawn together

# %% [markdown]
# Of the hands whose angles were drawn each by itself, {{ 100 * np.mean(beyond['each by itself'] > 5):.0f}} % are more
# than 5 degrees beyond a limit of their joints (lecture 10 has limits of a body), and
# {{ 100 * np.mean(beyond['together'] > 5):.0f}} % of those whose angles were drawn together. In the picture,
# one finger points while its neighbours are bent, as in no relaxed hand. The variance of each angle does not
# say which angles belong together; the covariance does.

# %% slide [markdown]
# ## The covariance knows which angles belong together
#
# - Each single angle varies by the same amount in both pictures.
# - One finger points while its neighbours are bent: no relaxed hand does.

# %% [markdown]
# ## A few coefficients
#
# Fingers close together. So the poses of a hand are described by a mean and **principal components**, which
# are found from many poses as shape directions are found from many people:
#
# $$ \theta = \bar\theta + \sum_c z_c\, \theta_c , \qquad z_c \sim N(0, \sigma_c^2) . $$
#
# This is no composition of rotations, whose vectors do not add up; it is simply a *linear* map, and a good enough one.
# So a problem may have $z$ as its unknowns in place of $\theta$: wherever a body takes the symbol of a pose, it also
# takes the expression $\bar\theta + \sum_c z_c\, \theta_c$ of a block $z$, and then $z$ is what solvers look for and
# what the diagnosis speaks of. In the library a pose space holds the `mean` (15, 3) and the `components` (45, 15, 3),
# and `np.tensordot` with the axes $(-1, 0)$ is the sum over $c$:

# %% slide [markdown]
# ## A few coefficients
#
# $$ \theta = \bar\theta + \sum_c z_c\, \theta_c, \qquad z_c \sim N(0, \sigma_c^2) $$
#
# - Mean and **principal components** of poses; no composition of rotations, simply linear
# - A problem may have $z$ as its unknowns in place of $\theta$.

# %%
source(type(space).mixed)

# %%
variance = space.deviations**2
held = np.cumsum(variance) / variance.sum()
moving = int((space.deviations > 1e-9).sum())
for count in (1, 2, 10):
    print(f"{count:2} components hold {100 * held[count - 1]:.0f} % of the variance")
print(f"{moving} of {space.n_components} components vary at all")

with house_style():
    figure, (ax,) = sheet(8.0, 3.2)
    steps = [(c, s) for c in (0, 1) for s in (-2, 2)]
    line_up(
        [
            Figurine(
                f"z{c + 1} = {s:+d} sd",
                hand.vertices(space.poses(hand, s * space.deviations * (np.arange(45) == c))),
                above if c == 0 else beside,
            )
            for c, s in steps
        ],
        hand.faces,
        ax=ax,
    )
    ax.set(ylabel="along the hand (m)")
Picture(
    figure,
    "The first component of the hand's pose, seen from above, opens and closes the fingers. The second one, "
    "seen from the side of the thumb, bends their bases while their ends stretch, and the other way round. Two "
    "standard deviations to either side of the mean pose.",
)

# %% slide [markdown]
# ## The first component closes the hand
#
# - Two hold {{ 100 * held[1]:.0f}} % of the variance, ten {{ 100 * held[9]:.0f}} %.

# %% [markdown]
# One component holds {{ 100 * held[0]:.0f}} % of the variance, two hold {{ 100 * held[1]:.0f}} %, and ten hold
# {{ 100 * held[9]:.0f}} %. So ten numbers stand for
# forty-five. (Only {{ moving}} components vary at all, because the poses are synthetic: rules made them, and were
# adjusted until two components held about as much as those of measured hands, for which more than 80 % are
# reported by [Santello, Flanders and Soechting](https://doi.org/10.1523/JNEUROSCI.18-23-10105.1998), 1998.)

# %% slide [markdown]
# ## Ten numbers stand for forty-five
#
# - One component holds {{ 100 * held[0]:.0f}} %; only {{ moving}} vary at all: rules made these poses.
# - Measured hands: two hold more than 80 % (Santello, Flanders and Soechting, 1998).

# %% [markdown]
# ## Which pose is zero?
#
# There are two conventions, and files do not say which one they follow. In one, zero is the mean pose, a
# relaxed hand; in the other, it is the flat hand of the template, and the mean pose has to be added. Who adds
# it to a pose that contains it already gets a fist.

# %% slide [markdown]
# ## Which pose is zero? Files do not say
#
# - **Relaxed**: zero is the mean pose.
# - **Flat**: zero is the template, and the mean has to be added.
# - Add it to a pose that has it already, and you get a fist.

# %%
mean = space.poses(hand, np.zeros(space.n_components))
flat = hand.vertices()
relaxed, twice = hand.vertices(mean), hand.vertices(2 * mean)
off = {
    "the mean left out": 1e3 * np.linalg.norm(flat - relaxed, axis=1).max(),
    "the mean added twice": 1e3 * np.linalg.norm(twice - relaxed, axis=1).max(),
}
for name, far in off.items():
    print(f"{name}: the farthest vertex is off by {far:.1f} mm")

with house_style():
    figure, (ax,) = sheet(7.5, 3.0)
    kinds = (("zero: flat", flat), ("the mean pose", relaxed), ("the mean twice", twice))
    line_up([Figurine(name, v, above) for name, v in kinds], hand.faces, ax=ax)
    ax.set(ylabel="along the hand (m)")
Picture(
    figure,
    "The same hand at zero, in its mean pose, and with the mean pose added twice. All of them look like hands; the last "
    "one is nearly a fist.",
)

# %% slide [markdown]
# ## All three look like hands
#
# - Mean left out: {{ off['the mean left out']:.0f}} mm at a tip. Added twice:
#   {{ off['the mean added twice']:.0f}} mm

# %% [markdown]
# Who leaves the mean out is off by {{ off['the mean left out']:.0f}} mm at a finger tip, and who adds it twice by
# {{ off['the mean added twice']:.0f}} mm. All three are hands,
# so that nothing reports an error. The command `workbench body check FILE` says which convention a file seems
# to follow.

# %% slide [markdown]
# ## Nothing reports an error
#
# - All three are valid poses of a valid hand.
# - `workbench body check FILE` says which convention a file seems to follow.

# %% [markdown]
# ## Left and right
#
# A left hand is a right one in a mirror, $x \to -x$. With $S = \operatorname{diag}(-1, 1, 1)$ a position $p$ becomes
# $S p$: its $x$ changes sign. What becomes of a rotation? The mirror image of $R p$ is $S R p = (S R S)(S p)$, since
# $S S = I$, so that the mirrored position is rotated by $S R S$. This is a rotation by the same angle, but
# in the opposite sense about the mirrored axis, for a mirror turns the sense of a cross product round:
# $S (a \times b) = - (S a) \times (S b)$. So the rotation vector $\theta$ becomes $-S \theta$: it *keeps* its
# $x$, and $y$ and $z$ change sign.

# %% slide [markdown]
# ## A mirror, $S = \operatorname{diag}(-1, 1, 1)$
#
# $$ S R p = (S R S)(S p), \qquad S (a \times b) = - (S a) \times (S b) $$
#
# - Positions: $p \to S p$, their $x$ changes sign.
# - Rotation vectors: $\theta \to -S \theta$, they *keep* their $x$; $y$ and $z$ change.

# %% [markdown]
# Two wheels show it: one whose axle points at the mirror spins as its image does,
# and one that rolls towards the mirror is met by an image that rolls the other way.

# %% slide [markdown]
# ## Two wheels
#
# - One whose axle points at the mirror spins as its image does.
# - One that rolls towards the mirror meets an image that rolls the other way.

# %% [markdown]
# The arrays of the model follow. Template and shape directions are positions, and all of their $x$ change sign. A left
# hand whose shape directions were copied from the right one looks right until somebody has another shape. Pose
# directions are positions too, but they are multiplied by elements of $R - I$, and the mirror makes $S R S$ of $R$: the
# four elements in which $x$ meets $y$ or $z$ change their sign. So the pose directions of these four elements change
# sign once more. In the cell, `REFLECTION` holds the signs of a position, $(-1, 1, 1)$, and `AXIAL` those of a rotation
# vector, $(1, -1, -1)$.

# %% slide [markdown]
# ## The model's arrays follow
#
# - Template and shape directions are positions: $x$ changes.
# - Pose directions are multiplied by $R - I \to S R S - I$: where $x$ meets $y$ or $z$, the sign changes once
#   more.

# %%
person = draw.standard_normal(hand.n_betas)
forgotten = replace(left, shapedirs=hand.shapedirs)
positions_alone = replace(left, posedirs=hand.posedirs * REFLECTION[:, None])
seen = hand.vertices(mean, person) * REFLECTION
errors = {
    "the rule": left.vertices(mean * AXIAL, person),
    "shape directions not mirrored": forgotten.vertices(mean * AXIAL, person),
    "pose directions mirrored as positions alone": positions_alone.vertices(mean * AXIAL, person),
    "the pose of the right hand": left.vertices(mean, person),
    "all of the rotation vector with its sign changed": left.vertices(-mean, person),
}
wrong = {name: 1e3 * np.linalg.norm(v - seen, axis=1).max() for name, v in errors.items()}
for name, far in wrong.items():
    print(f"{name}: the farthest vertex is off by {far:.1f} mm")

# %% slide [markdown]
# ## What is forgotten, and what it costs
#
# | | farthest vertex off by |
# | --- | --- |
# | the rule | {{ wrong['the rule']:.0f}} mm |
# | shape directions not mirrored | {{ wrong['shape directions not mirrored']:.0f}} mm |
# | pose directions as positions alone | {{ wrong['pose directions mirrored as positions alone']:.1f}} mm |
# | the pose of the right hand | {{ wrong['the pose of the right hand']:.0f}} mm |
# | all signs of $\theta$ changed | {{ wrong['all of the rotation vector with its sign changed']:.0f}} mm |

# %% [markdown]
# The rule is exact{{ wrong['the rule'] < 1e-9 }}. With shape directions that were copied, the hand of this person is
# off by {{ wrong['shape directions not mirrored']:.0f}} mm; for the
# mean person it would be right. With pose directions that were mirrored as positions alone, it is off by
# {{ wrong['pose directions mirrored as positions alone']:.1f}} mm, and at rest it would be
# right{{ np.array_equal(forgotten.vertices(), left.vertices()) and np.array_equal(positions_alone.vertices(), left.vertices()) }}.
# A wrong pose is easier to notice: the fingers of a right hand on a left one
# are off by {{ wrong['the pose of the right hand']:.0f}} mm, and with all three signs of the rotation vector changed
# by {{ wrong['all of the rotation vector with its sign changed']:.0f}} mm.

# %% slide [markdown]
# ## Errors that hide at rest
#
# - Shape directions copied: right for the mean person
# - Pose directions half mirrored: right at
#   rest{{ np.array_equal(forgotten.vertices(), left.vertices()) and np.array_equal(positions_alone.vertices(), left.vertices()) }}
# - So try a person, in a pose.

# %% [markdown]
# ## What points of a hand leave open
#
# Detectors find 21 points: the wrist, three joints of each finger, and its tip, which is a vertex of the skin. The
# joints alone are 16. How many of the 48 angles do they determine, if shape and place are known and there is no prior?
# Lecture 8 had the same question for a body.

# %% slide [markdown]
# ## What do points of a hand leave open?
#
# - Detectors find 21: wrist, three joints of each finger, and its tip, a vertex of the skin.
# - The joints alone are 16. How many of 48 angles do they tell?

# %%
TIPS = np.array([[name.endswith("_tip")] for name in HAND_POINTS])
bare = hand_problem(hand, priors=()).freeing("pose")
bent = {"pose": mean, "betas": np.zeros(10), "trans": np.zeros(3)}
known = points_of(hand, bent)
diagnoses = {
    "16 joints": wb.diagnose(bare, hand_start(hand, np.where(TIPS, np.nan, known))),
    "21 points": wb.diagnose(bare, hand_start(hand, known)),
}
for name, diagnosis in diagnoses.items():
    print(f"{name}: rank {diagnosis.rank} of 48")
    print("of the directions that stay open:", *str(diagnosis).splitlines()[4:6], "  ...", sep="\n")

# %% slide [markdown]
# ## Count as for a body
#
# | seen | rank of 48 | |
# | --- | --- | --- |
# | 16 joints | {{ diagnoses['16 joints'].rank}} | 3 of the wrist, 4 of each finger |
# | 21 points | {{ diagnoses['21 points'].rank}} | each tip adds the 3 of its last joint |
#
# - Open with the tips: {{ 48 - diagnoses['21 points'].rank}}, two twists for each finger

# %% [markdown]
# From 16 joints, {{ diagnoses['16 joints'].rank}} of 48 numbers are seen: 3 of the wrist, and 4 of each
# finger{{ diagnoses['16 joints'].rank == 3 + 5 * 4 }}. The last joint of a finger moves no
# joint at all, and so its 3 numbers are open; and the first two may twist about their own bones. With the tips the
# rank is {{ diagnoses['21 points'].rank}}: each tip adds the 3 numbers of its last joint, and $23 + 5 \cdot 3 =
# 38${{ diagnoses['21 points'].rank == 38 }}. A tip is a vertex of the skin, which
# follows more than one joint and their pose blend shapes. A tip that is rigid on the last bone would add one number
# less, because a rotation about the line from the last joint to it leaves it in place. The
# {{ 48 - diagnoses['21 points'].rank}} directions that are still open are two for each finger: twists of one bone
# that the next one undoes.

# %% slide [markdown]
# ## A tip is a vertex of the skin
#
# - It follows more than one joint, and their blend shapes.
# - Rigid on the last bone it would add one number less: a turn about the line to it leaves it in place.

# %% [markdown]
# What 21 points leave open, people's poses decide. Here are hands of the pose space, with errors of 2 mm in
# each coordinate of their points, fitted without a prior and with the prior of the pose space, limits and
# likely shapes.

# %%
NOISE, HANDS = 2.0, 12  # mm


def made_up():
    """A hand's values, turned any way."""
    pose = space.poses(hand, space.deviations * draw.standard_normal(space.n_components))
    pose[0] = Rotation.random(random_state=draw).as_rotvec()
    return {"pose": pose, "betas": draw.standard_normal(10), "trans": draw.standard_normal(3)}


def surface(values):
    """The skin (778, 3) m."""
    return hand.vertices(*(values[name] for name in ("pose", "betas", "trans")))


problems = {"no priors": hand_problem(hand, priors=()), "priors": hand_problem(hand)}
solver = wb.TrustRegion(max_iterations=60)
median = {name: [] for name in problems}
for k in range(HANDS):
    truth = made_up()
    points = points_of(hand, truth) + 1e-3 * NOISE * draw.standard_normal((21, 3))
    for name, problem in problems.items():
        if name == "priors" or k < 4:  # without priors a fit takes long
            found = wb.solve(problem, hand_start(hand, points), solver=solver)
            away = np.linalg.norm(surface(found.values) - surface(truth), axis=1)
            median[name].append(1e3 * np.median(away))
for name, each in median.items():
    print(
        f"{name}: half of the skin is within {np.median(each):.1f} mm, in the median of {len(each)} hands"
    )

# %% slide [markdown]
# ## What points leave open, poses decide
#
# - 21 points, off by 2 mm in each coordinate; {{ len(median['priors'])}} hands
# - With priors half of the skin is within {{ np.median(median['priors']):.1f}} mm.
# - Without: {{ np.median(median['no priors']) / np.median(median['priors']):.1f}} times as far

# %% [markdown]
# With priors, half of the skin is within {{ np.median(median['priors']):.1f}} mm of the truth, in the median of
# {{ len(median['priors'])}} hands, although the points themselves are off by 2 mm in each coordinate. Without them it
# is {{ np.median(median['no priors']) / np.median(median['priors']):.1f}} times as far, in the median of
# {{ len(median['no priors'])}} hands: nothing holds the shape, nor the twists.
#
# ## Hands on a body
#
# `full-hands` is a body with the 52 joints of SMPL-H. Body and hands were trained apart, because no scan of a
# whole body shows fingers well. Then the body's mesh was cut along a loop around each wrist, and the hand's
# joints, weights and blend shapes took over beyond it. What must hold afterwards?
#
# - A finger moves nothing but its hand, that is, the skin beyond the loop, which lies on the forearm behind the
#   wrist. Pose blend shapes have a column for each element of each rotation matrix, now {{ 9 * 51 }} instead of
#   {{ 9 * 23 }}, and
#   training would find use for all of them if nothing forbade it.
# - The pose has an order: 22 joints of the body, 15 of the left hand, 15 of the right hand. The last two
#   joints of SMPL's {{ 24 }}, the hands, are gone.

# %% slide [markdown]
# ## Hands on a body: sewn
#
# - Trained apart: no scan of a whole body shows fingers well. Cut along a loop around each wrist
# - A finger may move nothing but its hand; {{ 9 * 51}} pose features in place of {{ 9 * 23}}
# - The order: 22 joints of the body, 15 left, 15 right

# %%
body, whole = wb.load_body("full"), wb.load_body("full-hands")
print(
    f"pose features: {body.posedirs.shape[2]} with {body.n_joints} joints, {whole.posedirs.shape[2]} with {whole.n_joints}"
)
index1 = whole.joint_names.index("left_index1")
pose = np.zeros((whole.n_joints, 3))
pose[index1, 2] = -1.0
shift = 1e3 * np.linalg.norm(whole.vertices(pose) - whole.vertices(), axis=1)
joints = whole.joints()
from_wrist = 1e3 * np.linalg.norm(
    whole.template - joints[whole.joint_names.index("left_wrist")], axis=1
)
moved = shift > 0.01  # mm
wrist = joints[whole.joint_names.index("left_wrist"), 0]  # the arm points along x
behind = 1e3 * (wrist - whole.template[moved, 0]).max()
of_finger = [whole.joint_names.index(f"left_index{n}") for n in (1, 2, 3)]
follows = (whole.weights[:, of_finger] > 0).any(axis=1)  # with a weight of the finger's joints
print(f"a turn of left_index1 moves {moved.sum()} of {whole.n_vertices} vertices")
print(
    f"{(moved & follows).sum()} of them follow the finger by their weights; blend shapes move the other "
    f"{(moved & ~follows).sum()}, by {shift[moved & ~follows].max():.1f} mm at most"
)
print(f"the farthest of them is {from_wrist[moved].max():.0f} mm away from the wrist")
print(f"they reach {behind:.0f} mm behind the wrist")


def around(vertices, side):
    """One hand of the body alone, with its faces."""
    keep = side * whole.template[:, 0] > 0.6
    numbers = np.cumsum(keep) - 1
    return vertices[keep], numbers[whole.faces[keep[whole.faces].all(axis=1)]]


def outwards(vertices):
    """The view from above; the fingers of a left hand point down."""
    x, y, z = vertices.T
    return np.column_stack([-z, -x, y])


def inwards(vertices):
    """The same for a right hand."""
    x, y, z = vertices.T
    return np.column_stack([z, x, y])


both = np.zeros((whole.n_joints, 3))
for side, sign in (("left", 1.0), ("right", -1.0)):
    of_hand = pose_space(whole, side=side)
    z = 2 * sign * of_hand.deviations * (np.arange(of_hand.n_components) == 0)
    both += of_hand.poses(whole, z)
drawn = []
for name, vertices in (("at rest", whole.vertices()), ("z1", whole.vertices(both))):
    for side, sign, look in (("right", -1, inwards), ("left", 1, outwards)):
        label = name if name == "at rest" else f"z1 = {2 * sign:+d} sd"
        cut_out, own = around(vertices, sign)
        drawn.append(Figurine(f"{side}, {label}", cut_out, look, faces=own))
with house_style():
    figure, (ax,) = sheet(9.0, 3.4)
    line_up(drawn, whole.faces, ax=ax)
    ax.set(ylabel="along the arm (m)")
Picture(
    figure,
    "The hands of a body with 52 joints, cut out for the picture. The first two are at rest. In the last "
    "two, the first coefficient of each hand's pose space opens the right hand and closes the left one; the other 22 "
    "joints do not turn.",
)

# %% slide [markdown]
# ## Two hands, two pose spaces
#
# - The first coefficient opens the right hand and closes the left; the other 22 joints do not turn.

# %% [markdown]
# One joint of a finger moves {{ moved.sum()}} of {{ whole.n_vertices}} vertices. Most of these,
# {{ (moved & ~follows).sum()}}, are no part of the finger: pose blend shapes move them, by
# {{ shift[moved & ~follows].max():.1f}} mm at most. All of the {{ moved.sum()}} are in the left hand or at most
# {{ behind:.0f}} mm behind its wrist, and the farthest one is {{ from_wrist[moved].max():.0f}} mm away from the
# wrist, at the tip of the finger. The rest of
# the body may be trained, fitted and diagnosed as before: nothing in the equations has changed.

# %% slide [markdown]
# ## One joint of a finger moves {{ moved.sum()}} of {{ whole.n_vertices:,}} vertices
#
# - {{ (moved & ~follows).sum()}} are no part of the finger: blend shapes move them, by
#   {{ shift[moved & ~follows].max():.1f}} mm at most.
# - All are in the hand, or at most {{ behind:.0f}} mm behind the wrist.

# %% [markdown]
# ## What to remember
#
# - A hand is a body of 16 joints. What is different is how much its angles have to do with each other: use a
#   pose space, a linear map of a few coefficients.
# - Ask of each file whether zero is flat or relaxed. Add the mean once.
# - In a mirror the sign of $x$ changes in positions and in shape directions, and those of $y$ and $z$ in rotation
#   vectors. Pose directions change with the elements of $R - I$ that they belong to as well.
# - Joints of a finger do not show its twists, nor how its end turns. Tips help, and the rest is the prior's.
# - Bodies and hands are trained apart and sewn together. Blend shapes of a finger belong to its hand.

# %% slide [markdown]
# ## What to remember
#
# - Use a pose space: a mean and a few coefficients. Ask whether zero is flat or relaxed.
# - Mirror: $x$ of positions, $y$ and $z$ of rotation vectors; pose directions once more
# - Joints show no twists; tips help, the prior does the rest. Bodies and hands are trained apart and sewn.
