"""A video: forty frames of one person, each for itself, and all of them as one problem.

A person swings both arms and walks past two cameras, whose detector misses a tenth of the joints,
and all of them in a few frames of each camera. Frame by frame, every frame has a shape of its own,
and no more to go by than what it shows. As a sequence, one shape serves all frames, and pose and
place change smoothly, so that gaps are filled by what comes before and after.
Everything is made up: body, motion, cameras, and 3 px of noise.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.geometry.rotation import matrix_from_vector

FRAMES, SIGMA, MISSED = 40, 3.0, 0.1  # px; the share of joints that the detector misses
HIDDEN = {"front": range(10, 14), "side": range(12, 18)}  # frames in which a camera sees nothing
rng = np.random.default_rng(12)
body = wb.load_body("small")

# The motion: arms down, then both swing, and so do the legs.

times = np.arange(FRAMES) / 30  # s
swing = np.sin(2 * np.pi * times)[:, None]
shoulders, hips = [16, 17], [1, 2]
poses = np.repeat(0.1 * rng.standard_normal((1, 24, 3)), FRAMES, axis=0)
poses[:, shoulders, 2] += [-0.9, 0.9]
poses[:, shoulders, 0] += 0.5 * swing * [1, -1]
poses[:, hips, 0] += 0.4 * swing * [-1, 1]
shape = rng.standard_normal(body.n_betas)
places = np.outer(times - times.mean(), [0.0, 0.0, 0.8])  # m
joints = np.array([body.joints(p, shape, t) for p, t in zip(poses, places, strict=True)])

# One frame, as in 05_one_camera.py.

pose, betas, trans = (block.symbol for block in body.blocks())
points = body.joint_points(pose, betas, trans)
K = np.array([[1000.0, 0, 500], [0, 1000.0, 500], [0, 0, 1]])  # px
UPRIGHT = np.diag([1.0, -1.0, -1.0])  # y is up in the world and down in an image
terms, cameras, values = [], [], {}
for name, angle in {"front": 0.0, "side": np.pi / 2}.items():
    camera = wb.Camera(f"{name}/")
    R = UPRIGHT @ matrix_from_vector([0, -angle, 0])
    numbers = camera.values(K=K, R=R, t=[0, 0, 4])
    pixels = np.array([camera.pixels(one, numbers) for one in joints])
    sure = (rng.random((FRAMES, 24)) > MISSED).astype(float)
    sure[HIDDEN[name]] = 0.0
    observed = wb.Block(f"{name}/observed", (24, 2), "px", body.joint_names)
    seen = wb.Block(f"{name}/seen", (24,), "1", body.joint_names)
    terms.append(
        wb.residuals.keypoints(points, camera, observed.symbol, seen.symbol, sigma=SIGMA, name=name)
    )
    values |= numbers | {seen.name: sure}
    values[observed.name] = pixels + SIGMA * rng.standard_normal(pixels.shape)
    cameras += [block.name for block in camera.blocks]
standing = np.zeros((24, 3))
standing[shoulders, 2] = [-0.9, 0.9]
prior = wb.residuals.gaussian(pose, mean=standing, covariance=0.4**2, unit="rad", name="pose prior")
of_shape = wb.residuals.gaussian(betas, name="shape prior")
frame = wb.Problem([*terms, prior, of_shape], free=["trans", "pose", "betas"])
start = body.start() | {"pose": standing}

# Each for itself.

framed = [name for name in values if name not in cameras]
alone = []
for t in range(FRAMES):
    of_frame = values | {name: values[name][t] for name in framed}
    alone.append(wb.solve(frame, start | of_frame).values)

# All of them as one problem.

video = wb.sequence(
    [frame] * FRAMES,
    shared=("betas", *cameras),
    between=[
        wb.residuals.smooth("pose", sigma=0.03, order=2),  # rad
        wb.residuals.smooth("trans", sigma=0.003, order=2),  # m
    ],
)
begin = {name: np.repeat(start[name][None], FRAMES, axis=0) for name in ("pose", "trans")}
together = wb.solve(video, values | {"betas": start["betas"]} | begin)


def off(found: list[np.ndarray]) -> np.ndarray:
    """The mean distance of the joints of every frame from where they were, (T,) mm."""
    return 1e3 * np.linalg.norm(np.array(found) - joints, axis=2).mean(axis=1)


errors = {
    "frame by frame": off([body.joints(v["pose"], v["betas"], v["trans"]) for v in alone]),
    "as a sequence": off(
        [
            body.joints(p, together.values["betas"], t)
            for p, t in zip(together.values["pose"], together.values["trans"], strict=True)
        ]
    ),
}
shapes = {
    "frame by frame": np.array([v["betas"] for v in alone]) - shape,
    "as a sequence": together.values["betas"][None] - shape,
}
hidden = sorted(set(HIDDEN["front"]) | set(HIDDEN["side"]))

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    for name, error in errors.items():
        shown = np.delete(error, hidden)
        print(
            f"{name}: joints off by {shown.mean():.1f} mm in the mean, {error[hidden].mean():.0f} "
            f"mm where a camera sees nothing; betas by {np.sqrt(np.mean(shapes[name] ** 2)):.2f}"
        )
    print(
        f"{video.free.size:,} unknowns, {together.trace[-1].linear_algebra}, "
        f"{len(together.trace) - 1} iterations"
    )
    with house_style():
        figure, (ax,) = sheet(7, 3.8)
        ax.axvspan(hidden[0] - 0.5, hidden[-1] + 0.5, color="0.92", label="a camera sees nothing")
        for name, error in errors.items():
            ax.plot(error, "o-", ms=3, label=name)
        ax.set(xlabel="frame", ylabel="joints off by, mean (mm)", yscale="log")
        ax.legend()
    Path(__file__).with_name("a_video.png").write_bytes(png(figure))
    print("One shape and a smooth motion nearly halve the error; gaps are filled from both sides.")
