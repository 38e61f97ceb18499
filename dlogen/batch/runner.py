"""A batch: what has to be done, done where the pool does it, and recorded as it comes in."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dlogen._version import __version__
from dlogen.batch.executors.pool import Pool
from dlogen.batch.failures import MEMORY, OUTPUT, TIMEOUT, WORKER_DIED
from dlogen.batch.item import Item
from dlogen.batch.job import Failure, Outcome, Plan, Task, failure_of
from dlogen.batch.output_files import paths_of, remove_temporaries, write_files
from dlogen.batch.paths import as_unicode
from dlogen.batch.store import Row, Store
from dlogen.config.reader import read_text
from dlogen.errors import ConfigError, DlogenError, OutputError
from dlogen.io.cloud_files import sha256_of
from dlogen.io.outputs import Outputs

#: Failures that need not come again: they may be due to the machine and what else ran there.
_OF_THE_MACHINE = (TIMEOUT.code, MEMORY.code, WORKER_DIED.code)


@dataclass(frozen=True)
class BatchOptions:
    """How a batch deals with what is there already, and with its clouds' bytes.

    Attributes:
        force: do all clouds again, and overwrite files that no batch has made.
        retry: do clouds again that failed, though nothing has changed.
        ship: send the clouds' bytes to the workers, and take the results' bytes from them.
    """

    force: bool = False
    retry: bool = False
    ship: bool = False


class Kept:
    """The records of clouds that need not be done again, read as they are asked for.

    Args:
        store: that they are in.
        keys: of the clouds.
    """

    def __init__(self, store: Store, keys: frozenset[str]) -> None:
        self._store, self._keys = store, keys

    def __len__(self) -> int:
        return len(self._keys)

    def __iter__(self) -> Iterator[Row]:
        return (row for row in self._store.rows() if row.key in self._keys) if self._keys else iter(())


class Batch:
    """Clouds, with the folder for their results.

    Args:
        items: the clouds; their keys differ.
        folder: of the results.
        plan: what is done to each.
        store: the folder's records.
        options: see there.

    Attributes:
        kept: records of the clouds that need not be done again.
        todo: those that do.
    """

    def __init__(
        self, items: Sequence[Item], folder: Path, plan: Plan, store: Store, options: BatchOptions | None = None
    ) -> None:
        self.folder, self.plan, self.store = folder, plan, store
        self.options = options or BatchOptions()
        #: Key -> formats of which there are files that batches made; of the clouds that are to be done.
        self._made: dict[str, str] = {}
        #: Key -> what settings and cloud were when files were made of which some are not wanted now.
        self._before: dict[str, tuple[str, str | None]] = {}
        # There may be a million records: one is looked at after the other.
        place = {as_unicode(item.key): k for k, item in enumerate(items)}
        keep = bytearray(len(items))
        unfinished: dict[str, str] = {}
        touched: list[Row] = []
        for row in store.rows():
            if row.status == "running":
                unfinished[row.key] = row.formats
            k = place.get(row.key)
            if k is None:
                continue
            if self._is_up_to_date(items[k], row, touched):
                keep[k] = True
            elif row.formats:
                self._made[row.key] = row.formats
                if self._with_wanted(row.formats) != self._with_wanted(""):
                    self._before[row.key] = _made_of(row)
        for row in touched:
            store.write(row)
        self._remove_unfinished(items, unfinished)
        self.kept = Kept(store, frozenset(key for key, k in place.items() if keep[k]))
        self.todo = [item for item, kept in zip(items, keep, strict=True) if not kept]

    def run(self, pool: Pool) -> Generator[Row, None, None]:
        """Do what has to be done.

        Args:
            pool: where; it has the same plan.

        Yields:
            The records, as they come in.

        Raises:
            OutputError: nothing more can be written. What has been done is recorded.
            DlogenError: no work can be done at all.
        """
        under_way: dict[str, Row] = {}
        refused: list[Row] = []

        def tasks() -> Iterator[Task]:
            for item in self.todo:
                task, row = self._task(item)
                existing = self._of_others(item.key, row)
                if existing is None:
                    row.formats = self._with_wanted(row.formats)
                elif not self.options.force:
                    hint = "use --force to overwrite, or -o for another folder"
                    failure = Failure(OUTPUT.code, f"output exists: {as_unicode(str(existing))}", hint)
                    refused.append(self._failed(row, failure))
                    continue
                self.store.write(row)
                under_way[item.key] = row
                yield task if not self.options.ship else self._shipped(task)

        # Closed here and now when we are: what is under way ends before the records are closed.
        with contextlib.closing(pool.run(tasks())) as outcomes:
            for outcome in outcomes:
                yield from _drained(refused)
                yield self._record(under_way.pop(outcome.key), outcome)
        yield from _drained(refused)

    def _task(self, item: Item) -> tuple[Task, Row]:
        """What the worker is told, and what the records say meanwhile."""
        text = None
        if item.config is not None and os.path.isfile(item.config):  # noqa: PTH113
            # What cannot be read fails again in the worker, as the failure of this cloud.
            with contextlib.suppress(ConfigError):
                text = read_text(item.config)
        task = Task(item.cloud, item.key, item.config, text, item.overrides)
        size, modified = _stat(item.cloud)
        row = Row(as_unicode(item.key), as_unicode(item.cloud), "running", size=size, modified_ns=modified)
        row.digest, row.version = self.plan.digest(task), __version__
        row.formats = self._made.get(row.key, "")
        return task, row

    def _shipped(self, task: Task) -> Task:
        """With the cloud's bytes. What cannot be read fails again in the worker."""
        try:
            # Never waits for a pipe: those that the worker meets it refuses.
            content = Path(task.cloud).read_bytes() if Path(task.cloud).is_file() else None
        except OSError:
            content = None
        return dataclasses.replace(task, content=content)

    def _record(self, row: Row, outcome: Outcome) -> Row:
        """Put down how it went, and write the results if the worker could not."""
        failure = outcome.failure
        if failure is None and outcome.files is not None:
            try:
                write_files(str(self.folder), outcome.key, outcome.files)
            except DlogenError as error:
                failure = failure_of(error)
        if failure is not None and failure.stops_all:
            # Not this cloud's fault: it stays undone.
            raise OutputError(
                failure.message,
                "free some space and run the same command again: it goes on where it stopped",
                path=self.folder,
                for_all=True,
            )
        row.sha256, row.seconds = outcome.sha256, outcome.seconds
        if failure is not None:
            # A model of what the cloud or the settings were before would pass for one of what they are now.
            _remove(paths_of(self.folder, outcome.key, Outputs.of(row.formats.split())))
            row.formats = ""
            return self._failed(row, failure)
        row.status, row.verdict = "done", outcome.verdict
        if row.key in self._before and self._before[row.key] != _made_of(row):
            # They would pass as well.
            made = self._made[row.key].split()
            stale = Outputs.of(name for name in made if name not in self.plan.outputs.names)
            kept = set(paths_of(self.folder, outcome.key, self.plan.outputs))
            _remove([path for path in paths_of(self.folder, outcome.key, stale) if path not in kept])
            row.formats = ""
        row.formats = self._with_wanted(row.formats)
        row.findings, row.metrics = " ".join(outcome.findings), dict(outcome.metrics)
        row.timings = json.dumps({stage: round(seconds, 6) for stage, seconds in outcome.timings.items()})
        self.store.write(row)
        return row

    def _failed(self, row: Row, failure: Failure) -> Row:
        row.status, row.code, row.error = "failed", failure.code, as_unicode(failure.message)
        row.hint, row.stage = failure.hint and as_unicode(failure.hint), failure.stage
        self.store.write(row)
        return row

    def _remove_unfinished(self, items: Sequence[Item], unfinished: dict[str, str]) -> None:
        """Temporary files of a run that was killed, beside the summary and the results that were under way.

        Args:
            items: the clouds.
            unfinished: key -> formats of what was under way.
        """
        remove_temporaries(self.folder, "", self.plan.outputs)
        # What is not Unicode has another name in the records.
        odd = (
            {item.key: as_unicode(item.key) for item in items if as_unicode(item.key) in unfinished}
            if unfinished
            else {}
        )
        for key, formats in (unfinished | {key: unfinished[name] for key, name in odd.items()}).items():
            remove_temporaries(self.folder, key, Outputs.of(self._with_wanted(formats).split()))

    def _with_wanted(self, formats: str) -> str:
        return " ".join(dict.fromkeys((*formats.split(), *self.plan.outputs.names)))

    def _of_others(self, key: str, row: Row) -> Path | None:
        """A file in the place of a result that no batch has made."""
        ours = set(paths_of(self.folder, key, Outputs.of(row.formats.split()))) if row.formats else set()
        wanted = paths_of(self.folder, key, self.plan.outputs)
        return next((path for path in wanted if path not in ours and os.path.lexists(path)), None)

    def _is_up_to_date(self, item: Item, row: Row, touched: list[Row]) -> bool:
        """Whether nothing has changed since that record was made. One with a new time only goes into `touched`."""
        if self.options.force or row.status == "running":
            return False
        if row.status == "failed" and (self.options.retry or row.code in _OF_THE_MACHINE or row.code == OUTPUT.code):
            return False
        _, now = self._task(item)
        if (now.digest, now.size) != (row.digest, row.size):
            return False
        if now.modified_ns != row.modified_ns:
            # Copied or touched, perhaps not changed.
            if row.sha256 is None or _sha256(item.cloud) != row.sha256:
                return False
            row.modified_ns = now.modified_ns
            touched.append(row)
        return row.status == "failed" or all(map(os.path.lexists, paths_of(self.folder, item.key, self.plan.outputs)))


def _made_of(row: Row) -> tuple[str, str | None]:
    """Settings and version, and the cloud's bytes: when these are the same, so are files of all formats."""
    return (row.digest or "").partition(" ")[0], row.sha256


def _remove(paths: list[Path]) -> None:
    """Remove files. Folders stay: another cloud may be about to be written there."""
    for path in paths:
        with contextlib.suppress(OSError):
            path.unlink()


def _drained(rows: list[Row]) -> Iterator[Row]:
    while rows:
        yield rows.pop(0)


def _stat(path: str) -> tuple[int | None, int | None]:
    """Size and time of the last change; None where there is no such file."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return None, None
    return found.st_size, found.st_mtime_ns


def _sha256(path: str) -> str | None:
    try:
        with Path(path).open("rb") as stream:
            return sha256_of(stream)
    except OSError:
        return None
