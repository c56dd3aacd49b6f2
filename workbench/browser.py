"""What Python does not have inside of a browser: other processes, and threads.

Pyodide has CasADi 3.7.2, NLopt 2.9.1 and few other compiled packages: emcee, ArviZ and corner are
imported where they are needed (`installation.library`). Whatever would start threads or processes
asks `in_browser` first; what cannot do without another process raises NoProcesses.
"""

import sys

PLATFORMS = ("emscripten", "wasi")  # what `sys.platform` is there; the first is Pyodide's


def in_browser() -> bool:
    """Whether this is Python in WebAssembly, where no process and no thread can be started."""
    return sys.platform in PLATFORMS
