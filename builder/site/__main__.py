"""Write the full site: the course, the examples, the API reference and the documents.

    python -m builder.site FOLDER

Every lecture and every example is run. `workbench lecture site FOLDER` writes the course alone.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from builder.site import write_site
from workbench.cli import explain, tell
from workbench.errors import WorkbenchError


def main(given: Sequence[str] | None = None) -> int:
    """Parse the arguments, write the site, and return the exit code.

    It is 2 after an error, which is told in a sentence, and 130 after an interrupt.
    """
    parser = argparse.ArgumentParser(
        prog="python -m builder.site",
        description="Write the full site: the course, the examples, the API reference and the "
        "documents, without a network. Every lecture and every example is run.",
        epilog="It needs a checkout and the extra `course`. `workbench lecture site FOLDER` "
        "writes the course alone.",
    )
    parser.add_argument(
        "folder", type=Path, help="where to write; it is made, or an older site in it is replaced"
    )
    folder = parser.parse_args(given).folder
    console = Console()
    try:
        page = write_site(folder, lambda said: console.print(f"[dim]{escape(said)}[/]"))
    except WorkbenchError as error:
        explain(error)
        return 2
    except KeyboardInterrupt:
        tell("interrupted; nothing was written")
        return 130
    console.print(f"site: [bold]{escape(str(page))}[/]", soft_wrap=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
