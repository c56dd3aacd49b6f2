"""The static site of the course, built by Sphinx without a network."""

from workbench.site.building import NEEDED
from workbench.site.course_pages import write_course_site

__all__ = ["NEEDED", "write_course_site"]
