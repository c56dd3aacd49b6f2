"""emcee, imported when something is sampled: everything else works without it."""

from types import ModuleType

from workbench.environment import optional_library


def emcee() -> ModuleType:
    """The module emcee. Raises MissingLibrary where it is not installed."""
    return optional_library("emcee", "drawing a posterior by ensembles of walkers")
