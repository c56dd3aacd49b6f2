"""What studies share: a plan's fields as options, and results in a folder."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from workbench.errors import WorkbenchError
from workbench.plots.style import figure_of, png
from workbench.reports.folder import Content, write_folder
from workbench.reports.page import Table

Plan = TypeVar("Plan")
Report = Callable[[str], None]  # takes a line about what a study does next
Drawing = tuple[float, float, Callable[..., object]]  # width and height in inches; draws on `ax`


def report(line: str) -> None:
    """Print what a study does next."""
    print(line, flush=True)


def arguments(plan: type[Plan], about: str, *paths: str) -> tuple[Plan, argparse.Namespace]:
    """The plan that the command line asks for, with an option for each field; and all arguments.

    `paths` are the names of further arguments or options that are paths. The folder is `out`. Ends
    the program where an option or the plan is wrong.
    """
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    for name in paths:
        parser.add_argument(name, type=Path)
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder of the results")
    for field in fields(plan):  # type: ignore[arg-type]  # a dataclass
        default: Any = field.default
        several = isinstance(default, tuple)
        parser.add_argument(
            f"--{field.name.replace('_', '-')}",
            type=type(default[0] if several else default),
            nargs="+" if several else None,
            default=default,
            help=" ",  # so that the default is shown
        )
    chosen = parser.parse_args()
    values = {f.name: getattr(chosen, f.name) for f in fields(plan)}  # type: ignore[arg-type]
    try:
        made = plan(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
    except WorkbenchError as error:
        parser.error(str(error))
    return made, chosen


def write_study(
    folder: Path,
    tables: Sequence[Table],
    data: Mapping[str, Any],
    figures: Mapping[str, Drawing],
    others: Mapping[str, Content] | None = None,
) -> None:
    """Write tables.txt, summary.json with the data, NAME.png of each figure, and other files.

    The folder is written whole or not at all. The tables are printed as well.
    """
    text = "\n\n".join("\n".join(table.lines()) for table in tables)

    def picture(width: float, height: float, draw: Callable[..., object]) -> Content:
        return lambda path: path.write_bytes(png(figure_of(draw, width, height)))

    pictures = {f"{name}.png": picture(*drawing) for name, drawing in figures.items()}
    write_folder(folder, "", {"tables.txt": text + "\n", **pictures, **(others or {})}, data)
    print(f"{text}\n\nwritten to {folder}")
