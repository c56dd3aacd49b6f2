"""`workbench info`, as a user types it."""

import os
import subprocess
import sys
from pathlib import Path


def test_info_says_which_arithmetic_is_active_and_why(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from workbench.cli import main; main()", "info"],
        env=os.environ
        | {
            "WORKBENCH_COMPILE": "0",
            "WORKBENCH_CACHE": str(tmp_path / "kept"),
            "WORKBENCH_THREADS": "1",
        },
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "NumPy: switched off by WORKBENCH_COMPILE=0" in said
    assert "0 libraries" in said
    assert "1 in a run" in said
    for package in ("casadi 3.", "numpy ", "scipy ", "nlopt ", "emcee ", "python 3."):
        assert package in said
