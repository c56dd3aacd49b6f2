"""The real person on the beam as a video: many frames of one or several of the four cameras."""

from collections.abc import Sequence

from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument, check_known
from workbench.experiments.balance import observations, published
from workbench.fitting.observations import Clip, Observations, clip_of
from workbench.fitting.setup import Setup, names
from workbench.fitting.videos import video_fit

FPS = 60.0


def balance_clip(frames: Sequence[int], cameras: Sequence[str], fps: float = FPS) -> Clip:
    """The keypoints of some frames in some cameras. Raises UnknownName."""
    chosen = []
    for frame in frames:
        whole = observations(frame)[0]
        by_name = {photo.name: photo for photo in whole.photographs}
        for name in cameras:
            check_known("camera", name, by_name)
        chosen.append(Observations(whole.names, tuple(by_name[name] for name in cameras)))
    return clip_of(chosen, fps)


def balance_video(
    body: str = "default",
    cameras: Sequence[str] = ("cam01",),
    first: int = 40,
    last: int = 60,
    step: int = 5,
    sigma: float | None = None,
) -> Setup:
    """Fit one shape and the poses of frames `first` to `last`, of which each `step`-th is taken.

    `sigma` is in px; without one it follows the person's size (`video_fit`). Frames are told how
    much they are worth together by their own errors. Raises BadArgument if there are fewer than two
    frames, and UnknownName for a camera or a frame that does not exist.
    """
    all_ = len(published()["keypoints"])
    if step < 1 or not 0 <= first < last < all_ or last - first < step:
        raise BadArgument(
            f"a video is two frames or more of the frames 0 to {all_ - 1}, from first to last by a "
            f"step of 1 or more, not {first} to {last} by {step}"
        )
    frames, seen = range(first, last + 1, step), names(cameras)
    return video_fit(
        balance_clip(frames, seen, FPS / step),
        load_body(body),
        f"A real person on a beam was filmed by {' and '.join(seen)} in {len(frames)} frames. "
        "Which shape and which motion explain the 2D keypoints, and what are the frames worth "
        "together?",
        sigma=sigma,
    )
