"""Figures inside a page."""

from base64 import b64encode
from dataclasses import dataclass

from workbench.plots import Figure, smallest


@dataclass(frozen=True)
class Shown:
    """A figure as a page holds it: its bytes as a data address, and what it shows in words."""

    data: str
    caption: str
    width: int  # px on the page at most


def shown(figure: Figure, caption: str) -> Shown:
    """SVG or PNG, whichever is smaller."""
    drawn, kind = smallest(figure)
    code = b64encode(drawn).decode("ascii")
    return Shown(f"data:{kind};base64,{code}", caption, round(100 * figure.get_figwidth()))
