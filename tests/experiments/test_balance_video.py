"""The experiment `balance-video`: one real person, some frames, one or several cameras."""

from pathlib import Path

import numpy as np
import pytest

from workbench.errors import BadArgument, UnknownName
from workbench.experiments import find, run
from workbench.reports import write_report


def test_it_runs_and_its_page_shows_the_frames(tmp_path: Path) -> None:
    outcome = run(find("balance-video", {"last": 50}), compare=False)
    assert outcome.solution.converged
    text = write_report(outcome, tmp_path / "page").read_text()
    assert "cam01: 3 of 3 frames at 12 frames per second" in text
    assert "frames are worth" in text
    assert outcome.values["pose"].shape == (3, 24, 3)


def test_frames_and_cameras_that_do_not_exist_are_refused() -> None:
    for wrong in ({"first": 40, "last": 40}, {"last": 100}, {"step": 0}, {"first": -1}):
        with pytest.raises(BadArgument, match="two frames or more"):
            find("balance-video", wrong).setup()
    with pytest.raises(UnknownName):
        find("balance-video", {"cameras": ["cam09"]}).setup()


def test_two_cameras_place_the_body_better_than_one() -> None:
    from workbench.fitting.videos import landmarks_of

    apart = []
    four = find("balance-video", {"last": 50, "cameras": ["cam01", "cam02", "cam03", "cam04"]})
    true = None
    for experiment in (
        four,
        find("balance-video", {"last": 50, "cameras": ["cam01", "cam02"]}),
        find("balance-video", {"last": 50}),
    ):
        outcome = run(experiment, compare=False)
        moving = outcome.setup.moving
        assert moving is not None
        places = landmarks_of(moving, outcome.values)
        true = places if true is None else true
        apart.append(np.linalg.norm(places - true, axis=-1).mean())
    assert apart[1] < 0.7 * apart[2]
