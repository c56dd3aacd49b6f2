"""SMPL beside SCAPE and BlendSCAPE as a page, as text, and as data."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.bodies.gltf import write_gltf
from workbench.plots import Figure, caption_stitching, house_style, plot_stitching, sheet
from workbench.plots import triangles as drawn
from workbench.reports.figures import shown
from workbench.reports.folder import MAKER, SUMMARY, replacing_folder
from workbench.reports.page import page
from workbench.reports.summary import as_json, versions
from workbench.reports.tables import Table
from workbench.training.triangles.comparison import Explained
from workbench.training.triangles.models import BLEND_SCAPE, SCAPE, SMPL
from workbench.training.triangles.study import SHOWN, Study

SKINNED = "smpl.glb"
KNOWN = (
    "Everybody here is synthetic: people are drawn from artists' shape targets, and what pose does "
    "to them is a finer rig under dual quaternions. Poses are learned from draws of a Gaussian of "
    "recorded poses.",
    "Nobody is told a pose or a shape. SMPL is trained first, by the training pipeline, from the "
    "mean person cut into parts. SCAPE and BlendSCAPE take over its weights and joint regressor "
    "and begin at its poses and the subjects' rest shapes; then each finds its own in turn: S from "
    "everybody who stands, Q, poses by the same pose solver on its own surface, and each "
    "subject's D.",
    "All models are fitted to strangers alike: the same first guess, edges and then vertices, the "
    "same solver and steps, betas ordinary at one standard deviation. A pose of one model is not "
    "that of another, nor that of the rig behind the meshes: each learns what zero is.",
    f"{SKINNED}, beside this page, is SMPL's mean person in the hard poses below, with a skeleton "
    "that any viewer moves. A glTF blends motions of bones and adds shapes to the rest surface; a "
    "body whose surface is the solution of a linear system can only be written mesh by mesh.",
    "Times are those of one core of the machine that made this page, the least of several, after "
    "everything that is made once. The bodies on the full mesh are those in the package, SCAPE and "
    "BlendSCAPE on its skeleton without a Q that was learned: the numbers change no time.",
)


def in_one_sentence(s: Study) -> str:
    """Why one is additive and the other multiplicative, and what that costs."""
    smpl, scape = s.outcome(SMPL), s.outcome(SCAPE)
    fast, slow = (next(c for c in s.costs if (c.mesh, c.model) == ("full", m)) for m in
                  (SMPL, SCAPE))  # fmt: skip
    return (
        "SMPL adds what shape and pose do to each vertex before one linear blend moves it, so "
        f"either can be learned, looked at and exported without the other (together they differ by "
        f"{smpl.gap:.1g} mm from the sum); SCAPE multiplies what they do to each triangle, so pose "
        f"deforms a body in proportion to its shape (here {scape.gap:.2g} mm away from the sum), "
        "and pays with a linear system over the whole mesh for every surface: on "
        f"{slow.n_faces:,} triangles {slow.vertices_ms:.0f} ms instead of {fast.vertices_ms:.1f}, "
        f"and a Jacobian of which {slow.density:.0%} instead of {fast.density:.0%} is not zero, in "
        f"{slow.jacobian_ms:,.0f} ms instead of {fast.jacobian_ms:.0f}."
    )


def lecture_table(s: Study) -> Table:
    """The lecture's SMPL against SCAPE, filled by what was measured."""
    outcomes = [s.outcome(name) for name in SHOWN]
    own = {c.model: c for c in s.costs if c.mesh == s.plan.body}
    full = {c.model: c for c in s.costs if c.mesh == "full"}
    base = [s.shapes.learned["vertices"]] + 2 * [s.shapes.learned["triangles"]]
    rows: list[tuple[str, ...]] = [
        ("deforms", "vertices", "triangles, rigid parts", "triangles, blended parts"),
        ("shape and pose are", "added", "multiplied", "multiplied"),
        ("together less each alone (mm)", *(f"{o.gap:.2g}" for o in outcomes)),
        ("skeleton", "joints that move with shape", "rotations of parts, no bones",
         "rotations of parts, no bones"),
        ("as a skinned glTF, to be moved elsewhere", SKINNED, "no", "no"),
        ("linear system for a surface", "none", *(2 * ["one, factorised once"])),
        ("numbers learned", *(f"{o.parameters:,}" for o in outcomes)),
        *((f"directions for {level:.0%} of the vertices' variance",
           *(count(e, level) for e in base)) for level in drawn.LEVELS),
        ("strangers at rest, rms (mm)", *(mm(o.rest) for o in outcomes)),
        ("strangers in unseen poses, rms (mm)", *(f"{o.rms:.2f}" for o in outcomes)),
        (f"jump where parts meet (synthetic truth {s.true_crease:.3f})",
         *(f"{o.crease:.3f}" for o in outcomes)),
    ]  # fmt: skip
    for name, cost in ((s.plan.body, own), ("full", full)):
        faces = f"{cost[SMPL].n_faces:,} triangles"
        rows += [
            (f"surface of {name}, {faces} (ms)",
             *(f"{cost[m].vertices_ms:.2f}" for m in SHOWN)),
            (f"residual and Jacobian of {name} (ms)",
             *(f"{cost[m].jacobian_ms:,.1f}" for m in SHOWN)),
            (f"of that Jacobian not zero ({name})", *(f"{cost[m].density:.0%}" for m in SHOWN)),
        ]  # fmt: skip
    return Table(("", *SHOWN), tuple(rows), (1, 2, 3))


def outcome_table(s: Study) -> Table:
    """All models, with what they learned of pose and without."""
    head = ("model", "numbers", "learned from", "at rest", "rms", "mean", "largest", "jump",
            "together less each alone")  # fmt: skip
    rows = tuple(
        (o.model, f"{o.parameters:,}", mm(o.learned), mm(o.rest), f"{o.rms:.2f}",
         f"{o.mean:.2f}", f"{o.largest:.1f}", f"{o.crease:.3f}", f"{o.gap:.2g}")
        for o in s.outcomes
    )  # fmt: skip
    return Table(head, rows, tuple(range(1, len(head))))


def mm(distance: float | None) -> str:
    """To the hundredth, where it was measured."""
    return "" if distance is None else f"{distance:.2f}"


def choice_table(s: Study) -> Table:
    """What held pose's part of each model, and what that left of the subjects held back."""
    rows = tuple(
        (name, "sigma of P, m" if name == SMPL else "ridge of Q, m²",
         "; ".join(f"{tried:g}: {left:.2f}"
                   for tried, left in zip(c.tried, c.left, strict=True)), f"{c.chosen:g}")
        for name, c in s.choices.items()
    )  # fmt: skip
    return Table(("model", "held by", "left of subjects held back, rms mm", "chosen"), rows, (3,))


def claim(s: Study) -> str:
    """What there is to "10 against 300" on these people."""
    v, t = (s.shapes.learned[name] for name in ("vertices", "triangles"))
    own = s.shapes.gradients
    most = len(own) - 1
    counts = "; ".join(
        f"{level:.0%}: {count(v, level)} directions of vertices, {count(t, level)} of triangles "
        f"once stitched, {count(Explained(own, own), level)} for the gradients' own variance"
        for level in drawn.LEVELS
    )
    return (
        f"The lecture has 10 directions of SMPL against some 300 of SCAPE. Measured on "
        f"{s.plan.people} synthetic people, who span {most} directions at most: {counts}. "
        f"At every k from 1 to {most} vertices explained at least as much as triangles, as the "
        f"theorem says; the least difference of the shares was {s.shapes.leads.min():.0e}, the "
        f"largest {s.shapes.leads.max():.3f}. How many directions are needed depends on what is "
        "counted, a surface or its gradients, and on whom; 300 is no property of the model."
    )


def count(explained: Explained, level: float) -> str:
    """How many directions, or that there are not so many."""
    found = explained.count_for(level)
    return f"more than {len(explained.share) - 1}" if found is None else str(found)


def triangles_text(s: Study) -> str:
    """Both tables for a terminal."""
    parts = []
    for table in (lecture_table(s), outcome_table(s), choice_table(s)):
        lines = [table.head, *table.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(table.head))]
        parts.append("\n".join(
            "  ".join(cell.rjust(w) if i else cell.ljust(w)
                      for i, (cell, w) in enumerate(zip(line, widths, strict=True))).rstrip()
            for line in lines
        ))  # fmt: skip
    return "\n\n".join(parts)


def triangles_data(s: Study) -> dict[str, Any]:
    """Every number of it."""
    shapes = s.shapes
    return {
        "made_by": MAKER,
        "kind": "triangles",
        "name": "triangles",
        "source": "",
        "plan": asdict(s.plan),
        "test": s.said,
        "explained": {
            f"{name}, {who}": {"share": list(e.share), "rms_m": list(e.rms)}
            for who, group in (("learned", shapes.learned), ("strangers", shapes.strangers))
            for name, e in group.items()
        },
        "gradients": list(shapes.gradients),
        "outcomes": [asdict(o) for o in s.outcomes],
        "choices": {name: asdict(c) | {"chosen": c.chosen} for name, c in s.choices.items()},
        "true_jump": s.true_crease,
        "costs": [asdict(c) for c in s.costs],
        "versions": versions(),
    }


def write_triangles(study: Study, folder: str | Path) -> Path:
    """Write the folder of a study and return its page; whole or not at all."""
    target = Path(folder)
    with replacing_folder(target, "") as fresh:
        (fresh / "index.html").write_text(triangles_page(study), encoding="utf-8")
        (fresh / "tables.txt").write_text(triangles_text(study) + "\n", encoding="utf-8")
        summary = triangles_data(study) | {"files": ["index.html", "tables.txt", SKINNED, SUMMARY]}
        (fresh / SUMMARY).write_text(as_json(summary), encoding="utf-8")
        write_gltf(fresh / SKINNED, study.smpl, study.poses)
    return target / "index.html"


def triangles_page(s: Study) -> str:
    """The page."""
    torn, largest = list(s.torn.values()), drawn.largest_shown(s.hard)
    curves = [
        (_sheet(6.4, 4.6, lambda ax: drawn.plot_explained(s.shapes, ax=ax)),
         drawn.caption_explained(s.shapes)),
        (_sheet(6.4, 4.6, lambda ax: drawn.plot_left(s.shapes, ax=ax)),
         drawn.caption_left(s.shapes, s.plan.betas)),
    ]  # fmt: skip
    poses = [
        (_sheet(10.5, 3.4, _errors(s, name, largest)), drawn.caption_errors(name, s.hard[name]))
        for name in SHOWN
    ]
    soup = _sheet(10.5, 4.6, lambda ax: plot_stitching(s.torn, ax=ax))
    return page(
        "triangles.html",
        title="Vertices or triangles: SMPL beside SCAPE and BlendSCAPE",
        study=s,
        sentence=in_one_sentence(s),
        known=KNOWN,
        lecture=lecture_table(s),
        outcomes=outcome_table(s),
        choices=choice_table(s),
        claim=claim(s),
        soup=shown(soup, caption_stitching(torn[-2], torn[-1])),
        curves=[shown(*one) for one in curves],
        poses=[shown(*one) for one in poses],
        jumps=[s.outcome(n).crease for n in (f"{SCAPE}, Q = I", f"{BLEND_SCAPE}, Q = I")],
        versions=versions(),
    )


def _errors(s: Study, name: str, largest: float) -> Any:
    return lambda ax: drawn.plot_errors(s.hard[name], s.faces, largest, ax=ax)


def _sheet(width: float, height: float, draw: Any) -> Figure:
    with house_style():
        figure, (ax,) = sheet(width, height)
        draw(ax)
    return figure
