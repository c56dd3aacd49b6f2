"""A page inside another page, in the place of a figure that stands still.

The frame has no height until the page in it says that it is ready. So wherever something is
missing (scripts, WebGL 2, or the frame itself, which some viewers of notebooks take away), nothing
is seen of it, and the figure is there as ever. Once the page is ready, the figure is folded.
"""

from html import escape

FOLDED = "The still figure"
INSIDE = """
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
OUTSIDE = """
(figure => {
  const frame = figure.querySelector("iframe"), still = figure.querySelector("details");
  addEventListener("message", event => {
    if (event.source !== frame.contentWindow || !(event.data.height > 0)) return;
    if (!frame.offsetHeight) { still.open = false; still.querySelector("summary").hidden = false; }
    frame.style.height = event.data.height + "px";
  });
})(document.currentScript.parentElement)
"""


def framed(page: str, still: str) -> str:
    """HTML of a page in a frame that may run its own scripts and reach nothing else.

    `still` is what is seen until the page is ready, and where it never is.
    """
    inner = page.replace("</head>", f"{INSIDE}</head>", 1)
    return (
        f'<iframe srcdoc="{escape(inner)}" sandbox="allow-scripts" loading="lazy" '
        'title="the figure, which can be changed by hand" '
        'style="display: block; width: 100%; height: 0; border: 0"></iframe>'
        f"<details open><summary hidden>{FOLDED}</summary>{still}</details>"
        f"<script>{OUTSIDE}</script>"
    )
