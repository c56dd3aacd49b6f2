"""Learning a Student's t of poses from a recording: `workbench/data/poses/cmu_student.npz`.

Run as `python -m builder.pose_student MOCAP.npz --out workbench/data/poses`, with a recording as
`workbench.priors.recordings` describes it.
"""

from dataclasses import replace

import numpy as np
import scipy.optimize

from builder.from_a_recording import asked
from builder.mirrored_poses import both_ways
from builder.packing import write_arrays
from builder.pose_gaussian import LEAST_STD
from workbench.arrays import Mask
from workbench.errors import BadArgument
from workbench.priors.poses import STUDENT_FILE, PoseStudent, numbers_of
from workbench.priors.recordings import PoseRecording

DOF = 4.0  # while the scale is learned: near to what the parts that are left out then say
ROUNDS = 40  # of expectation and maximisation
PARTS = 8  # of the clips, each of which is left out once


def learn_pose_student(mocap: PoseRecording) -> PoseStudent:
    """The scale of all frames and their mirror images, and the tails of clips that were left out.

    Each eighth of the clips is left out once. The degrees of freedom and a factor of the scale are
    those with which the frames that were left out are likeliest, by the scales of the others: in
    the frames that a scale was learned from, tails look too light.
    """
    clips, moves = np.unique(mocap.clip), ~both_ways(mocap)[1]
    if len(clips) < 2:
        raise BadArgument("tails are those of clips that are left out; one clip has none")
    found: list[tuple[PoseStudent, np.ndarray]] = []
    for first in range(PARTS):
        out = np.isin(mocap.clip, clips[first::PARTS])
        if out.any() and not out.all():
            flat, _ = both_ways(mocap._where(out))
            found.append((_scale_of(mocap._where(~out), moves), flat))
    whole = _scale_of(mocap, moves)
    columns = numbers_of(whole.joint_names, mocap.joint_names[1:])

    def loss(logs: np.ndarray) -> float:
        dof, factor = np.exp(logs)
        told = [
            replace(one, dof=dof, scale=factor * one.scale).log_density(flat[:, columns])
            for one, flat in found
        ]
        return -float(np.mean(np.concatenate(told)))

    best = scipy.optimize.minimize(loss, np.log([DOF, 0.5]), method="Nelder-Mead")
    dof, factor = np.exp(best.x)
    return replace(whole, dof=float(dof), scale=factor * whole.scale)


def _scale_of(mocap: PoseRecording, moves: Mask) -> PoseStudent:
    """Mean and scale of the joints that move (K - 1,), without the root, by expectation and
    maximisation (Lange, Little and Taylor 1989).
    """
    names = tuple(np.array(mocap.joint_names[1:])[moves])
    x = both_ways(mocap)[0][:, np.repeat(moves, 3)]
    n, d = x.shape
    least = LEAST_STD**2 * np.eye(d)
    found = PoseStudent(
        x.mean(axis=0), np.cov(x.T) + least, DOF, names, len(mocap.poses), mocap.absent
    )
    for _ in range(ROUNDS):
        weights = (DOF + d) / (DOF + found.squares(x))
        mean = weights @ x / weights.sum()
        off = x - mean
        found = replace(found, mean=mean, scale=(off * weights[:, None]).T @ off / n + least)
    return found


def main() -> None:
    """Learn the prior from a recording and write it."""
    learned_from, held_out, out = asked(__doc__)
    prior = learn_pose_student(learned_from)
    write_arrays(
        out / STUDENT_FILE,
        {
            "mean": prior.mean.astype(np.float32),
            "scale": prior.scale.astype(np.float32),
            "dof": np.array(prior.dof),
            "joint_names": np.array(prior.joint_names),
            "n_frames": np.array(prior.n_frames),
            "held_out_clips": np.array(prior.held_out),
        },
    )
    columns = numbers_of(prior.joint_names, held_out.joint_names[1:])
    flat = both_ways(held_out)[0][:, columns]
    print(f"{prior.dof:.2f} degrees of freedom; {prior.n_frames} frames")
    print(f"mean log density of held-out frames: {prior.log_density(flat).mean():.2f}")


if __name__ == "__main__":
    main()
