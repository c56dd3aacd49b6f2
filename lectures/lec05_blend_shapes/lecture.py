# %% [markdown]
# # Blend shapes
#
# **How does a surface learn from examples what skinning gets wrong?**
#
# Linear blend skinning thins a twisted wrist and flattens a bent elbow (lecture 4). Suppose that we
# have examples: poses in which we know the right surface. We store them and interpolate, watch that
# fail far from the examples, and come to the blend shapes of SMPL: of pose, then of shape, and to the
# joints that go with them. Lengths are in metres, angles in radians.

# %%
from dataclasses import replace

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies import shapes, surface
from workbench.bodies.kinematics import pose_features
from workbench.bodies.scattered import Gaussians, Shares
from workbench.bodies.tubes import tube
from workbench.course import Picture, source
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots import house_style, plot_differences, plot_shape_gallery, sheet

# %% [markdown]
# ## What is to be added, and where
#
# Lecture 4's tube with one joint in its middle shall be an elbow. As the truth we take the same tube
# skinned by dual quaternions: not real skin, but a surface that keeps its thickness. The joint sits at
# the origin, and the first bone does not move. So linear blending takes the vertex $t_i$ to $M_i t_i$
# with
#
# $$ M_i = (1 - w_i)\, I + w_i R . $$


# %%
pipe = tube(rings=31, around=16)  # 60 cm long, 10 cm thick
truth = replace(pipe, skinning=wb.dual_quaternion_blend)
T, w = pipe.template, pipe.weights[:, 1]


def posed(body, theta):
    """Surfaces (n, N, 3) m for rotation vectors (n, 3) rad of the joint."""
    return body.vertices(np.stack([np.zeros_like(theta), theta], axis=1))


def blends(theta):
    """M_i for each pose and vertex, (n, N, 3, 3)."""
    R = matrix_from_vector(theta)[:, None]
    return (1 - w)[:, None, None] * np.eye(3) + w[:, None, None] * R


def skinned(theta, bulge):
    """The posed surface when the displacements `bulge` (n, N, 3) are added at rest."""
    return np.einsum("niab,nib->nia", blends(theta), T + bulge)


def rms(a):
    """Root mean square length of displacements (..., N, 3), in mm."""
    return 1e3 * np.sqrt(np.mean(np.sum(a**2, axis=-1), axis=-1))


bend = np.array([[0, 0, 2.0]])  # 115 degrees
missing = posed(truth, bend) - posed(pipe, bend)
print(f"linear blending is off by {rms(missing)[0]:.1f} mm at this bend")

# %% [markdown]
# A **blend shape** is a displacement for every vertex, $P \in \mathbb R^{3N}$. The naive thing is to
# store what is missing and to add it to the template before skinning. But skinning then turns it, too.
# What has to be added at rest is what skinning takes to the right place:
#
# $$ M_i\, (t_i + P_i) = v_i \qquad\Rightarrow\qquad P_i = M_i^{-1} v_i - t_i . $$


# %%
def at_rest(theta, v):
    """The displacements (n, N, 3) m that skinning takes to the surfaces v."""
    return np.linalg.solve(blends(theta), v[..., None])[..., 0] - T


for name, bulge in (("as seen in the pose", missing),
                    ("turned back by R'", missing @ matrix_from_vector(bend)[0]),
                    ("by the inverse of M", at_rest(bend, posed(truth, bend)))):  # fmt: skip
    print(
        f"added at rest, {name:20}: off by {rms(skinned(bend, bulge) - posed(truth, bend))[0]:.1f} mm"
    )

# %% [markdown]
# A transpose does not do: $M_i$ is a mean of rotations, and no rotation. The inverse meets the example
# exactly. So a pose has its blend shape. Now for poses between examples.
#
# ## Scattered data
#
# Lewis, Cordner and Fong (2000) let each example $i$ have a share that falls with the distance between
# its pose $\theta^i$ and the one asked for:
#
# $$
# K_i = e^{-\|\theta - \theta^i\|^2 / \tau^2}, \qquad
# B_P(\theta) = \sum_i \lambda_i P_i, \qquad \lambda_i = \frac{K_i}{\sum_j K_j} .
# $$
#
# A slide that this course follows only says that $\lambda_i$ is proportional to $K_i$. Divide, or do
# not? A third way divides by nothing, and solves for other shapes $Q_j$ with
# $\sum_j K_j(\theta^i)\, Q_j = P_i$ so that all examples come out exactly. We take five examples, the
# elbow bent by 0 to 120 degrees.

# %%
width = np.radians(30)  # tau
degrees = np.arange(0, 121, 30)
places = np.radians(degrees)[:, None] * [0, 0, 1]
examples = at_rest(places, posed(truth, places))


def kernels(theta):
    """K_i, (n, examples)."""
    away = theta[:, None] - places
    return np.exp(-np.sum(away**2, axis=2) / width**2)


exact = np.linalg.solve(kernels(places), examples.reshape(len(places), -1)).reshape(examples.shape)


def interpolated(theta):
    """Three ways to blend the examples, each (n, N, 3) m."""
    K = kernels(theta)
    shares = K / K.sum(axis=1, keepdims=True)
    return {
        "not normalised": np.tensordot(K, examples, 1),
        "normalised": np.tensordot(shares, examples, 1),
        "solved for": np.tensordot(K, exact, 1),
    }


asked = {"at the examples": degrees, "half-way between": degrees[:-1] + 15, "bent backwards": [-60]}
for where, angle in asked.items():
    theta = np.radians(angle)[:, None] * [0, 0, 1]
    off = {"no blend shapes": rms(posed(pipe, theta) - posed(truth, theta))}
    off |= {n: rms(skinned(theta, b) - posed(truth, theta)) for n, b in interpolated(theta).items()}
    print(f"{where:17}", ", ".join(f"{n} {o.mean():.2f} mm" for n, o in off.items()))

# %%
sweep = np.radians(np.arange(-170, 171, 5))
theta = sweep[:, None] * [0, 0, 1]
right = posed(truth, theta)
with house_style():
    figure, (ax,) = sheet(8, 3.8)
    ax.plot(np.degrees(sweep), rms(posed(pipe, theta) - right), color="0.6", lw=4,
            label="no blend shapes")  # fmt: skip
    for (name, bulge), dash in zip(interpolated(theta).items(), ("--", "-.", "-"), strict=True):
        ax.plot(np.degrees(sweep), rms(skinned(theta, bulge) - right), dash, label=name)
    ax.plot(degrees, 0 * degrees, "k^", clip_on=False, label="examples")
    ax.set(xlabel="bend of the elbow (degrees)", ylabel="off the truth (mm, rms)", ylim=(0, 12))
    ax.legend(loc="upper center", ncols=2)
Picture(
    figure,
    "Five examples, interpolated. Among the examples the lower two curves are good, and the one solved "
    "for meets every example; bent backwards, all three leave the error of skinning as it is.",
)

# %% [markdown]
# Not normalised is hardly better than nothing: at an example its neighbours add their own shapes to it.
# Divided by the sum, it comes near; solved for, it is exact at the examples, and wavers a little between
# them. The library has the plain kernels (for solving) and the divided ones. `Shares` takes the
# logarithm of the sum, because far away all $K_i$ are zero in the computer, and $0/0$ is no share.

# %%
source(Gaussians.__call__)

# %%
source(Shares.__call__)

# %% [markdown]
# There are two problems. **Far from all examples** the plain kernels fall to nothing, and shares go to
# the nearest example, however far that is. And **how many** must there be? Five for a bend of one joint
# along one axis. A joint has three numbers, and a body 23 such joints:

# %%
far = np.array([[0, 2.0, 0]])  # the same bend about another axis
K = kernels(far)[0]
print("a bend about y instead of z: kernels sum to", f"{K.sum():.0e};",
      "shares", (K / K.sum()).round(3))  # fmt: skip
print(f"five each way: {5**3} examples for one joint, 10^{69 * np.log10(5):.0f} for the body")

# %% [markdown]
# ## The idea: a shape for each number of the pose
#
# Do not store examples; store what can be *learned* from them. Make $B_P$ linear in some features
# $f(\theta)$ of the pose,
#
# $$ B_P(\theta) = \sum_n f_n(\theta)\, P_n , $$
#
# so that the $P_n$ are found by linear least squares from as many examples as there are, and cost the
# same for ever after. Which $f$? The first that comes to mind is $f(\theta) = \theta$. SMPL has the
# nine elements of each joint's rotation, less those at rest:
#
# $$ f(\theta) = \mathrm{vec}(R_k(\theta) - I), \quad k = 1, \dots, 23 . $$
#
# Learn both from 60 poses: the elbow bends up to 2 rad one way, and twists by up to 1 rad both ways.

# %%
rng = np.random.default_rng(0)


def draw(n):
    """Rotation vectors (n, 3) rad of an elbow."""
    return np.column_stack(
        [rng.uniform(-1, 1, n), 0.2 * rng.standard_normal(n), rng.uniform(0, 2, n)]
    )


features = {
    "theta": lambda theta: theta,
    "rotation elements": lambda theta: (matrix_from_vector(theta) - np.eye(3)).reshape(-1, 9),
}
lesson, test = draw(60), draw(200)
target = at_rest(lesson, posed(truth, lesson)).reshape(60, -1)
learned = {
    n: np.linalg.lstsq(f(lesson), target, rcond=1e-6)[0].reshape(-1, *T.shape)
    for n, f in features.items()
}


def predicted(name, theta):
    """B_P(theta), (n, N, 3) m."""
    return np.tensordot(features[name](theta), learned[name], 1)


right = posed(truth, test)
print(f"unseen poses, skinning alone: {rms(posed(pipe, test) - right).mean():.2f} mm")
for name in features:
    off = rms(skinned(test, predicted(name, test)) - right).mean()
    print(f"f = {name:18}: {off:.2f} mm, with {len(learned[name])} shapes")

# %% [markdown]
# Now do what a slide does with a neck: turn the joint right round, twice. After a full turn it is where
# it was, the same rotation. So the surface should be what it was.

# %%
around = np.radians(np.arange(0, 721, 5))
turning = around[:, None] * [0, 0, 1]
sizes = {name: rms(predicted(name, turning)) for name in features}
for name, size in sizes.items():
    print(f"f = {name:18}: rms of B_P at 0, 360, 720 degrees:", size[[0, 72, 144]].round(2), "mm")
t, axis = 1.3, np.array([0.6, 0, 0.8])
one, other = t * axis[None], (t - 2 * np.pi) * axis[None]
for name in features:
    gap = rms(predicted(name, one) - predicted(name, other))[0]
    print(f"f = {name:18}: two vectors of one rotation, B_P differs by {gap:.2f} mm")

with house_style():
    figure, (ax,) = sheet(8, 3.6)
    for (name, size), dash in zip(sizes.items(), ("--", "-"), strict=True):
        ax.plot(np.degrees(around), size, dash, label=f"f = {name}")
    ax.axvspan(0, 115, color="0.9", label="bends of the lesson")
    ax.set(xlabel="turn (degrees)", ylabel="size of B_P (mm, rms)", xticks=range(0, 721, 90))
    ax.legend(loc="upper left", bbox_to_anchor=(0.21, 1))
Picture(
    figure,
    "The size of the blend shapes while the joint turns twice about the axis of its bend. Those of theta "
    "grow for ever; those of the rotation's elements come back to zero at each full turn.",
)

# %% [markdown]
# Elements of a rotation are between $-1$ and $1$, so $|f_n| \le 2$; they are the same for every vector
# of one rotation; and at rest they are zero, hence $B_P$ is. They still are a guess: skin is not
# linear in $R$. But a good one, and it cannot run away.
#
# ## In SMPL
#
# The joint at the root is left out: turning the whole body changes no skin. So there are
# $9 \cdot 23 = 207$ features. Their order matters: entry $9 (k - 1) + 3 r + c$ is row $r$, column $c$ of
# joint $k$. CasADi (like Fortran) counts down columns, NumPy along rows; hence the transpose:

# %%
source(pose_features)

# %%
body = wb.load_body("default")
joint = {name: k for k, name in enumerate(body.joint_names)}
pose = np.zeros((24, 3))
pose[joint["left_elbow"]] = [0.3, -1.6, 0.2]


def elements(pose):
    """vec(R_k - I), row by row, of all joints but the root, (207,)."""
    return (matrix_from_vector(pose)[1:] - np.eye(3)).ravel()


f = elements(pose)
k = joint["left_elbow"]
print(f"posedirs are {body.posedirs.shape}; the elbow, joint {k}, touches columns",
      np.flatnonzero(f)[[0, -1]], f"= 9 ({k} - 1) and on")  # fmt: skip
wrong = (matrix_from_vector(pose)[1:] - np.eye(3)).transpose(0, 2, 1).ravel()
print(f"largest displacement {1e3 * np.linalg.norm(body.posedirs @ f, axis=1).max():.0f} mm; "
      f"columns for rows: off by up to "
      f"{1e3 * np.linalg.norm(body.posedirs @ (f - wrong), axis=1).max():.0f} mm, and no complaint")  # fmt: skip
R = cs.MX.sym("R", 3, 72)
print("linear in R:", cs.is_linear(pose_features(R, cs.repmat(cs.MX.eye(3), 1, 24)), R),
      "- and the f(theta) of this body is", body.features.__name__)  # fmt: skip

# %%
pose[joint["right_knee"], 0] = 1.8
pose[joint["right_wrist"], 0] = 1.6


def aslant(v):
    """Seen from half left."""
    return v @ matrix_from_vector([0, -0.7, 0]).T


bulged = body.template + body.posedirs @ elements(pose)
with house_style():
    figure, (ax,) = sheet(10, 4.8)
    plot_differences(body.template, {"with B_P, at rest": bulged}, body.faces, ax=ax, look=aslant,
                     name="the template")  # fmt: skip
Picture(
    figure,
    "What the left elbow, right wrist and right knee of a posed body add to the template, before "
    "anything is skinned. It looks wrong at rest, and is there to be right after skinning.",
)

# %% [markdown]
# (A slide counts the numbers of $P$ as $9 \cdot 23 \cdot 6890$, and gives the value 4,278,690. That is
# $3 \cdot 9 \cdot 23 \cdot 6890$: each shape has three coordinates for each vertex. The value is right.)
#
# ## Shape
#
# People differ as well, and that is linear from the start:
#
# $$ T(\beta) = \bar T + \sum_m \beta_m S_m . $$
#
# The $S_m$ are principal components of people at rest: each explains as much variance as can be
# explained after those before it. In SMPL's files they are *scaled*: $\beta_m = 1$ is one standard
# deviation. So the length of $S_m$ says how much people differ along it, and directions of length one
# would be another convention: then the same $\beta$ means another person.

# %%
variance = shapes.variances(body)  # m^2, the squared lengths of the S_m
S = body.shapedirs.reshape(-1, body.n_betas)
unit = S / np.linalg.norm(S, axis=0)
print("rms of one standard deviation:",
      (1e3 * np.sqrt(variance[:5] / body.n_vertices)).round(1), "mm")  # fmt: skip
print(f"columns at right angles: cosines below {np.abs(unit.T @ unit - np.eye(10)).max():.0e}")
gallery = {
    f"S{m + 1}, {amount:+d} sd": body.vertices(betas=shapes.along(body, m, amount))
    for m in (0, 1)
    for amount in (-3, 3)
}
gallery = {"the mean": body.template} | gallery
with house_style():
    figure, (ax,) = sheet(10, 3)
    plot_shape_gallery(gallery, body.faces, ax=ax)
Picture(
    figure,
    "The mean person, and three standard deviations along the first two directions of shape. The first "
    "makes them larger as a whole, the second broader at the shoulders.",
)

# %% [markdown]
# ## Joints
#
# A tall person's elbow is elsewhere than the mean person's. Where? Joints are inside, and nobody sees
# them. SMPL takes each as a fixed weighted mean of rest vertices,
#
# $$ J(\beta) = \mathcal J\, (\bar T + S \beta), \qquad \mathcal J \ge 0, \text{ rows sum to one} . $$
#
# Such a mean goes along when everybody is moved or scaled, and stays inside the surface's hull. What
# if we save ourselves the trouble, and give everybody the joints of the mean person?

# %%
tall = shapes.along(body, 0, 3)
lazy = shapes.with_joints_of_the_mean(body, tall)
moves = shapes.joint_moves(body, tall)
print(
    f"joints of a person at +3 sd: {1e3 * moves.min():.0f} to {1e3 * moves.max():.0f} mm from the mean's"
)
rows = body.J_regressor.toarray()
print(f"rows sum to 1 within {np.abs(rows.sum(axis=1) - 1).max():.0e}, least entry {rows.min():.0e}, "
      f"{np.mean((rows > 0).sum(axis=1)):.0f} vertices for a joint")  # fmt: skip
bent = np.zeros((24, 3))
bent[joint["left_knee"], 0] = bent[joint["right_knee"], 0] = 1.6
bent[joint["left_elbow"], 1] = -1.9
right, found = body.vertices(bent, tall), lazy.vertices(bent)
print(
    f"bent, with the mean's joints: off by up to {1e3 * np.linalg.norm(found - right, axis=1).max():.0f} mm"
)

with house_style():
    figure, (ax,) = sheet(10, 4.8)
    plot_differences(right, {"on the mean's joints": found}, body.faces, ax=ax, look=aslant,
                     name="their own joints")  # fmt: skip
Picture(
    figure,
    "A tall person with bent knees and a bent elbow, on their own joints and on those of the mean "
    "person: shins and forearm turn about the wrong place.",
)

# %% [markdown]
# ## All of it
#
# That was the last piece. The rest surface is $\bar T + B_S(\beta) + B_P(\theta)$, the joints come from
# $\bar T + B_S(\beta)$ *without* the pose's part (or bending would move the joints), and skinning moves
# it all:
#
# $$ M(\beta, \theta) = W\big(\bar T + B_S(\beta) + B_P(\theta),\; J(\beta),\; \theta,\; \mathcal W\big) . $$

# %%
source(surface.rest)

# %%
source(surface.posed)

# %% [markdown]
# ## What to remember
#
# - A blend shape is added at rest; from a posed example it is $M^{-1} v - t$. $M$ is no rotation.
# - Scattered data: divide by the sum. It costs a shape for each example, and knows nothing far away.
# - $f(\theta) = \theta$ tells one rotation from itself, and grows for ever. Elements of $R - I$ do not;
#   their order is row by row, without the root.
# - Shape is linear, with $\beta$ in standard deviations. Joints are weighted means of rest vertices.
