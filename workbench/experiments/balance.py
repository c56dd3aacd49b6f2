"""A real person balancing on a beam, seen by four cameras."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument, UnknownName, check_known, listed
from workbench.fitting.images import ByHeight, image_fit
from workbench.fitting.keypoints import keypoint_fit, landmark_set
from workbench.fitting.observations import Clip, Observations, clip_of, photograph
from workbench.fitting.setup import MANY, Setup, names
from workbench.fitting.videos import video_fit
from workbench.reading.arrays import Expected, any_reals, read_expected, reals, shipped, texts
from workbench.solvers import LevenbergMarquardt

NAMES = {  # of the file -> of the body's landmarks; neck and crown have none
    "Nose": "nose",
    **{
        f"{letter}{part}": f"{side}_{part.lower()}"
        for letter, side in (("L", "left"), ("R", "right"))
        for part in ("Eye", "Ear", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Heel")
    },
    **{
        f"{letter}{size}Toe": f"{side}_{size.lower()}_toe"
        for letter, side in (("L", "left"), ("R", "right"))
        for size in ("Big", "Small")
    },
}

PUBLISHED = {
    "camera": texts("C"),
    "K": reals("C", 3, 3),
    "R": reals("C", 3, 3),
    "T": reals("C", 3),
    "dist": reals("C", 4),
    "image_size": reals("C", 2),
    "keypoints": any_reals("frames", "C", "M", 3),
    "keypoint_names": texts("M"),
    "keypoints3d_dlt": any_reals("frames", "M", 3),
}
ADJUSTED = {"R": reals(4, 3, 3), "T": reals(4, 3)}
FRAME = 40  # the frame of the main experiment


def published() -> dict[str, NDArray[Any]]:
    """The arrays of `data/keypoints/balance.npz`; PROVENANCE.md beside it describes them."""
    return _shipped("balance.npz", PUBLISHED)


def calibrated() -> tuple[Array, Array]:
    """R (4, 3, 3) and T (4, 3) m of the cameras, adjusted on frames far from the fitted one."""
    data = _shipped("balance_cameras.npz", ADJUSTED)
    return data["R"], data["T"]


def _shipped(name: str, expected: Mapping[str, Expected]) -> dict[str, NDArray[Any]]:
    with shipped(f"keypoints/{name}", "file of the four cameras") as archive:
        return read_expected(archive, expected)


def observations(frame: int = FRAME) -> tuple[Observations, Array]:
    """The keypoints of one frame, and the file's own triangulation of them (M, 3) m.

    The four cameras are the adjusted ones. Raises UnknownName.
    """
    data = published()
    if not 0 <= frame < len(data["keypoints"]):
        raise UnknownName("frame", str(frame), hint=f"0 to {len(data['keypoints']) - 1}")
    landmarks = tuple(NAMES.get(str(name), str(name)) for name in data["keypoint_names"])
    R, T = calibrated()
    K, dist, size = data["K"], data["dist"], data["image_size"]
    photographs = tuple(
        photograph(
            str(name),
            size[i],
            data["keypoints"][frame, i],
            {"K": K[i], "R": R[i], "t": T[i], "distortion": dist[i]},
        )
        for i, name in enumerate(data["camera"])
    )
    triangulated = np.asarray(data["keypoints3d_dlt"][frame], dtype=float)
    return Observations(landmarks, photographs), triangulated


def balance(
    frame: int = FRAME,
    body: str = "default",
    held_out: Sequence[str] = (),
    sigma: float = 4.0,
    compared: Sequence[str] = MANY,
) -> Setup:
    """Fit pose, betas and trans of a body to the 2D keypoints; `sigma` is in px.

    Cameras in `held_out` are not used for the fit, only for the measures. Raises UnknownName for a
    frame or a camera that does not exist.
    """
    observed, reference, question = _case(frame, model := load_body(body), held_out)
    return keypoint_fit(
        observed,
        model,
        question,
        sigma=sigma,
        held_out=names(held_out),
        reference=reference,
        compared=names(compared),
    )


def balance_monocular(frame: int = FRAME, body: str = "default", camera: str = "cam01") -> Setup:
    """Fit one camera as `workbench fit` fits an image (`image_fit`); the other three are held out
    and show how far off the depth is. Raises UnknownName as `balance` does.
    """
    known = [p.name for p in observations(frame)[0].photographs]
    check_known("camera", camera, known)
    held_out = tuple(name for name in known if name != camera)
    observed, reference, question = _case(frame, model := load_body(body), held_out)
    return image_fit(
        observed,
        model,
        question,
        recipe=ByHeight(solver=LevenbergMarquardt()),
        held_out=held_out,
        reference=reference,
        compared=MANY,
    )


def _case(frame: int, body: Body, held_out: Sequence[str]) -> tuple[Observations, Array, str]:
    """The keypoints of a frame, their places (M, 3) m by the file, and what is asked of them."""
    observed, triangulated = observations(frame)
    known = [p.name for p in observed.photographs]
    for name in names(held_out):
        check_known("camera", name, known)
    places = dict(zip(observed.names, triangulated, strict=True))
    landmarks = body.landmark_names(landmark_set(body))
    reference = np.array([places.get(name, np.full(3, np.nan)) for name in landmarks])
    alone = f" of {listed(set(known) - set(names(held_out)))} alone" if held_out else ""
    return (
        observed,
        reference,
        f"A real person on a beam (frame {frame}) was seen by {len(known)} calibrated cameras. "
        f"Which pose, shape and place of the body explain the 2D keypoints{alone}, and what do "
        "the keypoints leave open?",
    )


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

    `sigma` is in px; without one it follows the person's size. How many independent frames these
    are worth is estimated from their errors (`video_fit`). Raises BadArgument if there are fewer
    than two frames, and UnknownName for a camera or a frame that does not exist.
    """
    count = len(published()["keypoints"])
    if step < 1 or not 0 <= first < last < count or last - first < step:
        raise BadArgument(
            f"a video is two frames or more of the frames 0 to {count - 1}, from first to last by "
            f"a step of 1 or more, not {first} to {last} by {step}"
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
