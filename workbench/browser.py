"""What Python does not have inside of a browser: other processes, and threads."""

import sys

PLATFORMS = ("emscripten", "wasi")  # what `sys.platform` is there; the first is Pyodide's


def in_browser() -> bool:
    """Whether this is Python in WebAssembly, where no process and no thread can be started."""
    return sys.platform in PLATFORMS
