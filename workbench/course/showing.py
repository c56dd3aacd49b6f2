"""What a lecture shows beside prose: pictures, sources, and the frame of an interactive figure."""

import ast
import inspect
import sys
from base64 import b64encode
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any, TypeGuard

from workbench.plots import Figure, png
from workbench.reports.replay import Recording
from workbench.reports.replays import ReplayPage, replay_page


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure with its caption, as the last line of a cell.

    Attributes:
        figure: the figure.
        caption: what to see in it.
        moving: makes an interactive version, a page or a replay with a caption of its own. It is
            called where a page is wanted, and not by a run in a terminal.
    """

    figure: Figure
    caption: str
    moving: Callable[[], ReplayPage | Recording] | None = None

    @cached_property
    def png(self) -> bytes:
        """The figure as a PNG file of 150 pixels to the inch."""
        return png(self.figure)

    @cached_property
    def page(self) -> ReplayPage | None:
        """The interactive version as a page of its own; None if there is none."""
        moving = None if self.moving is None else self.moving()
        return replay_page(moving) if isinstance(moving, Recording) else moving

    def __repr__(self) -> str:
        return f"[figure] {self.caption}"

    @property
    def image(self) -> str:
        """The figure as HTML, whether or not there is one that moves."""
        width = round(100 * self.figure.get_figwidth())
        return (
            f'<img alt="{escape(self.caption)}" style="width: {width}px" '
            f'src="data:image/png;base64,{b64encode(self.png).decode()}">'
        )

    def _repr_html_(self) -> str:
        """For notebooks and the site: the figure of which the text speaks, and below what moves."""
        below = "" if self.page is None else framed(self.page.html)
        return (
            f'<figure class="picture">{self.image}'
            f"<figcaption>{escape(self.caption)}</figcaption>{below}</figure>"
        )


@dataclass(frozen=True)
class Source:
    """Code of the library.

    Attributes:
        text: the code.
        where: the full names of what it defines.
    """

    text: str
    where: str

    def __repr__(self) -> str:
        return f"# {self.where}\n{self.text}"

    def _repr_markdown_(self) -> str:
        """The code for notebooks and the site."""
        return f"```python\n# {self.where}\n{self.text}\n```"


def source(*what: Any) -> Source:
    """The source of functions, methods or classes; the last line of a cell.

    A lecture shows the library's code by this, so that the two cannot drift apart. Of properties
    and cached properties it is the function that they wrap. Constants of their modules that they
    read stand above them, so that a reader knows their values.
    """
    defined = [getattr(d, "fget", None) or getattr(d, "func", None) or d for d in what]
    texts = [inspect.cleandoc("\n" + inspect.getsource(d)).rstrip() for d in defined]
    read = {node.id for text in texts for node in ast.walk(ast.parse(text)) if _is_name(node)}
    modules = dict.fromkeys(sys.modules[d.__module__] for d in defined)
    above = [line for module in modules for line in _constants(inspect.getsource(module), read)]
    shown = "\n\n\n".join(["\n".join(above)] * bool(above) + texts)
    return Source(shown, ", ".join(f"{d.__module__}.{d.__qualname__}" for d in defined))


def _is_name(node: ast.AST) -> TypeGuard[ast.Name]:
    return isinstance(node, ast.Name)


def _constants(module: str, names: Collection[str]) -> Iterator[str]:
    """The lines of a module's text that give some of the names a value, with their comments."""
    lines = module.splitlines()
    for node in ast.parse(module).body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(_is_name(t) and t.id in names and t.id.isupper() for t in targets):
                yield from lines[node.lineno - 1 : node.end_lineno]


FRAME_HEAD = """
<style>
main { padding: 0; max-width: none; }
footer { display: none; }
main .replay { margin: 0; }
</style>
<script>
document.addEventListener("ready", () => {
  const main = document.querySelector("main"), room = 4; // px
  const bottom = () => Math.ceil(main.getBoundingClientRect().bottom + scrollY);
  const tell = () => parent.postMessage({ height: bottom() + room }, "*");
  new ResizeObserver(tell).observe(main);
});
</script>
"""
FRAME_SCRIPT = """
(figure => {
  const frame = figure.querySelector("iframe");
  addEventListener("message", event => {
    if (event.source === frame.contentWindow && event.data.height > 0)
      frame.style.height = event.data.height + "px";
  });
})(document.currentScript.parentElement)
"""


def framed(page: str) -> str:
    """HTML of a page in a frame that may run its own scripts and reach nothing else.

    The frame has no height until the page is ready, and none where scripts cannot run.
    """
    inner = page.replace("</head>", f"{FRAME_HEAD}</head>", 1)
    return (
        f'<iframe srcdoc="{escape(inner)}" sandbox="allow-scripts" loading="lazy" '
        'title="the figure, which can be changed by hand" '
        'style="display: block; width: 100%; height: 0; border: 0"></iframe>'
        f"<script>{FRAME_SCRIPT}</script>"
    )
