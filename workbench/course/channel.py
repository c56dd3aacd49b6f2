"""Questions to the process of a student's file, and its answers: numbered messages.

Questions are pickled, with functions that an exercise hands out by value, because the process that
grades may run code in the other one. Answers are JSON, which is never unpickled: whatever the
process of the student's file sends, it is only data to the one that grades.
"""

import json
import pickle
from types import ModuleType
from typing import Any

import cloudpickle

from workbench.course.plain import Malformed
from workbench.processes.channel import Channel, TooLong

LARGEST = 4 * 2**20  # bytes of an answer: half a million numbers


class Answer:
    """The end of the process of the student's file."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel

    def asked(self) -> tuple[int, str, Any] | None:
        """Wait for a request: its number, what is asked, and the arguments; None at the end."""
        message = self._channel.receive()
        return pickle.loads(message) if message else None

    def tell(self, number: int, data: Any) -> bool:
        """Answer a request; False, and nothing is sent, if the answer would be too long."""
        message = json.dumps([number, data]).encode("ascii")
        if len(message) > LARGEST:
            return False
        self._channel.send(message)
        return True


class Question:
    """The end of the process that grades."""

    def __init__(self, channel: Channel, checks: ModuleType) -> None:
        self._channel, self._checks = channel, checks

    def ask(self, number: int, what: str, arguments: Any, seconds: float) -> None:
        """Send a request. Raises OSError, and TimeoutError if nobody reads it in time."""
        message = _pickled((number, what, arguments), self._checks)
        self._channel.send(message, max(seconds, 1e-3))

    def told(self, number: int, seconds: float) -> dict[str, Any] | None:
        """Wait for the answer to a request; None if the process has gone.

        Raises TimeoutError, and Malformed if what came is no answer to this request.
        """
        try:
            message = self._channel.receive(seconds, LARGEST)
            said = None if message is None else json.loads(message)
        except TooLong as error:
            raise Malformed("this is longer than an answer can be") from error
        except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, or too deep
            raise Malformed("this is no JSON") from error
        match said:
            case [int() as of, dict() as data] if of == number:
                return data
        if message is not None:
            raise Malformed("nothing of the kind was asked")
        return None


def _pickled(message: Any, checks: ModuleType) -> bytes:
    """Functions of the checks go as their code: the other process must not import that module."""
    cloudpickle.register_pickle_by_value(checks)
    try:
        return bytes(cloudpickle.dumps(message))
    finally:
        cloudpickle.unregister_pickle_by_value(checks)
