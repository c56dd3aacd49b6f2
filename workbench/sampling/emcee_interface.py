"""emcee, imported when something is sampled: everything else works without it."""

from types import ModuleType

from workbench.installation import library


def emcee() -> ModuleType:
    """The module emcee. Raises MissingLibrary where it is not installed."""
    return library("emcee", "drawing a posterior by ensembles of walkers")
