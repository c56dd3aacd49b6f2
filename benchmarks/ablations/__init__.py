"""What each term of training does: the same training without it."""
