"""The live page's server."""

import json
import secrets
import threading
from base64 import urlsafe_b64decode
from collections.abc import Mapping
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.errors import BadArgument, WorkbenchError
from workbench.fitting.setup import Setup
from workbench.reports.replay.recording import BodyNumbers, row_of_body
from workbench.reports.replay.runs import as_numbers
from workbench.solvers import Iterate, Solver

ADDRESS = "127.0.0.1"  # of this machine alone
TIMEOUT_SECONDS = 30.0  # s that a connection may say nothing, or take nothing
LONGEST_NAME = 64  # letters of the name that a page gives to a run


class LiveServer:
    """Serves a page and the solves that it asks for, from `serve` to `close`.

    Raises BadArgument for a setup without a body, or whose problem does not read the body's own
    pose, betas and trans, so that no start can be set by hand. `solvers` are those that may be
    asked for, by name.
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
        return f"http://{ADDRESS}:{self._server.server_address[1]}/{self._token}/"

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
        blocks = self.body.blocks()
        size = sum(block.size for block in blocks)
        if numbers.size != size or not np.isfinite(numbers).all():
            raise BadArgument(f"a start is {size} finite numbers in base64")
        parts = np.split(numbers, np.cumsum([block.size for block in blocks])[:-1])
        own = {b.name: part.reshape(b.shape) for b, part in zip(blocks, parts, strict=True)}
        return dict(self.setup.start) | own

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        live = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.0"  # a connection for each request
            timeout = TIMEOUT_SECONDS

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
        url = urlsplit(request.path)
        query = {name: values[-1] for name, values in parse_qs(url.query).items()}
        port = self._server.server_address[1]
        own_hosts = (f"{ADDRESS}:{port}", f"localhost:{port}")
        origin, host = request.headers.get("Origin"), request.headers.get("Host", "")
        if host not in own_hosts or origin not in (None, *(f"http://{own}" for own in own_hosts)):
            respond(request, 403, "only pages of this server may ask it")
        elif url.path == f"/{self._token}/":
            respond(request, 200, self._page, "text/html; charset=utf-8")
        elif url.path == f"/{self._token}/solve":
            self._solve(request, query)
        elif url.path == f"/{self._token}/stop":
            stop = self._stops.get(query.get("run", ""))
            if stop is not None:
                stop.set()
            respond(request, 200, "stopped" if stop is not None else "nothing of this name runs")
        else:
            respond(request, 404, "there is nothing here; open the address that was printed")

    def _solve(self, request: BaseHTTPRequestHandler, query: Mapping[str, str]) -> None:
        """Send every iterate as an event, and at last how it ended."""
        name, run = query.get("solver", ""), query.get("run", "")[:LONGEST_NAME]
        try:
            start = self.start_of(query.get("start", ""))
            if name not in self.solvers or not run or run in self._stops:
                raise BadArgument(f"no solver {name!r}, or no new name for its run")
        except BadArgument as error:
            return respond(request, 400, str(error))
        if not self._solving.acquire(blocking=False):
            return respond(request, 409, "another solve is running; stop it first")
        try:
            stop = self._stops[run] = threading.Event()
            request.send_response(200)
            request.send_header("Content-Type", "text/event-stream")
            request.send_header("Cache-Control", "no-store")
            request.end_headers()
            count = 0

            def tell(iterate: Iterate) -> bool:
                nonlocal count
                x = self.row(dict(start) | dict(iterate.values))
                event = {"iterate": count, "x": as_numbers(x), **_numbers(iterate)}
                count += 1
                return not sent(request, "iterate", event) or stop.is_set()

            solution = self.solvers[name].solve(self.setup.problem, start, callback=tell)
            status = solution.status.name.lower().replace("_", " ")
            sent(request, "ended", {"status": status, "message": solution.message})
        except WorkbenchError as error:
            sent(request, "ended", {"status": "refused", "message": str(error)})
        finally:
            del self._stops[run]
            self._solving.release()


def moved_by_hand(setup: Setup) -> tuple[Body, BodyNumbers]:
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


def respond(
    request: BaseHTTPRequestHandler, code: int, text: str | bytes, kind: str = "text/plain"
) -> None:
    """Answer with a text, and end."""
    content = text.encode() if isinstance(text, str) else text
    request.send_response(code)
    request.send_header("Content-Type", kind)
    request.send_header("Content-Length", str(len(content)))
    request.send_header("Cache-Control", "no-store")
    request.end_headers()
    request.wfile.write(content)


def sent(request: BaseHTTPRequestHandler, name: str, data: Mapping[str, Any]) -> bool:
    """Send an event; False if nobody listens any more, because the tab was closed."""
    try:
        request.wfile.write(f"event: {name}\ndata: {json.dumps(data)}\n\n".encode())
        request.wfile.flush()
    except OSError:
        return False
    return True
