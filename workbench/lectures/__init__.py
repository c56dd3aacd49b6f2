"""The course: a folder of four files for each lecture, and its line in `outline`.

In an installed package the lectures stand beside this file. In a checkout, and in an editable
installation of it, they stand in the folder `lectures/` at its top; `__path__` then leads there,
so that `workbench.lectures.outline` is the same module in both. AUTHORS.md, beside the lectures,
says how one is added.
"""

from pathlib import Path

_HERE = Path(__file__).parent
_CHECKOUT = _HERE.parents[1] / "lectures"

if not (_HERE / "outline.py").is_file() and (_CHECKOUT / "outline.py").is_file():
    __path__ = [str(_CHECKOUT)]
