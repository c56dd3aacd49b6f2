# %% [markdown]
# # Fitting to points, landmarks and cameras
#
# **Which pose and shape explain what we saw?**
#
# We begin with all that one could wish for, every vertex seen and known by its number, and take it
# away piece by piece: a few landmarks, then four cameras, then one. At each step we ask what is still
# known. Lengths are in metres, angles in radians, images in pixels. The person is made up, so that the
# truth is known.

# %%
import numpy as np

import workbench as wb
from workbench.course import Picture, source
from workbench.geometry.camera import project, triangulate
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.plots import house_style, sheet

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
    """How far the skin of fitted values is from the true one, vertex by vertex, mm."""
    return 1e3 * np.linalg.norm(body.vertices(**{k: values[k] for k in truth}) - surface, axis=1)


# %% [markdown]
# ## Every vertex known
#
# We saw vertex $i$ of the model, $M_i(\theta, \beta) + t$, at $v_i$, with a noise of 5 mm. Its number
# $i$ is known: we have **correspondences**. The residual is the model minus what was seen, divided by
# sigma, and the unknowns are 72 numbers of the pose $\theta$, 10 of the shape $\beta$ and 3 of the
# place $t$.
#
# In the workbench a fit has four lines. A *block* is a named array with a symbol: the body has three
# (`pose`, `betas`, `trans`), and what was observed gets one of its own. A *residual* is made from
# symbols; a *problem* is some residuals and the names that are free. `solve` takes a start that has a
# value for each block.

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
        f"skin off by {rms:.2g} mm a coordinate"
    )
m, p = 3 * body.n_vertices, 72 + 10 + 3
print(f"5 mm times the root of {p} / {m}: {5 * np.sqrt(p / m):.2f} mm")

# %% [markdown]
# That is as good as it gets: about ten iterations, and the fit is *better* than its data. It has
# $m = 1107$ equations for $p = 85$ unknowns, and the fit can follow noise only in the 85 directions in
# which the model can move: of the noise's squared length $\sigma^2 m$, the share $p / m$ is left. So
# the error is $\sigma \sqrt{p/m}$, to first order.
#
# ## A few landmarks
#
# Nobody sees all vertices. Take the 24 joints, seen as well as the vertices were, and do the same:

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
for name, residuals in (("joints alone", [at_joints]), ("joints and priors", [at_joints, *priors])):
    problem = wb.Problem(residuals, ["pose", "betas", "trans"], blocks=[seen_joints])
    solution = wb.solve(problem, given)
    off = 1e3 * (body.joints(**solution.values) - given["seen_joints"])
    rank = problem.linearize(given | solution.values).rank
    print(
        f"{name:18} rank {rank} of 85: joints met to {np.sqrt(np.mean(off**2)):.1f} mm, skin off by "
        f"{distances(solution.values).mean():.0f} mm on average, "
        f"worst beta off by {np.abs(solution.values['betas'] - truth['betas']).max():.1f}"
    )

# %% [markdown]
# The joints alone are met to *less* than their noise, which is no good sign: there are 72 equations for
# 85 unknowns, and what is free follows the noise. Lecture 8 explained why: only 53 of the 85 directions
# are seen. The shape is free to explain noise as well, and one of its betas is off by 1.3 standard
# deviations.
#
# What we know besides the data can be said in the same language. Among people each beta is 0 on
# average, with a standard deviation of 1; the angles of this lecture are 0 on average, with a standard
# deviation of 0.25 rad. Those are residuals too: $\theta / 0.25$ and $\beta / 1$, called **priors**.
# `gaussian` makes them; it takes a variance, hence the squares. With them something is known of every
# direction, and the rank is full. The worst beta is now off by half a standard deviation. The skin is
# hardly closer, 18 mm in place of 19 mm: nearly half of that comes from turns of bones that no joint
# depends on (lecture 8), and of these the prior says only that they are probably small. Lecture 10 is
# about priors.
#
# ## A camera
#
# A camera does not see metres. A point $x$ of the world goes to the camera's frame, $X = R x + t$ (to
# the right, down, forward), and then to pixels by dividing by its depth:
#
# $$ u = f \frac{X}{Z} + c_x, \qquad v = f \frac{Y}{Z} + c_y . $$
#
# Note that $t$ is not where the camera stands; it is where the world's origin is, seen from the camera.
# The library's line has lens distortion in it as well, which is zero here:

# %%
source(project)

# %%
F, DISTANCE, PIXELS = 1000.0, 4.0, 2.0  # px, m, px of noise
K = np.array([[F, 0, 500], [0, F, 500], [0, 0, 1]])


def camera_at(i, angle):
    """Camera i at a distance of 4 m, `angle` around the body from its front; and its numbers."""
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
    """The problem of some of the cameras, with priors, and the cameras' numbers."""
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
# `keypoints` is the residual: model minus observation in pixels, divided by sigma and multiplied by the
# root of the weight that the detector's confidence gives (here 1). One camera, from the front, and the
# same start as before:

# %%
one, numbers = by_cameras([0])
ends = {}
for name, angle in (("facing the camera", 0.0), ("facing away", np.pi)):
    turned = start["pose"].copy()
    turned[0] = [0, angle, 0]
    ends[name] = wb.solve(one, start | numbers | {"pose": turned})
    found = ends[name]
    missed = cameras[0][0].pixels(body.joints(**found.values), numbers) - views[0]
    angles = np.linalg.norm(found.values["pose"][1:], axis=1)
    print(
        f"begun {name:18}: {found.status.name} after {found.iterations:2} iterations, cost "
        f"{found.cost:4.1f}: image missed by {np.sqrt(np.mean(missed**2)):.1f} px, "
        f"{body.joint_names[1 + np.argmax(angles)]} turned by {angles.max():.2f} rad"
    )

# %% [markdown]
# Both converged, and both meet the image as well as the detector is good. But the one that began on the
# wrong side had to twist itself to do so: it sits in another minimum, at ten times the cost. No solver
# can be blamed for going downhill. So a fit to one image needs a good start. If in doubt, try several,
# and keep the one that ends at the lowest cost.
#
# ## Where to begin: similar triangles
#
# How far away is the person? Something that is $H$ metres long across the line of sight and $h$ pixels
# long in the image is at the depth
#
# $$ Z = f\, \frac{H}{h} . $$
#
# SMPLify begins in this way, with the trunk: it divides the mean of $H$ of several bones by the mean of
# $h$. For a trunk across the line of sight that is exact. How good is it when the person leans towards
# the camera?

# %%
names = body.joint_names
trunk = [
    (names.index(side + "_shoulder"), names.index(side + "_hip")) for side in ("left", "right")
]
a, b = np.array(trunk).T
rest = body.joints()
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
        f"leaning by {lean:2} degrees, the guess over the truth: {said}; 1 / cos is "
        f"{1 / np.cos(np.radians(lean)):.2f}"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (name, guess), dash in zip(wide.items(), ("-", "--"), strict=True):
        ax.plot(np.degrees(leans), guess, dash, label=name)
    ax.plot(np.degrees(leans), 1 / np.cos(leans), "k.", ms=5, label="1 / cos")
    ax.set(xlabel="how far the trunk leans to the camera (degrees)", ylabel="guess over true depth")
    ax.legend()
Picture(
    figure,
    "The depth by similar triangles. A trunk that leans looks short, and what looks short is taken to "
    "be far away: too far by about 1 / cos, and by less if the camera is near.",
)

# %% [markdown]
# For a start it is good enough: 11 to 19 % too far at 30 degrees. For an answer it is not.
#
# ## What one camera does not know
#
# Now the fit that began on the right side. In the image it is perfect. From the side?

# %%
results = {}
for count in (1, 2, 4):
    problem, numbers = by_cameras(range(count))
    solution = wb.solve(problem, start | numbers)
    here = problem.linearize(start | numbers | solution.values)
    covariance = np.linalg.inv(here.normal)  # (J'J)^-1, the translation in its last three rows
    off = 1e3 * np.sqrt(np.mean((body.joints(**solution.values) - joints) ** 2, axis=0))
    results[count] = solution
    x, y, z = 1e3 * np.sqrt(np.diag(covariance)[-3:])
    print(
        f"{count} camera{'s' * (count > 1):1} joints off by {off[0]:3.0f}, {off[1]:3.0f}, "
        f"{off[2]:4.0f} mm across, up and in depth; sigma of the place {x:.0f}, {y:.0f}, {z:.0f} mm"
    )

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
    "Left: what camera 0 sees; the truth and the fits to one camera and to four lie on top of each"
    " other. Right: the same three from the side. One camera has the person elsewhere in depth and"
    " bent otherwise.",
)

# %% [markdown]
# The Jacobian alone says the same: with one camera the place is known to 8 mm across the image, and to
# 230 mm in depth. There is a reason that no data can overcome. Make a person larger and move them away
# in proportion, all about the camera's centre: $X / Z$ stays, and so does every pixel. With one camera,
# size and depth are one unknown, and only the prior of the shape tells them apart.

# %%
camera, numbers = cameras[0]
centre = np.array([0, 0, DISTANCE])
for share in (1.05, 1.5):
    larger = centre + share * (joints - centre)
    moved = np.abs(camera.pixels(larger, numbers) - camera.pixels(joints, numbers)).max()
    print(f"{share:.2f} times as large and as far: pixels move by {moved:.0e} px")

# %% [markdown]
# Two cameras that look along different lines tell them apart: joints that were off by 190 mm in depth
# are off by 6 mm.
#
# ## A start for several cameras
#
# With two cameras or more there is a closed form for the start. A pixel says $x Z = X$ and $y Z = Y$,
# linear equations for the point in the world: two for each camera, three unknowns. The singular vector
# of the smallest singular value solves them. That is **triangulation**:

# %%
source(triangulate)

# %%
numbers = {key: value for _, values in cameras for key, value in values.items()}
each = [camera for camera, _ in cameras]
points = triangulate(each, numbers, views, [np.ones(24)] * 4)
print(f"triangulated joints are off by {1e3 * np.sqrt(np.mean((points - joints) ** 2)):.1f} mm")
motion = procrustes(rest, points)
begun = np.sqrt(np.mean((motion(rest) - joints) ** 2))
print(f"the body at rest, moved onto them: off by {1e3 * begun:.0f} mm")

# %% [markdown]
# The second step is Procrustes' problem: the rigid motion that takes the joints at rest nearest to the
# triangulated ones. Subtract the mean from each set of joints, find the rotation nearest to
# $\sum_i y_i x_i^\top$ (lecture 2), and choose the translation that takes one mean to the other.

# %%
source(procrustes)

# %% [markdown]
# ## What to remember
#
# - With every vertex known the fit is better than its data: $\sigma \sqrt{p/m}$.
# - Landmarks leave directions open. Data that are met to less than their noise are a warning; priors
#   decide what is open, and pull on the rest.
# - One camera: begin with $Z = f H / h$, try both sides, keep the cheaper. Size and depth remain one
#   unknown.
# - Two cameras know depth, and triangulation gives the start in closed form.
