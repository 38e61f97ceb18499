"""Fixtures: `clouds` and `plan`."""

from small_batch import clouds, plan  # noqa: F401
