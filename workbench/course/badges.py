"""The cells at the top of a notebook that open it elsewhere: links to Colab and Binder.

They were written from what both services document and have not been tried, because this project is
made without a network.
"""

import re
from typing import Any

from workbench.course.notebooks import tool
from workbench.environment import DISTRIBUTION
from workbench.errors import BadArgument


def add_links(made: Any, repository: str, at: str, name: str) -> Any:
    """Put links and an installation at the top of a notebook that has been run.

    `repository` is `OWNER/NAME` on GitHub, and `at` the branch with the folder, if there is one, in
    which the notebook `name` will be: `main/notebooks`. Raises BadArgument.
    """
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repository):
        raise BadArgument(f"--repository takes OWNER/NAME, as on GitHub, not {repository!r}")
    branch, _, folder = at.strip("/").partition("/")
    if not branch:
        raise BadArgument("--at takes a branch, and the folder in it: main/notebooks")
    path = "/".join(filter(None, (folder, f"{name}.ipynb")))
    colab = f"https://colab.research.google.com/github/{repository}/blob/{branch}/{path}"
    binder = f"https://mybinder.org/v2/gh/{repository}/{branch}?labpath={path.replace('/', '%2F')}"
    v4 = tool("nbformat").v4
    links = v4.new_markdown_cell(f"[Open in Colab]({colab}) | [Open in Binder]({binder})")
    install = v4.new_code_cell(
        f'%pip install --quiet "{DISTRIBUTION}"', metadata={"tags": ["install"]}
    )
    links["id"], install["id"] = "links", "install"
    made.cells[1:1] = [links, install]
    return made


def requirements() -> str:
    """The text of the file `requirements.txt` from which Binder installs."""
    return f"{DISTRIBUTION}\njupyterlab\n"
