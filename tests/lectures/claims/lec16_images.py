"""What lecture 16 says of its run."""
SAYS = {}
GIVEN = ()
