"""Named problems with a start and, where there is one, a known answer."""

from workbench.experiments.catalogue import EXPERIMENTS, find
from workbench.experiments.experiment import Experiment, Outcome, Setup, run

__all__ = ["EXPERIMENTS", "Experiment", "Outcome", "Setup", "find", "run"]
