"""The work on one cloud of a batch: what is told to a worker, what it does, and how it went."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from dlogen._version import __version__
from dlogen.batch.failures import CONFIG, FIT, INPUT, INTERNAL, MEMORY, OUTPUT
from dlogen.batch.output_files import write_files
from dlogen.config.reader import load_config
from dlogen.config.schema import Config
from dlogen.errors import ConfigError, DlogenError, FitError, InputError, OutputError
from dlogen.io.outputs import Outputs

if TYPE_CHECKING:
    from dlogen.types import Cloud, FitData


@dataclass(frozen=True)
class Plan:
    """What is done to every cloud of a batch.

    Attributes:
        folder: where the results go; None where they are sent back instead.
        config: what holds for all clouds, before their own.
        overrides: "KEY=VALUE" that win over what clouds have of their own.
        outputs: what is written.
    """

    folder: str | None
    config: Config = field(default_factory=Config)
    overrides: tuple[str, ...] = ()
    outputs: Outputs = field(default_factory=Outputs)

    @cached_property
    def _common_digest(self) -> str:
        said = [__version__, self.config.to_dict(), self.overrides]
        return hashlib.sha256(json.dumps(said).encode()).hexdigest()

    def digest(self, task: Task) -> str:
        """All that decides on the results but the cloud: SHA-256 of settings and version, and the wanted files."""
        said = [self._common_digest, task.config_text, task.overrides]
        return f"{hashlib.sha256(json.dumps(said).encode()).hexdigest()} {','.join(self.outputs.names)}"


@dataclass(frozen=True)
class Task:
    """A cloud to be worked on.

    Attributes:
        cloud: path of the file.
        key: where its results go, below the folder of the batch and without an ending.
        config, config_text: name of its own configuration, and what that holds.
        overrides: "KEY=VALUE" of its own.
        content: the file's bytes, where the worker cannot open it.
    """

    cloud: str
    key: str
    config: str | None = None
    config_text: str | None = None
    overrides: tuple[str, ...] = ()
    content: bytes | None = None


@dataclass(frozen=True)
class Failure:
    """Why there is no model of a cloud.

    Attributes:
        code: kind of failure, one of those in `dlogen.batch.failures`.
        message, hint, stage: as of `DlogenError`.
        stops_all: the other clouds would meet it as well.
    """

    code: str
    message: str
    hint: str | None = None
    stage: str | None = None
    stops_all: bool = False


@dataclass(frozen=True)
class Outcome:
    """How it went with a cloud.

    Attributes:
        key: of the task.
        failure: None if there is a model.
        verdict, findings, metrics: of the model; codes of the findings that are not mere notes.
        sha256: of the cloud's file; None if it could not be read.
        seconds: that it took, and `timings` of its stages.
        files: what is to be written, where the worker could not.
    """

    key: str
    failure: Failure | None = None
    verdict: str | None = None
    findings: tuple[str, ...] = ()
    metrics: dict[str, float] = field(default_factory=dict)
    sha256: str | None = None
    seconds: float = 0.0
    timings: dict[str, float] = field(default_factory=dict)
    files: dict[str, bytes] | None = None


def run_job(plan: Plan, task: Task) -> Outcome:
    """Make the model of a cloud and write it. Never raises: whatever goes wrong is this cloud's failure."""
    start = time.perf_counter()
    sha256 = None
    try:
        try:
            cloud = _read(task)
            sha256 = cloud.source.sha256 if cloud.source else None
            result, files = _fit(plan, task, cloud)
            if plan.folder is not None:
                write_files(plan.folder, task.key, files)
        except DlogenError as error:
            return Outcome(task.key, failure_of(error), sha256=sha256, seconds=time.perf_counter() - start)
        except MemoryError:
            failure = Failure(MEMORY.code, "not enough memory for this cloud", "raise --memory, or use fewer points")
            return Outcome(task.key, failure, sha256=sha256, seconds=time.perf_counter() - start)
        from dlogen.batch.metrics import metrics_of

        return Outcome(
            task.key,
            verdict=result.quality.verdict,
            findings=tuple(dict.fromkeys(item.code for item in result.quality.warnings)),
            metrics=metrics_of(result),
            sha256=sha256,
            seconds=time.perf_counter() - start,
            timings=result.timings,
            files=files if plan.folder is None else None,
        )
    except Exception as error:  # a bug of ours must not take the other clouds with it
        return Outcome(task.key, _bug(error), sha256=sha256, seconds=time.perf_counter() - start)


def failure_of(error: DlogenError) -> Failure:
    """An error as it is recorded."""
    kinds = ((InputError, INPUT), (ConfigError, CONFIG), (FitError, FIT), (OutputError, OUTPUT))
    code = next((failure.code for kind, failure in kinds if isinstance(error, kind)), OUTPUT.code)
    message = error.message
    if isinstance(error, ConfigError) and error.path is not None:
        message = f"{error.path}: {message}"
    stops_all = isinstance(error, OutputError) and error.for_all
    return Failure(code, message, error.hint, error.stage, stops_all)


def _read(task: Task) -> Cloud:
    from dlogen.io.cloud_files import read_cloud

    if task.content is None:
        _refuse_pipe(task.cloud, InputError)
        return read_cloud(task.cloud)
    # Readers look at sizes and seek: they want a file.
    with tempfile.TemporaryDirectory(prefix="dlogen-") as folder:
        copy = Path(folder, os.path.basename(task.cloud))  # noqa: PTH119 - of a path that need not be of this system
        copy.write_bytes(task.content)
        return read_cloud(copy)


def _refuse_pipe(path: str, kind: type[DlogenError]) -> None:
    """Pipes are for dlogen fit: opening one waits until somebody writes to it."""
    if os.path.exists(path) and not os.path.isfile(path):  # noqa: PTH110, PTH113
        what = "a folder" if os.path.isdir(path) else "a pipe or a device"  # noqa: PTH112
        raise kind(f"it is {what}, not a file", "name a file, or copy it to one", path=path)


def _fit(plan: Plan, task: Task, cloud: Cloud) -> tuple[FitData, dict[str, bytes]]:
    from dlogen.io.report import report_dict
    from dlogen.pipeline import fit

    if task.config is not None and task.config_text is None:
        _refuse_pipe(task.config, ConfigError)
    config = load_config(task.config, [*task.overrides, *plan.overrides], base=plan.config, text=task.config_text)
    stem = task.key.rsplit("/", 1)[-1]
    result = fit(cloud, config, name=stem)
    report = report_dict(result)
    # They are in the records. Reports are the same from run to run.
    report.pop("timings", None)
    return result, plan.outputs.contents(result, stem, report)


def _bug(error: Exception) -> Failure:
    import traceback

    place = traceback.extract_tb(error.__traceback__)[-1]
    return Failure(
        INTERNAL.code,
        f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})",
        "this is a bug in dlogen; dlogen fit --debug on this cloud shows where",
    )
