"""Fits to images, videos and markers, measured: `python -m benchmarks.images`."""
