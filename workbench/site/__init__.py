"""The static site: front page, course, examples, reference and documents, built without network."""

from workbench.site.building import NEEDED
from workbench.site.site import write_course_site, write_site

__all__ = ["NEEDED", "write_course_site", "write_site"]
