"""From registrations to bodies: the model, the data, the plan, the blocks and the evaluation."""
