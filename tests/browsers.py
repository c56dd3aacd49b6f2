"""The browser in which the scripts of pages are asked what they compute."""

import shutil
import subprocess
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
BROWSER = next((found for name in BROWSERS if (found := shutil.which(name))), None)
ALWAYS = ("--headless", "--no-sandbox", "--no-first-run", "--dump-dom")


def need_browser() -> None:
    """Skip the test, with the reason, where there is no browser."""
    if BROWSER is None:
        pytest.skip(f"no browser is called {', '.join(BROWSERS)}")


def dumped(page: Path, *options: str) -> tuple[str, str]:
    """The page as it is after its scripts have run, and the end of what the browser complained."""
    assert BROWSER is not None
    profile = f"--user-data-dir={page.parent / 'profile'}"
    command = [BROWSER, *ALWAYS, profile, *options, page.as_uri()]
    ran = subprocess.run(command, capture_output=True, timeout=300)
    return ran.stdout.decode(), ran.stderr.decode()[-1000:]
