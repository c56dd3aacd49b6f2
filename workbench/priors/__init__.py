"""Which poses are likely before any data: Gaussians and mixtures learned, and joint limits."""
