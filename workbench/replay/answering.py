"""What a live server answers over HTTP: a text, or events one after the other as they come."""

import json
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler
from typing import Any


def say(
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


def begin_events(request: BaseHTTPRequestHandler) -> None:
    """Announce events, which `sent` sends."""
    request.send_response(200)
    request.send_header("Content-Type", "text/event-stream")
    request.send_header("Cache-Control", "no-store")
    request.end_headers()


def sent(request: BaseHTTPRequestHandler, name: str, data: Mapping[str, Any]) -> bool:
    """Send an event; False if nobody listens any more, because the tab was closed."""
    try:
        request.wfile.write(f"event: {name}\ndata: {json.dumps(data)}\n\n".encode())
        request.wfile.flush()
    except OSError:
        return False
    return True
