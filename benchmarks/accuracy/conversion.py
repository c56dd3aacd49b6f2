"""Motions from body to body, from points to bodies, and to glTF.

Clips are made up: poses drawn from the shipped mixture and, for fingers, from the pose space of the
embedded hands, ten frames from one to the next, and a person drawn as well.
"""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import workbench as wb
from benchmarks.measuring import table
from tests.clips_made_up import clip
from workbench.bodies.body import Body
from workbench.conversion import conversion_errors, convert, correspond, motion_from_points
from workbench.motions import write_glb

FRAMES, SEEDS = 100, range(10, 15)
PAIRS: tuple[tuple[str, str], ...] = (
    ("default", "full-hands"),
    ("full-hands", "default"),
    ("default", "full-hands-female"),
    ("full-hands-female", "default"),
    ("default-male", "full-hands-female"),
    ("default", "default-male"),
    ("default", "small"),
    ("small", "default"),
)
POINTS: tuple[tuple[str, str], ...] = (("default", "joints"), ("default", "coco"), ("hand", "hand"))
NOISE, MISSING = 0.005, 0.1  # m along each axis; share of points in a frame
GLB = ("default", "full", "hand", "full-hands")
COUNTS = 0, 16, 32, None  # correctives of poses; None is exact


def pair(first: str, second: str, seeds: Sequence[int]) -> dict[str, Any]:
    """Conversions of one clip for each seed, in mm and CPU seconds."""
    source, target = wb.load_body(first), wb.load_body(second)
    began = time.process_time()
    kept = correspond(source, target)
    rows: dict[str, Any] = {"from": first, "to": second, "found": time.process_time() - began}
    each: dict[str, list[float]] = {
        name: [] for name in ("mean", "body", "p95", "largest", "copied", "seconds")
    }
    for seed in seeds:
        motion = clip(source, FRAMES, seed)
        began = time.process_time()
        found = convert(motion, source, target, correspondence=kept)
        each["seconds"].append(time.process_time() - began)
        copied = conversion_errors(motion.named(target), target, motion, source, kept)
        off = 1e3 * found.errors[np.isfinite(found.errors)]
        each["mean"].append(float(off.mean()))
        beside = [not part.endswith(("_hand", "_fingers")) for part in found.parts]
        each["body"].append(1e3 * float(np.nanmean(found.errors[:, beside])))
        each["p95"].append(float(np.percentile(off, 95)))
        each["largest"].append(off.max())
        each["copied"].append(float(1e3 * np.nanmean(copied)))
    return rows | each


def points(name: str, kind: str, seeds: Sequence[int]) -> dict[str, Any]:
    """Motions from noisy points with gaps, in mm and CPU seconds."""
    body = wb.load_body(name)
    each: dict[str, Any] = {"body": name, "points": kind, "seconds": [], "joints": [], "skin": []}
    for seed in seeds:
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
    return each


def _observed(body: Body, kind: str, motion: wb.Motion) -> tuple[Any, tuple[str, ...]]:
    from workbench.conversion.points_in_space import body_points, point_sets

    at = motion.pose, motion.betas, motion.trans
    return body_points(body, kind, *at), point_sets(body)[kind]


def files(name: str) -> list[dict[str, Any]]:
    """Files of one clip with several numbers of correctives."""
    body, rows = wb.load_body(name), []
    assert isinstance(body, wb.SkinnedBody)
    motion = clip(body, FRAMES, SEEDS[0])
    with tempfile.TemporaryDirectory() as folder:
        for count in COUNTS:
            path = Path(folder) / "a.glb"
            found = write_glb(path, motion, body, correctives=count, shapes=10)
            row = {
                "body": name,
                "exact": count is None,
                "correctives": len(found.shapes),
                "mean": 1e3 * found.mean,
                "largest": 1e3 * found.largest,
                "megabytes": path.stat().st_size / 1e6,
            }
            rows.append(row)
    return rows


def measured(quick: bool) -> dict[str, object]:
    """Conversions, points in space, and files."""
    seeds, some = SEEDS[: 1 if quick else None], slice(1 if quick else None)
    return {
        "pairs": [pair(*names, seeds) for names in PAIRS[some]],
        "points": [points(*names, seeds) for names in POINTS[some]],
        "glb": [row for name in GLB[some] for row in files(name)],
    }


def tables(found: dict[str, Any]) -> str:
    """All three."""
    clips = len(found["pairs"][0]["mean"])
    rows = [
        (
            f"{row['from']} to {row['to']}",
            *(_range(row[name]) for name in ("mean", "body")),
            f"{np.mean(row['p95']):.1f}",
            f"{max(row['largest']):.0f}",
            *(f"{np.mean(row['copied']):.1f}", f"{row['found']:.1f}"),
            f"{np.mean(row['seconds']):.1f}",
        )
        for row in found["pairs"]
    ]
    head = (
        *(f"{clips} clips, mm", "mean", "without hands", "95 % below", "largest", "copied"),
        *("correspondence, CPU s", f"{FRAMES} frames, CPU s"),
    )
    text = table(head, rows)
    rows = [
        (
            f"{row['body']}, {row['points']}",
            *(_range(row[name]) for name in ("joints", "skin")),
            f"{np.mean(row['seconds']):.1f}",
        )
        for row in found["points"]
    ]
    text += "\n" + table(("points in space, mm", "joints", "skin", f"{FRAMES} frames, CPU s"), rows)
    rows = [
        (
            *(row["body"], f"{row['correctives']}{' (exact)' * row['exact']}"),
            *(f"{row['mean']:.2g}", f"{row['largest']:.2g}", f"{row['megabytes']:.2f}"),
        )
        for row in found["glb"]
    ]
    return text + "\n" + table(("glTF, mm", "correctives", "mean", "largest", "MB"), rows)


def _range(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f} ({min(values):.2f} to {max(values):.2f})"
