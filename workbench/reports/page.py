"""Pages from templates: everything inside them, nothing fetched from elsewhere."""

import json
import platform
from collections.abc import Mapping
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from workbench.diagnostics.data import plain
from workbench.environment import DISTRIBUTION, version_of
from workbench.plots.palette import solver_styles
from workbench.solvers import SOLVERS

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "nlopt", "emcee", "matplotlib")


def page(template: str, **content: Any) -> str:
    """Fill one of `templates/`; every text is escaped.

    They also get `versions`, and `solver_colours`, that of each solver in the figures.

    Templates may include the scripts of `workbench/reports/replay/scripts`.
    """
    environment = Environment(
        loader=ChoiceLoader(
            [
                PackageLoader("workbench.reports", "templates"),
                PackageLoader("workbench.reports.replay", "scripts"),
            ]
        ),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    colours = {name: style.color for name, style in solver_styles(SOLVERS).items()}
    environment.globals["solver_colours"] = colours  # which macros see as well
    return environment.get_template(template).render(versions=versions(), **content)


def versions() -> dict[str, str | None]:
    """Of Python and of what computes; None for what is not installed."""
    return {"python": platform.python_version()} | {name: version_of(name) for name in PACKAGES}


def as_json(summary: Mapping[str, Any]) -> str:
    """JSON as every reader takes it: arrays as lists, null where a number is not finite."""
    return json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
