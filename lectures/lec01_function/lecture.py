# %% [markdown]
# # A body model is a function
#
# **What kind of function turns pose and shape into a surface?**
#
# A body model takes some numbers for the pose of a person and some for the shape. It returns the positions of
# the points of a mesh that covers the skin. So it is a function, and the question is which kind of function it
# should be. Could it be linear, or a polynomial? We fit both to examples, watch them fail, and then see what kind
# of function [SMPL](https://doi.org/10.1145/2816795.2818013) is. Angles are in radians and lengths in metres.

# %%
from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.forward import surface
from workbench.bodies.forward.surface import rotation_elements
from workbench.course import Picture, source
from workbench.lectures.material.blend_shapes import PosedSurfaces, TrainingData
from workbench.lectures.material.linearity import linear_in
from workbench.lectures.material.replays import recorded_side_by_side
from workbench.lectures.material.teacher import body_on_teachers_rig, teacher_of
from workbench.plots import house_style, plot_differences, sheet
from workbench.plots.body import Figurine, line_up
from workbench.priors.poses import draw_poses, shipped_gaussian

# %%
person = wb.load_body("default")
two_poses = draw_poses(shipped_gaussian(), 2, np.random.default_rng(4))  # (2, 24, 3) rad
two_poses[:, 0] = 0


def in_poses(angle):
    """The surface in poses that lead round between two, (N, 3) m."""
    return person.vertices(np.cos(angle) * two_poses[0] + np.sin(angle) * two_poses[1])


def as_people(angle):
    """The surface of people that lead round between two shapes, (N, 3) m."""
    return person.vertices(
        betas=2.5 * np.eye(person.n_betas)[:2].T @ [np.cos(angle), np.sin(angle)]
    )


with house_style():
    figure, (ax,) = sheet(9, 3.8)
    four = {"pose 1": in_poses(0), "pose 2": in_poses(np.pi / 2)}
    four |= {"shape 1": as_people(0), "shape 2": as_people(np.pi / 2)}
    line_up([Figurine(name, v) for name, v in four.items()], person.faces, ax=ax)
Picture(
    figure,
    "One function, with other numbers for the pose (left) and for the shape (right). Nothing else changes.",
    lambda: recorded_side_by_side(
        person.faces,
        np.radians(np.arange(0, 361, 24)),
        {"pose": {"a body": in_poses}, "shape": {"a body": as_people}},
        "Press the triangle: the numbers of the pose go round between two poses. Choose the shape in place of "
        "the pose, and drag the body to turn it.",
        say=lambda angle: "Every surface is the value of one function.",
    ),
)

# %% [markdown]
# ## One input and one output
#
# We begin with one input and one output. An elbow bends by the angle $x$, and the tip of the middle finger is then
# at the distance $v$ to the left of the body's middle. Ten examples are given: ten angles, with the distance that
# belongs to each. We look for a function that gives these distances. A polynomial of degree three is
#
# $$ f(x; w) = w_3 x^3 + w_2 x^2 + w_1 x + w_0 . $$
#
# The number $x$ is the **input**. The numbers $w$ are the **parameters**: they say *which* polynomial it is. They
# are learned once, from examples. To learn them is a linear least-squares problem, because $f$ is linear in $w$.
# What somebody chooses before anything is learned, such as the degree of the polynomial, is called a
# **hyper-parameter**. (This course follows the lecture *Body Models II* by Pons-Moll and Swoboda (2018), which uses
# this word for the learned numbers $w$ of a body model. We use it for what is chosen and not learned.)

# %% slide [markdown]
# ## Numbers in, a surface out
#
# - In: the **pose** (how joints are turned) and the **shape** (who it is).
# - Out: the place of every point of a mesh that covers the skin.
# - What kind of function? The **parameters** $w$ are learned once, from examples; their number and kind are
#   chosen before.

# %%
body = wb.load_body("small")
elbow = body.joint_names.index("left_elbow")
finger = int(body.template[:, 0].argmax())  # the vertex furthest to the left


def tip(angle):
    """How far to the left the fingertip is when the left elbow is bent forwards, (n,) m."""
    pose = np.zeros((np.size(angle), 24, 3))
    pose[:, elbow, 1] = -np.ravel(angle)
    return body.vertices(pose)[:, finger, 0]


given = np.linspace(0, 2.2, 10)
far = np.linspace(-1.5, 2 * np.pi + 1, 300)
fits = {degree: np.polyfit(given, tip(given), degree) for degree in (1, 3)}
for degree, w in fits.items():
    inside = np.abs(np.polyval(w, given) - tip(given)).max()
    once_more = np.abs(np.polyval(w, given + 2 * np.pi) - tip(given + 2 * np.pi)).max()
    print(
        f"degree {degree}: off by up to {1e3 * inside:.0f} mm at the examples, "
        f"{1e3 * once_more:,.0f} mm one turn further"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    ax.plot(far, tip(far), color="0.3", lw=2, label="the body")
    ax.plot(given, tip(given), "ko", label="examples")
    for (degree, w), dash in zip(fits.items(), ("--", "-."), strict=True):
        ax.plot(far, np.polyval(w, far), dash, label=f"polynomial of degree {degree}")
    ax.set(xlabel="angle of the elbow (rad)", ylabel="fingertip, to the left (m)", ylim=(-0.2, 1.4))
    ax.legend()
Picture(
    figure,
    "The position of a fingertip as a function of the elbow's angle. The cubic follows the examples, "
    "but leaves the true curve where they end. The body comes back after a full turn (2 pi = 6.28); a "
    "polynomial never does.",
)

# %% slide [markdown]
# ## A cubic fits the examples and knows nothing of elbows
#
# - Off by {{ printed("degree 3")[1]:.0f }} mm at the ten examples
# - Off by {{ printed("degree 3")[2]:,.0f }} mm one full turn further

# %% [markdown]
# A polynomial does not know that an angle and the same angle plus a full turn are the same rotation. It follows the
# examples{{ np.allclose(tip(given + 2 * np.pi), tip(given)) }}{{ printed("degree 3")[1] < 5 and printed("degree 3")[2] > 1000 }}
# and knows nothing about elbows.
#
# A note on the source: *Body Models II* prints the cubic as $w_1 x^3 + w_2 x^2 + w_1 x + w_0$, with $w_1$ twice. The
# first one has to be $w_3$. With a single number for both coefficients, the best fit is worse:

# %% slide [markdown]
# ## Why: a polynomial never comes back
#
# - An angle and the same angle plus $2\pi$ are one rotation; the body is the same.
# - $f(x; w) = w_3 x^3 + w_2 x^2 + w_1 x + w_0$ leaves towards infinity.
# - It is linear in $w$: learning is a linear least-squares problem, and that is worth keeping.

# %%
errors = {}  # m
for name, columns in (
    ("w3, w2, w1, w0", [given**3, given**2, given, given**0]),
    ("w1, w2, w1, w0", [given**3 + given, given**2, given**0]),
):
    A = np.column_stack(columns)
    w = np.linalg.lstsq(A, tip(given), rcond=None)[0]
    errors[name] = np.abs(A @ w - tip(given)).max()
    print(f"{name}: off by up to {1e3 * errors[name]:.1f} mm at the examples")

# %% slide [markdown]
# ## A misprint: $w_1$ twice
#
# - *Body Models II* prints $w_1 x^3 + w_2 x^2 + w_1 x + w_0$.
# - With one number for two coefficients the best fit is
#   {{ errors["w1, w2, w1, w0"] / errors["w3, w2, w1, w0"]:.1f }} times as far off.

# %% [markdown]
# The largest error is {{ errors["w1, w2, w1, w0"] / errors["w3, w2, w1, w0"]:.1f }} times as large.
#
# ## The whole body
#
# Now we take the whole body: 72 numbers in, 369 vertices out. The examples are poses drawn from a statistical model
# of recorded poses, and for each pose the surface that belongs to it. The surfaces come from a *teacher*, which is
# another synthetic body, whose skin follows fixed rules. (In the teacher a twist spreads gradually along the limb.
# SMPL cannot do this exactly, so SMPL makes errors as well.) The root joint stays at rest, because functions without
# bones could not cope with turns of the whole body. We learn
#
# - a linear function of the 72 numbers, and
# - a polynomial that also has the square and the cube of each number.
#
# The polynomial has {{ 1 + 3 * 72 }} parameters for every coordinate, and four hundred examples determine them only
# roughly. So we
# use *ridge regression*, which is least squares with a penalty on large parameters. We compare both functions with two models that have bones, which
# the skin follows. The first is SMPL without its pose blend shapes, which learns nothing from the poses. The second is
# SMPL with pose blend shapes (lecture 5), which are learned from the same four hundred examples. All of them are tried
# on sixty other poses:

# %% slide [markdown]
# ## The whole body: 72 numbers in, 369 vertices out
#
# - Four hundred examples: recorded poses, and the surface of a **teacher**, a body with fixed rules
# - Four learners: linear, with cubes, bones without learning, and SMPL
# - Sixty other poses to be tried on

# %%
rng = np.random.default_rng(0)
teacher, bones = teacher_of(body), body_on_teachers_rig(body)


def examples(n):
    """Poses (n, 24, 3) rad, and the teacher's surfaces in them, (n, 369, 3) m."""
    poses = draw_poses(shipped_gaussian(), n, rng)
    poses[:, 0] = 0
    return poses, np.stack([teacher.vertices(pose) for pose in poses])


def powers(poses, degree):
    """1, x, x^2, ... of every number of the pose, (n, 1 + 72 degree)."""
    x = poses.reshape(len(poses), -1)
    return np.column_stack([np.ones(len(x)), *(x**k for k in range(1, degree + 1))])


poses, surfaces = examples(400)
test_poses, test_surfaces = examples(60)
training, validation = PosedSurfaces(poses, surfaces), PosedSurfaces(*examples(40))
data = TrainingData(bones, training, validation)  # the ridge is chosen by validation
posedirs, _ = data.fit(rotation_elements, data.correctives(bones))


def learned(degree, ridge=1.0):
    """Surfaces that ridge regression predicts for the test poses, (60, 369, 3) m."""
    A, V = powers(poses, degree), surfaces.reshape(len(poses), -1)
    w = np.linalg.solve(A.T @ A + ridge * np.eye(A.shape[1]), A.T @ V)
    return (powers(test_poses, degree) @ w).reshape(-1, body.n_vertices, 3)


predictions = {
    "linear in theta": learned(1),
    "cubes of theta": learned(3),
    "bones and skin": bones.vertices(test_poses),
    "SMPL": replace(bones, posedirs=posedirs).vertices(test_poses),
}
mean = {}  # m
for name, found in predictions.items():
    off = np.linalg.norm(found - test_surfaces, axis=2)
    mean[name] = off.mean()
    print(f"{name:16} mean {1e3 * mean[name]:5.1f} mm, largest {1e3 * off.max():4.0f} mm")

# %% slide [markdown]
# ## Four learners, sixty new poses
#
# | | mean error | |
# | --- | --- | --- |
# | linear in the pose | {{ 1e3 * mean["linear in theta"]:.1f }} mm | learned |
# | with squares and cubes | {{ 1e3 * mean["cubes of theta"]:.1f }} mm | learned |
# | bones and skin | {{ 1e3 * mean["bones and skin"]:.1f }} mm | nothing learned |
# | SMPL | {{ 1e3 * mean["SMPL"]:.2f }} mm | learned |
#
# - Bones that learned nothing beat a polynomial that learned
#   everything.{{ 20 * mean["bones and skin"] < mean["cubes of theta"] }}

# %%
worst = np.linalg.norm(predictions["linear in theta"] - test_surfaces, axis=2).mean(axis=1).argmax()
shown = {name: predictions[name][worst] for name in ("linear in theta", "cubes of theta", "SMPL")}
with house_style():
    figure, (ax,) = sheet(9, 4.6)
    plot_differences(test_surfaces[worst], shown, body.faces, ax=ax, name="the teacher")
Picture(
    figure,
    "A pose that is not among the examples, as three functions predict it, coloured by the distance to "
    "the teacher's surface. In the models without bones, limbs shrink, and they bend where there is no "
    "joint.",
)

# %% slide [markdown]
# ## Without bones, limbs shrink and bend where there is no joint
#
# - A pose that is not among the examples
# - Colour: the distance to the teacher's surface

# %% [markdown]
# Four hundred examples do not teach a polynomial what an arm is: both polynomials are off by centimetres on average
# ({{ 1e3 * mean["linear in theta"]:.0f }} and {{ 1e3 * mean["cubes of theta"]:.0f }} mm), and SMPL by
# {{ 1e3 * mean["SMPL"]:.2f }}
# mm{{ 20 * mean["bones and skin"] < mean["cubes of theta"] < 0.9 * mean["linear in theta"] < 0.08 }}. More terms would need
# more examples. (A full cubic in 72 numbers has
# $\binom{75}{3}$ = {{ 75 * 74 * 73 // 6:,}} coefficients for every coordinate.) And no number of terms tells the
# function that **bones
# keep their length**.
#
# This can be worked out for the linear function. For the pose halfway between two others, it predicts the mean of the
# two surfaces. Let the forearm point along $v_1$ in one pose and along $v_2$ in the other, with the angle $\alpha$
# between them and the same length $\|v\|$. The squared length of their mean is
#
# $$
# \tfrac14 \|v_1 + v_2\|^2 = \tfrac14 \left( \|v_1\|^2 + \|v_2\|^2 + 2\, v_1^\top v_2 \right)
# = \tfrac12 \|v\|^2 (1 + \cos \alpha) = \|v\|^2 \cos^2 \tfrac{\alpha}{2} ,
# $$
#
# so this mean makes it shorter, by the factor $\cos \tfrac{\alpha}{2}$:

# %% slide [markdown]
# ## Would more terms help?
#
# - A full cubic in 72 numbers has $\binom{75}{3}$ = {{ 75 * 74 * 73 // 6:,}} coefficients for every coordinate.
# - No number of terms says that **bones keep their length**.

# %%
for alpha in (0.5, 1.0, 2.0, 3.0):
    ends = np.array([[np.cos(a), np.sin(a)] for a in (0, alpha)])
    print(
        f"{alpha} rad apart: {np.linalg.norm(ends.mean(axis=0)):.3f} of the length, "
        f"cos(alpha / 2) = {np.cos(alpha / 2):.3f}"
    )

# %% slide [markdown]
# ## Halfway between two poses, a linear function shortens the bone
#
# $$ \tfrac14 \|v_1 + v_2\|^2 = \|v\|^2 \cos^2 \tfrac{\alpha}{2} $$
#
# - It predicts the mean of the two surfaces, so a bone shrinks to $\cos \tfrac{\alpha}{2}$ of its length.
# - 2 rad apart: {{ np.cos(1.0):.2f }} of the length is left; 3 rad apart: {{ np.cos(1.5):.2f }}

# %% [markdown]
# ## The idea: build in what is known
#
# SMPL is a function
#
# $$ M(\theta, \beta; w), \qquad w = \{ \bar T, S, P, W, \mathcal J \} $$
#
# of two inputs, the pose $\theta$ (24 rotation vectors) and the shape $\beta$ (a few numbers). That bones turn
# and keep their length is built into the function. Its parameters are what is not known, and has to be learned
# once from scans:
#
# - the template $\bar T$, which is the surface of the average person at rest,
# - the directions $S$ in which people differ,
# - the directions $P$ in which the pose deforms them,
# - the weights $W$, which say which bones a vertex follows, and
# - the regressor $\mathcal J$, which computes the joints from a surface.
#
# The library first computes the person at rest, which is the template plus what the shape adds, and the joints of
# that person:

# %% slide [markdown]
# ## The idea: build in what is known, learn the rest
#
# $$ M(\theta, \beta; w), \qquad w = \{ \bar T, S, P, W, \mathcal J \} $$
#
# - Built in: bones turn and keep their length.
# - Two inputs: pose $\theta$, 24 rotation vectors, and shape $\beta$, a few numbers
# - Everything else is a parameter, learned once from scans.

# %%
source(surface.rest)

# %% slide [markdown]
# ## First the person at rest, $\bar T + B_S(\beta) + B_P(\theta)$
#
# - The template, plus what the shape adds, plus what the pose deforms
# - The joints are those of *that* person, computed from the surface by $\mathcal J$
#
# ```python
# person = shaped(body, at.betas, vertices)
# corrections = directions(body, "posedirs", vertices) @ body.features(at)
# return person + cs.reshape(corrections, person.shape)
# ```

# %% [markdown]
# Then it adds what the pose deforms, and turns the bones:

# %% slide [markdown]
# ## What is learned
#
# - $\bar T$, the average person at rest; $S$, the directions in which people differ
# - $P$, the directions in which the pose deforms them; $W$, which bones a vertex follows
# - $\mathcal J$, which computes the joints from a surface

# %%
source(surface.posed)

# %% slide [markdown]
# ## Then bones turn, and carry the skin
#
# - Then bones turn, and the skin follows them: `G` has a motion for each bone.
#
# ```python
# at = posture(body, pose, betas)
# G, _ = motions(body, at)
# points = rest(body, at, vertices)
# ...
# skinned = body.skinning(points, G, weights(body, vertices))
# return skinned + cs.repmat(trans, 1, points.shape[1])
# ```

# %% [markdown]
# How many numbers are these parameters? The released model has 6,890 vertices, {{ 23 }} joints and a root,
# and 10 shape directions:

# %%
N, K, B = 6890, 24, 10
counts = {
    "template": 3 * N,
    "shapedirs": 3 * N * B,
    "posedirs": 3 * N * 9 * (K - 1),
    "weights": N * K,
    "J_regressor": N * K,
}
for name, n in counts.items():
    print(f"{name:12}{n:>10,}")
print(f"{'together':12}{sum(counts.values()):>10,}")

# %% slide [markdown]
# ## How many numbers are learned?
#
# | | numbers |
# | --- | --- |
# | template | {{ counts["template"]:,}} |
# | shape directions | {{ counts["shapedirs"]:,}} |
# | pose directions | {{ counts["posedirs"]:,}} |
# | weights, regressor | {{ counts["weights"]:,}} each |
# | together | {{ sum(counts.values()):,}} |
#
# - The pose directions are {{ 100 * counts["posedirs"] / sum(counts.values()):.0f}} % of the model.

# %% [markdown]
# (The table in *Body Models II* adds up to {{ 6014970:,}}. Two of its rows count something else than a model file
# holds: it counts the regressor as a map from all coordinates of the vertices to all coordinates of the
# joints, and the four weights of a vertex as twelve.)
#
# ## In which arguments is it linear?
#
# So SMPL is neither linear nor a polynomial of its pose. But we may look at one argument at a time: in which of them
# is SMPL linear (up to a constant) while the others are held fixed? CasADi, the library in which the
# workbench writes its formulas, keeps the whole expression and can tell:


# %% slide [markdown]
# ## In which arguments is it linear?
#
# - Not in all of them together: it is no polynomial of the pose.
# - Look at *one* argument while the others are held fixed.
# - CasADi keeps the whole expression, so it can prove the answer.

# %%
some = (10, 200, finger)  # vertices
for names in (
    ("template",),
    ("shapedirs",),
    ("posedirs",),
    ("weights",),
    ("betas",),
    ("trans",),
    ("template", "posedirs"),
    ("weights", "posedirs"),
    ("shapedirs", "betas"),
    ("pose",),
):
    print(f"{' and '.join(names):24}{'linear' if linear_in(body, names, some) else 'not linear'}")

# %% slide [markdown]
# ## Linear in every argument but the pose
#
# | | |
# | --- | --- |
# | each alone: template, directions, weights, betas, place | linear |
# | template **and** pose directions | linear |
# | weights **and** pose directions | not linear |
# | pose | not linear |
#
# -
#   {{ linear_in(body, ("template", "posedirs"), some) and not linear_in(body, ("weights", "posedirs"), some) and not linear_in(body, ("pose",), some) }}Arguments
#   that are multiplied with each other are not linear together.

# %% [markdown]
# SMPL is not linear in the pose. It is linear in each of the other arguments alone, but not in two arguments together
# that are multiplied with each
# other{{ not linear_in(body, ("pose",), some) }}{{ all(linear_in(body, (name,), some) for name in ("template", "shapedirs", "posedirs", "weights", "betas", "trans")) }}{{ not linear_in(body, ("weights", "posedirs"), some) }},
# such as the shape directions and the betas.
# This helps a great deal when a model is trained. When the poses are known, the template and the pose directions are
# the solution of *one* linear least-squares problem{{ linear_in(body, ("template", "posedirs"), some) }}; when these
# are known, the weights are the solution
# of another (lecture 13). With a finished model, only the pose needs a nonlinear solver, and most of this course is
# about that.
#
# ## What to remember
#
# - A body model is a function of pose and shape; its parameters have been learned beforehand.
# - Polynomials of angles do not come back after a full turn. Halfway through a turn by $\alpha$, linear
#   interpolation shortens a bone by the factor $\cos(\alpha/2)$.
# - Taken one at a time, all arguments of SMPL but the pose enter linearly.

# %% slide [markdown]
# ## What linearity buys
#
# - Known poses: template and pose directions are **one** linear least-squares problem.
# - Then the weights are another one (lecture 13).
# - A finished model: only the pose needs a nonlinear solver. Most of this course is about that.

# %% slide [markdown]
# ## What to remember
#
# - A body model is a function of pose and shape; its parameters were learned beforehand.
# - Polynomials of angles never come back, and halfway they shorten bones by $\cos(\alpha/2)$.
# - One at a time, every argument of SMPL but the pose enters linearly.
