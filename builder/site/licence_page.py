"""The page of licences: the workbench's own, and those of the libraries that a site ships."""

from pathlib import Path

from builder.site.examples import raw


def write_licence_page(pages: Path, ours: tuple[str, ...], folder: Path) -> None:
    """Write a page with links to the workbench's own texts and to those in the folder."""
    texts = [*ours, *sorted(f"{folder.name}/{path.name}" for path in folder.iterdir())]
    items = "".join(f'<li><a href="{text}">{text}</a></li>' for text in texts)
    listed = raw(f"<ul>{items}</ul>")
    (pages / "licences.md").write_text(
        "# Licences\n\nThe licence of the workbench, its notices, and the licences of the "
        f"libraries whose style sheets, scripts and fonts are part of this site.\n\n{listed}\n",
        encoding="utf-8",
    )
