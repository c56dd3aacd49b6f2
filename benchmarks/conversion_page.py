"""The page of `benchmarks.conversion`: tables of its numbers, and sentences on them."""

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

FINGERS = "+ fingers"  # in the names of bodies of earlier results


def written(found: dict[str, Any]) -> str:
    """The page, in Markdown."""
    pairs, points, glb = found["pairs"], found["points"], found["glb"]
    count = len(pairs[0]["mean"])
    there, back = pairs[0], pairs[1]
    parts = [
        "# Motions from body to body",
        _filled(f"""
            `python -m benchmarks.conversion` makes up motions: poses drawn from the shipped mixture
            of poses and, for fingers, from the pose space of the embedded hands; ten frames from
            one to the next, and a person drawn as well. Every row of the first two tables is of
            {count} clips of 100 frames, on which nothing was tuned. Nobody was recorded, and real
            motion is smoother. {_old(found)}"""),
        "## Conversion",
        _filled("""
            A vertex is compared with its place on the surface of the first body, in mm: means over
            all clips, and in brackets the smallest and the largest mean of a clip. *Copied* takes
            pose, betas and trans of joints of the same names as they are. The correspondence is
            found once for two bodies. CPU seconds are of one core, with other work on the
            machine."""),
        "\n".join(
            [
                "| from | to | mean | without hands | 95 % below | largest | copied | "
                "correspondence, s | 100 frames, s |",
                "| --- | --- | --- | --- | --: | --: | --: | --: | --: |",
                *(_pair(row) for row in pairs),
            ]
        ),
        _filled(f"""
            From 24 joints to 52, the {count} clips are {_mean(there["mean"])} mm off on average and
            {_mean(there["body"])} mm without the hands, clip by clip {_each(there["body"])} mm;
            that is {_share(there)} of the error of copying. The largest errors are at arms and
            thighs, where `default` has few and long triangles and other weights. That is the limit
            and not the fit, as tuning clips onto `full-hands` show (seeds 0 to 2, every fourth
            frame: 2.5, 2.8 and 2.9 mm without hands; two of them taken apart): at rest the mean
            person is 1.5 mm off, in motion 2.5 to 2.7 mm, and a person of the clip in motion 2.7
            to 2.9 mm; more than three times as many vertices in the fit change nothing, and a
            kernel close to the mean distance gains 1 %. Back, the clips are
            {_mean(back["mean"])} mm off and {_mean(back["body"])} mm without the hands,
            {_share(back)} of the error of copying; the fingers lead, which a body of 24 joints
            cannot bend. `default` and `default-male` have the same triangles, so that what remains
            between them is not the correspondence: ten betas of one do not make people of the
            other."""),
        "## Points in space",
        _filled("""
            The same clips, seen as points with 5 mm of noise along each axis, of which a tenth is
            missing in every frame. Errors of joints and skin in mm, hidden ones included."""),
        "\n".join(
            [
                "| body | points | joints | skin | 100 frames, s |",
                "| --- | --- | --- | --- | --: |",
                *(
                    f"| {row['body']} | {row['points']} | {_range(row['joints'])} | "
                    f"{_range(row['skin'])} | {_mean(row['seconds'])} |"
                    for row in points
                ),
            ]
        ),
        "## glTF",
        _filled("""
            One clip with ten shape directions, normals and the way of the root. The error of
            correctives is what `write_glb` says, in mm; *three.js* is the largest distance from the
            body of a vertex that three.js shows, in mm, and *issues* are the errors, warnings,
            infos and hints of Khronos's validator together."""),
        "\n".join(
            [
                "| body | joints | frames | correctives | mean | largest | MB | three.js "
                "| issues |",
                "| --- | --: | --: | --- | --: | --: | --: | --: | --: |",
                *(_file(row) for row in glb),
            ]
        ),
        _filled(f"""
            Poses of a clip are alike. Of {_frames(found)} poses that are drawn one by one
            for `default`, {_unrelated(found["unrelated"])}."""),
        f"Measured on {_dates(found)}, {found['machine']['processor']}.",
    ]
    return "\n\n".join(parts) + "\n"


def _dates(found: dict[str, Any]) -> str:
    """The day of the measurement, and the day on which some rows were measured again."""
    day = str(found["machine"]["date"][:10])
    again = found.get("again")
    return day if again is None else f"{day}, and conversions from and to `full-hands` on {again}"


def _each(values: Sequence[float]) -> str:
    """`2.67, 2.91 and 3.16`."""
    *first, last = (f"{value:.2f}" for value in values)
    return f"{', '.join(first)} and {last}"


def _old(found: dict[str, Any]) -> str:
    """What `+ fingers` in the names of bodies stands for, if there are such rows."""
    rows = [*found["pairs"], *found["glb"]]
    if not any(FINGERS in name for row in rows for name in row.values() if isinstance(name, str)):
        return ""
    return (
        f"`{FINGERS}` is a body of 52 joints that was made of the one with 24 and the embedded "
        "hands before there was `full-hands`, which the benchmark takes now; the rows with it were "
        "not measured again."
    )


def _filled(text: str) -> str:
    """A paragraph, broken into lines."""
    return textwrap.fill(" ".join(text.split()), 110, break_on_hyphens=False)


def _frames(found: dict[str, Any]) -> int:
    return int(found["glb"][0]["frames"])


def _unrelated(rows: Sequence[dict[str, Any]]) -> str:
    said = [
        f"{row['correctives']} correctives leave {row['mean']:.2g} mm on average and "
        f"{row['largest']:.2g} mm at most"
        for row in rows
    ]
    return ", ".join(said[:-1]) + f", and {said[-1]}"


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f}"


def _range(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def _share(row: dict[str, Any]) -> str:
    shares = np.array(row["mean"]) / np.array(row["copied"])
    return f"{100 * shares.min():.0f} to {100 * shares.max():.0f} %"


def _pair(row: dict[str, Any]) -> str:
    return (
        f"| {row['from']} | {row['to']} | {_range(row['mean'])} | {_range(row['body'])} | "
        f"{_mean(row['p95'])} | {max(row['largest']):.0f} | {_mean(row['copied'])} | "
        f"{row['found']:.1f} | {np.mean(row['seconds']):.1f} |"
    )


def _file(row: dict[str, Any]) -> str:
    seen = ["-" if row[name] is None else f"{row[name]:.2g}" for name in ("three", "issues")]
    asked = f"{row['correctives']}" + (" (exact)" if row["asked"] == "exact" else "")
    return (
        f"| {row['body']} | {row['joints']} | {row['frames']} | {asked} | {row['mean']:.2g} | "
        f"{row['largest']:.2g} | {row['megabytes']:.2f} | {seen[0]} | {seen[1]} |"
    )
