"""The machine that numbers were measured on."""

import os
import platform


def processor() -> str:
    """The name of the processor, as the system gives it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            names = [line.partition(":")[2].strip() for line in lines if "model name" in line]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or "unknown"


def machine() -> str:
    """Processor, cores and system: `AMD EPYC, 2 cores, Linux x86_64`."""
    return f"{processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"
