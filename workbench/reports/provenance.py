"""What made a page and what it ran on, as JSON that every reader takes."""

import json
import math
import platform
from collections.abc import Mapping
from typing import Any

from workbench.installation import DISTRIBUTION, version_of

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "nlopt", "emcee", "matplotlib")


def versions() -> dict[str, str | None]:
    """Of Python and of what computes; None for what is not installed."""
    return {"python": platform.python_version()} | {name: version_of(name) for name in PACKAGES}


def as_json(summary: Mapping[str, Any]) -> str:
    """JSON as every reader takes it: null where a number is not finite."""
    return json.dumps(_finite(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(thing: Any) -> Any:
    if isinstance(thing, Mapping):
        return {str(key): _finite(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_finite(value) for value in thing]
    if isinstance(thing, float):  # NumPy's float64 is one
        return float(thing) if math.isfinite(thing) else None
    return thing
