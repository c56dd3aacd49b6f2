"""What the pages of a site point to and load, and what is wrong with that."""

import html.parser
from pathlib import Path
from urllib.parse import unquote, urlparse

LOADING = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}


class Links(html.parser.HTMLParser):
    """All that a page points to, all that it loads, and the places in it that have a name."""

    def __init__(self) -> None:
        super().__init__()
        self.to: list[str] = []
        self.loaded: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if found.get("id"):
            self.names.add(str(found["id"]))
        if tag == "a" and found.get("href"):
            self.to.append(str(found["href"]))
        if tag in LOADING and (at := found.get(LOADING[tag])):
            self.loaded.append(at)


def pages_of(site: Path) -> dict[Path, Links]:
    """Every page of a site by its path."""
    pages = {}
    for path in sorted(site.rglob("*.html")):
        if "_static" not in path.parts:
            pages[path] = Links()
            pages[path].feed(path.read_text(encoding="utf-8"))
    return pages


def troubles(site: Path) -> list[str]:
    """Links that lead nowhere, and what would be fetched from elsewhere."""
    pages, found = pages_of(site), []
    for page, links in pages.items():
        name = page.relative_to(site)
        for target in links.to + links.loaded:
            parts = urlparse(target)
            if parts.scheme == "data":
                continue
            if parts.netloc:
                if target in links.loaded:
                    found.append(f"{name} loads {target}")
                continue
            there = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            if not there.exists():
                found.append(f"{name} points to {target}")
            elif there in pages and unquote(parts.fragment) not in pages[there].names | {""}:
                found.append(f"{name} points to {target}, which has no such place")
    return found
