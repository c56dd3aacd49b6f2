"""Suites of problems on which solvers are compared.

| suite | problems | known |
| --- | --- | --- |
| `bodies` | 17 fits of synthetic people, graded; start 0 or a random one | answer or best cost |
| `more-wild` | 54 sums of squares, 2 to 100 unknowns, near and far starts | best cost |
| `nist` | 12 regressions of NIST's, 2 to 8 unknowns, 2 starts | answer, deviations: 11 digits |
| `training` | 5 small trainings of SMPL, 744 to 888 unknowns | best cost |
| `triangles` | 7 small trainings of SCAPE and BlendSCAPE, 276 to 702 unknowns | best cost |

Each problem is an experiment with a name of its own: `workbench run nist-misra1a --set start=2`.
"""

from collections.abc import Mapping

from workbench.experiments.body_problems import BODIES
from workbench.experiments.experiment import Experiment
from workbench.experiments.model_fits import MODEL_FITS
from workbench.experiments.more_wild import MORE_WILD
from workbench.experiments.nist import NIST
from workbench.experiments.small_trainings import TRAINING
from workbench.experiments.triangle_learning import TRIANGLES

SUITES: Mapping[str, tuple[Experiment, ...]] = {
    "nist": NIST,
    "more-wild": MORE_WILD,
    "bodies": (*BODIES, *MODEL_FITS),
    "training": TRAINING,
    "triangles": TRIANGLES,
}
SUMMARIES: Mapping[str, str] = {
    "nist": "regressions, answers certified by NIST",
    "bodies": "fits of synthetic people, graded",
    "more-wild": "sums of squares of Moré and Wild",
    "training": "small trainings of SMPL on symbols",
    "triangles": "small trainings of SCAPE and BlendSCAPE on symbols",
}
