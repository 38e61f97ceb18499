"""What is written for a cloud: models in the wanted formats, the report, a picture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dlogen.errors import UsageError
from dlogen.io.json_text import dump_json
from dlogen.io.registry import model_format, model_formats

if TYPE_CHECKING:
    from dlogen.types import FitData


#: Among the names of formats; none of them has it.
_PICTURE = "plot"


@dataclass(frozen=True)
class Outputs:
    """The files that are made of a result.

    Attributes:
        formats: names of model formats.
        plot: whether a picture is among them.

    Raises:
        UsageError: there is no such format.
    """

    formats: tuple[str, ...] = ("urdf", "json")
    plot: bool = False

    def __post_init__(self) -> None:
        for name in self.formats:
            model_format(name)

    @classmethod
    def parse(cls, formats: str, plot: bool = False) -> Outputs:
        """From names with commas between them, or `all`.

        Raises:
            UsageError: there is no such format, or none is named.
        """
        if formats == "all":
            return cls(tuple(item.name for item in model_formats()), plot)
        names = [name.strip() for name in formats.split(",") if name.strip()]
        if not names:
            known = ", ".join(item.name for item in model_formats())
            raise UsageError("no model format is named", f"known: {known}")
        return cls(tuple(dict.fromkeys(names)), plot)

    @classmethod
    def of(cls, names: Iterable[str]) -> Outputs:
        """The opposite of `names`."""
        names = tuple(names)
        return cls(tuple(name for name in names if name != _PICTURE), _PICTURE in names)

    @property
    def names(self) -> tuple[str, ...]:
        """What is written, in words."""
        return (*self.formats, *([_PICTURE] if self.plot else []))

    def files(self, stem: str) -> tuple[str, ...]:
        """Names of the files, or of the folders that they are in, known before there is anything to write."""
        models = [name for item in self.formats for name in model_format(item).files(stem)]
        return (*models, f"{stem}.report.json", *([f"{stem}.png"] if self.plot else []))

    def contents(self, result: FitData, stem: str, report: dict[str, Any]) -> dict[str, bytes]:
        """Their names, with folders before some of them, and what they hold.

        Raises:
            DlogenError: a format cannot hold this result, or pictures need matplotlib.
        """
        contents: dict[str, bytes] = {}
        for item in self.formats:
            contents |= model_format(item).write(result, stem)
        contents[f"{stem}.report.json"] = dump_json(report).encode()
        if self.plot:
            from dlogen.io.plots import fit_picture

            contents[f"{stem}.png"] = fit_picture(result)
        return contents
