"""Solvers end when they are told to, whatever the objective does.

NLopt's COBYLA, shown a NaN, loops in C for ever, whatever its limits; so all of this runs in a
process that can be killed.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.solvers.misbehaving import EVERYBODY, KINDS

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).parents[2]
HARD_TIMEOUT = 600.0  # of the process, which only kills what hangs

ENDS = {
    "nan": {"NOT_FINITE", "MAX_SECONDS"},
    "infinite": {"NOT_FINITE", "MAX_SECONDS"},
    "now and then": {"NOT_FINITE", "MAX_SECONDS", "STALLED", "CONVERGED"},
    "raises": {"RAISED"},
    "slow": {"MAX_SECONDS"},
}


@pytest.fixture
def calls() -> dict[tuple[str, str], tuple[float, str]]:
    """(algorithm, misbehaviour) -> seconds, status."""
    command = [sys.executable, "-m", "tests.solvers.misbehaving"]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=HARD_TIMEOUT, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    return {(name, kind): (float(seconds), status) for name, kind, seconds, status in rows}


def test_every_algorithm_ends_on_misbehaving_objectives(
    calls: dict[tuple[str, str], tuple[float, str]],
) -> None:
    """One test, so that the calls are made once, and not by every process of a test run."""
    assert calls.keys() == {(name, kind) for name in EVERYBODY for kind in KINDS}
    for kind in KINDS:
        ended = {name: status for (name, k), (_, status) in calls.items() if k == kind}
        assert set(ended.values()) <= ENDS[kind], ended
