"""The fit of a clip as a page, with the motion beside it."""

from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.fitting.doubts import doubts
from workbench.fitting.setup import Moving, Setup
from workbench.reports import tables
from workbench.reports.folder import SUMMARY, Content, write_folder
from workbench.reports.moving import moving_figures
from workbench.reports.page import page
from workbench.reports.replay import recorded_frames
from workbench.solvers import Solution
from workbench.writing import write_arrays

FILES = {
    "index.html": "this page",
    "motion.npz": "poses (T, K, 3) rad, trans (T, 3) m, betas, fps, and the names of joints",
    SUMMARY: "how the fit ended, for programs",
}


def motion_arrays(moving: Moving, values: Values) -> dict[str, Array]:
    """The arrays of `motion.npz`, which `read_motion` reads."""
    pose, betas, trans = (values[block.name] for block in moving.body.blocks())
    return {
        "poses": pose,
        "trans": trans,
        "betas": betas,
        "fps": np.array(moving.fps),
        "joint_names": np.array(moving.body.joint_names),
        "up_axis": np.array("y"),
    }


def write_video(
    setup: Setup, solution: Solution, folder: str | Path, title: str, source: str
) -> Path:
    """Write the folder of a fitted clip, and return its page `index.html`; raises BadFile."""
    values = {**setup.start, **solution.values}
    moving = setup.moving
    assert moving is not None  # a fit of a clip says what moves
    motion = motion_arrays(moving, values)
    measures, doubted = setup.measures(values), doubts(setup, values, solution)
    text = page(
        "video.html",
        title=title,
        setup=setup,
        solution=solution,
        status=solution.status.name.lower().replace("_", " "),
        said="; ".join(text for text in tables.ending_said(solution) if text),
        cost=tables.number(solution.cost, 6),
        measures=tables.measures_table(measures),
        doubted=doubted,
        moving=moving_figures(setup, values),
        files=FILES,
        recording=recorded_frames(setup, values),
    )
    contents: dict[str, Content] = {
        "index.html": text,
        "motion.npz": lambda path: write_arrays(path, motion),
    }
    summary = {
        "kind": "video",
        "status": solution.status.name,
        "cost": solution.cost,
        "frames": len(motion["poses"]),
        "warnings": list(doubted),
        "notes": list(setup.notes),
        "measures": [{"name": m.name, "value": m.value, "unit": m.unit} for m in measures],
    }
    return write_folder(folder, source, contents, summary)
