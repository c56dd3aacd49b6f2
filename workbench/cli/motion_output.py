"""Writing a motion to a file, whose suffix says how."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.cli.output import say
from workbench.errors import BadArgument, BadBody
from workbench.motions import Motion, save_motion, write_bvh, write_glb

MOTIONS = (".bvh", ".npz", ".glb")  # what is written
SHAPES = 10  # shape directions that become morph targets
EXACT = "exact"


def refuse_suffix(out: Path | None, suffixes: tuple[str, ...], what: str) -> None:
    """Raise BadArgument for an output that ends in none of the suffixes."""
    if out is not None and out.suffix.lower() not in suffixes:
        raise BadArgument(f"{what} can be written as {' or '.join(suffixes)}, and not as {out}")


def number_of_correctives(text: str) -> int | None:
    """The number that `--correctives` gives; None for `exact`. Raises BadArgument."""
    if text.strip().lower() == EXACT:
        return None
    if not text.strip().isdecimal() or len(text) > 9:
        raise BadArgument(
            f"--correctives takes {EXACT}, or a whole number from 0, not {text!r:.40}"
        )
    return int(text)


def write_motion(
    console: Console,
    out: Path,
    motion: Motion,
    body: Body | None,
    correctives: int | None = None,
    shapes: int = 0,
    betas: Array | None = None,
) -> None:
    """Write a motion as .bvh, .npz or .glb, and say where; a .glb needs a body.

    `betas` (T, B) take the place of the motion's own in a .glb.
    """
    suffix = out.suffix.lower()
    if suffix == ".bvh":
        write_bvh(out, motion, body)
    elif suffix == ".npz":
        save_motion(out, motion)
    else:
        if not isinstance(body, SkinnedBody):
            raise BadBody(
                why_not_skinned(body, "a .glb", "write .npz or .bvh, or take another body")
            )
        if correctives is not None or shapes:
            used = min(shapes, body.n_betas)
            found = write_glb(out, motion, body, correctives=correctives, shapes=used)
            say(console, f"{used} shape directions, {found}")
            say(console, f"size: {out.stat().st_size / 1e6:.2f} MB")
        else:
            write_glb(out, motion, body, betas=betas)
    say(console, f"motion: {escape(str(out))}")
