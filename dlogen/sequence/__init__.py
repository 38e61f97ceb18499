"""A recording of one object: one model for all frames, and its motion. Arrays to arrays; `files` writes."""
