"""From the skeleton line to joints: the paper's III.D and III.E, and criteria beyond them."""
