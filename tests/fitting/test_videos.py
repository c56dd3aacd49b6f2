"""Videos: what frames share, what they are worth, gaps, and single frames as a special case."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import load_body
from workbench.errors import BadArgument
from workbench.experiments.balance import balance_clip
from workbench.fitting import (
    BadObservation,
    Clip,
    Film,
    Smoothness,
    effective_frames,
    video_fit,
    video_mean,
)
from workbench.fitting.videos import errors_of
from workbench.solvers import TrustRegion

BODY = load_body("default")


def gapped(clip: Clip, frames: list[int]) -> Clip:
    """The clip with nothing observed in some frames."""
    films = []
    for film in clip.films:
        sure = film.confidence.copy()
        sure[frames] = 0
        films.append(replace(film, confidence=sure))
    return replace(clip, films=tuple(films))


@pytest.mark.thorough
def test_video_shares_one_shape() -> None:
    setup = video_fit(balance_clip(range(0, 40, 5), ["cam02"], 12), BODY, "?")
    assert setup.start["betas"].shape == (BODY.n_betas,)
    n = 8 * setup.start["evidence"][0]
    assert 1 <= n < 6  # of 8 frames: errors are alike
    assert any(f"count as {n:.1f} independent" in note for note in setup.notes)
    found = {**setup.start, **TrustRegion().solve(setup.problem, setup.start).values}
    measures = {one.name: one.value for one in setup.measures(found)}
    assert measures["reprojection, cam02"] < 15
    assert 1500 < measures["height at rest"] < 1900
    assert measures["independent frames"] == pytest.approx(n)  # as the note says
    sizes = []
    for worth in (1 / 8, 1.0):  # more of them outweigh the prior on the shape
        start = setup.start | {"evidence": np.array([worth])}
        found = TrustRegion().solve(setup.problem, start).values
        sizes.append(np.linalg.norm(found["betas"]))
    assert sizes[0] < 0.8 * sizes[1]


def test_gaps_are_filled_by_smoothness() -> None:
    whole = balance_clip(range(40, 47), ["cam01"])
    setup = video_fit(gapped(whole, [3]), BODY, "?", smoothness=Smoothness(5, 2))
    assert any("In 1 of 7 frames no keypoint" in note for note in setup.notes)
    # an acceleration of 6 m/s^2 is three sigmas of 2 m/s^2, whatever the rate of frames
    thrown = 3.0 * (np.arange(7) / whole.fps)[:, None] ** 2 * np.array([0.0, 1.0, 0.0])
    r = setup.problem.residual(*setup.problem.split(setup.start | {"trans": thrown}))
    weight = float(setup.start["evidence"][0])
    expected = np.tile([0.0, 3.0 * np.sqrt(weight), 0.0], 5)
    np.testing.assert_allclose(r[setup.problem.rows["smooth place"]], expected, atol=1e-9)
    found = TrustRegion().solve(setup.problem, setup.start).values
    between = (found["trans"][2] + found["trans"][4]) / 2
    assert np.linalg.norm(found["trans"][3] - between) < 0.01
    errors, known = errors_of(setup.problem, {**setup.start, **found}, setup.moving.data)
    assert not known[3].any()
    assert not errors[3].any()
    assert known[2].any()


def test_focal_length_is_shared_by_frames() -> None:
    clip = balance_clip(range(40, 46, 2), ["cam01"])
    unknown = replace(clip, films=tuple(replace(film, K=None) for film in clip.films))
    setup = video_fit(unknown, BODY, "?")
    found = {**setup.start, **TrustRegion().solve(setup.problem, setup.start).values}
    assert found["cam01/focal"].shape == (2,)
    assert not np.allclose(found["cam01/focal"], setup.start["cam01/focal"])
    assert {one.name: one.value for one in setup.measures(found)}["reprojection, cam01"] < 20


def test_interrupt_ends_the_start_of_a_video() -> None:
    told: list[tuple[int, int]] = []

    def stop(done: int, all_: int) -> None:
        told.append((done, all_))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        video_fit(balance_clip(range(40, 44), ["cam01"]), BODY, "?", told=stop)
    assert told == [(1, 4), (2, 4)]


def test_bad_clips_are_refused() -> None:
    clip = balance_clip([40, 41], ["cam01"])
    (film,) = clip.films
    with pytest.raises(BadArgument, match="2 frames are worth 1 to 2"):
        video_fit(clip, BODY, "?", worth=3)
    shorter = replace(film, pixels=film.pixels[:1], confidence=film.confidence[:1])
    three = film.confidence * (np.arange(len(clip.names)) < 3)
    few = replace(clip, films=(replace(film, confidence=three),))
    for bad, said in [
        (lambda: gapped(clip, [0, 1]), "no keypoint has a confidence above 0"),
        (lambda: replace(clip, fps=0), "frames per second"),
        (lambda: Clip(clip.names, (film, shorter), 60), "same frames"),
        (lambda: Film("a", (10, 10), film.pixels[0], film.confidence[0]), r"\(T, M, 2\)"),
        (lambda: video_fit(few, BODY, "?"), "no frame shows 4 keypoints"),
    ]:
        with pytest.raises(BadObservation, match=said):
            bad()


@pytest.mark.thorough
def test_video_mean_differs_smoothly_from_the_mode() -> None:
    clip = gapped(balance_clip(range(40, 48), ["cam01"]), [3, 4])
    setup = video_fit(clip, BODY, "?")
    values = setup.start
    asked: list[tuple[int, int]] = []
    mean = video_mean(setup, values, told=lambda *count: asked.append(count))
    assert asked[-1][0] == asked[-1][1] >= 2  # every fifth that was seen
    for name in set(values) - {"pose", "trans"}:
        np.testing.assert_array_equal(mean[name], values[name])
    for name in ("pose", "trans"):
        apart = mean[name] - values[name]
        assert 0.01 < abs(apart).max() < 1.5
        assert abs(np.diff(apart, axis=0)).max() < 0.3 * abs(apart).max()
    again = video_mean(setup, values)
    np.testing.assert_allclose(again["pose"], mean["pose"], atol=1e-12)


def correlated(rho: float, frames: int, series: int, seed: int = 0) -> np.ndarray:
    """AR(1) noise of unit variance, (frames, series)."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((frames, series))
    for t in range(1, frames):
        x[t] = rho * x[t - 1] + np.sqrt(1 - rho**2) * x[t]
    return x


def test_effective_frames_have_known_values() -> None:
    """Of a constant; of AR(1) noise, T (1 - rho) / (1 + rho); of a constant of variance b beside
    white noise of variance 1 - b, T / (1 + b (T - 1)); of white noise with gaps.
    """
    assert effective_frames(np.full((50, 6), -3.0)) == 1
    noisy = effective_frames(correlated(0.6, 2000, 600))
    assert noisy == pytest.approx(2000 * 0.4 / 1.6, rel=0.15)
    bias, white = np.random.default_rng(1).standard_normal(5000), correlated(0.0, 100, 5000)
    biased = effective_frames(np.sqrt(0.3) * bias + np.sqrt(0.7) * white)
    assert biased == pytest.approx(100 / (1 + 0.3 * 99), rel=0.05)
    gaps = np.where(np.arange(100)[:, None] % 2, white, np.nan)
    assert effective_frames(gaps, np.isfinite(gaps)) == pytest.approx(50, rel=0.1)


def test_bad_errors_of_frames_are_refused() -> None:
    for errors, known, said in [
        (np.ones((1, 4)), None, "in two frames or more"),
        (np.full((4, 2), np.nan), None, "are finite where something was observed"),
        (np.ones((4, 2)), np.ones((4, 3), dtype=bool), "same shape"),
    ]:
        with pytest.raises(BadObservation, match=said):
            effective_frames(errors, known)
