"""Names of what is written, known before there is anything to write."""

from __future__ import annotations

#: Stem of the model's files.
MODEL = "model"


def file_names(in_time: bool, plot: bool) -> tuple[str, ...]:
    """Names of the files beside the models: table, arrays, report and, if there is to be one, picture."""
    table, report = ("trajectory", "sequence") if in_time else ("poses", "one_model")
    return (f"{table}.csv", f"{table}.npz", f"{report}.json", *([f"{report}.png"] if plot else []))
