"""What made a page and what it ran on, as JSON that every reader takes."""

import json
import platform
from collections.abc import Mapping
from typing import Any

from workbench.diagnostics.schema import plain
from workbench.installation import DISTRIBUTION, version_of

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "nlopt", "emcee", "matplotlib")


def versions() -> dict[str, str | None]:
    """Of Python and of what computes; None for what is not installed."""
    return {"python": platform.python_version()} | {name: version_of(name) for name in PACKAGES}


def as_json(summary: Mapping[str, Any]) -> str:
    """JSON that every reader accepts: arrays are lists, and a number that is not finite is null."""
    return json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
