"""What to measure next: how true the predictions of `workbench.diagnostics.design` are."""
