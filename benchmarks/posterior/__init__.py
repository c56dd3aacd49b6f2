"""Posteriors measured: beside NUTS, held-out truth, simulated truth, and how many a second."""
