"""`workbench body`: what a body is, whether a file of one is right, sliders and C code."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.catalogue import BODIES, load_body
from workbench.bodies.checking.check_file import check_body_file, check_contents
from workbench.bodies.files.c_code import JOINTS, write_c
from workbench.bodies.files.saving import arrays_of
from workbench.cli.console import folder_to_write, print_page, rich_table, say
from workbench.cli.options import Fit, Frame
from workbench.cli.run import Out
from workbench.environment import expanded
from workbench.errors import BadArgument
from workbench.reports import card_text, write_card
from workbench.reports.folder import make_folder
from workbench.reports.page import Table
from workbench.reports.sliders import pose_and_betas, settings_of, write_sliders

Name = Annotated[
    str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
]
EXIT_WARNED = 1  # the exit code of `check` if there are warnings
KEYS_HEAD = ("key", "shape and type", "what becomes of it")


def card(name: Name = "default", out: Out = Path("runs")) -> None:
    """Print a body's model card, and write its page, with figures."""
    console = Console()
    model = load_body(name)
    texts = {name: text for name, text in model.card.items() if not isinstance(text, dict)}
    say(console, escape(card_text(replace(model, card=texts))))
    source = "" if name in BODIES else str(expanded(name).resolve())
    folder = folder_to_write(out, f"body-{Path(name).stem}", source)
    print_page(console, "card", write_card(model, folder, source))


def check(
    file: Annotated[
        str,
        typer.Argument(
            help="The file of a model (.npz or .pkl of SMPL, SMPL-H, SMPL-X, MANO, FLAME, STAR, or "
            "one that the workbench wrote), or the name of an embedded body."
        ),
    ],
) -> None:
    """Say what a model file is, and what is wrong with it.

    It also says which of the file's keys are used and kept. Each warning says what to do. The exit
    code is 0 if there are none, 1 if there are, and 2 if the file cannot be read.
    """
    console = Console()
    if file in BODIES:
        file_check = check_contents(dict(arrays_of(load_body(file))), file)
    else:
        file_check = check_body_file(file)
    widest = max(map(len, file_check.facts))
    say(console, f"[bold]{escape(file_check.path)}[/]")
    for name, text in file_check.facts.items():
        say(console, f"  {escape(f'{name:{widest}}')}  {escape(text)}")
    console.print()
    console.print(rich_table(Table(KEYS_HEAD, file_check.keys, numbers=())))
    console.print()
    for finding, line in zip(file_check.findings or [None], file_check.lines(), strict=True):
        warned = finding is not None and finding.warning
        say(console, f"[bold yellow]{escape(line)}[/]" if warned else escape(line))
    if file_check.warnings:
        raise typer.Exit(EXIT_WARNED)


def sliders(
    name: Name = "default",
    place: Fit = None,
    frame: Frame = 0,
    out: Annotated[Path, typer.Option(help="Folder that the page is written to.")] = Path("runs"),
) -> None:
    """Write a page with sliders for pose and shape.

    Switches turn the parts of the model off and on.
    """
    model = load_body(name)
    path = out / f"sliders-{Path(name).stem}.html"
    start = None
    if place is not None:
        start = settings_of(*pose_and_betas(expanded(place), model, frame), model)
    make_folder(out)
    print_page(Console(), "page", write_sliders(model, path, start, str(place or "")))


def code(
    out: Annotated[Path, typer.Option(help="The file, .c; a header, .h, is written beside it.")],
    name: Name = "default",
    points: Annotated[
        str, typer.Option(help="What it computes: joints, or a landmark set such as coco.")
    ] = JOINTS,
) -> None:
    """Write a function of pose, betas and trans as C code.

    It computes joints or landmarks.
    """
    if out.suffix.lower() != ".c":
        raise BadArgument(f"--out takes a file that ends in .c, not {out}")
    write_c(out, load_body(name), points)
    print_page(Console(), "code", out)


COMMANDS: dict[str, Callable[..., None]] = {
    "card": card,
    "check": check,
    "sliders": sliders,
    "code": code,
}
HELP = "Bodies: their cards, files, sliders and code."
