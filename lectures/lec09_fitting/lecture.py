# %% [markdown]
# # Fitting to points, landmarks and cameras
#
# **Which pose and shape explain what we saw?**
#
# We begin with the best data that one could wish for: every vertex is seen, and we know which vertex it
# is. Then we take information away, step by step. First only the joints are seen, and then only images of
# the joints in some cameras. At each step we ask what the data still determine. Lengths are in metres,
# angles in radians, and images in pixels. The person is synthetic, so that the truth is known.

# %%
import numpy as np

import workbench as wb
from workbench.course import Picture, source
from workbench.fitting.setup import View
from workbench.geometry.camera import project, triangulate
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.material.replays import recorded_bodies
from workbench.plots import house_style, sheet
from workbench.plots.body import Figurine, front, line_up

# %%
NOISE, POSE, BETAS = 0.005, 0.25, 1.0  # m, rad, 1: the sigmas of this lecture

body = wb.load_body("small")  # 369 vertices, 24 joints
rng = np.random.default_rng(1)
truth = {
    "pose": POSE * rng.standard_normal((24, 3)),
    "betas": BETAS * rng.standard_normal(body.n_betas),
    "trans": np.array([0.1, 0.2, 0.05]),
}
surface, joints = body.vertices(**truth), body.joints(**truth)


def distances(values):
    """How far each vertex of the fitted surface is from the true one, mm."""
    return 1e3 * np.linalg.norm(body.vertices(**{k: values[k] for k in truth}) - surface, axis=1)


# %% [markdown]
# ## Every vertex known
#
# Vertex $i$ of the model is at $M_i(\theta, \beta) + t$, and we saw it at $v_i$, with a noise of 5 mm. For
# each observed point we know the number $i$ of its vertex. Such pairs are called **correspondences**. The
# residual is the model minus the observation, $M_i(\theta, \beta) + t - v_i$, divided by the standard deviation
# $\sigma$ of the noise. The unknowns are 72 numbers of the pose $\theta$, 10 of the shape $\beta$ and 3 of the
# translation $t$.
#
# In the workbench a fit takes four steps. A *block* is a named array with a symbol: the body has three of them
# (`pose`, `betas`, `trans`), and the observations get a block of their own. A *residual* is made from these
# symbols. A *problem* consists of residuals and of the names of the blocks that are free, which means that they
# are unknown. Finally `solve` takes a start that has a value for each block, free or not.

# %% slide [markdown]
# ## Every vertex known: the best data of all
#
# $$ r_i = \frac{M_i(\theta, \beta) + t - v_i}{\sigma} $$
#
# - **Correspondences**: for each observed point, the number of its vertex
# - Unknown: 72 numbers of the pose, 10 of the shape, 3 of the place

# %%
pose, betas, trans = (block.symbol for block in body.blocks())
seen = wb.Block("seen", (body.n_vertices, 3), "m")
residual = wb.residuals.vertices(body.points(pose, betas, trans), seen.symbol, sigma=NOISE)
all_vertices = wb.Problem([residual], ["pose", "betas", "trans"], blocks=[seen])

start = body.start()  # the mean person at rest, at the origin
for noise in (0.0, NOISE):
    noisy = surface + noise * rng.standard_normal(surface.shape)
    solution = wb.solve(all_vertices, start | {"seen": noisy})
    rms = np.sqrt(np.mean(distances(solution.values) ** 2) / 3)
    print(
        f"noise {1e3 * noise:.0f} mm: {solution.status.name} after {solution.iterations} iterations, "
        f"surface off by {rms:.2g} mm per coordinate"
    )
m, p = 3 * body.n_vertices, 72 + 10 + 3
print(f"5 mm times the root of {p} / {m}: {5 * np.sqrt(p / m):.2f} mm")

# %% slide [markdown]
# ## Four steps of every fit
#
# ```python
# seen = wb.Block("seen", (body.n_vertices, 3), "m")
# residual = wb.residuals.vertices(body.points(pose, betas, trans), seen.symbol, sigma=NOISE)
# all_vertices = wb.Problem([residual], ["pose", "betas", "trans"], blocks=[seen])
# ...
# solution = wb.solve(all_vertices, start | {"seen": noisy})
# ```
#
# - A block is data or an unknown; a residual; a problem with what is free; a start, and solve.

# %% [markdown]
# This is as good as a fit can be: it takes {{ solution.iterations}} iterations, and the fit is *closer to the truth*
# ({{ rms:.1f}} mm) than its data{{ abs(rms / (5 * np.sqrt(p / m)) - 1) < 0.1 }}. Why closer? It has $m = {{ m}}$
# equations for $p = {{ p}}$ unknowns. The noise points in a random
# direction among $m$, and its expected squared length is $\sigma^2 m$, equally much in each direction. The fit can
# follow the noise only in the {{ p}} directions in which the model can move, so that $\sigma^2 p$ of the squared
# length remains in it. Divided by the $m$ coordinates, this is $\sigma^2 p / m$. So the error per coordinate is
# $\sigma \sqrt{p/m}$, to first order.

# %% slide [markdown]
# ## Closer to the truth than its data
#
# $$ \text{error per coordinate} \approx \sigma \sqrt{p / m} $$
#
# - Noise of 5 mm, error of {{ rms:.1f}} mm: $m$ = {{ m:,}} equations, $p$ = {{ p }} unknowns
# - The fit can follow the noise only in the $p$ directions in which the model can move.

# %% [markdown]
# ## Only the joints
#
# In practice nobody sees all vertices. So we take only the 24 joints, seen with the same noise, and do the same:

# %%
seen_joints = wb.Block("seen_joints", (24, 3), "m")
at_joints = wb.residuals.landmarks(
    body.joint_points(pose, betas, trans), seen_joints.symbol, sigma=NOISE
)
priors = [
    wb.residuals.gaussian(pose, covariance=POSE**2, unit="rad"),
    wb.residuals.gaussian(betas, covariance=BETAS**2),
]
given = start | {"seen_joints": joints + NOISE * rng.standard_normal((24, 3))}
fitted_to_joints, ranks, met, worst = {}, {}, {}, {}
for name, residuals in (("joints alone", [at_joints]), ("joints and priors", [at_joints, *priors])):
    problem = wb.Problem(residuals, ["pose", "betas", "trans"], blocks=[seen_joints])
    solution = wb.solve(problem, given)
    fitted_to_joints[name] = solution.values
    off = 1e3 * (body.joints(**solution.values) - given["seen_joints"])
    met[name] = np.sqrt(np.mean(off**2))  # mm
    ranks[name] = problem.linearize(given | solution.values).rank
    worst[name] = np.abs(solution.values["betas"] - truth["betas"]).max()
    print(
        f"{name:18} rank {ranks[name]} of 85: joints fitted to {met[name]:.1f} mm, surface off "
        f"by {distances(solution.values).mean():.0f} mm on average, worst beta off by {worst[name]:.1f}"
    )

# %% slide [markdown]
# ## Only the joints: {{ seen_joints.size }} equations for {{ p }} unknowns
#
# - Met to {{ met['joints alone']:.1f}} mm, with priors to {{ met['joints and priors']:.1f}} mm: this does not tell
#   the two fits apart.
# - Rank {{ ranks['joints alone']}} of {{ p }}: what is left open does.
# - One beta is off by {{ worst['joints alone']:.1f}} standard deviations.

# %% [markdown]
# Both fits meet the joints to less than their noise of 5 mm, to {{ met['joints alone']:.1f}} and
# {{ met['joints and priors']:.1f}} mm{{ max(met.values()) < 5 }}. This does not tell them apart: with
# {{ seen_joints.size}} equations for {{ p}} unknowns, what the data do determine follows the noise in both. They differ
# in what the data do not determine. As in lecture 8 these are some of the directions: without priors the rank is
# {{ ranks['joints alone']}} of {{ p}}. Others are determined so weakly that the noise decides, and one beta is off by
# {{ worst['joints alone']:.1f}} standard deviations.

# %% slide [markdown]
# ## What we know apart from the data: priors
#
# $$ \frac{\theta}{0.25 \text{ rad}}, \qquad \frac{\beta}{1} $$
#
# - Residuals like all others; the rank is {{ ranks['joints and priors']}}.
# - Worst beta: {{ worst['joints and priors']:.1f}} in place of {{ worst['joints alone']:.1f}} standard
#   deviations

# %% [markdown]
# What we know apart from the data can be written as residuals too. Among people each beta is 0 on average,
# with a standard deviation of 1; the angles of this lecture are 0 on average, with a standard deviation
# of 0.25 rad. This gives the residuals $\theta / 0.25$ and $\beta / 1$, which are called **priors**. The
# function `gaussian` makes them. (It takes a variance, so the code has the squares.) With priors, every
# direction is determined to some degree, and the rank is {{ ranks['joints and priors']}}. The worst beta is now off
# by {{ worst['joints and priors']:.1f}} standard deviations. The surface is hardly closer,
# {{ distances(fitted_to_joints['joints and priors']).mean():.0f}} mm in place of
# {{ distances(fitted_to_joints['joints alone']).mean():.0f}} mm: much of this error comes from turns of bones that
# move no joint (lecture 8), and of these the prior says only that they are
# probably small. Lecture 10 is about priors.

# %%
shown, coloured = [("truth", truth)], [np.full((len(body.faces), 3), 0.87)]
for name, values in fitted_to_joints.items():
    shown.append((name, {key: values[key] for key in truth}))
    share = np.minimum(distances(values)[body.faces].mean(axis=1) / 40, 1)[:, None]  # full at 40 mm
    coloured.append(0.87 + share * (np.array([0.75, 0.1, 0.1]) - 0.87))
with house_style():
    figure, (ax,) = sheet(9, 4.4)
    line_up(
        [
            Figurine(name, body.vertices(**values), front, colours)
            for (name, values), colours in zip(shown, coloured, strict=True)
        ],
        body.faces,
        ax=ax,
    )
Picture(
    figure,
    "The true person, and the fits to the joints without and with priors. Grey faces are where they ought to be; "
    "full red ones are 40 mm away or more.",
)

# %% slide [markdown]
# ## The shape is saved, the skin hardly
#
# - Surface off by {{ distances(fitted_to_joints['joints alone']).mean():.0f}} mm, with priors by
#   {{ distances(fitted_to_joints['joints and priors']).mean():.0f}}
# - Most of it: turns of bones that move no joint

# %% [markdown]
#
# ## A camera
#
# A camera measures pixels and not metres. How does a point $x$ in the world get its pixel? First we write it in
# the coordinates of the camera, $R x + t = (X, Y, Z)$, which point to the right, down and forward. A pinhole
# camera sees only the direction of the point, so we divide by the depth $Z$. Finally the focal length $f$ turns
# this into pixels, which are counted from the corner of the image. With $(c_x, c_y)$ the centre of the image:
#
# $$ u = f \frac{X}{Z} + c_x, \qquad v = f \frac{Y}{Z} + c_y . $$
#
# (Note that $t$ is not the place at which the camera stands. It is the world's origin in the coordinates of the
# camera.) The library's function has the same two divisions. It also bends the image as real lenses do, with five
# coefficients that are zero here:

# %% slide [markdown]
# ## A camera divides by depth
#
# $$ R x + t = (X, Y, Z), \qquad u = f \frac{X}{Z} + c_x, \qquad v = f \frac{Y}{Z} + c_y $$
#
# - It measures pixels, and sees directions only.
# - $t$ is not where the camera stands: it is the world's origin, seen from the camera.

# %%
source(project)

# %%
F, DISTANCE, PIXELS = 1000.0, 4.0, 2.0  # focal length px, distance m, noise px
K = np.array([[F, 0, 500], [0, F, 500], [0, 0, 1]])


def camera_at(i, angle):
    """Camera i and its numbers: 4 m from the body, turned around it by `angle` from the front."""
    forward = -np.array([np.sin(angle), 0, np.cos(angle)])
    right = np.cross(forward, [0.0, 1.0, 0.0])
    R = np.array([right, np.cross(forward, right), forward])
    camera = wb.Camera(f"camera {i}/")
    return camera, camera.values(K=K, R=R, t=R @ forward * DISTANCE)


cameras = [camera_at(i, angle) for i, angle in enumerate(np.pi / 2 * np.arange(4))]
views = [
    camera.pixels(joints, numbers) + PIXELS * rng.standard_normal((24, 2))
    for camera, numbers in cameras
]


def by_cameras(which):
    """The problem for some of the cameras, with priors, and the numbers of these cameras."""
    points, residuals, blocks, numbers = body.joint_points(pose, betas, trans), list(priors), [], {}
    for i in which:
        camera, values = cameras[i]
        residuals.append(
            wb.residuals.keypoints(
                points, camera, views[i], np.ones(24), sigma=PIXELS, name=f"view {i}"
            )
        )
        blocks += camera.blocks
        numbers |= values
    return wb.Problem(residuals, ["pose", "betas", "trans"], blocks=blocks), numbers


# %% [markdown]
# Images of joints are called **keypoints**. Their residual is the model minus the observation in pixels, divided
# by $\sigma$. A detector also says how confident it is of each keypoint. With a confidence $c$ the residual is
# divided by $\sigma / c$, so that doubtful keypoints count less; here $c = 1$. We take only the camera in front of
# the person and fit twice: once from the same start as before, and once from a start that faces away from the
# camera:

# %% slide [markdown]
# ## Keypoints: residuals in pixels
#
# $$ r = c\; \frac{\text{model} - \text{observation}}{\sigma} $$
#
# - $c$: the detector's confidence; doubtful keypoints count less.
# - One camera, two starts: facing it, and facing away

# %%
one, numbers = by_cameras([0])
ends, image_off = {}, {}
for name, angle in (("facing the camera", 0.0), ("facing away", np.pi)):
    turned = start["pose"].copy()
    turned[0] = [0, angle, 0]
    ends[name] = wb.solve(one, start | numbers | {"pose": turned})
    found = ends[name]
    missed = cameras[0][0].pixels(body.joints(**found.values), numbers) - views[0]
    image_off[name] = np.sqrt(np.mean(missed**2))  # px
    angles = np.linalg.norm(found.values["pose"][1:], axis=1)
    print(
        f"begun {name:18}: {found.status.name} after {found.iterations:2} iterations, cost "
        f"{found.cost:4.1f}: image off by {image_off[name]:.1f} px, "
        f"{body.joint_names[1 + np.argmax(angles)]} turned by {angles.max():.2f} rad"
    )


def facing(joint):
    """How far a joint's front faces the camera in the fit that began facing away, -1 to 1."""
    values = ends["facing away"].values
    G = body.kinematics.motion(values["pose"], values["betas"]).G
    return G[body.joint_names.index(joint)][2, 2]


# %% slide [markdown]
# ## Both fits converge, and both meet the image
#
# - Image off by {{ image_off["facing the camera"]:.1f}} and {{ image_off["facing away"]:.1f}} px; the
#   detector's noise is 2 px.
# - Costs: {{ ends["facing the camera"].cost:.1f}} and {{ ends["facing away"].cost:.1f}}

# %% [markdown]
# Both fits converged, and both reproduce the image to within the noise of the
# detector{{ max(image_off.values()) < PIXELS }}. How do they look?

# %%
with house_style():
    figure, (ax,) = sheet(9, 4.4)
    line_up(
        [
            Figurine(name, body.vertices(**{key: values[key] for key in truth}), front)
            for name, values in {
                "truth": truth,
                "begun facing the camera": ends["facing the camera"].values,
                "begun facing away": ends["facing away"].values,
            }.items()
        ],
        body.faces,
        ax=ax,
    )
Picture(
    figure,
    "The true person and both fits, seen from the camera. In the image the joints of all three agree. The fit that "
    "began facing away has turned its trunk towards the camera, but its lower legs still face away from it.",
)

# %% slide [markdown]
# ## The same image from two bodies
#
# - Begun facing away, hips, knees and ankles are twisted: another minimum,
#   {{ ends['facing away'].cost / ends['facing the camera'].cost:.1f}} times the cost

# %% [markdown]
# The fit that began facing away had to twist the body: hips, knees and ankles are turned so that the legs meet a
# trunk that faces the other way. It ended in another minimum, at
# {{ ends['facing away'].cost / ends['facing the camera'].cost:.1f}} times the
# cost{{ facing('spine3') > 0.9 and max(facing('left_knee'), facing('right_knee')) < 0 }}. This is no error of
# the solver, which only goes downhill. A fit to one image needs a good start. If we do not know which way the
# person faces, we try several starts, and keep the fit with the lowest cost.

# %% slide [markdown]
# ## A fit to one image needs a good start
#
# - The solver only goes downhill: this is no error of the solver.
# - Unknown which way the person faces? Try both, keep the lower cost.

# %% [markdown]
# ## Where to begin: similar triangles
#
# A good start also needs the distance of the person. Suppose that something is $H$ metres long, lies across the
# line of sight at the depth $Z$, and appears $h$ pixels long in the image. By the equations of the camera both of
# its ends are divided by the same $Z$, so that $h = f H / Z$, and hence
#
# $$ Z = f\, \frac{H}{h} . $$
#
# SMPLify (Bogo and others, [*Keep It SMPL: Automatic Estimation of 3D Human Pose and Shape from a Single
# Image*](https://doi.org/10.1007/978-3-319-46454-1_34), 2016) finds its start in this way, from the trunk. It takes the
# mean length $H$ of two distances, from the shoulder to the hip on each side, and the mean of their $h$. For a trunk
# across the line of sight this is exact. How good is it when the person leans towards the camera?

# %% slide [markdown]
# ## Where to begin: similar triangles
#
# $$ Z = f\, \frac{H}{h} $$
#
# - Something $H$ m long, across the line of sight, looks $h$ px long.
# - SMPLify takes the trunk: shoulders to hips, both sides.

# %%
names = body.joint_names
trunk = [
    (names.index(side + "_shoulder"), names.index(side + "_hip")) for side in ("left", "right")
]
a, b = np.array(trunk).T
rest = body.joints()
_, up, forward = (rest[a] - rest[b]).mean(axis=0)  # from the hips to the shoulders, m
ahead = np.degrees(np.arctan2(forward, up))
leans = np.radians(np.arange(0, 76, 5))
wide = {}
for f_and_distance in ((F, DISTANCE), (20 * F, 20 * DISTANCE)):
    f, away = f_and_distance
    guesses = []
    for lean in leans:
        place = rest @ matrix_from_vector([lean, 0, 0]).T  # about the pelvis
        x = place @ np.diag([1.0, -1.0, -1.0]) + [0, 0, away]  # in the camera's frame
        image = f * x[:, :2] / x[:, 2:]
        H = np.linalg.norm(rest[a] - rest[b], axis=1).mean()
        h = np.linalg.norm(image[a] - image[b], axis=1).mean()
        guesses.append(f * H / h / away)
    wide[f"from {away:.0f} m"] = np.array(guesses)
for lean in (0, 30, 60):
    k = lean // 5
    said = ", ".join(f"{name} {guess[k]:.2f}" for name, guess in wide.items())
    print(
        f"leaning by {lean:2} degrees, estimated depth over true depth: {said}; 1 / cos is "
        f"{1 / np.cos(np.radians(lean)):.2f}"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (name, guess), dash in zip(wide.items(), ("-", "--"), strict=True):
        ax.plot(np.degrees(leans), guess, dash, label=name)
    ax.plot(np.degrees(leans), 1 / np.cos(leans), "k.", ms=5, label="1 / cos")
    ax.set(
        xlabel="lean of the trunk towards the camera (degrees)", ylabel="estimated over true depth"
    )
    ax.legend()
Picture(
    figure,
    "The depth that similar triangles give. A trunk that leans towards the camera looks short, so it "
    "is taken to be further away than it is: by a factor of about 1 / cos, and by less if the camera "
    "is near.",
)

# %% slide [markdown]
# ## A trunk that leans looks far away
#
# - At 30 degrees {{ 100 * (wide['from 4 m'][6] - 1):.0f}} to {{ 100 * (wide['from 80 m'][6] - 1):.0f}} % too
#   far: good for a start, not for an answer

# %% [markdown]
# At 30 degrees the depth is {{ 100 * (wide['from 4 m'][6] - 1):.0f}} to {{ 100 * (wide['from 80 m'][6] - 1):.0f}} %
# too large{{ (wide['from 4 m'][1:] < wide['from 80 m'][1:]).all() }}. This is good enough for a start, but it is not
# good enough for
# an answer. (The factors are larger than $1 / \cos$ of the lean, because this body's shoulders are in front of its hips
# already at rest, by {{ ahead:.1f}} degrees{{ 3 < ahead < 4 }}.)
#
# ## What one camera does not determine
#
# Now we look again at the fit that began facing the camera. In the image it agrees with the data to within the
# noise. How does it look from the side? We compare it with fits to two and to four cameras, which stand around
# the person:

# %% slide [markdown]
# ## And from the side?
#
# - In the image the fit to one camera agrees with the data, to the noise.
# - Compare one, two and four cameras around the person.

# %%
results, off_by, spread = {}, {}, {}
for count in (1, 2, 4):
    problem, numbers = by_cameras(range(count))
    solution = wb.solve(problem, start | numbers)
    here = problem.linearize(start | numbers | solution.values)
    covariance = np.linalg.inv(here.normal)  # (J'J)^-1, the translation in its last three rows
    off = off_by[count] = 1e3 * np.sqrt(
        np.mean((body.joints(**solution.values) - joints) ** 2, axis=0)
    )
    results[count] = solution
    x, y, z = spread[count] = 1e3 * np.sqrt(np.diag(covariance)[-3:])
    print(
        f"{count} camera{'s' * (count > 1):1} joints off by {off[0]:3.0f}, {off[1]:3.0f}, "
        f"{off[2]:4.0f} mm across, up and in depth; sigma of trans {x:.0f}, {y:.0f}, {z:.0f} mm"
    )

# %% slide [markdown]
# ## One camera does not see depth
#
# | cameras | off across | up | in depth |
# | --- | --- | --- | --- |
# | 1 | {{ off_by[1][0]:.0f}} mm | {{ off_by[1][1]:.0f}} mm | {{ off_by[1][2]:.0f}} mm |
# | 2 | {{ off_by[2][0]:.0f}} mm | {{ off_by[2][1]:.0f}} mm | {{ off_by[2][2]:.0f}} mm |
# | 4 | {{ off_by[4][0]:.0f}} mm | {{ off_by[4][1]:.0f}} mm | {{ off_by[4][2]:.0f}} mm |

# %%
fitted = {count: body.joints(**found.values) for count, found in results.items()}
drawn = (
    ("truth", joints, "0.6", "-", 4.0),
    ("one camera", fitted[1], "C1", "-", 1.5),
    ("four cameras", fitted[4], "C0", "--", 1.5),
)
with house_style():
    figure, (left, right) = sheet(9, 4.8, columns=2)
    camera, numbers = cameras[0]
    for name, where, colour, dash, width in drawn:
        image = camera.pixels(where, numbers)
        for k, up in enumerate(body.parents[1:], start=1):
            label = name if k == 1 else None
            left.plot(*image[[up, k]].T, dash, color=colour, lw=width, label=label)
            right.plot(where[[up, k], 2], where[[up, k], 1], dash, color=colour, lw=width)
    left.plot(*views[0].T, "k.", ms=4, label="seen")
    left.set(xlabel="u (px)", ylabel="v (px)", aspect="equal")
    left.invert_yaxis()
    left.legend(loc="lower left", fontsize=8)
    right.set(xlabel="z, towards camera 0 (m)", ylabel="y (m)", aspect="equal")
Picture(
    figure,
    "Left: what camera 0 sees; the truth and the fits to one camera and to four cameras lie on top of "
    "each other. Right: the same three from the side. The fit to one camera is at another depth, and "
    "its limbs are bent differently.",
    lambda: recorded_bodies(
        body,
        {"fits": {f"fit to {n} of 4": results[n].values for n in results} | {"truth": truth}},
        "Fits to one, two and four cameras, and the true person. Look through each camera at what it saw: the circles are "
        "what was seen, the crosses the joints of the body. The lines lead from joints to the rays "
        "of all four cameras, also of those that the fit did not use.",
        views=[
            View(f"camera {i}", camera, (1000, 1000), "joints", views[i], np.ones(24))
            for i, (camera, _) in enumerate(cameras)
        ],
        cameras={key: value for _, values in cameras for key, value in values.items()},
    ),
)

# %% slide still [markdown]
# ## Same image, another body
#
# - Left: three bodies on top of each other. Right: from the side, another depth and other bends

# %% slide [markdown]
# ## Look through each camera
#
# - Circles: what was seen. Lines: rays of all four cameras
# - The fit to one camera misses the rays of the others.

# %% [markdown]
# The Jacobian predicts this without knowing the truth: with one camera, the standard deviation of the translation is
# {{ spread[1][0]:.0f}} mm across the image, and {{ spread[1][2]:.0f}} mm in depth. Better data from one camera would
# not help much,
# for the following reason. Make a person larger, and move the person away from the camera by the same factor.
# Then $X$, $Y$ and $Z$ are all multiplied by it, so $X / Z$ stays the same, and so does every pixel. One camera
# sees only the ratio of size and depth. Only the prior on the shape tells the two apart.

# %% slide [markdown]
# ## The Jacobian knows, without the truth
#
# - One camera: translation known to {{ spread[1][0]:.0f}} mm across, {{ spread[1][2]:.0f}} mm in depth
# - Larger and further by the same factor: every pixel stays.{{ spread[1][2] > 5 * spread[1][0] }}
# - Only the prior on the shape tells the two apart.

# %%
camera, numbers = cameras[0]
centre = np.array([0, 0, DISTANCE])
for share in (1.05, 1.5):
    larger = centre + share * (joints - centre)
    moved = np.abs(camera.pixels(larger, numbers) - camera.pixels(joints, numbers)).max()
    print(f"{share:.2f} times as large and as far: pixels move by {moved:.0e} px")

# %% slide [markdown]
# ## 1.5 times as large and as far
#
# - Pixels move by nothing but rounding.{{ moved < 1e-10 }}
# - So better data from one camera would not help much.
# - Two cameras: off in depth by {{ off_by[2][2]:.0f}} mm in place of {{ off_by[1][2]:.0f}}

# %% [markdown]
# Two cameras that look in different directions can tell size and depth apart: the joints, which were off by
# {{ off_by[1][2]:.0f}} mm in depth, are now off by {{ off_by[2][2]:.0f}} mm{{ moved < 1e-10 }}.
#
# ## A start for several cameras
#
# With two cameras or more there is a closed form for the start. Let $(a, b) = (X / Z, Y / Z)$ be the
# position in the image in units of the focal length, from the image's centre. Then $X - a Z = 0$ and
# $Y - b Z = 0$. These equations are linear in the point $x$ of the world, because $(X, Y, Z) = R x + t$ is. Each
# camera gives two of them, and there are three unknowns.
#
# To treat $t$ like the rest, we append a one to the point,
# so that $(X, Y, Z) = P\, (x, 1)$ with the matrix $P = [R\;\, t]$ of four columns. All equations together say that
# a matrix with two rows for each camera, multiplied by $(x, 1)$, is zero. With noise it cannot be quite zero. The
# vector of length one for which it is smallest is the last column of $V$ in the singular value decomposition of
# that matrix, and dividing this vector by its fourth entry gives $(x, 1)$. This is **triangulation** (Hartley and
# Zisserman, [*Multiple View Geometry in Computer Vision*](https://doi.org/10.1017/CBO9780511811685), section 12.2):

# %% slide [markdown]
# ## A start for several cameras: triangulation
#
# $$ X - a Z = 0, \qquad Y - b Z = 0, \qquad (X, Y, Z) = P\, (x, 1) $$
#
# - Two equations for each camera, linear in the point; three unknowns
# - The last column of $V$ of their matrix, over its fourth entry

# %%
numbers = {key: value for _, values in cameras for key, value in values.items()}
each = [camera for camera, _ in cameras]
points = triangulate(each, numbers, views, [np.ones(24)] * 4)
print(f"triangulated joints are off by {1e3 * np.sqrt(np.mean((points - joints) ** 2)):.1f} mm")
motion = procrustes(rest, points)
begun = np.sqrt(np.mean((motion(rest) - joints) ** 2))
print(f"the body at rest, moved onto them: off by {1e3 * begun:.0f} mm")

# %% slide [markdown]
# ## Then one rigid motion: Procrustes
#
# - Triangulated joints are off by {{ 1e3 * np.sqrt(np.mean((points - joints) ** 2)):.0f}} mm.
# - The body at rest, moved onto them: {{ 1e3 * begun:.0f}} mm, and facing the right way
# - Subtract the means; then the rotation nearest to $\sum_i y_i x_i^\top = U S V^\top$, which is
#   $U \operatorname{diag}(1, 1, \det(U V^\top))\, V^\top$

# %% [markdown]
# The last line solves *Procrustes' problem*{{ np.sqrt(np.mean((points - joints) ** 2)) < begun < 0.1 }}: it finds the
# rigid motion $x \mapsto R x + t$ that brings the joints
# $x_i$ at rest as near as possible to the triangulated ones $y_i$, so that $\sum_i \| R x_i + t - y_i \|^2$ is
# least. Whatever $R$ is, the best $t$ takes the mean of the $x_i$ to the mean of the $y_i$. So we subtract the mean
# from each set of joints, and only $R$ is left. The square of $\| R x_i - y_i \|$ is
# $\|x_i\|^2 + \|y_i\|^2 - 2\, y_i^\top R\, x_i$, and only its last term depends on $R$.
#
# The sum of these terms is
# largest for the rotation that is nearest to the matrix $A = \sum_i y_i x_i^\top$, and lecture 2 has shown how to find
# that: with $A = U S V^\top$ it is $R = U \operatorname{diag}(1, 1, \det(U V^\top))\, V^\top$.
#
# ## What to remember
#
# - With every vertex known, the fit is closer to the truth than its data: the error is
#   $\sigma \sqrt{p/m}$ per coordinate.
# - A few landmarks leave some directions undetermined. How closely they are met does not show this; the rank does.
#   Priors decide what the data leave open, and also pull a little on the rest.
# - With one camera, begin at the depth $Z = f H / h$, try a body that faces the camera and one that
#   faces away, and keep the fit with the lower cost. Size and depth cannot be told apart without a
#   prior.
# - Two cameras determine depth, and triangulation gives the start in closed form.

# %% slide [markdown]
# ## What to remember
#
# - All vertices: closer to the truth than the data, $\sigma \sqrt{p/m}$.
# - A close fit does not show what the data leave open, the rank does; priors decide it.
# - One camera: begin at $Z = f H / h$, try both ways round; two cameras determine depth.
