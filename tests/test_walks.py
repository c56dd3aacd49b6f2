"""How often a reader who follows a run from file to file has to turn back."""

from tests.walks import walk
from workbench.synthetic import made_up
from workbench.training.training import train

MOST_RETURNS = {"train": 5}


def test_training_leads_a_reader_down() -> None:
    start = made_up.jointed_tube(7, 5)
    body = made_up.random_smpl(start, 2, seed=3)
    poses, _ = made_up.draw_registrations(body, 3, 6, seed=0)
    shapes, _ = made_up.draw_registrations(body, 6, 1, seed=1, turn=0.2)
    found = walk(lambda: train(poses, start, multi_shape=shapes, n_betas=2))
    back = found.returns("training") + found.unrelated("training")
    assert len(back) <= MOST_RETURNS["train"], found.described("training")
    assert not found.climbs, found.described("training")
