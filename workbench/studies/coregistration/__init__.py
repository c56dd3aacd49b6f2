"""When it is worth registering scans together: by the number of scans, and the share of holes."""
