"""A named problem: a function that builds its setup, and the arguments of that function."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from workbench.errors import BadSetup
from workbench.experiments.user_errors import user_errors
from workbench.fitting.setup import Setup


@dataclass(frozen=True)
class Experiment:
    """A function that builds a setup, and its arguments.

    A setup holds symbols, which cannot be pickled; an experiment can be, if its function can.

    Attributes:
        name: by which the command line knows it.
        build: the function that returns a Setup.
        summary: one line for lists.
        arguments: those of `build` that differ from its defaults.
        source: the user's file that it is from or about; empty if it comes with the workbench.
    """

    name: str
    build: Callable[..., Setup]
    summary: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""

    def setup(self) -> Setup:
        """Build the setup.

        Raises BadFile with the line if the user's file is wrong, and BadArgument if an argument
        is.
        """
        with user_errors(self.source, self.name, self.arguments):
            setup = self.build(**self.arguments)
            if not isinstance(setup, Setup):
                raise BadSetup(
                    f"the function that builds it must return a Setup, not {setup!r:.80}"
                )
            return setup
