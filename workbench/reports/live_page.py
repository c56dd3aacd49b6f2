"""The page of `workbench live`, and the server behind it."""

from workbench.errors import BadArgument, NotSupported
from workbench.experiments.running import warm_up
from workbench.fitting.setup import Setup
from workbench.reports.page import page
from workbench.reports.replay.live import LiveServer, moved_by_hand
from workbench.reports.replay.runs import recorded_start
from workbench.solvers import SOLVERS
from workbench.solvers.abilities import refuse

OFFERED = 12  # solvers on a page at most, those that the problem compares first


def live_server(name: str, setup: Setup, port: int = 0) -> LiveServer:
    """A server for a setup: its page offers the solvers that can take the problem.

    Raises BadArgument where no start can be set by hand, or for a body that a page cannot pose, and
    OSError for a port that is taken.
    """
    moved_by_hand(setup)
    recording = recorded_start(setup)
    if recording is None:
        raise BadArgument(f"a page cannot pose the body of {name}; take a skinned body of SMPL's")
    order = dict.fromkeys((*setup.compared, *SOLVERS))
    able = [one for one in order if _takes(one, setup)][:OFFERED]
    solvers = {
        one: SOLVERS[one] if setup.strategy is None else setup.strategy(SOLVERS[one])
        for one in able
    }
    text = page(
        "live.html",
        title=name,
        question=setup.question,
        recording=recording,
        solvers=able,
    )
    warm_up(setup, solvers.values())  # so that no press waits
    return LiveServer(setup, solvers, text, port)


def _takes(name: str, setup: Setup) -> bool:
    try:
        refuse(name, SOLVERS[name].abilities, setup.problem)
    except NotSupported:
        return False
    return True
