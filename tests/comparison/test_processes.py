"""Processes to work in: whatever they are at, they end when they are told to."""

import signal
import socket
import subprocess
import sys
from types import SimpleNamespace
from typing import cast

import pytest

from workbench.processes.fork_server import FORKING, Forked, ForkServer

SLEEPER = (sys.executable, "-c", "import time; time.sleep(30)")


@pytest.mark.skipif(not FORKING, reason="nothing can be forked here")
def test_one_forked_a_moment_ago_is_killed_though_it_leads_no_group_yet() -> None:
    """Between the fork and its setsid: whoever then waited for it waited for ever."""
    ours, theirs = socket.socketpair()
    with ours, theirs, subprocess.Popen(SLEEPER) as child:
        parent = SimpleNamespace(wait=lambda pid: child.wait(timeout=20))
        assert Forked(cast(ForkServer, parent), child.pid, ours).end() == -signal.SIGKILL
