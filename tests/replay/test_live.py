"""The server of a live page: what it answers, what it refuses, and how its solves end."""

import http.client
import json
import threading
import time
from base64 import urlsafe_b64encode
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import urlencode, urlsplit

import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from tests.browsers import asked_of_replay
from workbench.arrays import Array
from workbench.cli.app import app
from workbench.errors import BadArgument
from workbench.experiments import find
from workbench.replay.live_server import LiveServer
from workbench.replay.recording import recorded_start
from workbench.reports.live_page import live_server
from workbench.reports.page import page
from workbench.solvers import SOLVERS, Spread, Starts

SETUP = find("landmarks", {"body": "small"}).setup()


@pytest.fixture(scope="module")
def server() -> Iterator[LiveServer]:
    made = live_server("landmarks", SETUP)
    thread = threading.Thread(target=made.serve)
    thread.start()
    yield made
    made.close()
    thread.join(timeout=10)
    assert not thread.is_alive()


def start(server: LiveServer, pose: Array | None = None) -> str:
    numbers = server.row(SETUP.start).copy()
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


def test_the_page_is_served_and_offers_solvers(server: LiveServer) -> None:
    response = asked(server)
    text = response.read().decode()
    assert response.status == 200
    assert "data-live=" in text
    assert all(name in text for name in server.solvers)
    assert "trust-region" in server.solvers


@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://elsewhere.example"}, {"Host": "elsewhere.example"}, {"Origin": "null"}],
)
def test_other_sites_are_refused(server: LiveServer, headers: dict[str, str]) -> None:
    for what in ("", "stop", "solve", "ends", "drag"):
        assert asked(server, what, headers).status == 403


def test_without_the_token_there_is_nothing(server: LiveServer) -> None:
    address = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=60)
    connection.request("GET", "/")
    assert connection.getresponse().status == 404


def test_the_iterates_are_those_of_the_solver(server: LiveServer) -> None:
    pose = 0.1 * np.random.default_rng(0).standard_normal((24, 3))
    given = start(server, pose)
    response = asked(server, "solve", solver="trust-region", start=given, run="a")
    assert response.status == 200
    *iterates, (last, end) = events(response.read().decode())
    own = SOLVERS["trust-region"].solve(SETUP.problem, {**SETUP.start, "pose": pose})
    assert (last, end["status"]) == ("ended", own.status.name.lower())
    assert [one["iterate"] for _, one in iterates] == list(range(len(own.trace)))
    np.testing.assert_allclose([one["cost"] for _, one in iterates], [i.cost for i in own.trace])
    for (_, one), iterate in zip(iterates, own.trace, strict=True):
        wanted = server.row({**SETUP.start, **iterate.values})
        np.testing.assert_allclose(one["x"], wanted, atol=1e-7)


@pytest.mark.parametrize(
    "query",
    [
        {"solver": "no-such", "run": "b"},
        {"solver": "trust-region", "run": ""},
        {"solver": "trust-region", "run": "b", "start": "AAAA"},
        {"solver": "trust-region", "run": "b", "start": "%%%"},
    ],
)
def test_what_cannot_be_solved_is_refused(server: LiveServer, query: dict[str, str]) -> None:
    response = asked(server, "solve", None, **({"start": start(server)} | query))
    assert response.status == 400
    assert response.read()


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


def test_one_solve_at_a_time_which_can_be_stopped(server: LiveServer) -> None:
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
    assert waiting.stopped.wait(timeout=20)
    assert b"event: ended" in first.read()


def test_a_closed_tab_ends_its_solve(server: LiveServer) -> None:
    waiting = Waiting()
    mapping: Any = server.solvers
    mapping["waiting"] = waiting
    response = asked(server, "solve", solver="waiting", start=start(server), run="tab 3")
    assert response.fp.readline() == b"event: iterate\n"
    response.close()
    assert waiting.stopped.wait(timeout=20)


@pytest.mark.parametrize("name", ["gauss-newton", "ipopt", "nlopt-slsqp", "scipy-trf"])
def test_solvers_stop_when_they_are_told(name: str) -> None:
    solver = SOLVERS[name]
    solution = solver.solve(SETUP.problem, SETUP.start, callback=lambda iterate: True)
    assert solution.status.name == "STOPPED"


def test_a_joint_follows_the_hand_and_the_rest_stays(server: LiveServer) -> None:
    body = SETUP.body
    assert isinstance(body, wb.SkinnedBody)
    wrist = body.joint_names.index("left_wrist")
    given = body.start()
    place = body.joints(**given)[wrist] + [-0.15, 0.2, 0.2]
    zero = start(server, np.zeros(72))
    x, y, z = map(str, place)
    answer = asked(server, "drag", start=zero, joint=str(wrist), x=x, y=y, z=z)
    row = np.array(json.loads(answer.read())["x"])
    pose = row[:72].reshape(24, 3)
    trans = SETUP.start["trans"]
    moved = body.joints(pose, row[72:-3], trans)
    there = body.joints(np.zeros((24, 3)), row[72:-3], trans)
    np.testing.assert_allclose(moved[wrist], place, atol=2e-3)  # m
    np.testing.assert_array_equal(row[-3:], trans)
    legs = [k for k, name in enumerate(body.joint_names) if "knee" in name or "foot" in name]
    np.testing.assert_allclose(moved[legs], there[legs], atol=1e-6)
    assert not pose[0].any()


def test_the_root_takes_the_whole_body_along(server: LiveServer) -> None:
    body = SETUP.body
    assert body is not None
    pose = 0.1 * np.ones(72)
    answer = asked(server, "drag", start=start(server, pose), joint="0", x="1", y="2", z="3")
    row = np.array(json.loads(answer.read())["x"])
    np.testing.assert_allclose(row[:72], pose, atol=1e-8)
    root = body.joints(row[:72].reshape(24, 3), row[72:-3], row[-3:])[0]
    np.testing.assert_allclose(root, [1, 2, 3], atol=1e-8)


@pytest.mark.parametrize(
    "query",
    [{"joint": "24"}, {"joint": "-1"}, {"joint": "wrist"}, {"x": "nan"}, {"y": ""}, {"start": "A"}],
)
def test_what_cannot_be_dragged_is_refused(server: LiveServer, query: dict[str, str]) -> None:
    given = {"start": start(server), "joint": "20", "x": "0", "y": "0", "z": "0"}
    response = asked(server, "drag", **(given | query))
    assert response.status == 400
    assert len(response.read()) > 20


def test_many_starts_show_their_basins(server: LiveServer) -> None:
    count, spread = 4, 1.2
    query = {"solver": "trust-region", "count": str(count), "spread": str(spread), "run": "many"}
    response = asked(server, "ends", start=start(server), **query)
    *ends, (last, ended) = events(response.read().decode())
    assert [one["start"] for _, one in ends] == list(range(count))
    drawn = Spread({"pose": spread, "trans": 0.3 * spread})
    own = Starts(count, SOLVERS["trust-region"], drawn).solve(SETUP.problem, SETUP.start)
    groups = {tuple(sorted(one["ends"])) for one in ends[-1][1]["basins"]}
    assert groups == {tuple(sorted(one.starts)) for one in own.hypotheses}
    costs = [one["cost"] for one in ends[-1][1]["basins"]]
    assert costs == sorted(costs)
    assert costs[0] == pytest.approx(own.cost, rel=1e-5)
    assert (last, ended["status"]) == ("ended", "done")
    assert f"of {count} starts" in ended["message"]


def test_many_starts_can_be_stopped(server: LiveServer) -> None:
    waiting = Waiting()
    mapping: Any = server.solvers
    mapping["waiting"] = waiting
    query = {"solver": "waiting", "count": "3", "spread": "0.5", "run": "tab 4"}
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(asked, server, "ends", None, start=start(server), **query)
        while asked(server, "stop", run="tab 4").read() != b"stopped":
            time.sleep(0.01)
        (only,) = events(answer.result(timeout=20).read().decode())
    assert only[1]["status"] == "stopped"
    assert waiting.stopped.is_set()


@pytest.mark.parametrize(
    "query", [{"count": "1"}, {"count": "1000"}, {"count": "few"}, {"spread": "0"}, {"spread": ""}]
)
def test_too_many_starts_are_refused(server: LiveServer, query: dict[str, str]) -> None:
    given = {"solver": "trust-region", "count": "4", "spread": "0.5", "run": "x"} | query
    response = asked(server, "ends", start=start(server), **given)
    assert response.status == 400
    assert b"spread" in response.read()


def test_no_press_waits_for_what_could_be_made_before(server: LiveServer) -> None:
    """The first iterate of every solver comes within 0.2 s of one core after it was asked for."""
    assert "ipopt-exact" in server.solvers
    assert "hessian" in vars(SETUP.problem), "its derivation takes half a second on larger bodies"
    for name, solver in server.solvers.items():
        if isinstance(solver, Waiting):
            continue
        began, first = time.process_time(), [np.inf]

        def tell(_: Any, began: float = began, first: list[float] = first) -> bool:
            first[0] = time.process_time() - began
            return True

        solver.solve(SETUP.problem, SETUP.start, callback=tell)
        assert first[0] < 0.2, name


DRAGGED = """
  const scene = replay.scene, canvas = scene.canvas, box = canvas.getBoundingClientRect();
  const k = replay.body.joint_names.indexOf("left_wrist");
  const place = replay.byHand.joints[k].map((x, d) => x + replay.byHand.shift[d]);
  const [u, v] = scene.place(place);
  let asked;
  window.fetch = url => {
    asked = url;
    return Promise.resolve({ ok: false, text: () => "no server" });
  };
  const send = (type, x, y) => {
    try {
      const at = { clientX: box.left + x, clientY: box.top + y, buttons: 1 };
      canvas.dispatchEvent(new PointerEvent(type, at));
    } catch (error) { }
  };
  const turn = scene.turn;
  send("pointerdown", u + 3, v - 2);
  send("pointermove", u + 43, v - 32);
  const told = new URLSearchParams(asked.split("?")[1]);
  answers.joint = told.get("joint");
  answers.turned = scene.turn - turn;
  answers.chosen = replay.live.joint.selectedOptions[0].textContent;
  const target = ["x", "y", "z"].map((d, i) => +told.get(d) + replay.byHand.shift[i]);
  answers.off = scene.place(target).map((x, d) => x - [u + 40, v - 30][d]);
  replay.live.basins.take({ start: 0, of: 2, x: [...replay.hand], cost: 2, status: "converged",
    basins: [{ cost: 2, ends: [0] }] });
  replay.live.basins.take({ start: 1, of: 2, x: [...replay.hand], cost: 1, status: "converged",
    basins: [{ cost: 1, ends: [1] }, { cost: 2, ends: [0] }] });
  replay.live.show("ends");
  answers.ends = replay.shown().map(one => one.name);
  answers.said = replay.sentence.textContent;
"""


def test_a_joint_is_dragged_in_the_browser(tmp_path: Path) -> None:
    recording = recorded_start(SETUP)
    html = page("live.html", title="t", question="q", recording=recording, solvers=["trust-region"])
    answers = asked_of_replay(html, DRAGGED, tmp_path)
    assert answers["joint"] == str(wb.load_body("small").joint_names.index("left_wrist"))
    assert answers["chosen"] == "left elbow"  # what turns
    assert answers["turned"] == 0  # the camera stands still meanwhile
    np.testing.assert_allclose(answers["off"], 0, atol=0.5)  # px
    assert answers["ends"] == ["1 (1 of 2)", "2 (1 of 2)"]
    assert answers["said"].startswith("2 of 2 starts have ended: 1 at the lowest cost, 1; 1 other")


def test_a_problem_without_a_body_is_refused() -> None:
    with pytest.raises(BadArgument, match="fits no body"):
        live_server("nist", find("nist-chwirut2", {}).setup())
    done = CliRunner().invoke(app, ["live", "nist-chwirut2", "--no-browser"])
    assert isinstance(done.exception, BadArgument)
