"""Motions from body to body, from points to bodies, and to glTF: `python -m benchmarks.conversion`.

It takes about five minutes, and a page of the results is written to CONVERSION.md. Where Node.js is
there and WORKBENCH_NODE_MODULES names a folder with gltf-validator and three, these look at the
files as well.
"""

import argparse
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import workbench as wb
from benchmarks import machine
from tests.clips_made_up import clip
from benchmarks.keeping import keep
from workbench.bodies.files.gltf import correctives_of
from workbench.conversion import conversion_errors, convert, correspond, motion_from_points
from workbench.motions import write_glb
from workbench.priors.poses import shipped_mixture

HERE = Path(__file__).parent
SCRIPT = HERE.parent / "tests" / "motions" / "three.mjs"
FRAMES, SEEDS, DIGITS = 100, range(10, 15), 4
PAIRS = (
    ("default", "full-hands"),
    ("full-hands", "default"),
    ("default", "full-hands-female"),
    ("full-hands-female", "default"),
    ("default-male", "full-hands-female"),
    ("default", "default-male"),
    ("default", "small"),
    ("small", "default"),
)
POINTS = (("default", "joints"), ("default", "coco"), ("hand", "hand"))
NOISE, MISSING = 0.005, 0.1  # m along each axis; share of points in a frame
GLB = (("default", 100), ("full", 100), ("hand", 100), ("full-hands", 100))
COUNTS, UNRELATED = (0, 16, 32, None), (16, 32, 64, 96)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, keep the numbers, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.conversion", description=__doc__)
    parser.add_argument("--page", action="store_true", help="write the page of kept numbers only")
    file = HERE / "results" / "conversion.json"
    if not parser.parse_args(arguments).page:
        found = {
            "machine": machine.description(),
            "pairs": [pair(*names) for names in PAIRS],
            "points": [points(*names) for names in POINTS],
            "glb": [one for name, frames in GLB for one in files(name, frames)],
            "unrelated": unrelated(),
        }
        keep(file, found, DIGITS)
    (HERE / "CONVERSION.md").write_text(page(json.loads(file.read_text())), encoding="utf-8")


def body_called(name: str) -> wb.SkinnedBody:
    """An embedded body."""
    body = wb.load_body(name)
    assert isinstance(body, wb.SkinnedBody)
    return body


def pair(first: str, second: str) -> dict[str, Any]:
    """Conversions of one clip for each seed, in mm and CPU seconds."""
    source, target = body_called(first), body_called(second)
    began = time.process_time()
    kept = correspond(source, target)
    rows: dict[str, Any] = {"from": first, "to": second, "found": time.process_time() - began}
    each: dict[str, list[float]] = {
        name: [] for name in ("mean", "body", "p95", "largest", "copied", "seconds")
    }
    for seed in SEEDS:
        motion = clip(source, FRAMES, seed)
        began = time.process_time()
        found = convert(motion, source, target, correspondence=kept)
        each["seconds"].append(time.process_time() - began)
        copied = conversion_errors(motion.named(target), target, motion, source, kept)
        off = 1e3 * found.errors[np.isfinite(found.errors)]
        each["mean"].append(off.mean())
        each["body"].append(1e3 * found.mean(hands=False))
        each["p95"].append(np.percentile(off, 95))
        each["largest"].append(off.max())
        each["copied"].append(1e3 * np.nanmean(copied))
    print(first, "->", second, {k: np.round(v, 2).tolist() for k, v in each.items()}, flush=True)
    return rows | each


def points(name: str, kind: str) -> dict[str, Any]:
    """Motions from noisy points with gaps, in mm and CPU seconds."""
    body = body_called(name)
    each: dict[str, Any] = {"body": name, "points": kind, "seconds": [], "joints": [], "skin": []}
    for seed in SEEDS:
        motion, rng = clip(body, FRAMES, seed), np.random.default_rng(seed)
        exact, names = _observed(body, kind, motion)
        seen = exact + rng.normal(scale=NOISE, size=exact.shape)
        seen[rng.random(seen.shape[:2]) < MISSING] = np.nan
        began = time.process_time()
        found = motion_from_points(seen, names, body, motion.fps, kind=kind, sigma=NOISE).motion
        each["seconds"].append(time.process_time() - began)
        for what, of in (("joints", wb.Motion.joints), ("skin", wb.Motion.vertices)):
            off = np.linalg.norm(of(found, body) - of(motion, body), axis=2)
            each[what].append(1e3 * off.mean())
    print(each, flush=True)
    return each


def _observed(body: wb.SkinnedBody, kind: str, motion: wb.Motion) -> tuple[Any, tuple[str, ...]]:
    from workbench.conversion.points_in_space import body_points, point_sets

    at = motion.pose, motion.betas, motion.trans
    return body_points(body, kind, *at), point_sets(body)[kind]


def files(name: str, frames: int) -> list[dict[str, Any]]:
    """Files of one clip with several numbers of correctives."""
    body, rows = body_called(name), []
    motion = clip(body, frames, SEEDS[0])
    with tempfile.TemporaryDirectory() as folder:
        for count in COUNTS:
            path = Path(folder) / "a.glb"
            found = write_glb(path, motion, body, correctives=count, shapes=10)
            row = {
                "body": name,
                "joints": body.n_joints,
                "frames": frames,
                "asked": "exact" if count is None else count,
                "correctives": len(found.shapes),
                "mean": 1e3 * found.mean,
                "largest": 1e3 * found.largest,
                "megabytes": path.stat().st_size / 1e6,
            }
            rows.append(row | looked_at(path, motion.vertices(body)))
            print(rows[-1], flush=True)
    return rows


def unrelated() -> list[dict[str, float]]:
    """Correctives of poses of `default` that have nothing to do with each other; errors in mm."""
    body, rng = body_called("default"), np.random.default_rng(SEEDS[0])
    poses = shipped_mixture().draw(FRAMES, rng)
    return [
        {"correctives": count, "mean": 1e3 * found.mean, "largest": 1e3 * found.largest}
        for count in UNRELATED
        for found in (correctives_of(body, poses, np.zeros(body.n_betas), count),)
    ]


def looked_at(path: Path, surface: Any) -> dict[str, Any]:
    """What the validator finds in a file, and how far vertices in three.js are off, in mm."""
    modules = os.environ.get("WORKBENCH_NODE_MODULES", "")
    if shutil.which("node") is None or not modules:
        return {"issues": None, "three": None}
    out = path.with_suffix(".bin")
    command = ["node", str(SCRIPT), modules, str(path), str(out)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    issues = json.loads(said)
    off = np.linalg.norm(np.fromfile(out).reshape(-1, 3) - surface.reshape(-1, 3), axis=1)
    kinds = ("Errors", "Warnings", "Infos", "Hints")
    return {"issues": sum(issues[f"num{k}"] for k in kinds), "three": 1e3 * off.max()}


def page(found: dict[str, Any]) -> str:
    """The page of the numbers."""
    from benchmarks.conversion_page import written

    return written(found)


if __name__ == "__main__":
    main()
