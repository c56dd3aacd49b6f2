"""What is likely of poses before any data: Gaussians and mixtures learned, and joint limits."""
