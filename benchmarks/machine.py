"""On what a benchmark ran."""

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from workbench.environment import DISTRIBUTION, version_of

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "jax", "jaxlib", "torch", "smplx", "libigl")


def description(packages: Sequence[str] = PACKAGES) -> dict[str, Any]:
    """Processor, cores, system, versions of packages, BLAS, date and load."""
    affinity = getattr(os, "sched_getaffinity", lambda _: set(range(os.cpu_count() or 1)))(0)
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "cores used": len(affinity),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: version_of(name) for name in packages},
        "blas of numpy": np.show_config(mode="dicts")["Build Dependencies"]["blas"]["name"],
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "load": load(),
    }


def load() -> list[float]:
    """Processes at work, over the last 1, 5 and 15 minutes."""
    return list(os.getloadavg()) if hasattr(os, "getloadavg") else []


def _processor() -> str:
    facts = Path("/proc/cpuinfo")
    if facts.exists():
        names = [line for line in facts.read_text().splitlines() if line.startswith("model name")]
        if names:
            return names[0].partition(":")[2].strip()
    return platform.processor() or platform.machine()
