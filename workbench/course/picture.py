"""What a lecture shows: figures with their captions, and the library's own source."""

import inspect
from base64 import b64encode
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any

from workbench.plots import Figure, png


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure and what to see in it; the last line of a cell."""

    figure: Figure
    caption: str

    @cached_property
    def png(self) -> bytes:
        """150 pixels to the inch."""
        return png(self.figure)

    def __repr__(self) -> str:
        return f"[figure] {self.caption}"

    def _repr_html_(self) -> str:
        """For notebooks and the site."""
        width = round(100 * self.figure.get_figwidth())
        return (
            f'<figure class="picture"><img alt="{escape(self.caption)}" style="width: {width}px" '
            f'src="data:image/png;base64,{b64encode(self.png).decode()}">'
            f"<figcaption>{escape(self.caption)}</figcaption></figure>"
        )


@dataclass(frozen=True)
class Source:
    """Code of the library, as it is."""

    text: str
    where: str

    def __repr__(self) -> str:
        return f"# {self.where}\n{self.text}"

    def _repr_markdown_(self) -> str:
        """For notebooks and the site."""
        return f"```python\n# {self.where}\n{self.text}\n```"


def source(what: Any) -> Source:
    """The source of a function, a method or a class; the last line of a cell.

    A lecture shows what it talks about by this, so the two cannot drift apart. Decorated things
    (cached properties) are looked through.
    """
    found = getattr(what, "fget", None) or getattr(what, "func", None) or what
    text = inspect.cleandoc("\n" + inspect.getsource(found))
    return Source(text.rstrip(), f"{found.__module__}.{found.__qualname__}")
