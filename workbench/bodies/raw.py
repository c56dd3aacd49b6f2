"""What a file of arrays holds before anyone has asked what it means."""

from dataclasses import dataclass
from typing import Any

MOST_BYTES = 2 * 2**30  # of one file, unpacked; licensed models reach a quarter of a GB

Raw = dict[str, Any]  # by key: arrays, csr_arrays, plain values, and what stayed unread


@dataclass(frozen=True)
class Unread:
    """An entry that was left as it was, and why: `shapedirs is ...`."""

    reason: str
