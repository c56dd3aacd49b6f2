"""Numbered questions to the process of a student's file, and its answers.

Questions are pickled, and functions among their arguments are sent as code, because the process
that grades may run code in the other one. Answers are JSON and are never unpickled: whatever the
process of the student's file sends is only data to the one that grades.
"""

import json
import pickle
from types import ModuleType
from typing import Any

import cloudpickle

from workbench.course.plain import Malformed
from workbench.processes import Channel, TooLong

LARGEST = 4 * 2**20  # bytes of an answer: half a million numbers


def send_question(
    channel: Channel,
    checks: ModuleType | None,
    number: int,
    what: str,
    arguments: Any,
    seconds: float,
) -> None:
    """Ask for something. Raises OSError, and TimeoutError if nobody reads the question in time."""
    channel.send(_pickled((number, what, arguments), checks), max(seconds, 1e-3))


def receive_question(channel: Channel) -> tuple[int, str, Any] | None:
    """Wait for a question: its number, what is asked, and the arguments; None at the end."""
    message = channel.receive()
    return pickle.loads(message) if message else None


def send_answer(channel: Channel, number: int, data: Any) -> bool:
    """Answer a question; False, and nothing is sent, if the answer would be too long."""
    message = json.dumps([number, data]).encode("ascii")
    if len(message) > LARGEST:
        return False
    channel.send(message)
    return True


def receive_answer(channel: Channel, number: int, seconds: float) -> dict[str, Any] | None:
    """Wait for the answer to a question; None if the other process has ended.

    Raises TimeoutError, and Malformed if what was sent is no answer to this question.
    """
    try:
        message = channel.receive(seconds, LARGEST)
        answer = None if message is None else json.loads(message)
    except TooLong as error:
        raise Malformed("this is longer than an answer can be") from error
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, or too deep
        raise Malformed("this is not JSON") from error
    match answer:
        case [int() as of, dict() as data] if of == number:
            return data
    if message is not None:
        raise Malformed("this is not the answer to the question")
    return None


def _pickled(message: Any, checks: ModuleType | None) -> bytes:
    """Pickle functions of the checks as code: the other process must not import that module."""
    if checks is None:
        return pickle.dumps(message)
    cloudpickle.register_pickle_by_value(checks)
    try:
        return bytes(cloudpickle.dumps(message))
    finally:
        cloudpickle.unregister_pickle_by_value(checks)
