# %% [markdown]
# # Triangles: SCAPE and BlendSCAPE
#
# **What if we deform triangles, and not vertices?**
#
# SMPL moves vertices. Models before it moved triangles: SCAPE (Anguelov and others, [*SCAPE: Shape Completion and
# Animation of People*](https://doi.org/10.1145/1073204.1073207), 2005) says for every triangle of the mesh how it is
# turned and stretched. That is a natural way to describe skin, which stretches. But triangles that move one by one do
# not meet at their corners any more. In this lecture we take a mesh apart, put it together again, and then compare the
# two ways. Lengths are in metres and angles in radians.

# %%
from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.triangles import blend_scape, scape
from workbench.bodies.triangles.surface import TriangleSurface
from workbench.comparison.statistics import median
from workbench.course import Picture, source
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.geometry.solids import mesh_edges, volume
from workbench.geometry.triangles import Stitching, edges, frames_on, gradients
from workbench.lectures.material.replays import recorded_side_by_side
from workbench.lectures.material.variance import (
    additivity_gap,
    explained_by_triangles,
    explained_by_vertices,
    explained_gradients,
)
from workbench.plots import house_style, plot_stitching, sheet
from workbench.plots.body import Figurine, front, line_up

# %%
body = wb.load_body("small")
faces, template = body.faces, body.template
elbow = body.joint_names.index("left_elbow")

# %% [markdown]
# ## Every triangle by itself
#
# Each of the {{ len(faces) }} triangles belongs to a part of the body. We bend the left elbow, and turn every
# triangle by the
# rotation of its part, about its own middle. This needs no blending at all:

# %% slide [markdown]
# ## Every triangle by itself
#
# - Turn each of {{ len(faces)}} triangles by the rotation of its part, about its own middle.
# - No blending is needed at all.

# %%
pose = np.zeros((24, 3))
pose[elbow, 2] = 1.6  # rad, upwards
rigid = scape(body)
X = rigid.deformations(pose, np.zeros(body.n_betas))  # (F, 3, 3)
about = template[faces].mean(axis=1, keepdims=True)
torn = about + (template[faces] - about) @ X.transpose(0, 2, 1)  # (F, 3, 3): corners


def gaps(corners):
    """How far apart the corners are that should be one vertex, (N,) mm."""
    middle = np.zeros((body.n_vertices, 3))
    count = np.bincount(faces.ravel(), minlength=body.n_vertices)
    np.add.at(middle, faces.ravel(), corners.reshape(-1, 3))
    middle /= count[:, None]
    away = np.zeros(body.n_vertices)
    np.maximum.at(
        away, faces.ravel(), np.linalg.norm(corners.reshape(-1, 3) - middle[faces.ravel()], axis=1)
    )
    return 1e3 * away


print(f"rotations alone: R'R = I to {np.abs(X.transpose(0, 2, 1) @ X - np.eye(3)).max():.0e}")
print(
    f"corners that were one vertex are up to {gaps(torn).max():.0f} mm from their mean; at rest "
    f"{gaps(template[faces]).max():.0f} mm"
)

# %% slide [markdown]
# ## Every triangle is perfect, and the surface is gone
#
# - Corners that were one vertex are up to {{ gaps(torn).max():.0f}} mm from their mean.
# - The forearm has not left its place: its triangles only turned on the spot.
# - Wanted: a connected surface whose *edges* are like those.

# %% [markdown]
# Every triangle is perfect and the surface is gone{{ np.allclose(X.transpose(0, 2, 1) @ X, np.eye(3), atol=1e-13) }}:
# corners are up to {{ gaps(torn).max():.0f}} mm apart. The forearm has not even left its place, because its triangles
# have only turned on the spot. (The figure below shows this in the middle.) What we want is a connected surface whose
# *edges* are like those of these triangles.
#
# ## What a triangle knows
#
# With corners $T_0, T_1, T_2$ a triangle's edges are $e_0 = T_2 - T_0$ and $e_1 = T_1 - T_0$. Its
# deformation is a $3 \times 3$ matrix $X$ with $X e_i = e_i'$, where $e_i'$ are the edges of the deformed
# triangle. Do the two edges determine $X$? They give six equations for nine unknowns. The two edges span a plane,
# and what $X$ does to the normal of that plane stays open. We try the solution with the smallest norm, which the
# pseudo-inverse gives:

# %% slide [markdown]
# ## What a triangle knows
#
# $$ X e_0 = e_0', \qquad X e_1 = e_1' $$
#
# - Six equations for nine unknowns: what happens to the normal stays open.
# - The pseudo-inverse takes the solution of least norm ...

# %%
T = template[faces[100]]
true = matrix_from_vector([0.3, -0.5, 0.2]) @ np.diag([1.1, 0.9, 1.0])
moved = T @ true.T
two = edges(T, np.array([[0, 1, 2]]))[0].T  # the edges as columns, (3, 2)
two_moved = edges(moved, np.array([[0, 1, 2]]))[0].T
by_edges = two_moved @ np.linalg.pinv(two)
print(
    f"from two edges: edges are met to {np.abs(by_edges @ two - two_moved).max():.0e} m, "
    f"but det X = {np.linalg.det(by_edges):.3f} and the true one is {np.linalg.det(true):.3f}"
)
print("rank of that X:", np.linalg.matrix_rank(by_edges))

# %% slide [markdown]
# ## ... which flattens space
#
# - Edges are met, and $\det X$ = {{ abs(np.linalg.det(by_edges)):.0f}}; the true one is
#   {{ np.linalg.det(true):.2f}}.
# - Rank {{ np.linalg.matrix_rank(by_edges)}}: the normal goes to zero.

# %% [markdown]
# Of all matrices that meet the edges, the one with the smallest norm flattens
# space{{ np.linalg.matrix_rank(by_edges) == 2 and np.allclose(by_edges @ two, two_moved) }}: it takes the normal to
# zero. So we add a third axis to the two edges, and then $X$ has nine equations. The usual axis is
# $n / \sqrt{\|n\|}$ with $n = e_1 \times e_0$. It is normal to the triangle. The length of $n$ is twice the
# triangle's area, so the axis is as long as the root of that. It grows with the triangle as an edge does, and has
# the unit of an edge. In the library the two edges and the axis are the columns of a matrix, the *frame*:

# %% slide [markdown]
# ## A third axis
#
# $$ \frac{n}{\sqrt{\|n\|}}, \quad n = e_1 \times e_0, \qquad X = E' E^{-1} $$
#
# - Normal to the triangle, and it grows as an edge does
# - $E$, the *frame*: both edges and the axis as columns
# - A whole mesh turned and scaled: the same $X$
#   everywhere{{ np.allclose(gradients(template, template @ matrix_from_vector([0, 1, 0]).T, faces), matrix_from_vector([0, 1, 0])) }}

# %%
source(frames_on)

# %% [markdown]
# With $E$ the frame of the triangle at rest and $E'$ that of the deformed one, $X E = E'$, so that
# $X = E' E^{-1}$. As a test we turn and scale a whole mesh, and find the same $X$ in every triangle:

# %%
turn = 1.2 * matrix_from_vector([0.3, -0.5, 0.2])
found = gradients(template, template @ turn.T, faces)
print(f"the whole mesh turned and scaled: every X is that, to {np.abs(found - turn).max():.0e}")

# %% [markdown]
# ## Stitching
#
# Find the vertices $V$ whose edges are nearest to those that the triangles ask for{{ np.allclose(found, turn) }}:
#
# $$ \min_V \sum_f \sum_{i} \| X_f e_{f,i} - (A V)_{f,i} \|^2 . $$

# %% slide [markdown]
# ## Stitching: vertices whose edges are nearest
#
# $$ \min_V \sum_f \sum_{i} \| X_f e_{f,i} - (A V)_{f,i} \|^2 \quad\Rightarrow\quad A^\top A\, V = A^\top e $$
#
# - $A$ takes vertices to edges: $+1$ and $-1$ in each row
# - The same for every pose: factorised once, then two triangular solves

# %% [markdown]
# Here $X_f e_{f,i}$ is the edge that triangle $f$ asks for. An edge of the mesh is the difference of two vertices. So
# there is a matrix $A$ that takes vertices to edges. It has two entries in each row, $+1$ and $-1$, and is the same
# for $x$, $y$ and $z$. This is linear least squares, so the best $V$ solves the normal equations
#
# $$ A^\top A\, V = A^\top e , $$
#
# where $e$ holds all edges that are asked for, one in each row. The matrix does not depend on the pose. It is
# factorised once, and every stitching after that takes two triangular solves. There is one thing that edges do not
# say: if all vertices move by the same offset, no edge changes. So $A$ leaves open where the mesh is as a whole:
# one direction for each coordinate (and each connected piece). The library puts the mean of the vertices where we
# say:

# %%
source(Stitching.vertices)

# %% slide [markdown]
# ## What edges do not say
#
# - All vertices moved alike: no edge changes. One direction for each coordinate stays open.
# - The library puts the mean where we say.

# %%
stitching = Stitching(faces, body.n_vertices)
A = stitching.A.toarray()
s = np.linalg.svd(A, compute_uv=False)
print(
    f"A is {A.shape}, smallest singular values {s[-2]:.2g} and {s[-1]:.0e}: rank {np.sum(s > 1e-9)}"
)
R = matrix_from_vector([0.2, 0.4, -0.9])
turned = stitching.vertices(edges(template, faces) @ R.T)
centred = (template - template.mean(axis=0)) @ R.T
print(f"all triangles turned alike: the mesh turned, to {np.abs(turned - centred).max():.0e} m")
asked = edges(template, faces) @ X.transpose(0, 2, 1)
stitched = stitching.vertices(asked, [template.mean(axis=0)])
left = 1e3 * np.linalg.norm(edges(stitched, faces) - asked, axis=2)
print(
    f"bent elbow: edges differ from what was asked by {left.mean():.1f} mm, at most {left.max():.0f} mm"
)

with house_style():
    figure, (ax,) = sheet(10, 3.8)
    stages = {"at rest": template[faces], "each by itself": torn, "stitched": stitched[faces]}
    plot_stitching(stages, ax=ax)
Picture(
    figure,
    "Left: the mesh. Middle: every triangle turned with its part, about its own middle; the arm has "
    "turned and has not moved. Right: the vertices whose edges are nearest to those.",
)

# %% slide [markdown]
# ## The arm arrives, and nobody said where the elbow is
#
# - Stitched, it has moved by up to {{ 1e3 * np.linalg.norm(stitched - template, axis=1).max():.0f}} mm: edges
#   add up along the arm.

# %% [markdown]
# The forearm has moved to where it belongs, by up to {{ 1e3 * np.linalg.norm(stitched - template, axis=1).max():.0f}}
# mm, although nobody said where the elbow
# is{{ np.sum(s > 1e-9) == body.n_vertices - 1 and np.allclose(turned, centred) and np.allclose(torn.mean(axis=1), template[faces].mean(axis=1)) }}.
# The edges add up along the arm,
# and so the hand has to be at their end. In this sense such a model has no skeleton: it needs no places of joints.
# But each part has a rotation, so somebody still has to choose the parts.

# %% slide [markdown]
# ## No skeleton, but parts
#
# - $A$ has rank {{ np.sum(s > 1e-9)}} for {{ body.n_vertices}} vertices.
# - It needs no places of joints; somebody still has to choose the parts.
# - Edges differ from what was asked by {{ left.mean():.1f}} mm on average, at most {{ left.max():.0f}}.

# %% [markdown]
# ## SCAPE
#
# SCAPE's deformation is a product of three,
#
# $$ X_f = R_{\ell(f)}\; D_f(\beta)\; Q_f(\theta) : $$
#
# and a vector is multiplied by the last one first. $Q_f$ is what bending does to the skin, and is linear in the
# rotation vectors of the joints nearby. $D_f$ is the person's shape. $R_{\ell(f)}$ is the rotation of the part
# $\ell(f)$ to which the triangle belongs. $Q$ and $D$ are learned by least squares on triangles.

# %% slide [markdown]
# ## SCAPE: a product of three
#
# $$ X_f = R_{\ell(f)}\; D_f(\beta)\; Q_f(\theta) $$
#
# - $Q$: what bending does to the skin, linear in rotation vectors nearby
# - $D$: the person's shape. $R$: the rotation of the part

# %% [markdown]
# Our elbow had neither $D$ nor $Q$, so $X_f = R_{\ell(f)}$, and it has a crease: on one side of the elbow all
# triangles turn by 1.6 rad, on the other none. **BlendSCAPE** (Hirshberg and others, [*Coregistration: Simultaneous
# Alignment and Modeling of Articulated 3D Shape*](https://doi.org/10.1007/978-3-642-33783-3_18), 2012) blends the
# rotations as skinning does:
#
# $$ X_f = B_f D_f Q_f, \qquad B_f = \sum_k w_{fk} R_k , $$
#
# with a weight $w_{fk}$ for each triangle and part. In the library these are two lines:

# %% slide [markdown]
# ## BlendSCAPE blends the rotations
#
# $$ X_f = B_f D_f Q_f, \qquad B_f = \sum_k w_{fk} R_k $$
#
# - A weight for each triangle and part, as in skinning
# - Without it, all of a bend is between two rows of triangles.

# %%
source(TriangleSurface.B)

# %%
source(TriangleSurface.deformations)

# %% [markdown]
# We measure the crease by how much two triangles that share an edge differ in their deformation, and look at the
# elbow of a body with more triangles from the front:

# %%
blended = blend_scape(body)
finer = wb.load_body("default")  # with more triangles around the elbow
sewn = Stitching(finer.faces, finer.n_vertices)
of_triangles = {"SCAPE": scape(finer), "BlendSCAPE": blend_scape(finer)}


def creases(X):
    """By how much each triangle's deformation differs from its neighbours': largest |X_f - X_g|, (F,)."""
    sides = {}
    for f, (a, b, c) in enumerate(finer.faces):
        for pair in ((a, b), (b, c), (c, a)):
            sides.setdefault(tuple(sorted(pair)), []).append(f)
    step = np.zeros(len(finer.faces))
    for f, g in sides.values():
        step[[f, g]] = np.maximum(step[[f, g]], np.linalg.norm(X[f] - X[g]))
    return step


bent_elbows, volumes = {}, {}
for name, model in of_triangles.items():
    deformed = model.deformations(pose, np.zeros(finer.n_betas))
    asked = edges(finer.template, finer.faces) @ deformed.transpose(0, 2, 1)
    placed = sewn.vertices(asked, [finer.template.mean(axis=0)])
    left = 1e3 * np.linalg.norm(edges(placed, finer.faces) - asked, axis=2)
    bent_elbows[name] = placed, creases(deformed)
    volumes[name] = volume(placed, finer.faces)
    print(
        f"{name:11} largest step between neighbours {creases(deformed).max():.2f}, stitching leaves "
        f"up to {left.max():.0f} mm, least det {np.linalg.det(deformed).min():.2f}"
    )

# %%
middles = finer.template[finer.faces].mean(axis=1)
near = np.linalg.norm(middles - finer.joints()[elbow], axis=1) < 0.22  # m
some, numbers = np.unique(finer.faces[near], return_inverse=True)


def elbow_of(model):
    """The surface of a model near its elbow, which is bent by an angle."""
    return lambda angle: model.vertices(np.where(pose > 0, angle, 0))[some]


with house_style():
    figure, (ax,) = sheet(9, 4.4)
    pale, red = np.array([0.87, 0.87, 0.87]), np.array([0.75, 0.1, 0.1])
    line_up(
        [
            Figurine(name, placed[some], front, pale + (step[near, None] / 2.1) * (red - pale))
            for name, (placed, step) in bent_elbows.items()
        ],
        numbers.reshape(-1, 3),
        ax=ax,
    )
Picture(
    figure,
    "The bent elbow, stitched, seen from the front. The redder a triangle, the more its deformation differs "
    "from a neighbour's. Left: with one rotation for each part, all of the bend is between two rows of triangles. "
    "Right: with blended rotations it is shared by more rows, and the arm has less volume.",
    lambda: recorded_side_by_side(
        numbers.reshape(-1, 3),
        np.radians(np.arange(0, 141, 5)),
        {
            "elbow": {
                "SMPL": elbow_of(finer),
                **{name: elbow_of(model) for name, model in of_triangles.items()},
            }
        },
        "The same elbow by SMPL, which blends points, and by both models of triangles, which "
        "blend nothing or rotations. Drag the bodies to look at the elbow from other sides.",
        opens=0.65,
    ),
)

# %% slide still [markdown]
# ## One crease, or a shared bend
#
# - Largest step between neighbours: {{ bent_elbows['SCAPE'][1].max():.2f}} and
#   {{ bent_elbows['BlendSCAPE'][1].max():.2f}}
# - Shared, and with less volume

# %% slide [markdown]
# ## The elbow by three models
#
# - SMPL blends points, BlendSCAPE rotations, SCAPE nothing.
# - Drag the bodies to look from other sides.

# %% [markdown]
# The crease is smaller, {{ bent_elbows['BlendSCAPE'][1].max():.2f}} in place of
# {{ bent_elbows['SCAPE'][1].max():.2f}}{{ bent_elbows['BlendSCAPE'][1].max() < 0.5 * bent_elbows['SCAPE'][1].max() and volumes['BlendSCAPE'] < volumes['SCAPE'] }},
# and something else has gone wrong, as in lecture 4: a mean of rotations is no rotation. Take
# the mean of the identity and a rotation by $\alpha$ about the axis $z$. In the plane across the axis it is
#
# $$
# \tfrac12 (I + R_\alpha) = \tfrac12
# \begin{pmatrix} 1 + \cos \alpha & -\sin \alpha \\ \sin \alpha & 1 + \cos \alpha \end{pmatrix},
# $$
#
# and along the axis it is 1. So its determinant is $\tfrac14 \left( (1 + \cos \alpha)^2 + \sin^2 \alpha \right)$,
# which is $\tfrac12 (1 + \cos \alpha)$, or
#
# $$ \det \tfrac12 (I + R_\alpha) = \cos^2 \tfrac{\alpha}{2} . $$
#
# A determinant is the factor by which volumes change, so the triangles at the bend shrink. In linear blend skinning
# the same factor makes the candy wrapper. There pose blend shapes have to repair it, and here $Q$ does.

# %% slide [markdown]
# ## A mean of rotations is no rotation
#
# $$ \det \tfrac12 (I + R_\alpha) = \cos^2 \tfrac{\alpha}{2} $$
#
# - A determinant is the factor of volumes: triangles at the bend shrink.
# - The same factor makes the candy wrapper; here $Q$ has to repair it.

# %%
angles = np.linspace(0, np.pi, 60)
mean_det = [np.linalg.det((np.eye(3) + matrix_from_vector([0, 0, a])) / 2) for a in angles]
least = []
for a in angles[::6]:
    bent = pose.copy()
    bent[elbow, 2] = a
    least.append(np.linalg.det(blended.deformations(bent, np.zeros(body.n_betas))).min())
with house_style():
    figure, (ax,) = sheet(7.5, 3.6)
    ax.plot(np.degrees(angles), np.cos(angles / 2) ** 2, color="0.6", lw=4, label="cos²(α / 2)")
    ax.plot(np.degrees(angles), mean_det, "--", label="half of each of two rotations")
    ax.plot(np.degrees(angles[::6]), least, "o", label="smallest on the bent elbow")
    ax.set(xlabel="angle of the elbow α (degrees)", ylabel="det B (share of the volume)")
    ax.legend()
Picture(
    figure,
    "What blending rotations does to volume. The triangles that follow upper arm and forearm alike "
    "follow the law; at half a turn they would vanish.",
)

# %% slide [markdown]
# ## The bent elbow follows the law
#
# - At 90 degrees half of the volume is left, at half a turn nothing.

# %% [markdown]
# ## Added or multiplied?
#
# In SMPL the effects of shape and pose on the skin are *added*{{ np.allclose(mean_det, np.cos(angles / 2) ** 2) and np.allclose(least, np.cos(angles[::6] / 2) ** 2, atol=0.05) }}
# to the template, before the joints turn it. In SCAPE
# they are *multiplied*. So in SMPL the effect of shape and pose together is the sum of their single effects. In SCAPE
# it is not: what a bend does to the skin is larger on a larger person. To see this, we give the triangles a
# made-up bending $Q$, and measure how far the effect of both is from the sum of the single effects:

# %%
rng = np.random.default_rng(0)
bending = replace(blended, posedirs=0.05 * rng.standard_normal(blended.posedirs.shape))
some_pose = 0.3 * rng.standard_normal((24, 3))
some_betas = 2 * rng.standard_normal(body.n_betas)
apart = {}  # mm
for name, model in (("SMPL", body), ("BlendSCAPE", bending)):
    gap = np.linalg.norm(additivity_gap(model, some_pose, some_betas), axis=1)
    apart[name] = 1e3 * gap.max()
    print(f"{name:11} effect of both minus the sum of single effects: up to {apart[name]:.2g} mm")

# %% [markdown]
# ## How many directions do people need?

# %% slide [markdown]
# ## Added or multiplied?
#
# - SMPL *adds* shape and pose at rest, SCAPE *multiplies* them: a bend does more on a larger person.
# - Effect of both minus the sum of single effects: {{ apart['SMPL']:.0f}} mm (SMPL), up to
#   {{ apart['BlendSCAPE']:.0f}} mm (BlendSCAPE with a made-up bending)

# %% [markdown]
# Multiplied, the two miss the sum by up to {{ apart['BlendSCAPE']:.0f}} mm{{ apart['SMPL'] < 1e-9 }}. Both kinds of
# model describe people by principal components: SMPL takes those of the vertices, and SCAPE those of the
# deformations. Which needs fewer? The answer depends on the data, but one thing is a theorem. Among all spaces of
# $k$ directions, the principal components of the vertices explain the most variance *of the vertices* (Eckart and
# Young, [*The Approximation of One Matrix by Another of Lower Rank*](https://doi.org/10.1007/BF02288367), 1936). And
# $k$ directions of deformations, once they are stitched, are $k$ directions of vertices, because stitching is linear.
# So for every $k$, SMPL's way explains at least as much. How much more does it explain? We take 80 people drawn from
# our shape space, each of whom is also posed a little, as in every registration:

# %% slide [markdown]
# ## Whose directions explain people better? A theorem
#
# - Principal components of vertices explain most of the variance *of vertices* (Eckart and Young).
# - $k$ directions of deformations, stitched, are $k$ directions of vertices.
# - So SMPL's way never explains less.

# %%
people = body.vertices(
    0.03 * rng.standard_normal((80, 24, 3)), rng.standard_normal((80, body.n_betas))
)
by_vertices = explained_by_vertices(people, 20)
by_triangles = explained_by_triangles(people, faces, 20)
for k in (1, 2, 5, 10, 20):
    print(f"k = {k:2}: vertices {by_vertices.share[k]:.3f}, triangles {by_triangles.share[k]:.3f}")
print("never less:", bool((by_vertices.share >= by_triangles.share - 1e-12).all()))

with house_style():
    figure, (ax,) = sheet(7.5, 3.6)
    ax.plot(100 * by_vertices.share, "o-", ms=4, label="of vertices (SMPL)")
    ax.plot(100 * by_triangles.share, "s--", ms=4, label="of deformations, stitched (SCAPE)")
    ax.set(
        xlabel="directions k",
        ylabel="variance of the vertices explained (%)",
        xticks=range(0, 21, 5),
    )
    ax.legend()
Picture(
    figure,
    "Variance of the vertices of 80 made-up people, explained by the first k directions of either "
    "kind. Directions of vertices never explain less, by the theorem; how much more they explain depends on "
    "the data.",
)

# %% slide [markdown]
# ## How much more depends on the data
#
# - Five directions: {{ by_vertices.share[5]:.0%}} and {{ by_triangles.share[5]:.0%}}

# %% [markdown]
# With five directions {{ by_vertices.share[5]:.0%}} and {{ by_triangles.share[5]:.0%}} are
# explained{{ (by_vertices.share >= by_triangles.share - 1e-12).all() }}. What do SCAPE's directions describe, then?
# There are nine numbers for each triangle, and a mesh has far fewer: most
# deformations are those of no mesh at all, and stitching averages them away. Moreover, SCAPE's principal components
# count each triangle alike, however small it is. So they spend directions on what hardly moves the mesh:

# %%
by_gradients = explained_gradients(people, faces, 20)
print(f"{9 * len(faces)} numbers of deformations, {3 * len(template)} of vertices")
for share in (0.9, 0.95):
    needed = {
        "vertices, by their own directions": by_vertices.share,
        "vertices, by SCAPE's directions": by_triangles.share,
        "deformations, by SCAPE's directions": by_gradients,
    }
    for what, shares in needed.items():
        k = int(np.argmax(shares >= share)) if shares.max() >= share else 0
        print(f"{100 * share:.0f} % of the {what}: {k or 'more than 20'} directions")

# %% slide [markdown]
# ## Say what directions are to explain
#
# - {{ 9 * len(faces):,}} numbers of deformations, {{ 3 * len(template):,}} of vertices: most deformations are
#   those of no mesh.
# - 90 % of the vertices' variance: {{ np.argmax(by_triangles.share >= 0.9)}} of SCAPE's directions; of the
#   deformations': {{ np.argmax(by_gradients >= 0.9)}}

# %% [markdown]
# With {{ np.argmax(by_triangles.share >= 0.9)}} of SCAPE's directions 90 % of the variance of the vertices are
# explained, but 90 % of the variance of the deformations takes {{ np.argmax(by_gradients >= 0.9)}}. So if we count
# the directions that a SCAPE needs, we have to say what they are to explain.
#
# ## Fits
#
# A triangle body has the same blocks as SMPL (pose, betas and trans), and residuals take its points like those
# of any body. So we can fit all three models to the same {{ len(range(0, body.n_vertices, 3)) }} vertices of one
# person, whom SMPL has made and
# who is seen with 5 mm of noise. SMPL has to win here. The question is how near the others come without learned
# bends, that is with $Q = I$.

# %%
truth = {
    "pose": np.vstack([np.zeros(3), 0.4 * rng.standard_normal((23, 3))]),
    "betas": rng.standard_normal(body.n_betas),
    "trans": np.zeros(3),
}
whole = body.vertices(**truth)
seen = np.arange(0, body.n_vertices, 3)
noisy = whole[seen] + 0.005 * rng.standard_normal((len(seen), 3))  # m
models = {"SMPL": body, "SCAPE": scape(body), "BlendSCAPE": blend_scape(body)}
off, iterations = {}, {}
for name, model in models.items():
    blocks = model.blocks()
    points = model.points(*(block.symbol for block in blocks), vertices=seen)
    terms = [
        wb.residuals.vertices(points, noisy, sigma=0.005),
        wb.residuals.gaussian(blocks[1].symbol, name="betas"),
    ]
    fit = wb.solve(wb.Problem(terms, [block.name for block in blocks]), model.start())
    off[name] = np.linalg.norm(model.vertices(**fit.values) - whole, axis=1)
    iterations[name] = fit.iterations
    print(
        f"{name:11} {fit.status.name}, {fit.iterations} iterations; all vertices off by "
        f"{1e3 * off[name].mean():.1f} mm in the mean, {1e3 * off[name].max():.0f} mm at most"
    )

# %% slide [markdown]
# ## Fits to a third of the vertices
#
# | | iterations | off by |
# | --- | --- | --- |
# | SMPL, who made the data | {{ iterations['SMPL']}} | {{ 1e3 * off['SMPL'].mean():.1f}} mm |
# | BlendSCAPE | {{ iterations['BlendSCAPE']}} | {{ 1e3 * off['BlendSCAPE'].mean():.1f}} mm |
# | SCAPE | {{ iterations['SCAPE']}} | {{ 1e3 * off['SCAPE'].mean():.1f}} mm |
#
# - Without learned bends, $Q = I$

# %% [markdown]
# BlendSCAPE blends rotations over the triangles of a joint. On average it comes nearer
# ({{ 1e3 * off['BlendSCAPE'].mean():.1f}} mm) than SCAPE ({{ 1e3 * off['SCAPE'].mean():.1f}} mm), whose parts are
# rigid{{ off['SMPL'].mean() < off['BlendSCAPE'].mean() < off['SCAPE'].mean() }}. Both lack what SMPL has learned of
# bends, and both need more
# iterations{{ min(iterations['SCAPE'], iterations['BlendSCAPE']) > 2 * iterations['SMPL'] }}. Since SMPL made these
# data,
# they do not tell which model is nearer to people. The example `examples/14_three_body_models.py` fits the three to
# keypoints of a real person.
#
# ## Edges or vertices: what should a pose be found from?
#
# To learn a person's shape from registrations, we first need the pose of each of them, and we have to find it with
# the template of somebody else, because the person's own is not known yet. What should we compare, the vertices, or
# the edges as SCAPE does? SMPL's own training takes edges (Loper and others, [*SMPL: A Skinned Multi-Person Linear
# Model*](https://doi.org/10.1145/2816795.2818013), 2015). We ask 12 made-up people whose poses are known. Both fits
# have the same body with mean shape, the same start at rest, and the same solver with the same stopping rule. A fit to
# vertices also finds the translation, which edges do not have.

# %% slide [markdown]
# ## Edges or vertices: find a pose with somebody else's template
#
# - A person's shape is not known yet, when registrations are un-posed.
# - 12 made-up people whose poses are known; compare by vertices, or by edges.

# %%
blocks = body.blocks()
points = body.points(*(block.symbol for block in blocks))
mesh = wb.Block("mesh", (body.n_vertices, 3), "m")
by = {
    "edges": wb.Problem(
        [wb.residuals.edges(points, mesh.symbol, mesh_edges(faces), sigma=0.005)],
        ["pose"],
        blocks=[mesh],
    ),
    "vertices": wb.Problem(
        [wb.residuals.vertices(points, mesh.symbol, sigma=0.005)], ["pose", "trans"], blocks=[mesh]
    ),
}
solver = wb.LevenbergMarquardt(max_iterations=500)


def turned_wrongly(spread, noise, seed, compared, at_the_truth=False):
    """Mean error of the joints' rotations without the root's, in degrees, and how the fit ended."""
    rng = np.random.default_rng(seed)
    true = np.vstack([np.zeros(3), 0.3 * rng.standard_normal((23, 3))])  # rad
    person = body.vertices(true, spread * rng.standard_normal(body.n_betas))
    seen = person + noise * rng.standard_normal(person.shape)
    begin = {"mesh": seen} | ({"pose": true} if at_the_truth else {})
    fit = solver.solve(by[compared], body.start() | begin)
    away = matrix_from_vector(fit.values["pose"]) @ matrix_from_vector(true).swapaxes(1, 2)
    return np.degrees(np.linalg.norm(vector_from_matrix(away)[1:], axis=1).mean()), fit.status.name


cases = {  # standard deviations of shape, and of noise in m
    "another person, exact": (1.0, 0.0),
    "the same person, 5 mm of noise": (0.0, 0.005),
}
degrees, ends = {}, set()
for case, (spread, noise) in cases.items():
    for compared in by:
        fits = [turned_wrongly(spread, noise, seed, compared) for seed in range(12)]
        degrees[case, compared] = np.array([error for error, _ in fits])
        ends |= {end for _, end in fits}
        m = median(degrees[case, compared])
        print(
            f"{case:30} by {compared:8} median {m.value:4.1f} degrees, "
            f"between {m.low:.1f} and {m.high:.1f} ({100 * m.coverage:.0f} %)"
        )
print("how the fits ended:", *ends)
from_truth = np.array([turned_wrongly(1.0, 0.0, seed, "vertices", True)[0] for seed in range(12)])
print(f"by vertices, begun at the true pose: median {np.median(from_truth):.1f} degrees")

with house_style():
    figure, axes = sheet(9, 3.8, columns=2)
    for ax, case in zip(axes, cases, strict=True):
        pair = np.array([degrees[case, compared] for compared in by])
        ax.plot([0, 1], pair, "o-", color="0.6", ms=4, lw=0.8)
        ax.plot([0, 1], np.median(pair, axis=1), "D", ms=8)
        ax.set(title=case, xticks=[0, 1], xticklabels=by, xlim=(-0.4, 1.4), ylim=(0, None))
        ax.set(xlabel="pose found by", ylabel="error of a joint (degrees)")
Picture(
    figure,
    "Errors of poses that were found by edges and by vertices. Each line is one of 12 made-up people, "
    "and a diamond is the median. With another person's template edges are better for everybody; with "
    "the right template and noise, vertices are.",
)

# %% slide [markdown]
# ## Another template: edges. Right template, noise: vertices
#
# - Another person's: {{ np.median(degrees['another person, exact', 'edges']):.1f}} degrees by edges,
#   {{ np.median(degrees['another person, exact', 'vertices']):.0f}} by vertices. The right one:
#   {{ np.median(degrees['the same person, 5 mm of noise', 'edges']):.1f}} and
#   {{ np.median(degrees['the same person, 5 mm of noise', 'vertices']):.1f}}

# %% [markdown]
# With another person's template the median error is {{ np.median(degrees['another person, exact', 'edges']):.1f}}
# degrees by edges and {{ np.median(degrees['another person, exact', 'vertices']):.0f}} degrees by vertices; the
# intervals above, which hold the median with a confidence of {{ 100 * m.coverage:.0f}} %, lie far
# apart{{ ends == {'CONVERGED'} and (degrees['another person, exact', 'edges'] < degrees['another person, exact', 'vertices']).all() }}.
# This is not a
# matter of the start: fits to vertices that begin at the true pose leave it and end at {{ np.median(from_truth):.0f}}
# degrees too. If the
# template's upper arm is too long, every vertex below the elbow is in the wrong place, and other joints bend to
# make up for it. The edges below the elbow, however, keep nearly the right directions, so that the error stays in
# the upper arm.

# %% slide [markdown]
# ## Why
#
# - An upper arm that is too long puts all vertices below it in the wrong place: other joints bend to make up
#   for it.
# - Edges below the elbow keep their directions: the error stays in the upper arm.
# - An edge carries the noise of two vertices over a short length.

# %% [markdown]
# Edges have a disadvantage too. Each is a difference of two vertices, so it carries the noise of
# both over a short length. With the right template and noise,
# vertices give {{ np.median(degrees['the same person, 5 mm of noise', 'vertices']):.1f}} degrees and edges
# {{ np.median(degrees['the same person, 5 mm of noise', 'edges']):.1f}}{{ (degrees['the same person, 5 mm of noise', 'vertices'] < degrees['the same person, 5 mm of noise', 'edges']).all() }}.
# These people and poses are synthetic, so the numbers
# say what happens with this body, and not how large the errors are for people who were scanned.
#
# ## Side by side
#
# The table below compares the two ways. We show one of its rows by numbers first. An edge is a difference of two
# vertices, so an offset cancels in it. That is why SCAPE's matrices need no fourth column, and SMPL's, which move
# vertices, do:

# %%
G = body.kinematics.motion(pose, np.zeros(body.n_betas)).G  # (24, 3, 4): the row 0 0 0 1 left out
hand = G[body.joint_names.index("left_wrist")]
corners = template[faces[100]]
edge = corners[2] - corners[0]
with_offset = corners @ hand[:, :3].T + hand[:, 3]
print(f"the offset in the matrix of the hand is {1e3 * np.linalg.norm(hand[:, 3]):.0f} mm long")
print(
    f"edges with the offset and without it differ by "
    f"{1e3 * np.linalg.norm(with_offset[2] - with_offset[0] - hand[:, :3] @ edge):.0e} mm"
)

# %% slide [markdown]
# ## An offset cancels in an edge
#
# - SCAPE's matrices need no fourth column: $3 \times 3$, they turn and stretch.
# - SMPL's move vertices: $4 \times 4$, they turn and shift, by {{ 1e3 * np.linalg.norm(hand[:, 3]):.0f}} mm
#   for the hand here.

# %% [markdown]
# | | SMPL | SCAPE, BlendSCAPE |
# | --- | --- | --- |
# | what moves | vertices | triangles, then stitched |
# | a matrix of the pose | $4 \times 4$: it turns and shifts | $3 \times 3$: it turns and stretches |
# | it is applied to | vertices | edges |
# | shape and pose | added at rest | multiplied |
# | joints | a chain; regressed from the rest surface | none: parts have rotations, and edges add up |
# | work to pose the body | matrix products | the same, and a sparse solve |
# | bones keep their length | by construction | nearly |
# | runs in game engines | as it is | no |
#
# And for a pose that is found in a mesh:
#
# | | vertices | edges |
# | --- | --- | --- |
# | unknowns beside the pose | the translation | none |
# | a bone of wrong length | other joints bend to make up for it | the error stays in that bone |
# | error of the pose, another person's template | {{ np.median(degrees['another person, exact', 'vertices']):.0f}} degrees | {{ np.median(degrees['another person, exact', 'edges']):.1f}} degrees |
# | error of the pose, the right template and 5 mm of noise | {{ np.median(degrees['the same person, 5 mm of noise', 'vertices']):.1f}} degrees | {{ np.median(degrees['the same person, 5 mm of noise', 'edges']):.1f}} degrees |
#
# ## What to remember
#
# - Two edges do not determine a triangle's deformation; a third axis is needed.
# - Stitching is linear least squares with one sparse matrix. It sees edges only, and not where the body is.
# - Blended rotations shrink volumes by $\cos^2(\alpha/2)$, with triangles as with vertices.
# - With the template of somebody else, find a pose by edges: a fit to vertices bends joints to make up for
#   bones of wrong length.
# - SMPL adds shape and pose, and SCAPE multiplies them. Of the variance of vertices, principal components of
#   vertices never explain less than any other directions.

# %% slide [markdown]
# ## Side by side
#
# | | SMPL | SCAPE, BlendSCAPE |
# | --- | --- | --- |
# | what moves | vertices | triangles, then stitched |
# | shape and pose | added at rest | multiplied |
# | joints | a chain | none: edges add up |
# | bones keep their length | by construction | nearly |
# | to pose a body | matrix products | and a sparse solve |

# %% slide [markdown]
# ## What to remember
#
# - Two edges do not determine a deformation: add an axis. Stitching is linear, and sees edges only.
# - Blended rotations shrink volumes by $\cos^2(\alpha/2)$.
# - With somebody else's template, find poses by edges.
