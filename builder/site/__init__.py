"""The full site: front page, course, examples, API reference and documents, from a checkout."""

from builder.site.full_site import write_site

__all__ = ["write_site"]
