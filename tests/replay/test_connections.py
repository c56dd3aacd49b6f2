"""Connections to a live page that say nothing, or that are closed before they are answered."""

import socket
import struct
import threading
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from workbench.experiments import find
from workbench.reports.replay import live as module
from workbench.reports.replay.live import LiveServer
from workbench.reports.replays import live_server


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveServer]:
    monkeypatch.setattr(module, "TIMEOUT_SECONDS", 0.2)
    made = live_server("landmarks", find("landmarks", {"body": "small"}).setup())
    thread = threading.Thread(target=made.serve)
    thread.start()
    yield made
    made.close()
    thread.join(timeout=60)


def connected(server: LiveServer) -> socket.socket:
    address = urlsplit(server.address)
    assert address.hostname is not None
    assert address.port is not None
    return socket.create_connection((address.hostname, address.port), timeout=60)


def test_server_closes_a_connection_that_says_nothing(server: LiveServer) -> None:
    with connected(server) as silent:
        assert silent.recv(1) == b""
    with connected(server) as half:
        half.sendall(b"GET / HTTP/1.0\r\nHost:")
        assert half.recv(1) == b""


def test_closed_tab_prints_no_traceback(
    server: LiveServer, capfd: pytest.CaptureFixture[str]
) -> None:
    path = urlsplit(server.address).path
    host = server.address.split("/")[2]
    for _ in range(5):
        tab = connected(server)
        tab.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        tab.sendall(f"GET {path} HTTP/1.0\r\nHost: {host}\r\n\r\n".encode())
        tab.close()  # with a reset, while the page is being sent
    with connected(server) as last:
        last.sendall(f"GET {path} HTTP/1.0\r\nHost: {host}\r\n\r\n".encode())
        assert last.recv(12) == b"HTTP/1.0 200"
    assert "Traceback" not in capfd.readouterr().err
