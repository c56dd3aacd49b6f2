"""Benchmarks of fits to images, videos and markers."""
