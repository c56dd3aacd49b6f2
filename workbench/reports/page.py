"""Pages from templates: everything inside them, nothing fetched from elsewhere."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from workbench.reports.provenance import versions


def page(template: str, **content: Any) -> str:
    """Fill one of `templates/`, which also get `versions`; every text is escaped."""
    environment = Environment(
        loader=PackageLoader("workbench.reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(versions=versions(), **content)
