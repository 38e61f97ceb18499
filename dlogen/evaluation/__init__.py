"""Synthetic clouds with a known truth, and how well the method does on them."""
