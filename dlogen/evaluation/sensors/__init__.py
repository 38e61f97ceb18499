"""Simulated sensors that fail as the real ones do: correlated noise, mixed pixels, holes, masks, ghosts."""
