"""Named problems with a start and, where there is one, a known answer."""

from workbench.experiments.catalogue import EXPERIMENTS, find
from workbench.experiments.experiment import Experiment, Outcome, Setup, run
from workbench.experiments.known import Known
from workbench.experiments.suites import SUITES

__all__ = ["EXPERIMENTS", "SUITES", "Experiment", "Known", "Outcome", "Setup", "find", "run"]
