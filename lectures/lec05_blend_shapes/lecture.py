# %% [markdown]
# # Blend shapes
#
# **How does a surface learn from examples what skinning gets wrong?**
#
# Lecture 4 ended with skin that collapses at an elbow. An artist would take the bad poses, one by one, and push the
# vertices to where they belong. We begin with such examples, and find out how to use them in other poses. This leads
# to the two kinds of blend shapes of SMPL: for poses, and for people. Lengths are in metres and angles in radians.

# %%
from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.bodies.forward import surface
from workbench.bodies.forward.kinematics import pose_features
from workbench.bodies.forward.posing import unpose
from workbench.bodies.forward.surface import rotation_elements, rotation_vectors
from workbench.course import Picture, source
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.material.kernel_features import (
    Examples,
    GaussianKernels,
    NormalisedKernels,
    as_posedirs,
)
from workbench.lectures.material.shape_directions import along, joint_moves, with_joints_of_the_mean
from workbench.lectures.material.tubes import tube
from workbench.plots import caption_shape_gallery, house_style, plot_shape_gallery, sheet
from workbench.plots.body import Figurine, line_up, side
from workbench.priors.poses import draw_poses, shipped_gaussian, shipped_mixture
from workbench.training.blend_shapes import MaskedCholesky, local_features

# %% [markdown]
# ## What an artist would do
#
# The arm is the tube of lecture 4, blended linearly. We need to know how it ought to look, so we call the truth what
# dual quaternions make of it. In a pose $\theta$ linear blending moves each vertex by a matrix $H$ and an offset
# $h$, which belong to this vertex and this pose: from $v$ to $H v + h$. We want the vertex to end at its true place
# $v^*$. If it starts at rest from its place $t$ in the template, it does not. Suppose that it starts from $t + p$
# instead. Then it ends at $H (t + p) + h$. This is $v^*$ if
#
# $$ H (t + p) = v^* - h , \qquad \text{so that} \qquad p = H^{-1} (v^* - h) - t . $$
#
# The displacements $p$ of all $N$ vertices together are a **blend shape** $P$: a displacement of the *rest* surface,
# $3 N$ numbers. Here is one for an elbow bent by 90 degrees:

# %% slide [markdown]
# ## What an artist would do: push the vertices back
#
# $$ H (t + p) + h = v^* \quad\Rightarrow\quad p = H^{-1} (v^* - h) - t $$
#
# - Skinning moves a vertex by $v \mapsto H v + h$; we want it at $v^*$.
# - So displace the surface **at rest**: a blend shape, $3 N$ numbers

# %%
arm = tube(rings=31)
truth = replace(arm, skinning=wb.dual_quaternion_blend)
zone = np.abs(arm.template[:, 0]) < 0.05  # m: the skin around the joint


def bent(angle):
    """The pose (2, 3) rad of the arm with its elbow bent by `angle`."""
    pose = np.zeros((2, 3))
    pose[1, 2] = angle
    return pose


def needed(angle):
    """The blend shape (N, 3) m that makes linear blending right at this angle."""
    G = arm.kinematics.motion(bent(angle), np.zeros(1)).G  # (2, 3, 4)
    Hh = np.einsum("nk,kij->nij", arm.weights, G)  # (N, 3, 4): H beside h, for each vertex
    away = truth.vertices(bent(angle)) - Hh[:, :, 3]
    return np.linalg.solve(Hh[:, :, :3], away[:, :, None])[:, :, 0] - arm.template


def errors(body, angles):
    """How far the skin around the joint is from the truth, root mean square, (A,) mm."""
    poses = np.array([bent(angle) for angle in angles])
    off = (body.vertices(poses) - truth.vertices(poses))[:, zone]
    return 1e3 * np.sqrt(np.mean(np.sum(off**2, axis=2), axis=1))


def error(body, angle):
    """How far the skin around the joint is from the truth at one angle, root mean square, mm."""
    return errors(body, [angle])[0]


shape = needed(np.pi / 2)
repaired = replace(arm, template=arm.template + shape)
print(
    f"bent by 90 degrees: off by {error(arm, np.pi / 2):.1f} mm; with the blend shape "
    f"{error(repaired, np.pi / 2):.0e} mm"
)
print(
    f"the same at rest: off by {error(arm, 0):.1f} mm; with the blend shape {error(repaired, 0):.1f} mm"
)

# %% slide [markdown]
# ## Perfect in its pose, harmful at rest
#
# - Bent by 90 degrees: off by {{ error(arm, np.pi / 2):.1f}} mm, with the blend shape by
#   rounding{{ error(repaired, np.pi / 2) < 1e-10 }}
# - At rest: off by {{ error(repaired, 0):.1f}} mm *because* of it
# - It has to come and go with the pose.

# %% [markdown]
# In its own pose it is perfect, and at rest it does harm: the skin is off by {{ error(repaired, 0):.1f}}
# mm.{{ error(repaired, np.pi / 2) < 1e-10 }} A blend shape has to come and go with the
# pose.
#
# ## Between the examples
#
# We make several examples. Example $i$ has a pose $\theta^i$ and a blend shape $P_i$ of the whole surface. In another
# pose $\theta$ we let each of them contribute the more, the nearer its pose is. This is called *scattered data
# interpolation* (Lewis, Cordner and Fong, [*Pose Space Deformation*](https://doi.org/10.1145/344779.344862), 2000). How
# near it is, a **kernel** $\kappa_i$ says, a bump that is one in the pose of the example:
#
# $$
# B_P(\theta) = \sum_i \lambda_i(\theta)\, P_i, \qquad
# \lambda_i = \frac{\kappa_i}{\sum_j \kappa_j}, \qquad
# \kappa_i(\theta) = \exp\left( - \|\theta - \theta^i\|^2 / \tau \right) .
# $$

# %% slide [markdown]
# ## Between the examples: near ones count
#
# $$ B_P(\theta) = \sum_i \lambda_i(\theta)\, P_i, \qquad \kappa_i(\theta) = \exp\left( - \|\theta - \theta^i\|^2 / \tau \right) $$
#
# - **Divided**: $\lambda_i = \kappa_i / \sum_j \kappa_j$; not divided: $\lambda_i = \kappa_i$
# - **Exact**: solve $\sum_i \mathcal K_{j i} A_i = P_j$, so that every example is met

# %% [markdown]
# Here $\tau$, in rad², says how far from its pose an example contributes. The library and the exercises
# ask for its root instead, the **width** $\sqrt \tau$ in radians: at that distance from its example a
# kernel has fallen to $1/e$. *Body Models II* (Pons-Moll and Swoboda, 2018) has $\lambda_i \propto \kappa_i$
# and leaves the sum out, so we try both: "divided by the sum", and "not divided", with $\lambda_i = \kappa_i$.
#
# A third way, "exact" in the output below, does not divide the kernels either. It takes
# $B_P(\theta) = \sum_i \kappa_i(\theta)\, A_i$ with shapes $A_i$ that are not those of the examples, but are solved for
# so that every example is met: in the pose of example $j$ the sum has to be $P_j$. With the matrix of the kernels
# between examples, $\mathcal K_{j i} = \kappa_i(\theta^j)$, these are the equations
# $\sum_i \mathcal K_{j i} A_i = P_j$, one for each example. Their solution is
# $A_i = \sum_j (\mathcal K^{-1})_{i j} P_j$. Put into the sum it gives
#
# $$ B_P(\theta) = \sum_j \bigl( \sum_i \kappa_i(\theta)\, (\mathcal K^{-1})_{i j} \bigr) P_j , $$
#
# so the shape $P_j$ counts by entry $j$ of $\mathcal K^{-1} \kappa(\theta)$, where $\kappa(\theta)$ is the column of
# all kernels. (The distance from $i$ to $j$ is that from $j$ to $i$, so $\mathcal K$ is symmetric, and so is its
# inverse.)

# %%
at = np.radians([-120, -80, -40, 0, 40, 80, 120])
shapes = np.array([needed(angle) for angle in at])
tau = 0.49  # rad^2
examples = Examples(places=np.array([[0, 0, angle] for angle in at]), width=np.sqrt(tau))
ways = {
    "none": arm,
    "divided by the sum": replace(
        arm, features=NormalisedKernels(examples), posedirs=as_posedirs(shapes)
    ),
    "not divided": replace(arm, features=GaussianKernels(examples), posedirs=as_posedirs(shapes)),
    "exact": replace(
        arm,
        features=GaussianKernels(examples),
        posedirs=GaussianKernels(examples).interpolating(shapes),
    ),
}
for name, body in ways.items():
    print(
        f"{name:19}: at an example (80 degrees) {error(body, at[5]):5.2f} mm, between two (60) "
        f"{error(body, np.radians(60)):5.2f} mm, beyond (150) {error(body, np.radians(150)):5.2f} mm"
    )

far = {name: error(body, np.radians(170)) for name, body in ways.items()}  # mm
not_divided_too_much = error(ways["not divided"], at[4]) > error(arm, at[4])

# %%
turns = np.radians(np.arange(-170, 171, 5))
with house_style():
    figure, (ax,) = sheet(8, 3.8)
    for (name, body), dash in zip(ways.items(), (":", "-", "--", "-."), strict=True):
        ax.plot(np.degrees(turns), errors(body, turns), dash, label=name)
    for angle in np.degrees(at):
        ax.axvline(angle, color="0.85", lw=0.8, zorder=0)
    ax.set(xlabel="elbow (degrees)", ylabel="skin off by (mm)", ylim=(0, 12))
    ax.legend(loc="upper center", ncols=2)
Picture(
    figure,
    "The error by angle. Grey lines are the examples. Kernels that are divided by their sum "
    "reproduce no example, because its neighbours contribute as well; kernels that are not "
    "divided add up to too much; with coefficients that are solved for (exact), kernels leave "
    "nothing at the examples. Between inner examples 'exact' is nearer to the truth than "
    "'divided by the sum'; between the last two on either side it is the other way round: at "
    f"105 degrees 'exact' leaves {error(ways['exact'], np.radians(105)):.1f} mm, and 'divided "
    f"by the sum' {error(ways['divided by the sum'], np.radians(105)):.1f} mm.",
)

# %% slide [markdown]
# ## Divided kernels reproduce no example
#
# - At 80 degrees, an example: divided {{ error(ways["divided by the sum"], at[5]):.1f}} mm, not divided
#   {{ error(ways["not divided"], at[5]):.1f}}, exact {{ error(ways["exact"], at[5]):.1f}}
# - At 170, beyond all: {{ far['exact']:.0f}} mm in place of {{ far['none']:.0f}}

# %% [markdown]
# {{ errors(ways['divided by the sum'], at).min() > 0.5 and errors(ways['exact'], at).max() < 1e-6 and not_divided_too_much }}Far
# from all examples, at 170 degrees (where the curves have left the figure at its top), the kernels have faded, and
# hardly anything is repaired: {{ far['exact']:.0f}} mm in place of {{ far['none']:.0f}}. If they are divided by their
# sum, the nearest example is used instead ({{ far['divided by the sum']:.0f}} mm), whether it fits or
# not. And there is a bigger problem. Seven examples will do for one angle. A body has three angles for each of 23
# joints, and each example is a whole body, $3 N$ numbers, that have to be kept and summed. Examples cannot fill
# {{ 3 * 23 }} dimensions.

# %% slide [markdown]
# ## Examples cannot fill {{ 3 * 23 }} dimensions
#
# - Seven examples will do for one angle; a body has three for each of 23 joints.
# - Each example is a whole surface that has to be kept and summed.

# %% [markdown]
# ## The idea: a function of the pose that is linear in what is learned
#
# Instead of keeping the examples, we learn from them once. We choose some **features** $f_n(\theta)$ of the pose,
# which are few and cheap to compute. From here on a blend shape belongs to a feature, and no longer to an example:
# $P_n$ is that of feature $n$, and
#
# $$ B_P(\theta) = \sum_n f_n(\theta)\, P_n . $$
#
# This is linear in the $P_n$, so they are found by linear least squares (lecture 6). We write the features of each
# example pose into a row of a matrix $F$, the displacements that the example needs into a row of $D$, and the unknown
# blend shapes $P_n$ into the rows of a matrix $P$. Row $i$ of $F P$ is then what the blend shapes give in the pose of
# example $i$, and all of it should be near $D$:
#
# $$ \min_P \; \|F P - D\|^2 + \rho \|P\|^2 , $$
#
# where $\|\cdot\|^2$ is the sum of the squares of all elements. The second term keeps $P$ small where examples say
# little. Its factor $\rho$ is called the **ridge**. The first term has the gradient $2 F^\top (F P - D)$, and the
# second one $2 \rho P$. Their sum is zero if
#
# $$ (F^\top F + \rho I)\, P = F^\top D . $$

# %% slide [markdown]
# ## The idea: linear in what is learned
#
# $$ B_P(\theta) = \sum_n f_n(\theta)\, P_n, \qquad (F^\top F + \rho I)\, P = F^\top D $$
#
# - A blend shape belongs to a **feature** of the pose, no longer to an example.
# - $F$: features of the example poses; $D$: what they need; $\rho$: the **ridge**

# %% [markdown]
# Which features? The obvious ones are the angles themselves, $f(\theta) = \theta$. SMPL takes the
# elements of the rotation matrices, less those at rest: of each joint $k$ the nine numbers of $R_k - I$.


# %%
def learned(features, poses, ridge=1e-4):
    """The arm with blend shapes for these features, learned from poses (n,) rad."""
    joint = np.array([bent(angle)[1] for angle in poses])  # (n, 3) rad
    elements = (matrix_from_vector(joint) - np.eye(3)).reshape(-1, 9)
    F = joint if features is rotation_vectors else elements
    D = np.array([needed(angle).ravel() for angle in poses])
    P = np.linalg.solve(F.T @ F + ridge * np.eye(F.shape[1]), F.T @ D)
    posedirs = P.T.reshape(arm.n_vertices, 3, F.shape[1])
    return replace(arm, features=features, posedirs=posedirs)


taught_in = np.radians(np.arange(-120, 121, 10))
students = {
    "f = the angles": learned(rotation_vectors, taught_in),
    "f = rotation elements": learned(rotation_elements, taught_in),
}
inside = {}  # mm
for name, body in {"none": arm, **students}.items():
    inside[name] = np.sqrt(np.mean(errors(body, taught_in) ** 2))
    print(
        f"{name:22}: off by {inside[name]:.1f} mm where it was taught, {error(body, np.radians(150)):.1f} mm at 150 degrees"
    )

# %% slide [markdown]
# ## Which features? Not the angles
#
# - None: {{ inside["none"]:.1f}} mm. Angles: {{ inside["f = the angles"]:.1f}} mm. Elements of $R - I$:
#   {{ inside["f = rotation elements"]:.1f}} mm
# - An elbow needs the same correction to both sides; a linear function of the angle changes its sign.
# - $R - I$ contains $\cos \alpha - 1$, which is even.

# %% [markdown]
# Angles are of little
# use{{ inside['f = the angles'] > 0.9 * inside['none'] > 1.8 * inside['f = rotation elements'] }}. An elbow needs the
# same correction to whichever side it bends, but a linear
# function of the angle has opposite signs on the two sides. $R - I$ has $\cos \alpha - 1$ among its
# elements, which is even.
#
# There is a worse failure. Turn a joint all the way round, and it is where it was. Is its skin too?

# %%
full_turn = {}  # m
for name, body in students.items():
    moved = body.vertices(bent(0.6)) - body.vertices(bent(0.6 - 2 * np.pi))
    full_turn[name] = np.linalg.norm(moved, axis=1).max()
    print(
        f"{name:22}: 0.6 rad, and the same rotation a full turn further: vertices differ by up to "
        f"{1e3 * full_turn[name]:.0e} mm"
    )
around = np.linspace(-2 * np.pi, 2 * np.pi, 161)
with house_style():
    figure, (ax,) = sheet(8, 3.6)
    for (name, body), dash in zip(students.items(), ("--", "-"), strict=True):
        still = replace(
            body, weights=np.eye(2)[[0] * arm.n_vertices]
        )  # the skin does not ride along
        B = still.vertices(np.array([bent(angle) for angle in around])) - arm.template
        ax.plot(np.degrees(around), 1e3 * np.linalg.norm(B, axis=2).max(axis=1), dash, label=name)
    ax.set(xlabel="the joint, turned by (degrees)", ylabel="largest displacement (mm)")
    ax.legend()
Picture(
    figure,
    "How far the blend shapes move the rest surface, while the joint turns twice round. By rotation "
    "elements it is the same after each turn, and bounded, for no element of R - I leaves [-2, 2]. By "
    "angles it grows and grows.",
)

# %% slide [markdown]
# ## All the way round: is the skin where it was?
#
# - By angles the same rotation differs by {{ 1e3 * full_turn["f = the angles"]:.0f}} mm a full turn further,
#   by rotation elements by nothing.{{ full_turn['f = rotation elements'] < 1e-13 }}

# %% [markdown]
# ## In SMPL
#
# SMPL's body has 24 joints{{ full_turn['f = rotation elements'] < 1e-13 < 1e-3 < full_turn['f = the angles'] }}. The
# root is left out, because a person who turns as a whole keeps their form. The other
# 23 have nine elements each, so there are $9 \cdot 23 = 207$ features:
#
# $$ B_P(\theta) = \sum_{n=1}^{207} \bigl( R_n(\theta) - R_n(\theta^*) \bigr) P_n . $$
#
# Here $R_n(\theta)$ is one element of the rotation matrix of one joint, and $\theta^*$ is the pose at rest, in which
# all these matrices are $I$: so $R_n(\theta^*)$ is one on a diagonal, and zero elsewhere. The order of the features is
# part of the file format. It is that of the matrices, joint by joint and row by row: joint $k$, row $r$, column $c$ is
# feature $9 (k - 1) + 3 r + c$. In this rule everything is counted from zero: the root is joint zero, and the first
# element of the matrix of the first joint after it is feature zero.

# %% slide [markdown]
# ## In SMPL: 207 features
#
# $$ B_P(\theta) = \sum_{n=1}^{207} \bigl( R_n(\theta) - R_n(\theta^*) \bigr) P_n $$
#
# - 23 joints without the root, nine elements each: $9 \cdot 23 = 207$
# - Joint $k$, row $r$, column $c$ is feature $9 (k - 1) + 3 r + c$, counted from zero.

# %%
source(pose_features)

# %%
body = wb.load_body("default")
one = np.zeros((24, 3))
elbow = body.joint_names.index("left_elbow")
one[elbow] = [0, -1.2, 0]
R = matrix_from_vector(one)
f = (R[1:] - np.eye(3)).ravel()
print(
    "features that are not zero when the left elbow turns:",
    np.flatnonzero(np.abs(f) > 1e-12),
    f"; 9 (k - 1) = {9 * (elbow - 1)}",
)
N = 6890
print(f"numbers in P for {N} vertices: 3 x {N} x 207 = {3 * N * 207}")

# %% slide [markdown]
# ## A number with a factor of three in it
#
# - $3 \cdot 6890 \cdot 207$ = {{ 3 * N * 207:,}} numbers in $P$
# - *Body Models II* has a third of it beside this: three coordinates are missing.
# - The left elbow turned about $y$: four features are not zero, the corners of its matrix.

# %% [markdown]
# A turn about $y$ changes four of the nine elements, the corners of the
# matrix{{ (np.flatnonzero(np.abs(f) > 1e-12) - 9 * (elbow - 1)).tolist() == [0, 2, 6, 8] }}. (*Body Models II* has
# the number of
# elements of $P$, and beside it the product $9 \cdot 23 \cdot 6890$, which is a third of it: the three coordinates of a
# vertex are missing.)
#
# ## People
#
# The same idea serves for shapes. People at rest are points with $3N$ coordinates; their mean is the
# template $\bar T$, and the directions in which they differ most are the principal components (a
# singular value decomposition, once the mean is taken away):
#
# $$ B_S(\beta) = S \beta, \qquad S = V \operatorname{diag}(s_1, s_2, \dots) , \qquad s_k = \sigma_k / \sqrt{n - 1} . $$
#
# The columns of $V$ are the first singular vectors, which have the length one; $\sigma_k$ are their singular values,
# and $n$ is the number of people. A singular value is the root of a *sum* of squares over all people, so $s_k$ is the
# standard deviation of people along direction $k$, in metres. The scale is a convention that has to be stated: with
# it, $\beta$ is in standard deviations, and along each direction one person in twenty is beyond $\pm 2$. We learn the
# directions from 60 people that we draw from the body's own shape space:

# %% slide [markdown]
# ## People: principal components
#
# $$ B_S(\beta) = S \beta, \qquad S = V \operatorname{diag}(s_1, s_2, \dots), \qquad s_k = \sigma_k / \sqrt{n - 1} $$
#
# - $\beta$ counts standard deviations: one person in twenty is beyond $\pm 2$.
# - That scale is a convention, and has to be stated.

# %%
rng = np.random.default_rng(0)
people = body.vertices(betas=rng.standard_normal((60, body.n_betas))).reshape(60, -1)
mean = people.mean(axis=0)
_, sigma, Vt = np.linalg.svd(people - mean, full_matrices=False)
share = np.cumsum(sigma**2) / np.sum(sigma**2)
print("variance explained by 1, 2, 5 and 10 directions:", share[[0, 1, 4, 9]].round(3))
s = sigma / np.sqrt(len(people) - 1)  # m: the standard deviations
S = Vt[:3].T * s[:3]
betas = np.linalg.lstsq(S, (people - mean).T, rcond=None)[0]
print("standard deviations of their first three betas:", betas.std(axis=1, ddof=1).round(3))

gallery = {
    f"{k + 1}, {amount:+d} sd": body.vertices(betas=along(body, k, amount))
    for k in range(2)
    for amount in (-3, 0, 3)
}
with house_style():
    figure, (ax,) = sheet(11, 3.8)
    plot_shape_gallery(gallery, body.faces, ax=ax)
drawn = (
    "Each of the first two directions of the body, from whose shape space the people were drawn,"
)
Picture(figure, caption_shape_gallery(gallery, "three", drawn))

# %% slide [markdown]
# ## Sixty synthetic people, two directions
#
# - 1, 2, 5 and 10 directions explain {{ share[0]:.0%}}, {{ share[1]:.0%}}, {{ share[4]:.0%}} and
#   {{ share[9]:.0%}} of the variance.

# %% [markdown]
# ## Women, men, and everybody
#
# SMPL has a model of women, one of men, and one of everybody{{ np.allclose(betas.std(axis=1, ddof=1), 1) }}. The
# workbench has them too, on one mesh.
# **Their people are synthetic**, drawn from the shape targets of artists, so this section says what
# principal components do with two groups, and nothing about real people. We draw 200 of each, and take the
# components of the women, of the men, and of all 400:


# %%
def principal(people, k):
    """Mean (m,), unit directions (k, m) and standard deviations (k,) m of people (n, m) m."""
    mean = people.mean(axis=0)
    _, sigma, Vt = np.linalg.svd(people - mean, full_matrices=False)
    return mean, Vt[:k], sigma[:k] / np.sqrt(len(people) - 1)


rng = np.random.default_rng(1)
groups = {
    name: of.vertices(betas=rng.standard_normal((200, of.n_betas))).reshape(200, -1)
    for name, of in (
        ("women", wb.load_body("default-female")),
        ("men", wb.load_body("default-male")),
    )
}
groups["all"] = np.vstack([groups["women"], groups["men"]])
found = {name: principal(group, 3) for name, group in groups.items()}
apart = found["men"][0] - found["women"][0]  # (m,) m, from the mean woman to the mean man
d = apart / np.linalg.norm(apart)
for name, other in (("women", "men"), ("women", "all"), ("men", "all")):
    alike = np.abs(found[name][1][0] @ found[other][1][0])
    print(f"first directions of {name} and of {other}: |cosine| {alike:.3f}")
for name in groups:
    print(
        f"first direction of {name} and the difference of the means: {abs(found[name][1][0] @ d):.2f}"
    )


def between(direction):
    """The share of a coordinate's variance that is between the means of the groups."""
    w, m = groups["women"] @ direction, groups["men"] @ direction
    return ((w.mean() - m.mean()) / 2) ** 2 / np.var(np.concatenate([w, m]))


first_of_all = found["all"][1][0]
print(
    f"{between(first_of_all):.0%} of the variance of the common first coordinate lies between the groups"
)

# %%
ends = {}
for name, (mean, axes, sd) in found.items():
    upright = np.sign(
        axes[0].reshape(-1, 3)[body.template[:, 1].argmax(), 1]
    )  # + is the taller one
    for amount in (-3, 3):
        ends[f"{name}, {amount:+d} sd"] = (mean + amount * upright * sd[0] * axes[0]).reshape(-1, 3)
with house_style():
    figure, (ax,) = sheet(12, 4.0)
    line_up([Figurine(name, v) for name, v in ends.items()], body.faces, ax=ax)
Picture(
    figure,
    "The first direction of synthetic women, of men and of all, at minus and plus three standard "
    "deviations. In all three it is mostly stature. The common one is longer: it begins near the small end "
    "of the women, and ends near the tall end of the men.",
)

# %% slide [markdown]
# ## Women, men, and everybody: stature comes first
#
# - Synthetic people. The common first direction is longer: {{ between(first_of_all):.0%}} of its variance
#   lies *between* the groups.

# %% [markdown]
# The three are nearly parallel: within each group people differ most in stature, and the groups differ in it too:
# {{ between(first_of_all):.0%}} of the variance of the common first coordinate lies between
# them{{ all(np.abs(found[a][1][0] @ found[b][1][0]) > 0.97 for a, b in (('women', 'men'), ('women', 'all'), ('men', 'all'))) and found['all'][2][0] > 1.1 * max(found['women'][2][0], found['men'][2][0]) }}.
# So
# the common first direction mixes two reasons to be tall. One line of algebra shows that it has to. If a share $q$ of
# the people has the mean $\mu_1$ and the covariance $C_1$, and the others have $\mu_2$ and $C_2$, then everybody
# together has the mean $\mu = q\, \mu_1 + (1 - q)\, \mu_2$. With $d = \mu_2 - \mu_1$ the two groups are off that mean
# by $\mu_1 - \mu = -(1 - q)\, d$ and $\mu_2 - \mu = q\, d$. In each group, the mean of the squares about $\mu$ is its
# own covariance plus the square of that. So
#
# $$ C = q\, \bigl( C_1 + (1 - q)^2 d\, d^\top \bigr) + (1 - q) \bigl( C_2 + q^2 d\, d^\top \bigr)
#    = q\, C_1 + (1 - q)\, C_2 + q (1 - q)\, d\, d^\top , $$
#
# because $q (1 - q)^2 + (1 - q)\, q^2 = q (1 - q)$. A difference between groups counts like one more direction of
# shape. To see it alone, we **make up** two groups of the same size: both vary like the synthetic women, with the
# standard deviations $s_1, s_2, \dots$ along the women's directions, and their means differ only along the *fourth*
# direction. Let the length of this difference be $\delta$. With $q = \tfrac12$ the variance along the fourth direction
# is $s_4^2 + \delta^2 / 4$, and along the others it stays what it was. So the fourth direction becomes the first one as
# soon as

# %% slide [markdown]
# ## A difference of groups is one more direction of shape
#
# $$ C = q\, C_1 + (1 - q)\, C_2 + q (1 - q)\, d\, d^\top $$
#
# - $d$: the difference of the means; $q$: the share of the first group
# - It becomes the first direction as soon as $\|d\| > 2 \sqrt{s_1^2 - s_4^2}$, if it lies along the fourth.

# %% [markdown]
# $$ s_4^2 + \tfrac14 \delta^2 > s_1^2 , \qquad \text{that is,} \qquad \delta > 2 \sqrt{s_1^2 - s_4^2} . $$
#
# We move the means apart, look when it happens, and compare with the formula. ($\delta$ is a length in $3 N$
# dimensions; divided by $\sqrt N$, it is the root mean square over the vertices of how far they are apart.)

# %%
within = wb.load_body("default-female").shapedirs.reshape(-1, body.n_betas)
lengths = np.linalg.norm(within, axis=0)  # m: the standard deviations along the directions
axes = within / lengths
steps = np.linspace(0, 4, 41)  # m, over all coordinates together
shares = []
for step in steps:
    everything = np.column_stack([within, step / 2 * axes[:, 3]])  # C is this times its transpose
    U, _, _ = np.linalg.svd(everything, full_matrices=False)
    shares.append(np.abs(U[:, :2].T @ axes[:, 3]))
shares = np.array(shares)
per_vertex = 1e3 * steps / np.sqrt(body.n_vertices)  # mm, rms of a vertex
taken = steps[np.argmax(shares[:, 0] > 0.9)]
needed_step = 2 * np.sqrt(lengths[0] ** 2 - lengths[3] ** 2)


def rms_mm(step):
    """How far apart means are, the root mean square over the vertices, mm."""
    return 1e3 * step / np.sqrt(body.n_vertices)


print(
    f"the first direction becomes the difference when means are {rms_mm(taken):.0f} mm "
    f"apart (rms of a vertex); 2 sqrt(s_1^2 - s_4^2) is {rms_mm(needed_step):.0f} mm"
)
with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    centre = groups["all"].mean(axis=0)
    for name, dash in (("women", "-"), ("men", "--")):
        coordinates = (groups[name] - centre) @ first_of_all * np.sign(first_of_all @ d)
        counts, edges = np.histogram(coordinates, bins=np.linspace(-4.5, 4.5, 19))
        left.stairs(counts, edges, label=name, ls=dash, lw=1.8)
    left.set(xlabel="common first coordinate (m)", ylabel="people (of 200)")
    left.legend()
    for k, (name, dash) in enumerate((("first", "-"), ("second", "--"))):
        right.plot(per_vertex, shares[:, k], dash, label=f"{name} direction")
    right.set(xlabel="means apart by (mm rms of a vertex)", ylabel="|cosine| with the difference")
    right.legend()
Picture(
    figure,
    "Left: synthetic women and men along the common first direction; the two groups overlap, and their "
    "means differ. Right: two made-up groups that differ in what hardly varies within them. Far enough "
    "apart, the difference of the means becomes the second direction, and then the first.",
)

# %% slide [markdown]
# ## Two groups, and a "shape" that says who is in which
#
# - Predicted at {{ rms_mm(needed_step):.0f}} mm; seen at the first step beyond it, {{ rms_mm(taken):.0f}} mm
# - A Gaussian on this $\beta$ expects most people where there are none.

# %% [markdown]
# It happens at {{ rms_mm(taken):.0f}} mm, the first of our steps that is beyond the {{ rms_mm(needed_step):.0f}} mm
# of the
# formula{{ (shares[:, 1] > 0.9).argmax() < (shares[:, 0] > 0.9).argmax() and needed_step / 2 > 5 * lengths[3] }}.
# From then on the first "shape" of
# the mixture is one along which nobody in either group varies much: the coordinate says which group a person belongs
# to. A Gaussian prior on such a $\beta$ expects most people between the groups, where there are none. Models of one
# group each avoid this. But each has directions of its own, so the betas of one model are not those of another.
#
# ## Shape is learned at rest
#
# Where do the people at rest come from? SMPL was trained on two sets of meshes: the multi-pose set has few people, each
# in many poses, and the multi-shape set has many people, each in about one pose. The notes *SMPL and SMPLify* say in
# one place that $S$ is learned from the multi-pose set. (They have exchanged the sets there: $S$ comes from the
# multi-shape set, and the poses of its people are undone first.)

# %% slide [markdown]
# ## Shape is learned at rest
#
# - **Multi-pose** set: few people, many poses. **Multi-shape** set: many people, one pose each
# - $S$ comes from the multi-shape set, un-posed. The notes have exchanged the two.
# - We do what the notes say: 10 people, 36 poses each.

# %% [markdown]
# We do what the notes say, with 10 of our synthetic
# people in 36 poses each, drawn from a distribution of poses that was learned from motion capture (a mixture of
# Gaussians, lecture 10). We compute principal components of four sets of meshes: first the meshes as they are posed,
# moved rigidly onto each other; then the same meshes un-posed, which means that skinning and pose blend shapes were
# undone as at the beginning of this lecture; then three of the ten people alone; and last 360 people, who are at rest.

# %%
poses = draw_poses(shipped_mixture(), 360, rng)
who = np.repeat(np.arange(10), 36)
ten = rng.standard_normal((10, body.n_betas))
posed = body.vertices(poses, ten[who])
unposed = [unpose(body, pose, v) for pose, v in zip(poses, posed, strict=True)]
sets = {
    "10 people, posed": np.array([procrustes(v, posed[0])(v) for v in posed]),
    "10 people, un-posed": np.array(unposed),
    "3 people, un-posed": np.array(unposed)[who < 3],
    "360 people at rest": body.vertices(betas=rng.standard_normal((360, body.n_betas))),
}
newcomers = body.vertices(betas=rng.standard_normal((100, body.n_betas))).reshape(100, -1)
newcomers = newcomers - newcomers.mean(axis=0)


def share_of_pose(meshes, who):
    """The share of the variance that is left within each person: what changes with the pose."""
    flat = meshes.reshape(len(meshes), -1)
    means = np.array([flat[who == k].mean(axis=0) for k in np.unique(who)])
    return np.sum((flat - means[who]) ** 2) / np.sum((flat - flat.mean(axis=0)) ** 2)


learned_from = {
    name: principal(meshes.reshape(len(meshes), -1), 2 if name.startswith("3 ") else 5)
    for name, meshes in sets.items()
}
explained = {}
for name, (_, directions, _) in learned_from.items():
    own = share_of_pose(sets[name], who[: len(sets[name])]) if "posed" in name else 0.0
    count = "five" if len(directions) == 5 else "two"
    left_over = newcomers - newcomers @ directions.T @ directions
    explained[name] = 1 - np.sum(left_over**2) / np.sum(newcomers**2)
    print(
        f"{name:19}: pose is {own:4.0%} of the variance; {count} directions explain {explained[name]:.0%} "
        "of how 100 new people differ"
    )
coordinate = sets["10 people, posed"].reshape(360, -1) @ learned_from["10 people, posed"][1][0]
print(f"of the first posed coordinate alone, pose is {share_of_pose(coordinate, who):.0%}")

with house_style():
    figure, (ax,) = sheet(11, 4.2)
    ends_drawn = []
    for name in ("10 people, posed", "10 people, un-posed"):
        mean, directions, sd = learned_from[name]
        for amount in (-2, 2):
            up = np.sign(directions[0].reshape(-1, 3)[body.template[:, 0].argmax(), 1])  # of a hand
            v = (mean + amount * up * sd[0] * directions[0]).reshape(-1, 3)
            ends_drawn.append(Figurine(f"{name.split(', ')[1]}, {amount:+d} sd", v))
    line_up(ends_drawn, body.faces, ax=ax)
Picture(
    figure,
    "The first direction of the same 360 meshes. Left: of the meshes as they are posed, it goes from "
    "lowered hands to raised ones, and legs change their length on the way, since a direction moves "
    "every vertex along a straight line. Right: of the un-posed meshes, it is mostly stature.",
)

# %% slide [markdown]
# ## Posed meshes learn raised hands, un-posed ones stature
#
# - Pose is {{ share_of_pose(sets["10 people, posed"], who):.0%}} of the variance of the posed meshes.
# - Legs change their length on the way: a direction moves vertices along straight lines.

# %% [markdown]
# Here un-posing is exact{{ np.allclose(unposed, body.vertices(betas=ten[who]), atol=1e-10) }}, because the meshes
# were made by the model that un-poses them. (`unpose` is not told the
# shape, and so not the joints. But these are a fixed weighted mean of the rest surface, as the next section says, so
# that for a known pose the posed vertices are linear in the rest surface, joints included: one linear system undoes it
# all.) Real registrations are un-posed only as well as the model describes them. Even with exact un-posing, the meshes
# of ten people fill nine directions at most, however many poses there are. In the output this hardly shows, because
# our synthetic people differ in ten directions, of which five hold {{ share[4]:.0%}} of the variance. But the three
# people, in 36
# poses each, have two directions, and these explain {{ explained['3 people, un-posed']:.0%}} of how new people
# differ{{ explained['10 people, posed'] + 0.2 < explained['10 people, un-posed'] < explained['360 people at rest'] }}.
# Poses do not replace people.

# %% slide [markdown]
# ## Poses do not replace people
#
# - How much of 100 new people five directions explain: posed {{ explained["10 people, posed"]:.0%}}, un-posed
#   {{ explained["10 people, un-posed"]:.0%}}, 360 people {{ explained["360 people at rest"]:.0%}}
# - Three people in 36 poses each have two directions: {{ explained['3 people, un-posed']:.0%}}

# %% [markdown]
# ## Joints move with the person
#
# A longer thigh has its knee further down. So the joints are not constant. They are computed from the
# *shaped* surface, before it is posed, by a matrix of weights:
#
# $$ J(\beta) = \mathcal J\, (\bar T + S \beta), \qquad \mathcal J \ge 0, \text{ rows of sum one.} $$
#
# The weights of a joint are found by least squares, from the rest surfaces of many people and the places of their
# joints (lecture 13). Why these conditions? If the weights of a joint sum to one, the joint moves along with a person
# who stands elsewhere. If none is negative, the joint lies among its vertices.
#
# This condition also makes most weights
# zero. Without it, least squares would make many weights negative. If these are held at zero and the others are found
# again, some of the others would become negative and are held at zero as well, and so on, until only a few positive
# weights are left. `scipy.optimize.nnls` solves least squares with weights that are not negative; one more equation,
# multiplied by a large number, says that they sum to one. What if the joints of the mean person are kept instead? We
# try it with somebody tall, three standard deviations along the first shape direction.

# %% slide [markdown]
# ## Joints move with the person
#
# $$ J(\beta) = \mathcal J\, (\bar T + S \beta), \qquad \mathcal J \ge 0, \text{ rows of sum one} $$
#
# - Sum one: the joint moves along with a person who stands elsewhere.
# - None negative: it lies among its vertices, and most weights are zero.

# %%
tall = along(body, 0, 3)
print(
    f"the tall person's joints are up to {1e3 * joint_moves(body, tall).max():.0f} mm from the mean person's"
)
kept = with_joints_of_the_mean(body, tall)
bend = np.zeros((24, 3))
for k, angle in (("left_knee", 1.6), ("right_knee", 1.6), ("left_shoulder", -0.9)):
    bend[body.joint_names.index(k), 0 if "knee" in k else 2] = angle
right, wrong = body.vertices(bend, tall), kept.vertices(bend)
shin = body.weights[:, body.joint_names.index("left_knee")] > 0.9
shin_off = (wrong - right)[shin].mean(axis=0)  # m
print(
    f"posed on the mean person's joints the skin is off by up to "
    f"{1e3 * np.linalg.norm(right - wrong, axis=1).max():.0f} mm"
)
with house_style():
    figure, (ax,) = sheet(8, 4.4)
    shown = [
        Figurine("own joints", right, side),
        Figurine("the mean's joints", wrong, side),
    ]
    line_up(shown, body.faces, ax=ax)
Picture(
    figure,
    "The tall person from the side, posed on the joints that the regressor finds, and on the "
    "mean person's. The mean's knee is further up: there the leg folds within the thigh, and "
    f"the shin sits {1e2 * shin_off[1]:.0f} cm too high and {-1e2 * shin_off[2]:.0f} cm too far "
    "back.",
)

# %% slide [markdown]
# ## A tall person on the mean person's joints
#
# - Joints are up to {{ 1e3 * joint_moves(body, tall).max():.0f}} mm apart.
# - The shin sits {{ 1e2 * shin_off[1]:.0f}} cm too high and {{ -1e2 * shin_off[2]:.0f}} cm too far back.

# %% [markdown]
# ## All together
#
# Now we have all parts of SMPL. (The shin of the last figure sits {{ 1e2 * shin_off[1]:.0f}} cm too high and
# {{ -1e2 * shin_off[2]:.0f}} cm too far back.) The mean person gets the shape of somebody else. Then what skinning is
# going to lose
# is added, and the result is skinned by the joints of that person:
#
# $$ M(\theta, \beta) = \operatorname{skin}\left( \bar T + B_S(\beta) + B_P(\theta),\; J(\beta),\; \theta,\; w \right) . $$
#
# Here $\operatorname{skin}$ is the linear blend skinning of lecture 4 and $w$ are its weights. (The [paper on
# SMPL](https://doi.org/10.1145/2816795.2818013) calls the function $W$ and the weights $\mathcal W$. The notes *SMPL
# and SMPLify*, which this course uses, have $\beta$ for the third argument. It is the pose.) Step by step, for the tall
# person of the last figure:

# %% slide [markdown]
# ## All together
#
# $$ M(\theta, \beta) = \operatorname{skin}\left( \bar T + B_S(\beta) + B_P(\theta),\; J(\beta),\; \theta,\; w \right) $$
#
# - The person's shape; what skinning is going to lose; the joints of *that* person; skinning

# %%
f_bend = (matrix_from_vector(bend) - np.eye(3))[1:].ravel()
shaped = body.vertices(betas=tall)
prepared = shaped + body.posedirs @ f_bend
G = body.kinematics.motion(bend, tall).G  # (24, 3, 4)
Hh = np.einsum("nk,kij->nij", body.weights, G)  # (N, 3, 4): H beside h, for each vertex
skinned = np.einsum("nij,nj->ni", Hh[:, :, :3], prepared) + Hh[:, :, 3]
print(f"the steps end at the library's vertices, to {np.abs(skinned - right).max():.0e} m")
print(
    f"pose blend shapes move the rest surface by up to "
    f"{1e3 * np.linalg.norm(prepared - shaped, axis=1).max():.0f} mm"
)
steps = {
    "template": body.template,
    "+ shape": shaped,
    "+ pose blend shapes": prepared,
    "skinned": skinned,
}
with house_style():
    figure, (ax,) = sheet(11, 4.4)
    line_up([Figurine(name, v, side) for name, v in steps.items()], body.faces, ax=ax)
Picture(
    figure,
    "SMPL step by step, from the side: the template, the person's shape, what skinning is going to lose "
    "(a change of the rest surface, largest at the knees), and the skinned body.",
)

# %% slide [markdown]
# ## SMPL, step by step
#
# - Pose blend shapes move the rest surface by up to
#   {{ 1e3 * np.linalg.norm(prepared - shaped, axis=1).max():.0f}} mm, most at the knees.

# %% [markdown]
# These steps end at the library's vertices{{ np.allclose(skinned, right, atol=1e-9) }}. Shape and pose can be given
# one by one, or both. To turn the whole body by $R$, turn its root: the
# vertices $M(\theta, \beta)$ turn about the root joint $j_0$, and become $R\,(M(\theta, \beta) - j_0) + j_0$.

# %%
about_y = np.array([0, np.pi / 2, 0])
facing = bend.copy()
facing[0] = about_y
as_whole = body.vertices(facing, tall)
j_0 = body.joints(betas=tall)[0]
by_hand = (right - j_0) @ matrix_from_vector(about_y).T + j_0
print(f"the root turned, and R (M - j_0) + j_0: differ by {np.abs(as_whole - by_hand).max():.0e} m")
panel = {
    "M(0, β)": shaped,
    "M(θ, 0)": body.vertices(bend),
    "M(θ, β)": right,
    "the root turned": as_whole,
}
with house_style():
    figure, (ax,) = sheet(11, 4.4)
    line_up([Figurine(name, v) for name, v in panel.items()], body.faces, ax=ax)
Picture(
    figure,
    "The body as a function, from the front: shaped, posed, both, and both with the root turned by a "
    "quarter turn.",
)

# %% slide [markdown]
# ## The body as a function
#
# - To turn the whole body, turn its root: $R\,(M(\theta, \beta) - j_0) + j_0$

# %% [markdown]
# In the library these are two functions{{ np.allclose(as_whole, by_hand, atol=1e-9) }}, written in symbols (`cs` is
# CasADi; arrays there have a point in each column).
# In `rest`, `shaped` is $\bar T + B_S(\beta)$, `body.features(at)` is the column of the features $f_n(\theta)$, and
# `directions(body, "posedirs", vertices)` is the matrix with $3 N$ rows whose column $n$ is $P_n$, so that the product
# of the two is $B_P(\theta)$. In `posed`, `posture` makes the rotation matrices of all joints from the pose, and keeps
# them with the betas in `at`; `motions` gives the matrices $G'_k$ of lecture 3; `body.skinning` is
# $\operatorname{skin}$, and `weights(body, vertices)` are its weights $w$. Two arguments come on top of
# $M(\theta, \beta)$: `displaced` moves single vertices of the rest surface, for instance those of clothes, and `trans`
# moves the whole body.

# %%
source(surface.rest)

# %%
source(surface.posed)

# %% slide [markdown]
# ## In the library
#
# ```python
# person = shaped(body, at.betas, vertices)
# corrections = directions(body, "posedirs", vertices) @ body.features(at)
# return person + cs.reshape(corrections, person.shape)
# ...
# G, _ = motions(body, at)
# points = rest(body, at, vertices)
# ...
# skinned = body.skinning(points, G, weights(body, vertices))
# ```

# %% [markdown]
# ## Hands: few data, many joints
#
# SMPL's recipe was used again for hands: MANO (Romero, Tzionas and Black, [*Embodied Hands: Modeling and Capturing
# Hands and Bodies Together*](https://doi.org/10.1145/3130800.3130883), 2017) was learned from about 1000 scans of the
# hands of 31 people. A hand has many joints, and there are few data. One problem can be shown here. SMPL lets every
# vertex depend on every joint; if poses are few, blend shapes learn relations that are due to chance. So we learn blend
# shapes once more, on the whole body: the truth is what dual quaternions do, seen with 2 mm of noise. We learn two
# kinds. The first has all 207 features for each vertex; in the second, a vertex depends only on the joints that move it
# and on their neighbours. The ridge of each is chosen on 50 further poses, and the error is measured on 50 others.

# %%
plain = without_pose_blend_shapes(body)
ideal = replace(plain, skinning=wb.dual_quaternion_blend)
lessons = draw_poses(shipped_mixture(), 260, rng)
F_all = (matrix_from_vector(lessons) - np.eye(3))[:, 1:].reshape(260, -1)
wanted = []
for lesson in lessons:
    G_lesson = plain.kinematics.motion(lesson, np.zeros(body.n_betas)).G[:, :, :3]
    turned = np.einsum("nk,kij->nij", body.weights, G_lesson)
    off = ideal.vertices(lesson) - plain.vertices(lesson)
    wanted.append(np.linalg.solve(turned, off[..., None])[..., 0])
wanted = np.array(wanted)  # (260, N, 3) m
noisy = wanted + 0.002 * rng.standard_normal(wanted.shape)
pupils = {
    "all joints": np.ones((body.n_vertices, 207), dtype=bool),
    "near joints": local_features(body.weights, body.parents, 1),
}


def missed(P, which):
    """How far blend shapes P (N, 3, 207) m are off in some of the poses, mm rms of a vertex."""
    off = np.einsum("nif,jf->jni", P, F_all[which]) - wanted[which]
    return 1e3 * np.sqrt((off**2).sum(axis=2).mean())


counts = (20, 40, 80, 160)
scores = {name: [] for name in pupils}
for n in counts:
    gram = F_all[:n].T @ F_all[:n]
    sums = np.einsum("jf,jni->nif", F_all[:n], noisy[:n])
    for name, mask in pupils.items():
        tried = [
            MaskedCholesky.of(gram + ridge * np.eye(207), mask).solved(sums * mask[:, None, :])
            for ridge in (0.1, 1.0, 10.0, 100.0)
        ]
        best = min(tried, key=lambda P: missed(P, slice(160, 210)))
        scores[name].append(missed(best, slice(210, 260)))
nothing = missed(np.zeros((body.n_vertices, 3, 207)), slice(210, 260))
print("poses learned from: " + ", ".join(map(str, counts)))
for name, mask in pupils.items():
    off_by = ", ".join(f"{score:.1f}" for score in scores[name])
    print(f"{name:11}: {3 * int(mask.sum()):6} numbers, off by {off_by} mm")
print(f"without blend shapes: {nothing:.1f} mm")
with house_style():
    figure, (ax,) = sheet(7.5, 3.6)
    for (name, score), mark in zip(scores.items(), ("s--", "o-"), strict=True):
        ax.plot(counts, score, mark, label=name)
    ax.axhline(nothing, color="0.6", ls=":", label="no blend shapes")
    ax.set(xlabel="poses learned from", ylabel="off in new poses (mm rms)", ylim=(0, None))
    ax.set_xticks(counts)
    ax.legend(loc="lower left")
Picture(
    figure,
    "Blend shapes learned from few poses. If a vertex may depend on near joints only, a quarter of the "
    "poses is enough for the same error.",
)

# %% slide [markdown]
# ## Few poses: let a vertex depend on near joints only
#
# - 20 poses: {{ scores['near joints'][0]:.1f}} mm with near joints, {{ scores['all joints'][0]:.1f}} with
#   all; without blend shapes {{ nothing:.1f}}
# - A quarter of the poses is enough for the same error.

# %% [markdown]
# From 20 poses near joints leave {{ scores['near joints'][0]:.1f}} mm and all joints
# {{ scores['all joints'][0]:.1f}}{{ all(scores['near joints'][k] < 1.05 * scores['all joints'][k + 2] for k in (0, 1)) }}.
# This truth is local: dual quaternions move a vertex by its own joints only. Whether real skin is as local has
# to be measured. Other problems of hand models have answers too, and most of these occur elsewhere in this
# course:
#
# | problem | answer | whose | here |
# | --- | --- | --- | --- |
# | in scans of whole bodies hands are small, coarse and often hidden | learn the hand from scans of hands alone, and attach it to SMPL (SMPL+H) | *Embodied Hands* | lecture 18; the bodies of this lecture have one joint for all fingers of a hand |
# | few scans | mirror the left hands: one set for both sides | *Embodied Hands*, supplement | lectures 13 and 18: a mirror changes the sign of $x$ and exchanges vertices |
# | 45 angles, more than an image tells | a linear space of few directions, learned from poses | *Embodied Hands* | lecture 18; a Gaussian of poses in lecture 10, and for bodies below |
# | far joints move a vertex by chance | blend shapes that are local: a penalty that grows with the distance along the skin, or joints that are left out | the notes on MANO that this course uses; Osman, Bolkart and Black, [*STAR*](https://arxiv.org/abs/2008.08535) (2020) | above; the embedded bodies are local |
# | skin collapses where a joint bends | blend shapes that are linear in $R - I$ | Loper and others, *SMPL* (2015) | above |
# | the template is drawn in a pose of its own | binding matrices | the notes on MANO | lecture 3 |
# | where are the joints of a posed hand? | the offsets of the chain, and not regressed from posed skin | the notes on MANO ask | lecture 3 |

# %% slide [markdown]
# ## Hands: what MANO changed
#
# - Scans of hands alone, left ones mirrored: one set for both sides
# - 45 angles are more than an image tells: a linear space of few directions
# - Far joints move a vertex by chance: local blend shapes

# %%
variances = np.linalg.eigvalsh(shipped_gaussian().covariance)[::-1]  # of recorded body poses
told = np.cumsum(variances) / variances.sum()
print(
    f"recorded poses of bodies, {len(variances)} angles: 10 directions explain {told[9]:.0%} of the "
    f"variance, 20 directions {told[19]:.0%}"
)
print(f"embedded body: {np.mean(body.posedirs == 0):.0%} of the pose blend shapes are exactly zero")

# %% slide [markdown]
# ## Few directions hold most poses
#
# - {{ len(variances)}} angles of recorded bodies: 10 directions explain {{ told[9]:.0%}} of the variance, 20
#   explain {{ told[19]:.0%}}.
# - {{ np.mean(body.posedirs == 0):.0%}} of the embedded body's pose blend shapes are exactly zero.

# %% [markdown]
# ## What to remember
#
# - A blend shape is a displacement of the rest surface: find it by undoing skinning.
# - Interpolation between examples works near them. Kernels that are divided by their sum reproduce no example
#   exactly; with coefficients that are solved for, they do. The cost grows with the number of examples.
# - Blend shapes that are linear in features are learned by least squares. Features should be the same
#   for the same rotation: elements of $R - I$, row by row, without the root.
# - Shape directions are principal components, scaled so that betas are standard deviations; joints are
#   regressed from the shaped surface.
# - Groups whose means differ add a direction to the principal components of all. Shape directions are
#   learned from many people, whose poses are undone first.
# - If poses are few, let a vertex depend on near joints only.

# %% slide [markdown]
# ## What to remember
#
# - A blend shape displaces the rest surface; linear in features, it is learned by least squares.
# - Features: elements of $R - I$, row by row, without the root. Betas: standard deviations
# - Joints come from the shaped surface; shape directions from many people, whose poses are undone first.
