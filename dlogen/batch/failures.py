"""The codes of failures in the records of a batch, explained. Imports nothing heavy: `dlogen explain` reads it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from dlogen.stages.quality.findings import Explanation, declared

_declared: dict[str, Explanation] = {}

#: All of them by their codes.
FAILURES: Mapping[str, Explanation] = MappingProxyType(_declared)


def _failure(code: str, meaning: str, what_to_do: str) -> Explanation:
    """Declare a kind of failure."""
    return declared(_declared, Explanation(code, "batch", meaning, what_to_do))


INPUT = _failure(
    "input",
    "The cloud cannot be read, or does not hold what it claims.",
    "Try dlogen info on it; where a download or a copy was cut short, get the file again.",
)
CONFIG = _failure(
    "config",
    "The configuration cannot be used, or does not fit this cloud.",
    "Correct the key that the message names, in the cloud's own YAML file or list row, in -c or in --set.",
)
FIT = _failure(
    "fit",
    "No chain can be made of this cloud.",
    "Leave only the object in the cloud, check r and units, and look at it with dlogen info.",
)
OUTPUT = _failure(
    "output",
    "The results cannot be written, or a file that is not of this batch stands in their place.",
    "See whether there is space and whether the folder may be written; --force overwrites, -o takes another folder.",
)
MEMORY = _failure(
    "memory",
    "The memory that a worker may take was not enough for this cloud.",
    "Raise --memory, use fewer --jobs, or leave out points of the cloud.",
)
TIMEOUT = _failure(
    "timeout",
    "The cloud took longer than --timeout allows.",
    "Raise --timeout, or look at the cloud with dlogen info: it may be more than one object.",
)
WORKER_DIED = _failure(
    "worker-died",
    "The process that worked on the cloud ended, each time that it was tried.",
    "Memory may have run out: try fewer --jobs, or give --memory. Run dlogen fit on this cloud to see it alone.",
)
INTERNAL = _failure(
    "internal",
    "This is a bug in dlogen.",
    "Run dlogen fit --debug on this cloud, which shows where it is, and report it.",
)
