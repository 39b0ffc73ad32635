"""Rock that slides on rock in the laboratory: rate-and-state friction from a step of the speed."""
