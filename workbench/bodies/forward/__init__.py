"""From pose, betas and trans to points: the skeleton, the graph, and the arithmetic."""
