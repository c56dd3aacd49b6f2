"""All cases of the gym."""

from benchmarks.gym.bodies import FAR_BODIES
from benchmarks.gym.case import Case, case
from benchmarks.gym.chains import CHAINS
from benchmarks.gym.curves import CURVES
from benchmarks.gym.farther import FARTHER
from benchmarks.gym.mgh import MGH
from benchmarks.gym.outliers import ROBUST
from benchmarks.gym.published import PUBLISHED
from benchmarks.gym.reaching import ARMS
from benchmarks.gym.regressions import REGRESSIONS
from benchmarks.gym.reprojection import BUNDLES
from workbench.experiments import SUITES
from workbench.experiments.more_wild import FAMILIES, MORE_WILD, more_wild
from workbench.experiments.nist import nist

TUNED_NIST: tuple[Case, ...] = tuple(
    case(one.name, "nist, tuned", nist, {**one.arguments, "start": start}, f"start {start}")
    for one in SUITES["nist"]
    for start in (1, 2)
)
TUNED_SUMS: tuple[Case, ...] = (
    *(
        case(
            f"more-wild-{one.arguments['function']}-{one.arguments['n']}",
            "more-wild, tuned",
            more_wild,
            one.arguments,
            f"start x {one.arguments['scale']:g}",
        )
        for one in MORE_WILD
    ),
    *(
        case(
            f"more-wild-{function}-{n}",
            "more-wild, tuned",
            more_wild,
            {"function": function, "n": n, "scale": 100.0},
            "start x 100",
        )
        for function, family in FAMILIES.items()
        for n in family.sizes
        if function != "mancino"  # whose start is nearly its answer, in units of its own
    ),
)
NEW: tuple[Case, ...] = (
    *REGRESSIONS,
    *MGH,
    *PUBLISHED,
    *CHAINS,
    *CURVES,
    *ROBUST,
    *BUNDLES,
    *ARMS,
    *FAR_BODIES,
)
CASES: tuple[Case, ...] = (*TUNED_NIST, *FARTHER, *TUNED_SUMS, *NEW)
