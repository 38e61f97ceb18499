"""Watching a batch: progress, lines of JSON, thresholds, and what to say at the end."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from types import FrameType

import click

from dlogen.batch.executors.pool import Pool
from dlogen.batch.executors.worker import NotStarted
from dlogen.batch.metrics import Threshold
from dlogen.batch.paths import shown
from dlogen.batch.runner import Batch
from dlogen.batch.store import Row
from dlogen.batch.summary import CSV_NAME, Causes, write_summary
from dlogen.cli.console import Console
from dlogen.cli.progress import duration, progress
from dlogen.errors import DlogenError, Interrupted, OutputError

#: Causes of failure, and clouds above a limit, that are named at the end; all are in the summary.
_MOST_NAMED = 10


def run_batch(
    batch: Batch,
    pool: Pool,
    console: Console,
    *,
    thresholds: Sequence[Threshold] = (),
    strict: bool = False,
    as_json: bool = False,
    tolerant: bool = False,
    finish: Callable[[], None] | None = None,
) -> None:
    """Run a batch to its end, or to Ctrl-C; what has been done is recorded and summed up either way.

    Args:
        batch: what is to be done.
        pool: where.
        console: for messages.
        thresholds: metrics that may not be larger.
        strict: only good models will do.
        as_json: print a line for every cloud on stdout.
        tolerant: clouds may fail; it is said all the same.
        finish: what else is to be done when all clouds are, before it is said how that went.

    Raises:
        DlogenError: a cloud failed, or is worse than wanted; or nothing more could be written.
        Interrupted: by Ctrl-C, or by SIGTERM.
    """
    tally = _Tally(thresholds, strict)
    start = time.monotonic()
    total = len(batch.kept) + len(batch.todo)
    if batch.kept:
        failed = sum(row.status == "failed" for row in batch.kept)
        before = f", {failed} failed before: --retry does them again" if failed else ""
        console.info(
            f"{len(batch.kept) - failed} of {_clouds(total)} {'is' if total == 1 else 'are'} done already{before}"
        )
    # What else is written to the terminal would mix with a bar.
    bar = console.level == 0 and not (as_json and sys.stdout.isatty())
    try:
        with _terminable(), contextlib.closing(_rows(batch, pool, console, bar)) as rows:
            for row, kept in rows:
                tally.add(row)
                if as_json:
                    more = {"kept": True} if kept else {}
                    _print(json.dumps(row.to_dict() | more, ensure_ascii=False, allow_nan=False))
                elif not kept:
                    console.detail(_line(row))
        write_summary(batch.store, batch.folder)
    except BaseException as error:
        # Summed up as far as it came; a second Ctrl-C omits that.
        with contextlib.suppress(OutputError, KeyboardInterrupt):
            write_summary(batch.store, batch.folder)
        ended = f"{tally.ended} of {_clouds(total)} are done and recorded"
        if isinstance(error, KeyboardInterrupt):
            number = error.number if isinstance(error, _Terminated) else int(signal.SIGINT)
            hint = "run the same command again: it goes on where it stopped"
            raise Interrupted(f"interrupted: {ended}", hint, signal=number) from None
        if isinstance(error, (OutputError, NotStarted)):
            raise DlogenError(f"{error.message}; {ended}", error.hint, path=error.path) from error
        raise
    if finish is not None:
        finish()
    tally.tell(batch, console, time.monotonic() - start, tolerant)


def _print(line: str) -> None:
    try:
        # JSON is UTF-8, whatever the terminal is.
        click.echo(line.encode())
    except BrokenPipeError:
        # Nobody reads it any more (`| head`), which is no error of ours.
        raise
    except OSError as error:
        hint = "free some space where standard output leads to, and run the same command again"
        raise OutputError(f"cannot print: {error.strerror or error}", hint, for_all=True) from error


def _rows(batch: Batch, pool: Pool, console: Console, bar: bool) -> Generator[tuple[Row, bool], None, None]:
    """All records, and whether each was there before. Shows the progress of the others."""
    for row in batch.kept:
        yield row, True
    done = failed = 0
    with progress(console, len(batch.todo), bar=bar) as show, contextlib.closing(batch.run(pool)) as rows:
        for row in rows:
            failed += row.status == "failed"
            done += row.status != "failed"
            show(done, failed)
            yield row, False


class _Terminated(KeyboardInterrupt):
    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM, which schedulers and containers send, ends the block as Ctrl-C does."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise _Terminated(number)

    try:
        before = signal.signal(signal.SIGTERM, stop)
    except ValueError:  # not in the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


class _Tally:
    """What came out so far."""

    def __init__(self, thresholds: Sequence[Threshold], strict: bool) -> None:
        self.thresholds, self.strict = thresholds, strict
        self.ended = 0
        self.verdicts: Counter[str] = Counter()
        self.causes = Causes()
        self.failed = 0
        #: Text of the limit -> clouds above it.
        self.above: dict[str, list[str]] = {}

    def add(self, row: Row) -> None:
        self.ended += 1
        if row.status == "failed":
            self.failed += 1
            self.causes.add(row)
            return
        verdict = row.verdict or ""
        self.verdicts[verdict] += 1
        for limit in self.thresholds:
            if limit.exceeded(row.metrics):
                text = f"{limit.name} is above {limit.limit:g}"
                self.above.setdefault(text, []).append(f"{shown(row.cloud)} ({row.metrics[limit.name]:.6g})")
        if self.strict and verdict != "good":
            self.above.setdefault("the verdict is not good", []).append(f"{shown(row.cloud)} ({verdict})")

    def tell(self, batch: Batch, console: Console, seconds: float, tolerant: bool) -> None:
        """The outcome in a few lines.

        Raises:
            DlogenError: something failed, or is worse than wanted.
        """
        total = len(batch.kept) + len(batch.todo)
        verdicts = ", ".join(
            f"{self.verdicts[name]} {name}" for name in ("good", "doubtful", "bad") if self.verdicts[name]
        )
        worked = f" in {duration(seconds)}" if batch.todo else ", nothing to do"
        console.info(
            f"{_clouds(total)}{worked}: {total - self.failed} done"
            + (f" ({verdicts})" if verdicts else "")
            + f", {self.failed} failed; {batch.folder / CSV_NAME}"
        )
        causes = self.causes.sorted()
        for cause in causes[:_MOST_NAMED]:
            more = ", ..." if cause.count > len(cause.clouds) else ""
            stage = f"{cause.stage}: " if cause.stage else ""
            console.warning(
                f"{cause.count} x {stage}{cause.error} [{cause.code}]: {', '.join(map(shown, cause.clouds))}{more}"
            )
            if cause.hint:
                console.hint(cause.hint)
        if len(causes) > _MOST_NAMED:
            console.warning(f"and {len(causes) - _MOST_NAMED} other causes: see {batch.folder / CSV_NAME}")
        for text, clouds in self.above.items():
            more = f" and {len(clouds) - _MOST_NAMED} more" if len(clouds) > _MOST_NAMED else ""
            console.warning(f"{len(clouds)} x {text}: {', '.join(clouds[:_MOST_NAMED])}{more}")
        wrong = [f"{self.failed} of {_clouds(total)} failed"] if self.failed and not tolerant else []
        wrong += [f"{text} for {len(clouds)}" for text, clouds in self.above.items()]
        if wrong:
            raise DlogenError("; ".join(wrong), f"{batch.folder / CSV_NAME} names them all")


def _clouds(number: int) -> str:
    return "1 cloud" if number == 1 else f"{number} clouds"


def _line(row: Row) -> str:
    if row.status == "failed":
        return f"{shown(row.cloud)}: {row.error} [{row.code}]"
    findings = f" ({row.findings})" if row.findings else ""
    return (
        f"{shown(row.cloud)}: {row.metrics['length']:.4f} m, {row.metrics['segment_count']} segments, "
        f"deviation {1e3 * (row.metrics.get('max_deviation') or 0.0):.2f} mm, {row.verdict}{findings}"
    )
