"""A planar figure that answers to the hand, as a page of its own.

An interactive figure is the third argument of a lecture's `Picture`: a function that makes a page,
called only where a page is wanted. `course/framing.py` puts it into a frame of no height above the
still figure, which stays if anything is missing.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup

from workbench.reports.page import page
from workbench.reports.replay_page import ReplayPage

WITHOUT = "This page needs a browser with scripts to show the figure."


def flat_page(script: Path, data: Mapping[str, Any], caption: str) -> ReplayPage:
    """The page of a script that draws with `flat.js`.

    The script defines `figure(root, data)`, which returns a `Flat`. What `packed` made of arrays
    in `data` are arrays there.
    """
    text = Markup(script.read_text(encoding="utf-8"))
    html = page(
        "flat.html", title="", script=text, data=dict(data), caption=caption, without=WITHOUT
    )
    return ReplayPage(html, caption)
