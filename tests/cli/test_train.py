"""`workbench train`: a folder of registrations becomes a body."""

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.first_guess import write_start

START = jointed_tube(7, 5)


@cache
def body_made_up() -> wb.SkinnedBody:
    return random_smpl(START, 2, seed=3)


def made_folder(folder: Path, seed: int = 4) -> Path:
    """Three people in six poses, eight people in about one."""
    folder.mkdir()
    poses, _ = draw_registrations(body_made_up(), 3, 6, seed=seed)
    shapes, _ = draw_registrations(body_made_up(), 8, 1, seed=5, turn=0.1)
    write_start(START, folder / "start.npz")
    np.save(
        folder / "poses.npy",
        CorruptedRegistrations(poses, seed=6, noise=0.001).read(slice(0, 18)).vertices,
    )
    np.save(folder / "shapes.npy", shapes.vertices)
    with (folder / "registrations.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "subject", "gender", "set"])
        for j, s in enumerate(poses.subject):
            writer.writerow([f"poses.npy#{j}", f"p{s}", ("female", "male")[s % 2], "poses"])
        writer.writerows([f"shapes.npy#{j}", f"s{j}", "female", "shapes"] for j in range(8))
    return folder


@pytest.mark.thorough
def test_train_makes_a_body_with_a_card(workbench: Run, tmp_path: Path) -> None:
    made_folder(tmp_path / "mine")
    made_folder(tmp_path / "others", seed=14)
    quick = ("--rounds", "1", "--jobs", "1")
    options = (*quick, "--betas", "2", "--held-out", "others", "--reach", "9")
    code, out, err = workbench("train", "mine", *options)
    assert code == 0, err
    assert "18 registrations of 3 subjects in poses, 8 people for shape" in out
    assert "14/14 surfaces" in out
    place = tmp_path / "runs" / "train-mine"
    body = wb.load_body(place / "body.npz")
    assert body.n_betas == 2
    assert body.card["trained_on"]["people_for_shape"] == 8
    met = body.card["held_out"]
    assert (met["people_in_poses"], met["registrations"]) == (3, 9)
    assert 0 < met["mean_mm"] < met["mean_without_posedirs_mm"]
    assert "ideal_skinning_mean_mm" not in met  # nobody said how these were made
    assert "worst kkt" in (place / "card" / "index.html").read_text()
    code, out, err = workbench("train", "mine", *options)
    assert code == 0, err
    assert "surfaces" not in out  # every block had run
    code, _, err = workbench("train", "mine", *quick, "--gender", "male", "--no-blend-shapes")
    assert code == 0, err
    alone = wb.load_body(tmp_path / "runs" / "train-mine-male" / "body.npz")
    assert isinstance(alone, wb.SkinnedBody)
    assert alone.n_betas == 0
    assert not alone.posedirs.any()


def test_train_says_what_is_wrong_before_anything_is_done(workbench: Run, tmp_path: Path) -> None:
    folder = made_folder(tmp_path / "mine")
    stack = np.load(folder / "poses.npy")
    stack[3] *= 1000
    stack[5, 2, 1] = np.nan
    stack[7] *= [-1, 1, 1]
    np.save(folder / "poses.npy", stack)
    code, _, err = workbench("train", "mine")
    assert code == 2
    for said in ("3 of 26", "poses.npy#3", "millimetres", "poses.npy#5", "poses.npy#7 is mirrored"):
        assert said in err
    assert not (tmp_path / "runs").exists()


def test_train_refuses_options_that_make_no_sense(workbench: Run, tmp_path: Path) -> None:
    made_folder(tmp_path / "mine")
    others = made_folder(tmp_path / "others")
    table = (others / "registrations.csv").read_text().splitlines()
    (others / "registrations.csv").write_text("\n".join(table[:8]))  # six of p0, and one of p1
    for options, said in (
        ("mine --start small", "(35, 3), but the topology has (369, 3)"),
        ("mine --gender cat", "female, male, neutral"),
        ("mine --held-out nowhere", "subject table"),
        ("mine --held-out others --start mine/start.npz", "there is only one of p1"),
        ("mine --betas 0", "1 or more"),
        ("nowhere", "subject table"),
        ("mine --gender neutral", "neutral"),
    ):
        code, _, err = workbench("train", *options.split())
        assert code == 2
        assert said in err
    assert not (tmp_path / "runs").exists()
