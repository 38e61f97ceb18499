"""The stages of the paper's section III, one file each: pure functions from arrays to arrays."""
