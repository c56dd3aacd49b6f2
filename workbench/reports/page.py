"""Pages from templates: everything inside them, nothing fetched from elsewhere."""

import json
import platform
from collections.abc import Mapping
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from workbench.diagnostics.data import plain
from workbench.installation import DISTRIBUTION, version_of

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "nlopt", "emcee", "matplotlib")


def page(template: str, **content: Any) -> str:
    """Fill one of `templates/`, which also get `versions`; every text is escaped.

    Templates may include the scripts of `workbench/replay/scripts`.
    """
    environment = Environment(
        loader=ChoiceLoader(
            [
                PackageLoader("workbench.reports", "templates"),
                PackageLoader("workbench.replay", "scripts"),
            ]
        ),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(versions=versions(), **content)


def versions() -> dict[str, str | None]:
    """Of Python and of what computes; None for what is not installed."""
    return {"python": platform.python_version()} | {name: version_of(name) for name in PACKAGES}


def as_json(summary: Mapping[str, Any]) -> str:
    """JSON as every reader takes it: arrays as lists, null where a number is not finite."""
    return json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
