"""Reports in plain text: sections under their titles, and tables."""

from collections.abc import Iterable, Sequence


def sections(parts: Iterable[tuple[str, Iterable[str]]]) -> str:
    """Titles in capitals, the lines of each indented; a section without lines is left out."""
    indented = [(title.upper(), [f"  {line}" for line in lines]) for title, lines in parts]
    return "\n\n".join("\n".join([title, *lines]) for title, lines in indented if lines)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table: the first column is aligned left, the others right."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    return [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (header, *rows)
    ]
