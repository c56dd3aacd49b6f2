"""SMPL beside SCAPE and BlendSCAPE as a page, as text, and as data."""

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from workbench.arrays import Array
from workbench.bodies.files.gltf import write_gltf
from workbench.plots import caption_stitching, plot_stitching
from workbench.reports.page import Columns, Table, page, plotted
from workbench.studies.pages import text_of, write_study
from workbench.studies.triangles import figures
from workbench.studies.triangles.explained_variance import ExplainedVariance
from workbench.studies.triangles.models import BLEND_SCAPE, SCAPE, SMPL, without_bends
from workbench.studies.triangles.study import SHOWN, ModelResult, TriangleStudy
from workbench.training.ridge import Selection

SKINNED = "smpl.glb"
REMARKS = (
    "Everybody here is synthetic: people are drawn from artists' shape targets, and what pose does "
    "to them is computed with a finer rig and dual quaternions. The training poses are draws from "
    "a Gaussian of recorded poses.",
    "No model is given a pose or a shape. SMPL is trained first, by the training pipeline, "
    "starting from the mean person cut into parts. SCAPE and BlendSCAPE take over its weights and "
    "joint regressor, and start from its poses and the subjects' rest shapes. Then each learns its "
    "own, in turn: the shape directions S from all standing people, the deformations Q by pose, "
    "the poses by the same pose solver on its own surface, and the deformations D of each subject.",
    "All models are fitted to held-out people in the same way: with the same first guess, to edges "
    "and then to vertices, by the same solver with as many steps, and with betas of one standard "
    "deviation. A pose of one model is neither that of another nor that of the rig behind the "
    "meshes, because each model learns what the zero pose is.",
    f"The file {SKINNED} beside this page holds the trained SMPL's mean person in the difficult "
    "poses below, with a skeleton that any viewer can move. A glTF file blends motions of bones "
    "and adds shapes to the rest surface. A body whose surface is the solution of a linear system "
    "can only be written mesh by mesh.",
    "Times are those of one core of the machine that made this page: the least of several, after "
    "everything that is made once. The bodies on the full mesh are those of the package, with "
    "SCAPE and BlendSCAPE on its skeleton and without a learned Q; what was learned changes no "
    "time.",
)


def in_short(s: TriangleStudy) -> str:
    """Why SMPL adds and SCAPE multiplies, and what that costs."""
    smpl, scape = s.result(SMPL), s.result(SCAPE)
    fast, slow = (
        next(c for c in s.timings if (c.mesh, c.model) == ("full", m)) for m in (SMPL, SCAPE)
    )
    return (
        "SMPL adds what shape and pose do to each vertex before one linear blend moves it, so that "
        "each can be learned, looked at and exported without the other (what they do together "
        f"differs from the sum by {smpl.gap:.1g} mm). SCAPE multiplies what they do to each "
        "triangle, so that pose deforms a body in proportion to its shape (here the two together "
        f"differ from the sum by {scape.gap:.2g} mm). The price is a linear system over the whole "
        f"mesh for every surface: on {slow.n_faces:,} triangles it takes {slow.vertices_ms:.0f} ms "
        f"instead of {fast.vertices_ms:.1f}. The Jacobian, of which {slow.density:.0%} instead of "
        f"{fast.density:.0%} is not zero, takes {slow.jacobian_ms:,.0f} ms instead of "
        f"{fast.jacobian_ms:.0f}."
    )


def lecture_table(s: TriangleStudy) -> Table:
    """The table of SMPL against SCAPE in Body Models II, filled with what was measured."""
    results = [s.result(name) for name in SHOWN]
    own = {c.model: c for c in s.timings if c.mesh == s.plan.body}
    full = {c.model: c for c in s.timings if c.mesh == "full"}
    base = [s.shapes.training["vertices"]] + 2 * [s.shapes.training["triangles"]]
    rows: list[tuple[str, ...]] = [
        ("deforms", "vertices", "triangles, rigid parts", "triangles, blended parts"),
        ("what shape and pose do is", "added", "multiplied", "multiplied"),
        ("effect of both minus the sum of their effects (mm)", *(f"{o.gap:.2g}" for o in results)),
        (
            "skeleton",
            "joints that move with shape",
            "rotations of parts, no bones",
            "rotations of parts, no bones",
        ),
        ("as a skinned glTF file", SKINNED, "no", "no"),
        ("linear system for a surface", "none", *(2 * ["one, factorised once"])),
        ("parameters", *(f"{o.parameters:,}" for o in results)),
        *(
            (
                f"directions for {level:.0%} of the vertices' variance",
                *(count(e, level) for e in base),
            )
            for level in figures.LEVELS
        ),
        ("held-out people at rest, rms (mm)", *(mm(o.rest_rms) for o in results)),
        ("held-out people in held-out poses, rms (mm)", *(f"{o.rms:.2f}" for o in results)),
        (
            f"jump where parts meet (test meshes: {s.true_seam_jump:.3f})",
            *(f"{o.seam_jump:.3f}" for o in results),
        ),
    ]
    for name, cost in ((s.plan.body, own), ("full", full)):
        faces = f"{cost[SMPL].n_faces:,} triangles"
        rows += [
            (f"surface of {name}, {faces} (ms)", *(f"{cost[m].vertices_ms:.2f}" for m in SHOWN)),
            (
                f"residual and Jacobian of {name} (ms)",
                *(f"{cost[m].jacobian_ms:,.1f}" for m in SHOWN),
            ),
            (
                f"nonzero share of that Jacobian ({name})",
                *(f"{cost[m].density:.0%}" for m in SHOWN),
            ),
        ]
    return Table(("", *SHOWN), tuple(rows), (1, 2, 3))


def result_table(s: TriangleStudy) -> Table:
    """All models, with and without what they learned of pose."""
    columns: Columns[ModelResult] = {
        "model": lambda o: o.model,
        "parameters": lambda o: f"{o.parameters:,}",
        "training rms": lambda o: mm(o.training_rms),
        "rms at rest": lambda o: mm(o.rest_rms),
        "rms": lambda o: mm(o.rms),
        "mean": lambda o: mm(o.mean),
        "largest": lambda o: f"{o.largest:.1f}",
        "jump": lambda o: f"{o.seam_jump:.3f}",
        "shape and pose together minus their sum": lambda o: f"{o.gap:.2g}",
    }
    return Table.of(s.results, columns, tuple(range(1, len(columns))))


def mm(distance: float | None) -> str:
    """A distance in mm to the hundredth; empty where it was not measured."""
    return "" if distance is None else f"{distance:.2f}"


def choice_table(s: TriangleStudy) -> Table:
    """How strongly the pose-dependent part is regularized, and the errors on held-out subjects."""

    def errors(choice: Selection) -> str:
        tried = zip(choice.tried, choice.errors, strict=True)
        return "; ".join(f"{strength:g}: {left:.2f}" for strength, left in tried)

    columns: Columns[str] = {
        "model": str,
        "regularized by": lambda name: "sigma of P, m" if name == SMPL else "ridge of Q, m²",
        "error on held-out subjects, rms mm": lambda name: errors(s.choices[name]),
        "chosen": lambda name: f"{s.choices[name].chosen:g}",
    }
    return Table.of(s.choices, columns, (3,))


def claim(s: TriangleStudy) -> str:
    """How many directions these people need, beside the lecture's 10 of SMPL and 300 of SCAPE."""
    v, t = (s.shapes.training[name] for name in ("vertices", "triangles"))
    own = s.shapes.gradients
    most = len(own) - 1
    counts = "; ".join(
        f"{level:.0%}: {count(v, level)} directions of vertices, {count(t, level)} of triangles "
        f"once stitched, {count(ExplainedVariance(own, own), level)} of the gradients themselves"
        for level in figures.LEVELS
    )
    return (
        "The lectures “Body Models II” (Pons-Moll and Swoboda, 2018) give 10 directions for SMPL "
        f"and some 300 for SCAPE. Measured on {s.plan.people} synthetic people, who span {most} "
        f"directions at most: {counts}. At every k from 1 to {most} vertices explained at least as "
        "much as triangles, as the theorem says; the least difference of the shares was "
        f"{s.shapes.leads.min():.0e}, the largest {s.shapes.leads.max():.3f}. How many directions "
        "are needed depends on whether a surface or its gradients are counted, and on the people; "
        "300 is no property of the model."
    )


def count(explained: ExplainedVariance, level: float) -> str:
    """The number of directions as text, or that there are not enough of them."""
    found = explained.count_for(level)
    return f"more than {len(explained.share) - 1}" if found is None else str(found)


def triangles_text(s: TriangleStudy) -> str:
    """All tables for a terminal."""
    return text_of(lecture_table(s), result_table(s), choice_table(s))


def triangles_data(s: TriangleStudy) -> dict[str, Any]:
    """Every number of it."""
    shapes = s.shapes
    return {
        "kind": "triangles",
        "name": "triangles",
        "plan": asdict(s.plan),
        "test": s.test_poses,
        "explained": {
            f"{name}, {who}": {"share": e.share, "rms_m": e.rms}
            for who, group in (("training", shapes.training), ("held out", shapes.held_out))
            for name, e in group.items()
        },
        "gradients": shapes.gradients,
        "results": [asdict(result) for result in s.results],
        "choices": {name: asdict(c) | {"chosen": c.chosen} for name, c in s.choices.items()},
        "true_seam_jump": s.true_seam_jump,
        "timings": [asdict(one) for one in s.timings],
    }


def write_triangles(s: TriangleStudy, folder: str | Path) -> Path:
    """Write the folder of a study, and return its page; it is written whole or not at all."""
    others = {SKINNED: lambda path: write_gltf(path, s.smpl, s.poses)}
    return write_study(folder, triangles_page(s), triangles_text(s), triangles_data(s), others)


def triangles_page(s: TriangleStudy) -> str:
    """The page as HTML."""
    largest = figures.largest_shown(s.difficult)
    plot_errors = partial(figures.plot_errors, faces=s.faces, largest=largest)
    caption_rms = partial(figures.caption_rms, k=s.plan.betas)
    return page(
        "triangles.html",
        title="Vertices or triangles: SMPL beside SCAPE and BlendSCAPE",
        study=s,
        summary=in_short(s),
        remarks=REMARKS,
        lecture=lecture_table(s),
        results=result_table(s),
        choices=choice_table(s),
        claim=claim(s),
        soup=plotted(10.5, 4.6, plot_stitching, caption_soup, s.torn),
        curves=[
            plotted(6.4, 4.6, figures.plot_explained, figures.caption_explained, s.shapes),
            plotted(6.4, 4.6, figures.plot_rms, caption_rms, s.shapes),
        ],
        poses=[
            plotted(
                10.5, 3.4, plot_errors, partial(figures.caption_errors, name), s.difficult[name]
            )
            for name in SHOWN
        ],
        jumps=[s.result(without_bends(name)).seam_jump for name in (SCAPE, BLEND_SCAPE)],
    )


def caption_soup(stages: Mapping[str, Array]) -> str:
    """The caption of the stages (F, 3, 3) m: how far edges are apart before and after stitching."""
    *_, torn, stitched = stages.values()
    return caption_stitching(torn, stitched)
