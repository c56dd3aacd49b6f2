"""The browser in which the scripts of pages are asked what they compute."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

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


ASKED = """
<pre id="answers"></pre>
<script type="module">
const answers = {};
try {
  const root = document.querySelector("[data-replay], [data-flat]");
  for (let n = 0; n < 200 && !root.dataset.ready && !root.hidden; n++)
    await new Promise(done => setTimeout(done, 50));
  const replay = root.replay ?? root.flat;
  const buttons = [...root.querySelectorAll("button")];
  const press = text => buttons.find(button => button.textContent.startsWith(text)).click();
  %s
} catch (error) { answers.error = String(error); }
document.getElementById("answers").textContent = JSON.stringify(answers);
</script>
"""
DRAWING = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--window-size=500,500",
    "--virtual-time-budget=20000",
)


def asked_of_replay(html: str, script: str, folder: Path) -> Any:
    """What a script puts into `answers` when it asks the first replay of a page in the browser.

    A planar figure is asked in the same way. The script has `replay`, and `press(text)`, which
    presses a button of it. Skips the test where there is no browser.
    """
    need_browser()
    page = folder / "index.html"
    page.write_text(html.replace("</main>", ASKED % script + "</main>"), encoding="utf-8")
    text, complaints = dumped(page, *DRAWING)
    found = re.search(r'<pre id="answers">(.*?)</pre>', text, re.DOTALL)
    assert found, complaints
    told = json.loads(unescape(found[1]))
    assert "error" not in told, (told, complaints)
    return told
