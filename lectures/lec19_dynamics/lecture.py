# %% [markdown]
# # Dynamics and rigging
#
# **What do meshes in motion tell that single meshes do not?**
#
# SMPL's surface is a function of shape and pose. Two things are missing in this sentence. Soft tissue goes on
# moving when the bones have stopped, so that its form is no function of the pose. And the bones themselves
# were given; somebody found them in meshes that move. This lecture looks at both. The first part makes
# tissue of springs, fails to predict it from the pose, finds what does predict it, and adds it to the body
# as Dyna and DMPL do ([Pons-Moll et al.](https://doi.org/10.1145/2766993), 2015; [Loper et
# al.](https://doi.org/10.1145/2816795.2818013), 2015). The second part finds a joint, and shows a motion in which it
# cannot be found. **No tissue was measured here: all of it is simulated**, and the motions are made up of sines.
# Lengths are in metres and millimetres, angles in radians.

# %%
from dataclasses import replace

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies.forward.posing import Posing
from workbench.bodies.spaces import body_mass_index
from workbench.course import Picture, source
from workbench.lectures.material.tissue import (
    OneStep,
    TissueClip,
    TissuePlan,
    one_step_of,
    score_tissue,
    train_tissue,
)
from workbench.lectures.material.tissue_simulation import simulate_tissue
from workbench.motions import load_tissue
from workbench.motions.soft_tissue import (
    MovingFrames,
    companion,
    free_run,
    second_differences,
    with_tissue,
)
from workbench.plots import house_style, sheet
from workbench.synthetic.made_up import limb, made_up_motion, random_smpl

# %%
body = wb.load_body("small")

# %% [markdown]
# ## Tissue of springs
#
# Between bone and skin there is a soft layer. We put a mass at each vertex, and hang it with a spring and a
# damper on the place where SMPL has the vertex. The thicker the layer, the softer the spring. How thick it is
# follows from how far the skin is from the bone, and so heavier people are softer. The **displacement** of a
# vertex is how far the mass is from the place of SMPL, in the frame of the rest pose.

# %% slide [markdown]
# ## Two things that a pose does not say
#
# - Soft tissue goes on moving when the bones have stopped.
# - The bones themselves: somebody found them in meshes that move.
# - No tissue was measured here: all of it is simulated.

# %%
FPS, CLIPS, SECONDS = 60.0, 10, 4.0
people = np.random.default_rng(19).standard_normal((CLIPS, body.n_betas))


def clip(seed, betas):
    """A made-up motion of a person, with its simulated tissue."""
    motion = replace(made_up_motion(body, SECONDS, seed=seed), betas=betas)
    return TissueClip(motion, simulate_tissue(body, motion))


learned = [clip(seed, betas) for seed, betas in enumerate(people)]
unseen = clip(99, np.full(body.n_betas, 0.3))
far = 1e3 * np.linalg.norm(unseen.displacements, axis=2)  # mm
softest = int(far.mean(axis=0).argmax())
print(f"{CLIPS} clips of {SECONDS:g} s to learn from, each of another person")
print(f"in an unseen clip the skin is displaced by up to {far.max():.0f} mm")

# %% slide [markdown]
# ## Tissue of springs
#
# - A mass at each vertex, hung on the place where SMPL has it; thicker layers are softer.
# - In an unseen clip the skin is displaced by up to {{ far.max():.0f}} mm.
# - Learned from {{ CLIPS}} clips, each of another person

# %% [markdown]
# ## A function of the pose?
#
# Pose blend shapes correct the surface by a linear function of the rotation matrices (lecture 5). Can they
# do this as well? We fit the displacements by such a function, with the rotation of the root among its
# features, because gravity pulls tissue down, wherever down is. How good it is we say by the share of the
# variance of the displacements that it explains: 1 is perfect, 0 is as good as a tissue that keeps its mean
# place, and below 0 is worse.


# %% slide [markdown]
# ## A function of the pose?
#
# - Linear in the rotation matrices, the root's included, because gravity pulls down
# - Judge: the share of the variance that it explains. Below 0 is worse than the mean place.


# %%
def features(motion):
    """Rotation matrices of all joints, the root included, and a one, (T, F)."""
    local = Posing.of(motion.pose, body.parents).local
    return np.column_stack([local.reshape(len(local), -1), np.ones(len(local))])


def share(true, found):
    """The share of the variance of displacements (T, N, 3) that is explained."""
    return 1 - np.square(true - found).sum() / np.square(true - true.mean(axis=0)).sum()


F = np.concatenate([features(one.motion) for one in learned])
Y = np.concatenate([one.displacements.reshape(len(one.motion), -1) for one in learned])
W = np.linalg.solve(F.T @ F + np.eye(F.shape[1]), F.T @ Y)
by_pose = {}
for name, one in (("a clip it was learned from", learned[0]), ("an unseen clip", unseen)):
    guess = (features(one.motion) @ W).reshape(one.displacements.shape)
    by_pose[name] = share(one.displacements, guess)
    print(f"as a function of the pose, {name}: explains {by_pose[name]:.2f}")

with house_style():
    figure, (ax,) = sheet(7.5, 3.4)
    seconds = np.arange(len(guess)) / FPS
    ax.plot(seconds, 1e3 * unseen.displacements[:, softest, 1], "k", lw=2, label="simulated")
    ax.plot(seconds, 1e3 * guess[:, softest, 1], "C1", label="as a function of the pose")
    ax.set(xlabel="time (s)", ylabel="displacement upwards (mm)")
    ax.legend()
Picture(
    figure,
    "The vertex that moves most, in a clip that nothing was learned from. A function of the pose does not "
    "follow it.",
)

# %% slide [markdown]
# ## It has learned the clips by heart
#
# - A clip it learned from: {{ by_pose['a clip it was learned from']:.2f}}. An unseen one:
#   {{ by_pose['an unseen clip']:.2f}}

# %% [markdown]
# It explains {{ 100 * by_pose['a clip it was learned from']:.0f}} % of a clip that it was learned from. In the unseen
# clip it is worse than a tissue that stays in its mean place{{ by_pose['an unseen clip'] < -0.3 }}: it has learned
# the clips by heart. Where the tissue is does not follow from the pose,
# since the same pose may be the top of a hop or a rest.

# %% slide [markdown]
# ## The same pose may be the top of a hop, or a rest
#
# - Where the tissue is does not follow from the pose.
# - What else is needed: where it *was*, and how fast it moved

# %% [markdown]
# ## What a mass on a spring does
#
# A mass on a spring that nothing drives obeys $\ddot s = -\omega^2 s - 2 \zeta \omega \dot s$. Here $s$ is how
# far it is from its place of rest, $\omega$ is $2 \pi$ times the frequency at which it would swing without
# damping, and $\zeta$ is the damping, as a share of the one at which nothing swings any more. Seen at the frames
# of a film, $f$ of them a second, its path is exactly
#
# $$ s_t = a_1 s_{t-1} + a_2 s_{t-2}, \qquad a_1 = 2 r \cos w, \quad a_2 = -r^2 . $$

# %% slide [markdown]
# ## What a mass on a spring does
#
# $$ s_t = a_1 s_{t-1} + a_2 s_{t-2}, \qquad a_1 = 2 r \cos w, \quad a_2 = -r^2 $$
#
# - Exactly so at the frames of a film, from $\ddot s = -\omega^2 s - 2 \zeta \omega \dot s$
# - The two frames before are what the pose cannot know.

# %% [markdown]
# Why? Put $s = e^{\lambda \tau}$, with the time $\tau$ in seconds, into the equation of the spring: it holds if
# $\lambda^2 + 2 \zeta \omega \lambda + \omega^2 = 0$, so $\lambda = -\zeta \omega \pm i \omega \sqrt{1 - \zeta^2}$. In
# a frame, $1/f$ seconds, such a term is multiplied by $z = e^{\lambda / f} = r e^{\pm i w}$, with
# $r = e^{-\zeta \omega / f}$ and $w = \omega \sqrt{1 - \zeta^2} / f$. So the path is a sum of two terms of the form
# $z^t$, with $z = r e^{i w}$ and $z = r e^{-i w}$.
#
# Put $z^t$ into the equation on the left and divide by $z^{t-2}$: it
# holds if $z^2 = a_1 z + a_2$. The equation with these two solutions is
# $(z - r e^{i w}) (z - r e^{-i w}) = z^2 - 2 r \cos w\, z + r^2 = 0$, which gives $a_1$ and $a_2$ as above. These
# numbers $z$ are the **poles**. Their angle $w$ is how far the swing gets in a frame, and their size $r$ is how much of
# it is left. The two frames before are what the pose cannot know: where the tissue is, and how fast it moves.

# %% slide [markdown]
# ## Poles
#
# $$ z^2 = a_1 z + a_2, \qquad z = r e^{\pm i w}, \quad r = e^{-\zeta \omega / f} $$
#
# - Angle $w$: how far the swing gets in a frame. Size $r$: how much of it is left

# %%
HZ, DAMPING = 5.0, 0.15
omega = 2 * np.pi * HZ
pole = np.exp(omega / FPS * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2)))
a1, a2 = 2 * pole.real, -(abs(pole) ** 2)
swings = abs(np.angle(pole)) * FPS / (2 * np.pi)
halves = np.log(0.5) / np.log(abs(pole)) / FPS
print(f"a1 = {a1:.3f}, a2 = {a2:.3f}; a pole of size {abs(pole):.3f}")
print(f"it swings {swings:.2f} times a second and halves in {1e3 * halves:.0f} ms")

# %% slide [markdown]
# ## A layer of 6 cm
#
# - 5 Hz, 15 % of the critical damping: it swings {{ swings:.2f}} times a second and halves in
#   {{ 1e3 * halves:.0f}} ms.
# - Half a second after a push {{ 100 * abs(pole) ** 30:.0f}} % are left.

# %% [markdown]
# Our springs have 15 % of the damping at which nothing swings any more. Those of a layer of 6 cm have 5 Hz; thicker
# layers are softer. Such a mass swings {{ swings:.2f}} times a second, and its swing halves in {{ 1e3 * halves:.0f}}
# ms. Half a second after a push, {{ 100 * abs(pole) ** 30:.0f}} % of it are left.
#
# ## Dynamic blend shapes
#
# For a whole body, the principal components of the displacements are **dynamic blend shapes** $D_c$. They
# are added at rest, as all of SMPL's blend shapes are, and their coefficients $\varphi_t$ follow a model of
# the same form with matrices, and with inputs $x_t$ that drive it:
#
# $$ T = \bar T + B_S(\beta) + B_P(\theta) + \sum_c \varphi_{t,c} D_c , \qquad
# \varphi_t = A_1 \varphi_{t-1} + A_2 \varphi_{t-2} + B x_t . $$

# %% slide [markdown]
# ## Dynamic blend shapes
#
# $$ T = \bar T + B_S(\beta) + B_P(\theta) + \sum_c \varphi_{t,c} D_c $$
#
# - Principal components of displacements, added at rest
# - All coefficients zero: SMPL

# %% slide [markdown]
# ## A model of the coefficients
#
# $$ \varphi_t = A_1 \varphi_{t-1} + A_2 \varphi_{t-2} + B x_t $$
#
# - $x_t$: what drives it. In Dyna: velocities and accelerations of joints and root
# - Linear least squares: each frame from the two before it, as observed

# %% [markdown]
# Where all coefficients are zero, this is SMPL. In Dyna the inputs are velocities and accelerations of the
# joints and of the root. Matrices are found by linear least squares: predict each frame from the two frames
# before it, as they were observed. With one row for each frame, the equations are
#
# $$ \underbrace{\begin{pmatrix} \varphi_{t-1}^\top & \varphi_{t-2}^\top & x_t^\top \end{pmatrix}}_{\text{a row of } Z}
# \begin{pmatrix} A_1^\top \\ A_2^\top \\ B^\top \end{pmatrix} = \varphi_t^\top . $$
#
# Here are the lines that do it. `OneStep.of` stacks these rows of all clips; `regressors` is $Z$, and `targets` are the
# right-hand sides, which form the matrix $Y$; the matrices that are looked for, one below the other, are $W$. In
# `solve`, $C$ is the number of coefficients, `own` marks the columns of the two frames before, and `price` is the ridge
# (lecture 5) of each column: next to nothing for these.
#
# For an input it is `ridge * (size + HARDLY**2)`, where `size`
# is the mean square of the input. The library squashes each vector $v$ of inputs to $v / \sqrt{m^2 + |v|^2}$, with a
# scale $m$ for its kind, so that inputs stay between -1 and 1 in every motion. What is added to the mean of the squares
# is the price times the square of the input's factor. The part of the first term is the same for large and small
# inputs: an input that is half as large needs twice the factor for the same effect, and its `size` is a quarter.
#
# The
# second term makes inputs dear that hardly move in the clips: `HARDLY` is a hundredth, and where the mean square of an
# input is much smaller than `HARDLY**2`, the price, compared with this mean square, is many times that of other inputs,
# and least squares gives the input only a small factor, so that it does not explain noise.
#
# `penalised` solves the
# normal equations $(Z^\top Z / M + \operatorname{diag}(\text{price}))\, W = Z^\top Y / M$ of $M$ rows.
#
# We train one model with Dyna's inputs and one that also has the forces on parts of the body, which the next section
# explains.

# %% slide [markdown]
# ## Prices of inputs
#
# - Inputs are squashed to $v / \sqrt{m^2 + |v|^2}$: they stay between -1 and 1 in every motion.
# - The ridge is scaled by an input's mean square: large and small inputs cost alike.
# - Inputs that hardly move are dear: they shall not explain noise.

# %%
source(OneStep.of, OneStep.solve)

# %%
PLANS = {
    "Dyna's inputs": TissuePlan(components=8, parts=0),
    "with forces on parts": TissuePlan(components=8, parts=12),
}
tissues = {name: train_tissue(body, learned, plan) for name, plan in PLANS.items()}


def one_step_error(tissue, some):
    """The rms of the error one frame ahead, over the rms of the coefficients."""
    one = one_step_of(tissue, body, [some])
    ahead = one.regressors @ np.hstack([tissue.first, tissue.second, tissue.response]).T
    return np.sqrt(np.square(one.targets - ahead).sum() / np.square(one.targets).sum())


def nothing_changes(tissue, some):
    """The same error of: as in the frame before."""
    one = one_step_of(tissue, body, [some])
    before = one.regressors[:, : tissue.n_coefficients]
    return np.sqrt(np.square(one.targets - before).sum() / np.square(one.targets).sum())


ahead = {"as in the frame before": nothing_changes(tissues["Dyna's inputs"], unseen)}
free = {}
for name, tissue in tissues.items():
    ahead[name] = one_step_error(tissue, unseen)
    free[name] = score_tissue(tissue, body, unseen).explained
for name, error in ahead.items():
    alone = f"; by itself it explains {free[name]:.2f}" if name in free else ""
    print(f"{name}: one frame ahead off by {100 * error:.1f} % of the coefficients' rms{alone}")

runs = {
    name: tissue.displacements(body, tissue.coefficients(body, unseen.motion), unseen.motion.betas)
    for name, tissue in tissues.items()
}
drawn_truth = unseen.displacements[:, softest, 1]  # m
drawn_run = runs["with forces on parts"][:, softest, 1]

with house_style():
    figure, axes = sheet(9.5, 3.4, columns=2)
    for ax, (name, run) in zip(axes, runs.items(), strict=True):
        ax.plot(seconds, 1e3 * unseen.displacements[:, softest, 1], "k", lw=2, label="simulated")
        ax.plot(seconds, 1e3 * run[:, softest, 1], "C0", label=f"by itself: {name}")
        ax.set(xlabel="time (s)", ylabel="displacement upwards (mm)")
        ax.set(ylim=(-9, 14))
        ax.legend(loc="upper right")
Picture(
    figure,
    "The same vertex in the same clip. Each model runs by itself, from the motion alone. With "
    "Dyna's inputs it goes astray; with what each soft part feels as further inputs it follows "
    f"in the main, and is off by up to {1e3 * np.abs(drawn_truth - drawn_run).max():.1f} mm.",
)

# %% slide [markdown]
# ## A free run tells models apart
#
# - Explained in an unseen clip: {{ free["Dyna's inputs"]:.2f}} with Dyna's inputs,
#   {{ free['with forces on parts']:.2f}} with what soft parts feel

# %% [markdown]
# One frame ahead, both models look good: they are off by {{ 100 * ahead["Dyna's inputs"]:.1f}} % and
# {{ 100 * ahead['with forces on parts']:.1f}} % of the rms of the coefficients. But the guess
# that nothing changes is off by no more than {{ 100 * ahead['as in the frame before']:.0f}} %, since at 60 frames a
# second not much happens in a frame. So let each
# model run by itself, from the motion alone, and feed on its own output. This is a **free run**, and it tells them
# apart: with Dyna's inputs it is worse than a tissue that keeps its place{{ free["Dyna's inputs"] < -0.5 }}, and with
# the further inputs of the next section it explains {{ 100 * free['with forces on parts']:.0f}} %. (That is of all
# vertices. Of the curve in the figure it explains {{ 100 * share(drawn_truth, drawn_run):.0f}} %.)

# %% slide [markdown]
# ## One frame ahead, everything looks good
#
# | | off by |
# | --- | --- |
# | nothing changes | {{ 100 * ahead['as in the frame before']:.0f}} % |
# | Dyna's inputs | {{ 100 * ahead["Dyna's inputs"]:.1f}} % |
# | with forces on parts | {{ 100 * ahead['with forces on parts']:.1f}} % |
#
# - At 60 frames a second not much happens in a frame. Let each model feed on its own output.

# %% [markdown]
# ## What a part of the body feels
#
# Why are velocities and accelerations of joints not enough? Tissue is driven by what it feels where it is. A belly is
# pressed back when the body accelerates forwards, no matter which joints caused this. In the frame of its bone, a mass
# at the place $p$ feels $R^\top (g - \ddot p)$, gravity less acceleration. This depends on where down is, and on
# centrifugal forces, which grow with the square of a speed: it is no linear function of Dyna's inputs. What it feels in
# the rest pose, $g$, has to be subtracted, since the template hangs in gravity already. The soft vertices are divided
# into parts, and what the middle of each part feels are three more inputs.
#
# How does the library get $\ddot p$? A point that is fixed to a joint is carried by it: if the joint is at $j_t$ in
# frame $t$ and has turned by $R_t$, and the point was at $c$ beside the joint at rest, it is at $p_t = R_t\, c + j_t$.
# Half a frame before and after frame $t$, its velocity is $f\, (p_t - p_{t-1})$ and $f\, (p_{t+1} - p_t)$, with $f$
# frames a second. Their difference, times $f$ again, is the acceleration, $f^2 (p_{t+1} - 2 p_t + p_{t-1})$. In the
# lines, `self.turns` are the $R_t$ of all joints, `self.joints` their places $j_t$, and $R^\top$ is the index order
# `tpji`. The first and the last frame lack a neighbour; `_same_at_ends` gives them the value beside them.

# %% slide [markdown]
# ## What a soft part feels
#
# - Gravity less acceleration, in the frame of its own bone
# - Acceleration by second differences: $f^2 (p_{t+1} - 2 p_t + p_{t-1})$, with $p_t = R_t\, c + j_t$

# %%
source(second_differences, MovingFrames.forces)

# %% [markdown]
# ## A model that does not blow up
#
# A free run feeds on its own output. What becomes of a push when nothing drives the model any more, so that $x_t = 0$?
# As above, we ask for $\varphi_t = z^t v$, now with a vector $v$. Put into the model without inputs, it gives
# $z^2 v = z A_1 v + A_2 v$. With $u = z v$ these are the two equations $A_1 u + A_2 v = z u$ and $u = z v$, and so the
# poles of the matrices are the eigenvalues $z$ of
#
# $$ \begin{pmatrix} A_1 & A_2 \\ I & 0 \end{pmatrix} . $$

# %% slide [markdown]
# ## A model that does not blow up
#
# $$ \begin{pmatrix} A_1 & A_2 \\ I & 0 \end{pmatrix} $$
#
# - Its eigenvalues are the poles; the largest size is the **spectral radius**.
# - Above one, every push grows for ever. Least squares does not forbid it.

# %% [markdown]
# In the long run, each frame multiplies what is left of a push by the size of the largest one, the **spectral radius**.
# If that is above one, the model blows up. Least squares does not forbid this. But multiply $z^2 v = z A_1 v + A_2 v$
# by $\rho^2$: it becomes $(\rho z)^2 v = (\rho z)\, \rho A_1 v + \rho^2 A_2 v$. So with $\rho A_1$ and $\rho^2 A_2$ in
# place of $A_1$ and $A_2$ all poles are multiplied by $\rho$, and what is left after $t$ frames by $\rho^t$: every
# wobble keeps its frequency and its form. So if a model is not stable, it is made so by one factor.

# %% slide [markdown]
# ## One factor mends it
#
# $$ (\rho z)^2 v = (\rho z)\, \rho A_1 v + \rho^2 A_2 v $$
#
# - $\rho A_1$ and $\rho^2 A_2$: all poles times $\rho$
# - Every wobble keeps its frequency and its form.

# %%
tissue = tissues["with forces on parts"]
pushed = np.zeros((600, tissue.n_coefficients))
pushed[0] = 1.0  # in place of the inputs: a push in the first frame, and nothing after it
sizes = {}
for wanted in (tissue.spectral_radius, 1.0, 1.02):
    rho = wanted / tissue.spectral_radius
    run = free_run(rho * tissue.first, rho**2 * tissue.second, pushed)
    sizes[wanted] = np.linalg.norm(run, axis=1)
    kept = np.abs(np.linalg.eigvals(companion(rho * tissue.first, rho**2 * tissue.second))).max()
    print(
        f"spectral radius {kept:.3f}: 10 s after a push {sizes[wanted][-1] / sizes[wanted][0]:.1e} of it is left"
    )

with house_style():
    figure, (left, right) = sheet(9.5, 3.6, columns=2)
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
    left.plot(circle.real, circle.imag, color="0.6", lw=1)
    left.plot(tissue.poles.real, tissue.poles.imag, "o", ms=5)
    left.set(xlabel="real part", ylabel="imaginary part", aspect="equal")
    for wanted, size in sizes.items():
        right.semilogy(np.arange(600) / FPS, size, label=f"spectral radius {wanted:.2f}")
    right.set(xlabel="time after a push (s)", ylabel="size of the coefficients")
    right.legend()
Picture(
    figure,
    "Left: the poles of the model that was learned, inside of the circle of size 1. Right: what is left of a "
    "push, with all poles scaled by one factor. In the first frames, where the three curves lie nearly on each other, "
    "it grows in all of them: a push also gives the coefficients a velocity, and they swing on before they turn back. On "
    "the circle the peaks grow for some seconds more, because the coefficients of different shapes push each other. In "
    "the long run it dies away where the largest pole is inside of the circle, stays where it is on it, and grows where "
    "it is outside.",
)

# %% slide [markdown]
# ## Inside, on, and outside of the circle
#
# - Ten seconds after a push: {{ sizes[tissue.spectral_radius][-1] / sizes[tissue.spectral_radius][0]:.0e}} of
#   it with {{ tissue.spectral_radius:.2f}}, {{ sizes[1.02][-1] / sizes[1.02][0]:.0e}} with 1.02

# %% [markdown]
# Ten seconds after a push, {{ sizes[1.02][-1] / sizes[1.02][0]:.0e}} of it are there with a spectral radius of
# 1.02{{ sizes[tissue.spectral_radius][-1] < 1e-6 * sizes[tissue.spectral_radius][0] and 0.5 < sizes[1.0][-1] / sizes[1.0][0] < 50 and (np.abs(tissue.poles) < 1).all() }}.
#
# ## The embedded body
#
# `load_tissue()` is the tissue of the body `default`. It was learned in the same way, with
# {{ load_tissue().n_coefficients }} dynamic blend shapes, from springs that recorded motion drove. The recordings are
# not part of the package, but what was
# measured with them is: in clips and people that it had not seen, a free run explains {{ 87.9 }} % of the variance,
# with a 95 % interval from {{ 81.1 }} % to {{ 90.8 }} %. With Dyna's inputs alone it explains {{ 33.5 }} %. (Above,
# where
# they failed, the body and the clips were others.)
#
# Coefficients of zero give SMPL, to the last bit. An **exaggeration** multiplies them. How much farther the
# tissue of a heavy person moves is a gain, a power of the body mass index that was learned with the rest.

# %% slide [markdown]
# ## The embedded body's tissue
#
# - Learned from recorded motion that drove springs; {{ load_tissue().n_coefficients}} dynamic blend shapes
# - Unseen clips and people: {{ 87.9 }} % explained, interval {{ 81.1 }} to {{ 90.8 }} %
# - With Dyna's inputs alone: {{ 33.5 }} %

# %%
whole, embedded = wb.load_body("default"), load_tissue()
hop = made_up_motion(whole, 1.5, seed=3)
bare = hop.vertices(whole)
untouched = np.array_equal(embedded.vertices(whole, hop, exaggeration=0.0), bare)
print("exaggeration 0 is SMPL to the last bit:", untouched)
moves = {}
for third in (-2.0, 0.0, 2.0):
    here = replace(hop, betas=np.array([0.0, 0.0, third]))
    index = body_mass_index(whole, here.betas)
    away = np.linalg.norm(embedded.vertices(whole, here) - here.vertices(whole), axis=2)
    moves[index] = 1e3 * away.max()
    print(f"body mass index {index:.0f}: the skin moves by {moves[index]:.0f} mm at most")
print(f"with exaggeration 3, by {3 * max(moves.values()):.0f} mm")

# %% slide [markdown]
# ## Heavier people wobble more
#
# - Body mass index {{ min(moves):.0f}}: up to {{ moves[min(moves)]:.0f}} mm in a hop; {{ max(moves):.0f}}: up
#   to {{ moves[max(moves)]:.0f}} mm
# - Exaggeration 0 is SMPL to the last bit{{ untouched }}; 3 makes {{ 3 * moves[max(moves)]:.0f}} mm.
# - Bounded inputs, stable model: bounded displacements

# %% [markdown]
# With a body mass index of {{ min(moves):.0f}} the skin moves by up to {{ moves[min(moves)]:.0f}} mm in this hop, and
# with {{ max(moves):.0f}} by up to {{ moves[max(moves)]:.0f}} mm. An exaggeration of 3 makes
# {{ 3 * moves[max(moves)]:.0f}} mm of these{{ untouched }}. The inputs are bounded, as they are squashed, and the
# model is stable: what
# each frame's input moves dies away like the push above. So the displacements are bounded too, whatever the motion.
#
# ## Coefficients as unknowns
#
# So far the coefficients followed from the motion. Where the surface is seen, they can be fitted as pose and shape
# are: they are one more block. The gain is part of the graph, a function of the betas that are free as well. We take
# the frame of the unseen clip in which the springs are displaced most, and fit to its vertices twice: with SMPL
# alone, where the coefficients stay zero, and with the coefficients free. The displacements are those of the springs
# and not of the model, so that neither fit can be perfect.

# %% slide [markdown]
# ## Coefficients as unknowns
#
# - Where the surface is seen, they are one more block.
# - The frame in which the springs are displaced most, fitted with and without them

# %%
pose, betas, trans = (block.symbol for block in body.blocks())
phi = wb.Block("tissue", (tissue.n_coefficients,))
swing = tissue.gain_of(body, betas) * phi.symbol
skin = with_tissue(body, tissue).points(pose, cs.vertcat(betas, swing), trans)
moving, shifted = unseen.motion, unseen.displacements
most = int(np.linalg.norm(shifted, axis=(1, 2)).argmax())
swinging = replace(
    body, template=body.template + shifted[most], rest_joints=body.joints(None, moving.betas)
)
seen = swinging.vertices(moving.pose[most], moving.betas, moving.trans[most])
fit = wb.Problem(
    [wb.residuals.vertices(skin, seen, sigma=0.002)],
    free=["pose", "betas", "trans", "tissue"],
    blocks=[phi],
)
start = body.start() | {"tissue": np.zeros(tissue.n_coefficients)}
apart, turned, shape_off = {}, {}, {}
for name, problem in (("SMPL", fit.freeing("pose", "betas", "trans")), ("tissue", fit)):
    answer = wb.solve(problem, start)
    apart[name] = 1e3 * 0.002 * np.sqrt(2 * answer.cost / len(seen))  # mm
    turned[name] = np.rad2deg(np.sqrt(np.square(answer.values["pose"] - moving.pose[most]).mean()))
    shape_off[name] = np.abs(answer.values["betas"] - moving.betas).max()
    print(
        f"{name}: vertices are off by {apart[name]:.2f} mm (rms), angles by {turned[name]:.2f} "
        f"degrees (rms), betas by up to {shape_off[name]:.2f} sd"
    )
diagnosis = wb.diagnose(fit, answer.values)
print(f"rank {diagnosis.rank} of {fit.free.size}")

# %% slide [markdown]
# ## SMPL alone bends joints to explain tissue
#
# | | vertices | angles | betas |
# | --- | --- | --- | --- |
# | SMPL | {{ apart['SMPL']:.1f}} mm | {{ turned['SMPL']:.2f}} degrees | {{ shape_off['SMPL']:.2f}} sd |
# | tissue free | {{ apart['tissue']:.1f}} mm | {{ turned['tissue']:.2f}} degrees | {{ shape_off['tissue']:.2f}} sd |
#
# - Rank {{ diagnosis.rank}} of {{ fit.free.size}}: all are determined. AMASS was made in this way.

# %% [markdown]
# All {{ fit.free.size }} numbers are determined{{ diagnosis.rank == fit.free.size }}: no pose and no shape does what
# a dynamic blend shape does. But some do nearly so. SMPL alone bends joints and changes the person's shape to explain
# tissue that swings, and its angles are off by {{ turned['SMPL']:.2f}} degrees, although no vertex has any noise. With
# the coefficients free it is {{ turned['tissue']:.2f}} degrees. What is left of the vertices' distance falls from
# {{ apart['SMPL']:.1f}} to {{ apart['tissue']:.1f}} mm, and the error of the shape from {{ shape_off['SMPL']:.2f}} to
# {{ shape_off['tissue']:.2f}} standard deviations{{ shape_off['tissue'] < 0.5 * shape_off['SMPL'] }}.
#
# The archive AMASS (Mahmood et al., 2019) was made in this way: its coefficients of DMPL, `dmpls`, were fitted to
# markers together with the poses. A motion that is read from such a file keeps them, and `with_dmpls(body, file)` makes
# a body that they move.
#
# ## Where bones come from
#
# So far the skeleton was given. Suppose that it is not, and that there are only meshes with the same vertices, in
# motion. `wb.rig` divides them into bones that move rigidly and blend ([Le and
# Deng](https://doi.org/10.1145/2366145.2366218), 2012). It solves in turn for the weights while the motions of the
# bones are held, which is a linear problem because of lecture 4's blending, and for these motions while the weights are
# held. Then it looks for a joint between each two bones. A **joint** is a point that two bones take to the same places:
#
# $$ R^a_t\, p + t^a_t = R^b_t\, p + t^b_t \quad \text{for all frames } t ,
# \qquad \text{or} \quad (R^a_t - R^b_t)\, p = t^b_t - t^a_t . $$

# %% slide [markdown]
# ## Where bones come from: a joint stays together
#
# $$ (R^a_t - R^b_t)\, p = t^b_t - t^a_t \quad \text{for all frames } t $$
#
# - `wb.rig` divides meshes in motion into bones, then looks for joints between them.
# - Three equations in each frame for three numbers. Do they determine them?

# %% [markdown]
# (The letters $a$ and $b$ above stand for the two bones.) These are linear equations for three numbers, three in each
# frame. Do they determine them? Put the matrices $R^a_t - R^b_t$ of all frames below each other, and call that matrix
# $Q$. The directions in which $p$ may slide without a change are those of its null space, and the singular values of
# $Q$ tell how many there are (lecture 8). With measured meshes, noise leaves none of them exactly zero, so that one
# asks how small a singular value is *compared with the largest one*: the smaller it is, the further a given noise moves
# the joint along its direction. We try it with a synthetic limb of two bones that moves in two ways: like a shoulder,
# about all axes, and like a hinge, about one.
#
# In the cell, the rows of `joint.directions` are the right singular
# vectors of $Q$, and `joint.parting` holds its singular values over the root of the number of frames: how far the bones
# part a point, root mean square over the frames, for each metre along that direction. These meshes have no noise, so
# that a fixed limit tells zero from the rest.

# %% slide [markdown]
# ## Compare the smallest singular value with the largest
#
# - The matrices of all frames below each other; the null space is where $p$ may slide.
# - With noise none is zero: the smaller, the further noise moves the joint.

# %%
made = random_smpl(limb(9, 6), 1, seed=0)
made = replace(made, shapedirs=made.shapedirs[:, :, :0], posedirs=np.zeros_like(made.posedirs))
rigged, rank = {}, {}
for name, axes_of_turn in (("shoulder", [1, 1, 1]), ("hinge", [0, 0, 1])):
    turns = 0.5 * np.random.default_rng(1).standard_normal((20, 2, 3))
    turns[:, 1] *= axes_of_turn
    meshes = np.stack([made.vertices(pose) for pose in turns])
    rigged[name] = wb.rig(meshes, made.faces, rest=made.template, bones=2)
    joint = rigged[name].joints[0]
    rank[name] = int((joint.parting > 1e-6).sum())
    off = 1e3 * np.linalg.norm(joint.place - made.joints()[1])
    print(
        f"{name}: meshes met to {rigged[name].rms:.0e} m, rank {rank[name]} of 3, joint off by {off:.1f} mm"
    )
    print("   ", rigged[name].notes[0])

with house_style():
    figure, axes = sheet(9.0, 3.6, columns=2)
    side = np.linspace(-0.1, 0.1, 81)
    x, z = np.meshgrid(side, side)
    for ax, (name, found) in zip(axes, rigged.items(), strict=True):
        joint = found.joints[0]
        way = np.stack([x, 0 * x, z], axis=-1) @ joint.directions.T * joint.parting
        apart = 1e3 * np.linalg.norm(way, axis=-1)
        lines = ax.contour(1e3 * x, 1e3 * z, apart, levels=[5, 15, 30, 45])
        along_x = 1e3 * np.linalg.norm(joint.directions[:, 0] * joint.parting)  # mm for each m
        places = [(1e3 * level / along_x, 0.0) for level in lines.levels]
        ax.clabel(lines, fmt="%d mm", manual=[place for place in places if place[0] < 90])
        ax.plot(0, 0, "k+", ms=10)
        ax.set(title=name, xlabel="x from the joint (mm)", ylabel="z from the joint (mm)")
Picture(
    figure,
    "How far the two bones take a point apart that is not the joint, root mean square over 20 meshes. Left: "
    "the limb turns about all axes, and there is one joint. Right: it turns about z only; the valley along z "
    "is level, and any point of it would do.",
)

# %% slide [markdown]
# ## A shoulder has a joint, a hinge has a line of them
#
# - Shoulder: rank {{ rank['shoulder']}}, found to rounding. Hinge: rank {{ rank['hinge']}}, {{ off:.0f}} mm
#   away along its axis, and no mesh contradicts

# %% [markdown]
# Both limbs are explained to rounding{{ all(one.rms < 1e-9 for one in rigged.values()) }}. The shoulder is found to
# rounding too, since its equations have rank {{ rank['shoulder']}}. (The note below it is about another joint, that
# of the root: the root hangs on nothing, so that no equation
# speaks of its place.) Those of the hinge have rank {{ rank['hinge']}}: its joint is {{ off:.0f}} mm away from where
# it was when the meshes were
# made, along the axis z{{ abs(rigged['hinge'].joints[0].free[0, 2]) > 0.999 }}, and no mesh contradicts. This is a
# null direction as in lecture 8. `wb.rig` names it in its
# notes, and the remedy lies in the data: turn the limb about another axis as well.

# %% slide [markdown]
# ## The remedy lies in the data
#
# - A null direction, as in lecture 8; `wb.rig` names it in its notes.
# - Turn the limb about another axis as well.

# %% [markdown]
# ## What to remember
#
# - Soft tissue is no function of the pose. It remembers where it was and how fast it moved: two frames.
# - Dynamic blend shapes are added at rest like all others, and zero coefficients are SMPL. The model of
#   their coefficients is linear, and learned by least squares.
# - Judge it by a free run on unseen clips. One frame ahead, even "nothing changes" looks good.
# - What drives tissue is felt where the tissue is: gravity less acceleration, in the frame of its bone.
# - Coefficients are unknowns like pose and shape where the surface is seen. Left out, they bias both.
# - Stability is a property of the poles. One factor on all of them mends it.
# - A joint is a point that stays together in two bones. A motion about one axis leaves a line of them.

# %% slide [markdown]
# ## What to remember
#
# - Tissue remembers two frames; dynamic blend shapes are added at rest, with a linear model.
# - Judge by a free run on unseen clips; one factor on all poles makes it stable.
# - A joint is a point that stays together in two bones; one axis leaves a line.
