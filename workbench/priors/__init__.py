"""Which poses are likely before any data: learned Gaussians and mixtures, and joint limits."""
