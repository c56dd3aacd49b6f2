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
    """A figure with its caption, as the last line of a cell.

    Attributes:
        figure: the figure.
        caption: what to see in it.
    """

    figure: Figure
    caption: str

    @cached_property
    def png(self) -> bytes:
        """The figure as a PNG file of 150 pixels to the inch."""
        return png(self.figure)

    def __repr__(self) -> str:
        return f"[figure] {self.caption}"

    def _repr_html_(self) -> str:
        """The picture for notebooks and the site."""
        width = round(100 * self.figure.get_figwidth())
        return (
            f'<figure class="picture"><img alt="{escape(self.caption)}" style="width: {width}px" '
            f'src="data:image/png;base64,{b64encode(self.png).decode()}">'
            f"<figcaption>{escape(self.caption)}</figcaption></figure>"
        )


@dataclass(frozen=True)
class Source:
    """Code of the library.

    Attributes:
        text: the code.
        where: the full name of what it defines.
    """

    text: str
    where: str

    def __repr__(self) -> str:
        return f"# {self.where}\n{self.text}"

    def _repr_markdown_(self) -> str:
        """The code for notebooks and the site."""
        return f"```python\n# {self.where}\n{self.text}\n```"


def source(what: Any) -> Source:
    """The source of a function, a method or a class; the last line of a cell.

    A lecture shows the library's code by this, so that the two cannot drift apart. Of properties
    and cached properties it is the function that they wrap.
    """
    found = getattr(what, "fget", None) or getattr(what, "func", None) or what
    text = inspect.cleandoc("\n" + inspect.getsource(found))
    return Source(text.rstrip(), f"{found.__module__}.{found.__qualname__}")
