"""Studies: one question each, answered from seeds to a page."""
