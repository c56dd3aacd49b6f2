"""Messages between two processes, on a socket: the length of each, followed by its bytes."""

import socket
import struct
import time
from typing import Self

LENGTH = struct.Struct("!Q")
PIECE = 2**16  # bytes that are read at a time


class TooLong(Exception):
    """A message is longer than the receiver accepts."""


class Channel:
    """One end of a connection that sends and receives whole messages."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection

    @classmethod
    def inherited(cls, handle: int) -> Self:
        """The end that this process was given at its start; its own children do not get it."""
        connection = socket.socket(fileno=handle)
        connection.set_inheritable(False)
        return cls(connection)

    def send(self, message: bytes, seconds: float | None = None) -> None:
        """Send a message. Raises OSError, and TimeoutError if nobody reads it in time."""
        self._connection.settimeout(seconds)
        self._connection.sendall(LENGTH.pack(len(message)) + message)

    def receive(self, seconds: float | None = None, longest: int | None = None) -> bytes | None:
        """Wait for the next message; None if the process at the other end has gone.

        Raises TimeoutError if the whole message has not arrived in time, and TooLong if it has more
        than `longest` bytes.
        """
        until = None if seconds is None else time.monotonic() + seconds
        header = self._read(LENGTH.size, until)
        if header is None:
            return None
        (length,) = LENGTH.unpack(header)
        if longest is not None and length > longest:
            raise TooLong(f"a message of {length:,} bytes; at most {longest:,} are accepted")
        return self._read(length, until)

    def close(self) -> None:
        """Close this end; the process at the other end is told that nothing more will come."""
        self._connection.close()

    def _read(self, count: int, until: float | None) -> bytes | None:
        got = bytearray()
        while len(got) < count:
            self._connection.settimeout(
                None if until is None else max(until - time.monotonic(), 1e-3)
            )
            try:
                more = self._connection.recv(min(count - len(got), PIECE))
            except ConnectionError:  # the other process died before it had read everything
                return None
            if not more:
                return None
            got += more
        return bytes(got)
