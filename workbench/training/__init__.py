"""From registrations to bodies: training a model, and the builder of the embedded ones."""
