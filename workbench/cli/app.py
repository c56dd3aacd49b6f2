"""All commands by name and group; the file of each is imported when it is run."""

from collections.abc import Callable
from functools import cached_property, wraps
from importlib import import_module
from typing import Annotated, Any, NamedTuple, ParamSpec

import typer
from typer.core import TyperCommand

from workbench.cli import INTERRUPTED, defer_signals, interrupts_say
from workbench.environment import DISTRIBUTION, VERSION

P = ParamSpec("P")
FIT, UNDERSTAND, COMPARE = "Fit", "Understand a fit", "Compare solvers"
MODELS, FILES, ELSE = "Models", "Motions and files", "Course and others"


class Verb(NamedTuple):
    """A command: the file that has a function of its name, its group in the help, and its line."""

    file: str
    group: str
    summary: str


VERBS = {
    "run": Verb("run", FIT, "Run an experiment and write its report to runs/NAME/."),
    "fit": Verb("fit", FIT, "Fit a body to keypoints, images, a video, markers or a mesh."),
    "register": Verb("register", FIT, "Register scans, each by itself."),
    "coregister": Verb("register", FIT, "Register scans and learn their model together."),
    "diagnose": Verb(
        "diagnose", UNDERSTAND, "What a fit cannot determine, and what to do about it."
    ),
    "design": Verb("diagnose", UNDERSTAND, "What to measure next so that most is known."),
    "sample": Verb("sample", UNDERSTAND, "Draw from the posterior of a fit, and judge the draws."),
    "live": Verb("run", UNDERSTAND, "Move a body by hand in the browser, and watch solvers."),
    "compare": Verb("compare", COMPARE, "Compare solvers on problems; it continues after a stop."),
    "solvers": Verb("compare", COMPARE, "List the solvers, what they can do, and their sources."),
    "body": Verb("body", MODELS, "A body's card, sliders and C code; what is wrong with a file."),
    "measure": Verb("measure", MODELS, "Stature, lengths and girths of a body, in metres."),
    "train": Verb("train", MODELS, "Train a body from registrations; it continues after a stop."),
    "rig": Verb("train", MODELS, "Find skeleton and skinning weights of meshes in motion."),
    "motion": Verb("motion", FILES, "What a file of a motion or of markers holds; convert it."),
    "convert": Verb("motion", FILES, "Turn the motion of one body into that of another."),
    "lecture": Verb("lecture", ELSE, "Lectures that can be run, and exercises that are graded."),
    "new": Verb("new", ELSE, "Write a commented file of your own that works as it is."),
    "info": Verb("info", ELSE, "Print versions, threads, the compiler and the cache."),
}


class Later(TyperCommand):
    """A command of which only the name is known until it is run, or asked for its options."""

    @cached_property
    def command(self) -> Any:
        """The command itself. Signals wait until its file has been imported."""
        with defer_signals():
            file = import_module(f"{__package__}.{VERBS[str(self.name)].file}")
        several = getattr(file, "COMMANDS", None)
        if several is None:
            own = typer.Typer(add_completion=False, rich_markup_mode=None)
            function = getattr(file, str(self.name).replace("-", "_"))
            own.command(self.name)(interruptible(function))
        else:
            own = typer.Typer(
                help=file.HELP, no_args_is_help=True, add_completion=False, rich_markup_mode=None
            )
            for name, command in several.items():
                own.command(name)(interruptible(command))
        return typer.main.get_command(own)

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """The context of the command itself."""
        return self.command.make_context(*arguments, **options)

    def get_params(self, ctx: Any) -> list[Any]:
        """The arguments and options of the command itself."""
        return list(self.command.get_params(ctx))


def interruptible(command: Callable[P, None]) -> Callable[P, None]:
    """A command in which an interrupt, wherever it occurs, ends in a sentence."""

    @wraps(command)
    def run_it(*arguments: P.args, **options: P.kwargs) -> None:
        with interrupts_say(lambda: INTERRUPTED):
            command(*arguments, **options)

    return run_it


app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


def tell_version(wanted: bool) -> None:
    """Print the distribution's name and version, and exit."""
    if wanted:
        typer.echo(f"{DISTRIBUTION} {VERSION}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=tell_version,
            is_eager=True,
            help="Print the name and the version.",
        ),
    ] = False,
) -> None:
    """Fit a symbolic SMPL body model, and see what the fit cannot determine."""


def _placeholder() -> None:
    """What Typer is given in place of a command: `Later` finds the command itself."""


for name, verb in VERBS.items():
    app.command(name, cls=Later, help=verb.summary, rich_help_panel=verb.group)(_placeholder)
