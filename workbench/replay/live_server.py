"""A live page: starts are set by hand, a solver is chosen, and its iterates stream in.

A joint may be dragged (`dragging.py`), and a solver may go from many starts (`many_starts.py`).

The server listens on the loopback address alone. Its pages stand under a path that nobody can
guess, and what another site's page asks for is refused, so that only the reader's own tabs reach
it. One solve runs at a time; each belongs to the connection that asked for it, and ends with it.
"""

import json
import secrets
import threading
from base64 import urlsafe_b64decode
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.errors import BadArgument, WorkbenchError
from workbench.fitting.setup import Setup
from workbench.replay.answering import begin_events, say, sent
from workbench.replay.arguments import Row, row_of_body
from workbench.replay.dragging import Puppet
from workbench.replay.many_starts import basins, in_words, starts_about
from workbench.replay.tracks import as_numbers
from workbench.solvers import Iterate, Solution, Solver

ADDRESS = "127.0.0.1"  # of this machine alone
PATIENCE = 30.0  # s that a connection may say nothing, or take nothing
LONGEST_NAME = 64  # letters of the name that a page gives to a run
Ended = dict[str, str] | None  # how it ended; None if nobody listens any more
Stream = Callable[[BaseHTTPRequestHandler, Solver, Sequence[Values], threading.Event], Ended]


class LiveServer:
    """Serves a page and the solves that it asks for, from `serve` to `close`.

    Raises BadArgument for a setup without a body, or whose problem does not read the body's own
    pose, betas and trans, so that no start can be set by hand.

    Attributes:
        setup: the problem.
        solvers: those that may be asked for, by name.
    """

    def __init__(
        self, setup: Setup, solvers: Mapping[str, Solver], page: str, port: int = 0
    ) -> None:
        self.setup, self.solvers = setup, solvers
        self.body, self.row = moved_by_hand(setup)
        self._page = page.encode()
        self._solving = threading.Lock()
        self._puppet = Puppet(self.body) if isinstance(self.body, SkinnedBody) else None
        self._stops: dict[str, threading.Event] = {}
        self._token = secrets.token_urlsafe(16)
        self._server = ThreadingHTTPServer((ADDRESS, port), self._handler())
        self._server.daemon_threads = True

    @property
    def address(self) -> str:
        """Where a browser finds the page."""
        return f"{self._origin}/{self._token}/"

    @property
    def _origin(self) -> str:
        return f"http://{ADDRESS}:{self._server.server_address[1]}"

    def serve(self) -> None:
        """Answer requests until `close` is called from another thread, or Ctrl-C."""
        self._server.serve_forever(poll_interval=0.1)

    def close(self) -> None:
        """End what is being solved, and answer nothing any more."""
        for stop in list(self._stops.values()):
            stop.set()
        self._server.shutdown()
        self._server.server_close()

    def start_of(self, text: str) -> Values:
        """The values of all blocks at a start whose pose, betas and trans were set by hand.

        `text` is base64 of 3 K + B + 3 little-endian numbers in double precision. Raises
        BadArgument for anything else.
        """
        blocks = self.body.blocks()
        own = {b.name: part for b, part in zip(blocks, self._parts(text), strict=True)}
        return dict(self.setup.start) | own

    def _parts(self, text: str) -> list[Array]:
        """The pose, the betas and the trans in a text of numbers."""
        try:
            numbers = np.frombuffer(urlsafe_b64decode(text.encode()), "<f8")
        except ValueError:
            numbers = np.zeros(0)
        K, B = self.body.n_joints, self.body.n_betas
        if numbers.size != 3 * K + B + 3 or not np.isfinite(numbers).all():
            raise BadArgument(f"a start is {3 * K + B + 3} finite numbers in base64")
        parts = np.split(numbers, [3 * K, 3 * K + B])
        return [part.reshape(b.shape) for b, part in zip(self.body.blocks(), parts, strict=True)]

    def warm(self) -> None:
        """Go one step with each solver, so that its first press does not wait for anything.

        What a solver loads and derives at its first call (IPOPT's library, exact Hessians) takes up
        to half a second.
        """
        for solver in self.solvers.values():
            with suppress(WorkbenchError):
                solver.solve(self.setup.problem, self.setup.start, callback=lambda iterate: True)

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        live = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.0"  # a connection for each request
            timeout = PATIENCE

            def handle(self) -> None:
                """Answer, unless the tab is closed or says nothing."""
                with suppress(ConnectionError, TimeoutError):
                    super().handle()

            def do_GET(self) -> None:
                """Answer a request of the page."""
                live.answer(self)

            def log_message(self, format: str, *args: object) -> None:
                """Say nothing: the page says it all."""

        return Handler

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        """Answer one request."""
        asked = urlsplit(request.path)
        given = {name: values[-1] for name, values in parse_qs(asked.query).items()}
        port = self._server.server_address[1]
        own_hosts = (f"{ADDRESS}:{port}", f"localhost:{port}")
        origin, host = request.headers.get("Origin"), request.headers.get("Host", "")
        if host not in own_hosts or origin not in (None, *(f"http://{own}" for own in own_hosts)):
            say(request, 403, "only pages of this server may ask it")
        elif asked.path == f"/{self._token}/":
            say(request, 200, self._page, "text/html; charset=utf-8")
        elif asked.path == f"/{self._token}/solve":
            self._solve(request, given, self._stream)
        elif asked.path == f"/{self._token}/ends":
            self._solve(request, given, self._stream_ends)
        elif asked.path == f"/{self._token}/drag":
            self._drag(request, given)
        elif asked.path == f"/{self._token}/stop":
            stop = self._stops.get(given.get("run", ""))
            if stop is not None:
                stop.set()
            say(request, 200, "stopped" if stop is not None else "nothing of this name runs")
        else:
            say(request, 404, "there is nothing here; open the address that was printed")

    def _drag(self, request: BaseHTTPRequestHandler, given: Mapping[str, str]) -> None:
        """Answer with the numbers of the body whose joint was drawn to a place."""
        try:
            pose, betas, trans = self._parts(given.get("start", ""))
            joint, place = _joint_and_place(given)
            if self._puppet is None:
                raise BadArgument(f"body {self.body.name!r} has no joints that can be dragged")
            pose, trans = self._puppet.dragged(pose, betas, trans, joint, place)
        except BadArgument as error:
            return say(request, 400, str(error))
        row = np.concatenate([pose.ravel(), betas, trans])
        say(request, 200, json.dumps({"x": as_numbers(row)}), "application/json")

    def _solve(
        self, request: BaseHTTPRequestHandler, given: Mapping[str, str], stream: Stream
    ) -> None:
        name, run = given.get("solver", ""), given.get("run", "")[:LONGEST_NAME]
        try:
            starts = self._starts(given)
            if name not in self.solvers or not run or run in self._stops:
                raise BadArgument(f"no solver {name!r}, or no new name for its run")
        except BadArgument as error:
            return say(request, 400, str(error))
        if not self._solving.acquire(blocking=False):
            return say(request, 409, "another solve is running; stop it first")
        try:
            stop = self._stops[run] = threading.Event()
            begin_events(request)
            ended = stream(request, self.solvers[name], starts, stop)
            if ended is not None:
                sent(request, "ended", ended)
        except WorkbenchError as error:
            sent(request, "ended", {"status": "refused", "message": str(error)})
        finally:
            del self._stops[run]
            self._solving.release()

    def _starts(self, given: Mapping[str, str]) -> list[Values]:
        """The start that was set by hand, and those about it that are asked for."""
        start = self.start_of(given.get("start", ""))
        if "count" not in given:
            return [start]
        pose, _, trans = (block.name for block in self.body.blocks())
        try:
            count, spread = int(given["count"]), float(given.get("spread", ""))
        except ValueError as error:
            raise BadArgument("`count` is a whole number, and `spread` one in rad") from error
        return starts_about(self.setup.problem, start, pose, trans, spread, count)

    def _stream(
        self,
        request: BaseHTTPRequestHandler,
        solver: Solver,
        starts: Sequence[Values],
        stop: threading.Event,
    ) -> Ended:
        """Send every iterate as an event, and return how it ended."""
        told, (start,) = [0], starts[:1]

        def tell(iterate: Iterate) -> bool:
            x = self.row(dict(start) | dict(iterate.values))
            one = {"iterate": told[0], "x": as_numbers(x), **_numbers(iterate)}
            told[0] += 1
            return not sent(request, "iterate", one) or stop.is_set()

        solution = solver.solve(self.setup.problem, start, callback=tell)
        return {"status": _status(solution), "message": solution.message}

    def _stream_ends(
        self,
        request: BaseHTTPRequestHandler,
        solver: Solver,
        starts: Sequence[Values],
        stop: threading.Event,
    ) -> Ended:
        """Send the end of each start with the basins known by then, and return a summary."""
        problem, ends = self.setup.problem, list[Solution]()
        found: list[dict[str, Any]] = []
        for k, start in enumerate(starts):
            end = solver.solve(problem, start, callback=lambda _: stop.is_set())
            if stop.is_set():
                break
            ends.append(end)
            found = basins(problem, starts[0], ends)
            x = as_numbers(self.row(dict(start) | dict(end.values)))
            one = {"start": k, "of": len(starts), "x": x, "cost": as_numbers(end.cost)}
            if not sent(request, "end", {**one, "status": _status(end), "basins": found}):
                return None
        status = "stopped" if stop.is_set() else "done"
        return {"status": status, "message": in_words(found, len(ends))}


def moved_by_hand(setup: Setup) -> tuple[Body, Row]:
    """The body of a setup, and its numbers from values. Raises BadArgument where there is none."""
    body = setup.body
    if body is None:
        raise BadArgument("this problem fits no body, and a live page moves one by hand")
    names = [block.name for block in body.blocks()]
    row = row_of_body(body, setup.problem, setup.start)
    if row is None or not set(names) & set(setup.problem.free.names):
        raise BadArgument(
            f"a live page sets {', '.join(names)} by hand, but this problem is solved for "
            f"{', '.join(setup.problem.free.names)}"
        )
    return body, row


def _numbers(iterate: Iterate) -> dict[str, Any]:
    return {
        "cost": as_numbers(iterate.cost),
        "optimality": as_numbers(iterate.optimality),
        "damping": as_numbers(iterate.damping),
        "seconds": as_numbers(iterate.seconds),
        "evaluations": iterate.evaluations.total,
    }


def _joint_and_place(given: Mapping[str, str]) -> tuple[int, Array]:
    """The joint and its place (3,) m that a page asks for. Raises BadArgument."""
    try:
        joint, place = int(given.get("joint", "")), [float(given.get(d, "")) for d in "xyz"]
    except ValueError:
        joint, place = -1, [np.nan]
    if not np.isfinite(place).all():
        raise BadArgument("a joint is a whole number, and its place three finite numbers in m")
    return joint, np.array(place)


def _status(solution: Solution) -> str:
    return solution.status.name.lower().replace("_", " ")
