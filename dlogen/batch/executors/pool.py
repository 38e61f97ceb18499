"""What a batch needs of the place where its work is done."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Protocol

from dlogen.batch.job import Outcome, Task


class Pool(Protocol):
    """Where the work of a batch is done."""

    def run(self, tasks: Iterator[Task]) -> Generator[Outcome, None, None]:
        """The outcomes, in the order in which they come. Tasks are taken as they are needed.

        Closing the iterator abandons what is under way.

        Raises:
            DlogenError: no work can be done at all.
        """
