"""Messages between the process that marks and the one that answers: numbered, each with its length.

Towards the answer they are pickled, with functions that an exercise hands out by value, because
what marks may run code there. Back they are JSON, which is never unpickled: whatever the process
of the answer sends, it is data here.
"""

import json
import pickle
import socket
import struct
import time
from types import ModuleType
from typing import Any

import cloudpickle

from workbench.course.plain import Malformed

LENGTH = struct.Struct("!I")
LARGEST = 4 * 2**20  # bytes of an answer: half a million numbers
PIECE = 2**16  # bytes that are read at a time


class Answer:
    """The end of the process that answers."""

    def __init__(self, channel: socket.socket) -> None:
        self._channel = channel

    def asked(self) -> tuple[int, str, Any] | None:
        """The next request: its number, what is asked, and the arguments; None at the end."""
        length = self._read(LENGTH.size)
        message = self._read(*LENGTH.unpack(length)) if length else b""
        return pickle.loads(message) if message else None

    def tell(self, number: int, data: Any) -> bool:
        """Answer a request; False, and nothing is sent, if that would be too long."""
        message = json.dumps([number, data]).encode("ascii")
        if len(message) > LARGEST:
            return False
        self._channel.sendall(LENGTH.pack(len(message)) + message)
        return True

    def _read(self, count: int) -> bytes:
        got = bytearray()
        while len(got) < count:
            more = self._channel.recv(count - len(got))
            if not more:
                return b""
            got += more
        return bytes(got)


class Question:
    """The end of the process that marks."""

    def __init__(self, channel: socket.socket, checks: ModuleType) -> None:
        self._channel, self._checks = channel, checks

    def ask(self, number: int, what: str, arguments: Any, seconds: float) -> None:
        """Send a request. Raises OSError, and TimeoutError, which is one, if nobody reads it."""
        message = _pickled((number, what, arguments), self._checks)
        self._channel.settimeout(max(seconds, 1e-3))
        self._channel.sendall(LENGTH.pack(len(message)) + message)

    def told(self, number: int, seconds: float) -> Any:
        """The answer to a request; None if the process has gone.

        Raises TimeoutError, and Malformed for what is no answer to this request.
        """
        until = time.monotonic() + seconds
        header = self._read(LENGTH.size, until)
        if header is None:
            return None
        (length,) = LENGTH.unpack(header)
        if length > LARGEST:
            raise Malformed("this is longer than an answer can be")
        message = self._read(length, until)
        if message is None:
            return None
        try:
            said = json.loads(message)
        except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, or too deep
            raise Malformed("this is no JSON") from error
        match said:
            case [int() as of, dict() as data] if of == number:
                return data
        raise Malformed("nothing of the kind was asked")

    def _read(self, count: int, until: float) -> bytes | None:
        got = bytearray()
        while len(got) < count:
            self._channel.settimeout(max(until - time.monotonic(), 1e-3))
            try:
                more = self._channel.recv(min(count - len(got), PIECE))
            except ConnectionError:  # it died with a request unread
                return None
            if not more:
                return None
            got += more
        return bytes(got)


def _pickled(message: Any, checks: ModuleType) -> bytes:
    """Functions of the checks go as their code: the other process must not import that module."""
    cloudpickle.register_pickle_by_value(checks)
    try:
        return bytes(cloudpickle.dumps(message))
    finally:
        cloudpickle.unregister_pickle_by_value(checks)
