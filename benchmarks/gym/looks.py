"""Every look at the untouched cases is written down, before it is taken.

`looks.md` beside this file is the log. It belongs into the repository: a look that is not committed
has still been taken.
"""

import subprocess
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.gym.case import Case
from benchmarks.gym.split import untouched
from workbench.identity import code_version

LOG = Path(__file__).parent / "looks.md"
HEAD = """# Looks at the untouched cases of the gym

`python -m benchmarks.gym --untouched PURPOSE` adds a line before it runs.

| date | commit | code | purpose |
| --- | --- | --- | --- |
"""


def looked(purpose: str, log: Path = LOG) -> tuple[Case, ...]:
    """The untouched cases, after this look at them has been written down.

    Raises ValueError for an empty purpose, and OSError if the log cannot be written.
    """
    said = " ".join(purpose.split()).replace("|", "/")
    if not said:
        raise ValueError("say what the look at the untouched cases is for")
    text = log.read_text(encoding="utf-8") if log.exists() else HEAD
    date = datetime.now(UTC).isoformat(timespec="seconds")
    log.write_text(f"{text}| {date} | {_commit()} | {code_version()} | {said} |\n", "utf-8")
    return untouched()


def _commit() -> str:
    """The short hash of the commit that is checked out, with `+` if files differ from it."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=LOG.parent, capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    return (git("rev-parse", "--short", "HEAD") or "unknown") + "+" * bool(git("status", "-s"))
