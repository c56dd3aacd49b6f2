"""How fast the workbench is, against its peers and the hardware: `python -m benchmarks`."""
