"""The errors that dlogen raises. The command line turns them into messages in one place (`dlogen.cli.main`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


class DlogenError(Exception):
    """Something that the user can act on.

    Args:
        message: what is wrong, in one sentence.
        hint: what to try.
        path: the file that it is about, if any.
        stage: the pipeline stage that it happened in, if any.

    >>> import dlogen
    >>> try:
    ...     dlogen.fit([[0.0, 0.0, 0.0]])
    ... except dlogen.DlogenError as error:
    ...     print(f"{error.message} ({error.stage}); try: {error.hint}")
    1 points are too few: at least 12 are needed (input); try: a few hundred points along the object are a good start
    """

    #: Exit code of the command line: 1 the run failed, 2 usage, config or an input that cannot be read.
    exit_code = 1

    def __init__(
        self,
        message: str,
        hint: str | None = None,
        *,
        path: str | Path | None = None,
        stage: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.path = path
        self.stage = stage

    def __str__(self) -> str:
        where = "".join(f"{part}: " for part in (self.path, self.stage) if part is not None)
        return f"{where}{self.message}" + (f" ({self.hint})" if self.hint else "")


class InputError(DlogenError):
    """A file that cannot be read, or that does not hold what it claims.

    >>> import dlogen
    >>> try:
    ...     dlogen.read_cloud("nowhere.ply")
    ... except dlogen.InputError as error:
    ...     print(error.message)
    cannot read: No such file or directory
    """

    exit_code = 2


class ConfigError(DlogenError):
    """A configuration that cannot be used: unknown key, wrong type, out of range.

    >>> import dlogen
    >>> try:
    ...     dlogen.Config.from_dict({"emax": 0.01})
    ... except dlogen.ConfigError as error:
    ...     print(error.message)
    unknown key 'emax'
    """

    exit_code = 2


class UsageError(DlogenError):
    """A call that cannot be carried out as it was made (flags that contradict, an existing output).

    >>> import dlogen
    >>> try:
    ...     dlogen.write_cloud("cloud.xyz", [[0.0, 0.0, 0.0]])
    ... except dlogen.UsageError as error:
    ...     print(error.message)
    no cloud format has the name ending '.xyz'
    """

    exit_code = 2


class OutputError(UsageError):
    """A place that cannot be written.

    Args:
        message: as of `DlogenError`.
        hint: as of `DlogenError`.
        path: as of `DlogenError`.
        for_all: nothing else can be written there either: the disk is full or read-only.

    >>> import dlogen
    >>> try:
    ...     dlogen.write_cloud("/dev/null/cloud.ply", [[0.0, 0.0, 0.0]])
    ... except dlogen.OutputError as error:
    ...     print(error.exit_code)
    2
    """

    def __init__(
        self, message: str, hint: str | None = None, *, path: str | Path | None = None, for_all: bool = False
    ) -> None:
        super().__init__(message, hint, path=path)
        self.for_all = for_all


class FitError(DlogenError):
    """A readable cloud from which no chain can be made.

    >>> import dlogen
    >>> try:
    ...     dlogen.fit([[0.0, 0.0, 0.0]] * 3 + [[1.0, 0.0, 0.0]])
    ... except dlogen.FitError as error:
    ...     print(error.message)
    2 points are too few: at least 12 are needed
    """


class Interrupted(DlogenError):
    """The user, or the system, wants the program to end.

    Args:
        message: as of `DlogenError`.
        hint: as of `DlogenError`.
        signal: its number; the exit code is 128 more, as of shells.
    """

    def __init__(self, message: str, hint: str | None = None, *, signal: int = 2) -> None:
        super().__init__(message, hint)
        self.exit_code = 128 + signal
