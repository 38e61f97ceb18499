"""How long each stage takes, and the name of the stage in errors that come out of it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from dlogen.errors import DlogenError


class Clock:
    """Seconds per stage.

    Attributes:
        seconds: by the name of the stage, in the order in which the stages ended.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what runs inside; a `DlogenError` without a stage gets this one."""
        start = time.perf_counter()
        try:
            yield
        except DlogenError as error:
            error.stage = error.stage or name
            raise
        finally:
            self.seconds[name] = time.perf_counter() - start
