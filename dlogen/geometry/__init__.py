"""Geometry of curves, rotations and meshes: arrays in, arrays out."""
