"""A motion is called after the joints that move, not after the limb in which it was looked for."""

import re

import numpy as np

from workbench import diagnose
from workbench.blocks import Block, Layout, Tree
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.turned_joints import named_by_joints
from workbench.experiments.balance import balance_monocular

NAMES = ("pelvis", "collar", "shoulder", "elbow", "wrist", "hand", "other_collar")
TREE = Tree("pose", NAMES, (-1, 0, 1, 2, 3, 4, 0))
FREE = Layout((Block("pose", (7, 3), "rad", NAMES), Block("trans", (3,), "m")))
LIMB = NamedSubspace("joint", "turns from collar down", (), np.arange(3, 18), None, TREE)


def name_of(motion: NamedSubspace, turns: dict[str, float], trans: float = 0.0) -> str:
    pose = np.zeros((7, 3))
    for joint, angle in turns.items():
        pose[NAMES.index(joint), 1] = angle
    v = np.concatenate([pose.ravel(), [trans, 0, 0]])
    return named_by_joints(motion, v, np.eye(24), FREE, 0.0)[0]


def test_a_turn_of_the_hand_is_no_turn_from_the_collar_down() -> None:
    assert name_of(LIMB, {"hand": 1.0, "collar": 0.01, "wrist": 0.05}) == "a turn of pose[hand]"
    assert name_of(LIMB, {"hand": 1.0, "wrist": 0.3, "collar": 0.01}) == "turns from wrist down"
    assert name_of(LIMB, {"hand": 0.4, "elbow": 0.5, "collar": 0.3}) == "turns from collar down"
    assert name_of(LIMB, {"elbow": 0.5, "other_collar": 0.5}) == "turns below pelvis"


def test_a_translation_that_takes_no_part_is_not_named() -> None:
    near = NamedSubspace("joint", "turns near pelvis", (), np.arange(24), None, TREE, "trans")
    assert name_of(near, {"elbow": 1.0, "hand": 0.5}, 0.01) == "turns from elbow down"
    assert name_of(near, {"elbow": 1.0}, 0.5) == "a turn of pose[elbow], undone by trans"


def test_in_one_image_of_a_person_every_limb_is_named_by_who_moves() -> None:
    setup = balance_monocular()
    problem = setup.problem.without(*setup.priors)
    d = diagnose(problem, setup.start)
    labels = problem.free["pose"].labels
    assert labels is not None
    checked = 0
    for direction in (*d.null_directions, *d.weak_directions):
        found = re.match(r"turns from (\w+) down|a turn of pose\[(\w+)\]:", direction.name)
        if direction.kind == "joint" and found:
            pose = direction.vector[problem.free.slices["pose"]].reshape(-1, 3)
            angles = np.linalg.norm(pose, axis=1)
            named = labels.index(found[1] or found[2])
            assert angles[named] > 0.1 * abs(direction.vector).max(), direction.name
            checked += 1
    assert checked > 10
