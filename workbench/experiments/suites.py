"""Suites of problems on which solvers are compared.

| suite | problems | known |
| --- | --- | --- |
| `nist` | 12 regressions of NIST's, 2 to 8 unknowns, 2 starts | answer, deviations: 11 digits |

Each problem is an experiment with a name of its own: `workbench run nist-misra1a --set start=2`.
"""

from collections.abc import Mapping

from workbench.experiments.experiment import Experiment
from workbench.experiments.nist import NIST

SUITES: Mapping[str, tuple[Experiment, ...]] = {
    "nist": NIST,
}
SUMMARIES: Mapping[str, str] = {
    "nist": "regressions with answers certified by NIST; start=1 or 2",
}
