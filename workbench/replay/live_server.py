"""A live page: starts are set by hand, a solver is chosen, and its iterates stream in.

The server listens on the loopback address alone. Its pages stand under a path that nobody can
guess, and what another site's page asks for is refused, so that only the reader's own tabs reach
it. One solve runs at a time; each belongs to the connection that asked for it, and ends with it.
"""

import json
import secrets
import threading
from base64 import urlsafe_b64decode
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument, WorkbenchError
from workbench.fitting.setup import Setup
from workbench.replay.arguments import Row, row_of_body
from workbench.replay.tracks import as_numbers
from workbench.solvers import Iterate, Solution, Solver

ADDRESS = "127.0.0.1"  # of this machine alone
LONGEST_NAME = 64  # letters of the name that a page gives to a run


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
        try:
            numbers = np.frombuffer(urlsafe_b64decode(text.encode()), "<f8")
        except ValueError:
            numbers = np.zeros(0)
        K, B = self.body.n_joints, self.body.n_betas
        if numbers.size != 3 * K + B + 3 or not np.isfinite(numbers).all():
            raise BadArgument(f"a start is {3 * K + B + 3} finite numbers in base64")
        parts = np.split(numbers, [3 * K, 3 * K + B])
        blocks = self.body.blocks()
        own = {b.name: part.reshape(b.shape) for b, part in zip(blocks, parts, strict=True)}
        return dict(self.setup.start) | own

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        live = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.0"  # a connection for each request

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
            _say(request, 403, "only pages of this server may ask it")
        elif asked.path == f"/{self._token}/":
            _say(request, 200, self._page, "text/html; charset=utf-8")
        elif asked.path == f"/{self._token}/solve":
            self._solve(request, given)
        elif asked.path == f"/{self._token}/stop":
            stop = self._stops.get(given.get("run", ""))
            if stop is not None:
                stop.set()
            _say(request, 200, "stopped" if stop is not None else "nothing of this name runs")
        else:
            _say(request, 404, "there is nothing here; open the address that was printed")

    def _solve(self, request: BaseHTTPRequestHandler, given: Mapping[str, str]) -> None:
        name, run = given.get("solver", ""), given.get("run", "")[:LONGEST_NAME]
        try:
            start = self.start_of(given.get("start", ""))
            if name not in self.solvers or not run or run in self._stops:
                raise BadArgument(f"no solver {name!r}, or no new name for its run")
        except BadArgument as error:
            return _say(request, 400, str(error))
        if not self._solving.acquire(blocking=False):
            return _say(request, 409, "another solve is running; stop it first")
        try:
            stop = self._stops[run] = threading.Event()
            _begin(request)
            self._stream(request, self.solvers[name], start, stop)
        finally:
            del self._stops[run]
            self._solving.release()

    def _stream(
        self, request: BaseHTTPRequestHandler, solver: Solver, start: Values, stop: threading.Event
    ) -> None:
        """Send every iterate as an event, and how it ended."""
        told = [0]

        def tell(iterate: Iterate) -> bool:
            x = self.row(dict(start) | dict(iterate.values))
            one = {"iterate": told[0], "x": as_numbers(x), **_numbers(iterate)}
            told[0] += 1
            try:
                _event(request, "iterate", one)
            except OSError:  # the tab was closed
                return True
            return stop.is_set()

        try:
            solution: Solution = solver.solve(self.setup.problem, start, callback=tell)
            status = solution.status.name.lower().replace("_", " ")
            ended = {"status": status, "message": solution.message}
        except WorkbenchError as error:
            ended = {"status": "refused", "message": str(error)}
        try:
            _event(request, "ended", ended)
        except OSError:
            return


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


def _say(
    request: BaseHTTPRequestHandler, code: int, text: str | bytes, kind: str = "text/plain"
) -> None:
    content = text.encode() if isinstance(text, str) else text
    request.send_response(code)
    request.send_header("Content-Type", kind)
    request.send_header("Content-Length", str(len(content)))
    request.send_header("Cache-Control", "no-store")
    request.end_headers()
    request.wfile.write(content)


def _begin(request: BaseHTTPRequestHandler) -> None:
    request.send_response(200)
    request.send_header("Content-Type", "text/event-stream")
    request.send_header("Cache-Control", "no-store")
    request.end_headers()


def _event(request: BaseHTTPRequestHandler, name: str, data: Mapping[str, Any]) -> None:
    request.wfile.write(f"event: {name}\ndata: {json.dumps(data)}\n\n".encode())
    request.wfile.flush()
