"""The server of a live page: what it answers, what it refuses, and how its solves end."""

import http.client
import json
import threading
import time
from base64 import urlsafe_b64encode
from collections.abc import Iterator
from functools import cache
from typing import Any
from urllib.parse import urlencode, urlsplit

import numpy as np
import pytest
from typer.testing import CliRunner

from workbench.arrays import Array
from workbench.cli.app import app
from workbench.errors import BadArgument
from workbench.experiments import find
from workbench.fitting.setup import Setup
from workbench.reports.replay.live import LiveServer
from workbench.reports.replays import live_server
from workbench.solvers import SOLVERS


@cache
def setup() -> Setup:
    return find("landmarks", {"body": "small"}).setup()


@pytest.fixture(scope="module")
def server() -> Iterator[LiveServer]:
    made = live_server("landmarks", setup())
    thread = threading.Thread(target=made.serve)
    thread.start()
    yield made
    made.close()
    thread.join(timeout=10)
    assert not thread.is_alive()


def start(server: LiveServer, pose: Array | None = None) -> str:
    numbers = server.row(setup().start).copy()
    if pose is not None:
        numbers[: pose.size] = pose.ravel()
    return urlsafe_b64encode(numbers.astype("<f8").tobytes()).decode()


def asked(
    server: LiveServer, what: str = "", headers: dict[str, str] | None = None, **query: str
) -> http.client.HTTPResponse:
    address = urlsplit(server.address)
    assert address.hostname is not None
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=60)
    given = f"?{urlencode(query)}" if query else ""
    connection.request("GET", address.path + what + given, headers=headers or {})
    return connection.getresponse()


def events(text: str) -> list[tuple[str, Any]]:
    found = []
    for event in text.strip().split("\n\n"):
        name, data = event.split("\n")
        found.append((name.removeprefix("event: "), json.loads(data.removeprefix("data: "))))
    return found


def test_live_page_is_served_and_offers_solvers(server: LiveServer) -> None:
    response = asked(server)
    text = response.read().decode()
    assert response.status == 200
    assert "data-live=" in text
    assert all(name in text for name in server.solvers)
    assert "trust-region" in server.solvers


def test_live_server_refuses_other_sites(server: LiveServer) -> None:
    for headers in (
        {"Origin": "http://elsewhere.example"},
        {"Host": "elsewhere.example"},
        {"Origin": "null"},
    ):
        for what in ("", "stop", "solve"):
            assert asked(server, what, headers).status == 403


def test_live_server_answers_nothing_without_its_token(server: LiveServer) -> None:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=60)
    connection.request("GET", "/")
    assert connection.getresponse().status == 404


@pytest.mark.thorough
def test_live_iterates_are_those_of_the_solver(server: LiveServer) -> None:
    pose = 0.1 * np.random.default_rng(0).standard_normal((24, 3))
    given = start(server, pose)
    response = asked(server, "solve", solver="trust-region", start=given, run="a")
    assert response.status == 200
    *iterates, (last, end) = events(response.read().decode())
    own = SOLVERS["trust-region"].solve(setup().problem, {**setup().start, "pose": pose})
    assert (last, end["status"]) == ("ended", own.status.name.lower())
    assert [one["iterate"] for _, one in iterates] == list(range(len(own.trace)))
    np.testing.assert_allclose([one["cost"] for _, one in iterates], [i.cost for i in own.trace])
    for (_, one), iterate in zip(iterates, own.trace, strict=True):
        wanted = server.row({**setup().start, **iterate.values})
        np.testing.assert_allclose(one["x"], wanted, atol=1e-7)


def test_live_server_refuses_bad_queries(server: LiveServer) -> None:
    good = {"solver": "trust-region", "run": "b", "start": start(server)}
    for query in ({"solver": "no-such"}, {"run": ""}, {"start": "AAAA"}, {"start": "%%%"}):
        response = asked(server, "solve", None, **(good | query))
        assert response.status == 400, query
        assert len(response.read()) > 10


class Waiting:
    """A solver that goes on until its callback stops it."""

    def __init__(self) -> None:
        self.stopped = threading.Event()

    def solve(self, problem: Any, begin: Any, *, callback: Any = None) -> Any:
        solution = SOLVERS["gauss-newton"].solve(problem, begin)
        while callback(solution.trace[0]) is not True:
            time.sleep(0.01)
        self.stopped.set()
        return solution


@pytest.mark.thorough
def test_live_solves_run_one_at_a_time_and_stop(server: LiveServer) -> None:
    waiting = Waiting()
    mapping: Any = server.solvers
    mapping["waiting"] = waiting
    first = asked(server, "solve", solver="waiting", start=start(server), run="tab 1")
    assert first.fp.readline() == b"event: iterate\n"
    second = asked(server, "solve", solver="trust-region", start=start(server), run="tab 2")
    assert second.status == 409
    assert asked(server, "stop", run="tab 2").read() == b"nothing of this name runs"
    assert not waiting.stopped.is_set()
    assert asked(server, "stop", run="tab 1").read() == b"stopped"
    assert waiting.stopped.wait(timeout=200)
    assert b"event: ended" in first.read()


@pytest.mark.thorough
def test_closed_tab_ends_its_solve(server: LiveServer) -> None:
    waiting = Waiting()
    mapping: Any = server.solvers
    mapping["waiting"] = waiting
    response = asked(server, "solve", solver="waiting", start=start(server), run="tab 3")
    assert response.fp.readline() == b"event: iterate\n"
    response.close()
    assert waiting.stopped.wait(timeout=200)


def test_live_server_refuses_problems_without_a_body() -> None:
    with pytest.raises(BadArgument, match="fits no body"):
        live_server("nist", find("nist-chwirut2", {}).setup())
    done = CliRunner().invoke(app, ["live", "nist-chwirut2", "--no-browser"])
    assert isinstance(done.exception, BadArgument)
