"""The builder of the embedded bodies: from the published wheel to the shipped arrays."""
