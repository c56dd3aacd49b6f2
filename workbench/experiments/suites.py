"""Suites of problems on which solvers are compared.

| suite | problems | known |
| --- | --- | --- |
| `bodies` | 13 fits of synthetic people, graded; start 0 or a random one | answer or best cost |
| `more-wild` | 54 sums of squares, 2 to 100 unknowns, near and far starts | best cost |
| `nist` | 12 regressions of NIST's, 2 to 8 unknowns, 2 starts | answer, deviations: 11 digits |

Each problem is an experiment with a name of its own: `workbench run nist-misra1a --set start=2`.
"""

from collections.abc import Mapping

from workbench.experiments.body_problems import BODIES
from workbench.experiments.experiment import Experiment
from workbench.experiments.more_wild import MORE_WILD
from workbench.experiments.nist import NIST

SUITES: Mapping[str, tuple[Experiment, ...]] = {
    "nist": NIST,
    "more-wild": MORE_WILD,
    "bodies": BODIES,
}
SUMMARIES: Mapping[str, str] = {
    "nist": "regressions, answers certified by NIST",
    "bodies": "fits of synthetic people, graded",
    "more-wild": "sums of squares of Moré and Wild",
}
