"""Named problems with a start and, where there is one, a known answer."""

from workbench.experiments.catalogue import EXPERIMENTS, SUITES, find
from workbench.experiments.experiment import Experiment
from workbench.experiments.running import Outcome, run
from workbench.fitting.setup import KnownAnswer, Setup

__all__ = ["EXPERIMENTS", "SUITES", "Experiment", "KnownAnswer", "Outcome", "Setup", "find", "run"]
