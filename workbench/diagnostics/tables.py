"""Reports in plain text: sections under their titles, and tables."""

from collections.abc import Iterable, Sequence


def sections(parts: Iterable[tuple[str, Iterable[str]]]) -> str:
    """Titles in capitals, the lines of each indented; a section without lines is left out."""
    indented = [(title.upper(), [f"  {line}" for line in lines]) for title, lines in parts]
    return "\n\n".join("\n".join([title, *lines]) for title, lines in indented if lines)


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] | None = None
) -> list[str]:
    """Lines of a table, two spaces between its columns.

    The columns with the indices `numbers`, or else all but the first, are aligned right.
    """
    right = range(1, len(header)) if numbers is None else numbers
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    return [
        "  ".join(
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (header, *rows)
    ]
