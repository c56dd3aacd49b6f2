"""Videos: what frames share, what they are worth, gaps, and single frames as a special case."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import load_body
from workbench.errors import BadArgument
from workbench.experiments.balance_video import balance_clip
from workbench.fitting import (
    BadObservation,
    Clip,
    Film,
    Smoothness,
    mesh_fit,
    video_fit,
    video_mean,
)
from workbench.fitting.videos import errors_of
from workbench.solvers import Status, TrustRegion

BODY = load_body("default")
NOTHING = Smoothness(None, None)
PRECISE = TrustRegion(gradient_tolerance=1e-8)


def gapped(clip: Clip, frames: list[int]) -> Clip:
    """The clip with nothing observed in some frames."""
    films = []
    for film in clip.films:
        sure = film.confidence.copy()
        sure[frames] = 0
        films.append(replace(film, confidence=sure))
    return replace(clip, films=tuple(films))


def test_frames_that_share_nothing_are_fitted_as_if_alone() -> None:
    frames = [40, 44, 48]
    clip = balance_clip(frames, ["cam01", "cam02"])
    setup = video_fit(clip, BODY, "?", smoothness=NOTHING, shared=(), worth=len(frames))
    whole = {**setup.start, **PRECISE.solve(setup.problem, setup.start).values}
    for t, frame in enumerate(frames):
        one = video_fit(balance_clip([frame], ["cam01", "cam02"]), BODY, "?", shared=())
        own = {name: setup.start[name][t][None] for name in ("pose", "betas", "trans")}
        alone = PRECISE.solve(one.problem, {**one.start, **own}).values
        for name in ("pose", "betas", "trans"):
            np.testing.assert_allclose(whole[name][t], alone[name][0], atol=1e-4)


def test_a_video_shares_one_shape_and_counts_as_few_frames() -> None:
    setup = video_fit(balance_clip(range(0, 40, 5), ["cam02"], 12), BODY, "?")
    assert setup.start["betas"].shape == (BODY.n_betas,)
    n = 8 * setup.start["evidence"][0]
    assert 1 <= n < 6  # of 8 frames: errors are alike
    assert any(f"count as {n:.1f} independent" in note for note in setup.notes)
    found = {**setup.start, **TrustRegion().solve(setup.problem, setup.start).values}
    measures = {one.name: one.value for one in setup.measures(found)}
    assert measures["reprojection, cam02"] < 15
    assert 1500 < measures["height at rest"] < 1900


def test_frames_worth_more_leave_the_shape_prior_less() -> None:
    clip = balance_clip(range(0, 40, 5), ["cam02"], 12)
    sizes = []
    for worth in (1.0, 8.0):
        setup = video_fit(clip, BODY, "?", worth=worth)
        found = TrustRegion().solve(setup.problem, setup.start).values
        sizes.append(np.linalg.norm(found["betas"]))
    assert sizes[0] < 0.8 * sizes[1]


def test_gaps_are_said_and_filled_by_smoothness() -> None:
    whole = balance_clip(range(40, 47), ["cam01"])
    setup = video_fit(gapped(whole, [3]), BODY, "?", smoothness=Smoothness(5, 2))
    assert any("In 1 of 7 frames no keypoint" in note for note in setup.notes)
    found = TrustRegion().solve(setup.problem, setup.start).values
    between = (found["trans"][2] + found["trans"][4]) / 2
    assert np.linalg.norm(found["trans"][3] - between) < 0.01
    errors, known = errors_of(setup.problem, {**setup.start, **found}, setup.moving.data)
    assert not known[3].any()
    assert not errors[3].any()
    assert known[2].any()


def test_a_first_frame_without_keypoints_begins_at_a_later_one() -> None:
    setup = video_fit(gapped(balance_clip(range(40, 44), ["cam01"]), [0]), BODY, "?")
    np.testing.assert_array_equal(setup.start["trans"][0], setup.start["trans"][1])


def test_a_focal_length_is_one_for_all_frames() -> None:
    clip = balance_clip(range(40, 46, 2), ["cam01"])
    unknown = replace(clip, films=tuple(replace(film, K=None) for film in clip.films))
    setup = video_fit(unknown, BODY, "?")
    found = {**setup.start, **TrustRegion().solve(setup.problem, setup.start).values}
    assert found["cam01/focal"].shape == (2,)
    assert not np.allclose(found["cam01/focal"], setup.start["cam01/focal"])
    assert {one.name: one.value for one in setup.measures(found)}["reprojection, cam01"] < 20


def test_frames_are_told_and_an_interrupt_ends_the_start() -> None:
    told: list[tuple[int, int]] = []

    def stop(done: int, all_: int) -> None:
        told.append((done, all_))
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        video_fit(balance_clip(range(40, 44), ["cam01"]), BODY, "?", told=stop)
    assert told == [(0, 4), (1, 4)]


def test_an_interrupted_fit_keeps_its_motion() -> None:
    setup = video_fit(balance_clip(range(40, 44), ["cam01"]), BODY, "?")
    end = TrustRegion().solve(setup.problem, setup.start, callback=lambda iterate: True)
    assert end.status is Status.STOPPED
    assert np.isfinite(end.values["pose"]).all()


def test_what_makes_no_clip_is_refused() -> None:
    clip = balance_clip([40, 41], ["cam01"])
    with pytest.raises(BadArgument, match="2 frames are worth 1 to 2"):
        video_fit(clip, BODY, "?", worth=3)
    with pytest.raises(BadObservation, match="no frame shows a keypoint"):
        gapped(clip, [0, 1])
    with pytest.raises(BadObservation, match="frames per second"):
        replace(clip, fps=0)
    film = clip.films[0]
    shorter = replace(film, pixels=film.pixels[:1], confidence=film.confidence[:1])
    with pytest.raises(BadObservation, match="same frames"):
        Clip(clip.names, (film, shorter), 60)
    with pytest.raises(BadObservation, match=r"\(T, M, 2\)"):
        Film("a", (10, 10), film.pixels[0], film.confidence[0])


def test_a_body_cannot_be_placed_by_three_keypoints() -> None:
    clip = balance_clip([40], ["cam01"])
    film = clip.films[0]
    sure = film.confidence.copy()
    sure[:, 3:] = 0
    few = replace(clip, films=(replace(film, confidence=sure),))
    with pytest.raises(BadObservation, match="no frame shows 4 keypoints"):
        video_fit(few, BODY, "?")


def test_the_mean_of_a_video_differs_smoothly_from_its_mode() -> None:
    clip = gapped(balance_clip(range(40, 53), ["cam01"]), [5, 6])
    setup = video_fit(clip, BODY, "?")
    values = setup.start
    asked: list[tuple[int, int]] = []
    mean = video_mean(setup, values, told=lambda *count: asked.append(count))
    assert asked == [(1, 3), (2, 3), (3, 3)]  # frames 0, 7, 12: every fifth that was seen
    for name in set(values) - {"pose", "trans"}:
        np.testing.assert_array_equal(mean[name], values[name])
    for name in ("pose", "trans"):
        apart = mean[name] - values[name]
        assert 0.01 < abs(apart).max() < 1.5
        assert abs(np.diff(apart, axis=0)).max() < 0.3 * abs(apart).max()
    again = video_mean(setup, values)
    np.testing.assert_allclose(again["pose"], mean["pose"], atol=1e-12)


def test_frames_with_few_keypoints_are_not_drawn() -> None:
    """With a single keypoint, nothing says where a body is if the other frames do not."""
    clip = balance_clip(range(40, 44), ["cam01"], 12)
    films = []
    for film in clip.films:
        sure = film.confidence.copy()
        sure[0, np.argsort(sure[0])[:-1]] = 0
        films.append(replace(film, confidence=sure))
    setup = video_fit(replace(clip, films=tuple(films)), BODY, "?")
    asked: list[tuple[int, int]] = []
    mean = video_mean(setup, setup.start, told=lambda *count: asked.append(count))
    assert asked[-1] == (3, 3)
    assert np.isfinite(mean["pose"]).all()


def test_a_mean_of_what_is_no_video() -> None:
    setup = mesh_fit(BODY, BODY.template, "?", sigma=0.01)
    with pytest.raises(BadArgument, match="give one that `video_fit` made"):
        video_mean(setup, setup.start)
