"""The configuration: what can be set, what each setting may hold, and how it is read.

Every key is declared once, as a field of `Config` or of one of its sections, with a `Setting` that says what it may
hold. The checks below, the commented YAML of `dlogen config show` and the JSON Schema of `dlogen config schema` all
follow from that.

Lengths (`r`, `r_n`, `e_max`, `normals.radius`) are metres, always: `units` says only what the cloud's numbers are.
"""

from __future__ import annotations

import difflib
import math
import numbers
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, cast

from dlogen.errors import ConfigError

Auto = Literal["auto"]
#: The value that leaves a setting to dlogen.
AUTO: Final = "auto"

#: A configuration file larger than this is something else, given by mistake.
MAX_BYTES = 100_000


@dataclass(frozen=True)
class Setting:
    """What one key may hold.

    Attributes:
        kind: the type of its values. Whole floats such as 21.0 count as integers, as they do in JSON Schema.
        help: one sentence.
        unit: of a number.
        auto: what "auto" does; None where "auto" is not allowed.
        above: numbers must be greater than this.
        least, most: smallest and largest number allowed.
        choices: the words that a "choice" can be.
        also: other spellings of the key that are accepted.
        sought: names under which people look for it; they are not accepted, but lead to a hint.
    """

    kind: Literal["number", "integer", "flag", "choice", "text"]
    help: str
    unit: str = ""
    auto: str | None = None
    above: float | None = None
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    sought: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        """What is allowed, in words."""
        if self.kind == "flag":
            return "true or false"
        if self.kind == "choice":
            return "one of " + ", ".join(self.choices) if len(self.choices) > 1 else self.choices[0]
        if self.kind == "text":
            return f"text of {self.least:g} to {self.most:g} printable characters"
        what = "a whole number" if self.kind == "integer" else "a number"
        limits = [
            f"{sign} {limit:.12g}"
            for sign, limit in ((">", self.above), (">=", self.least), ("<=", self.most))
            if limit is not None
        ]
        what += "".join(f" {part}" for part in (" and ".join(limits), self.unit) if part)
        return f"{what}, or auto" if self.auto is not None else what

    def read(self, value: object) -> Any:
        """The value with the type that the key's field has.

        Raises:
            ValueError: it is not allowed. The text is a hint, or empty.
        """
        if self.kind == "flag":
            if not isinstance(value, bool):
                raise ValueError("write true or false")
            return value
        if self.kind == "choice":
            if not isinstance(value, str) or value not in self.choices:
                raise ValueError(_near_word(value, self.choices))
            return value
        if self.kind == "text":
            if not isinstance(value, str):
                raise ValueError("put it in quotes")
            if not (self.least or 0) <= len(value) <= (self.most or math.inf) or not value.isprintable():
                raise ValueError("")
            return value
        if self.auto is not None and isinstance(value, str) and value == AUTO:
            return AUTO
        return self._read_number(value)

    def _read_number(self, value: object) -> int | float:
        if isinstance(value, str):
            raise ValueError(self._text_hint(value))
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ValueError("")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ValueError("it must be finite")
        if self.kind == "integer":
            if number != math.floor(number):
                raise ValueError("it must be whole")
            number = math.floor(value)
        if (
            (self.above is not None and number <= self.above)
            or (self.least is not None and number < self.least)
            or (self.most is not None and number > self.most)
        ):
            raise ValueError("")
        return number

    def _text_hint(self, text: str) -> str:
        if self.auto is not None and text.strip().casefold() == AUTO:
            return "write auto in small letters"
        if re.fullmatch(r"\s*[-+]?[\d.]+([eE][-+]?\d+)?\s*", text):
            return "write it without quotes"
        if re.fullmatch(r"\s*\d*,\d+\s*", text):
            return "the decimal mark is a point"
        length = re.fullmatch(r"\s*(\d*\.?\d+)\s*(mm|cm|m)\s*", text)
        if length and self.unit == "m":
            metres = float(length[1]) * {"mm": 1e-3, "cm": 1e-2, "m": 1.0}[length[2]]
            return f"lengths are metres, without a unit: {metres:.12g}"
        return ""


def _holds(*args: Any, **kwargs: Any) -> dict[str, Setting]:
    """A `Setting` as the metadata of a dataclass field."""
    return {"setting": Setting(*args, **kwargs)}


def _near_word(value: object, words: Sequence[str]) -> str:
    near = difflib.get_close_matches(str(value).casefold(), words, n=1)
    return f"did you mean {near[0]!r}?" if near else ""


class _Checked:
    """Checks the settings among its fields when it is made."""

    @classmethod
    def _settings(cls) -> tuple[tuple[str, Setting], ...]:
        return tuple(
            (item.name, item.metadata["setting"]) for item in fields(cast("Any", cls)) if "setting" in item.metadata
        )

    def __post_init__(self) -> None:
        problems = []
        for name, setting in self._settings():
            value = getattr(self, name)
            try:
                object.__setattr__(self, name, setting.read(value))
            except ValueError as error:
                problems.append(_wrong_value("", name, value, setting, str(error)))
        _refuse(problems)


@dataclass(frozen=True)
class Normals(_Checked):
    """Surface normals (paper III.B)."""

    neighbours: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "How many nearest points the plane of a normal is fitted to.",
            auto="chosen from the cloud, unless `radius` is set",
            least=3,
            most=1000,
            sought=("neighbors", "k", "knn", "k_neighbours", "n_neighbours"),
        ),
    )
    radius: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Fit the plane of a normal to all points within this distance instead.",
            unit="m",
            auto="not used: the nearest `neighbours` are",
            above=0,
            sought=("normal_radius",),
        ),
    )
    orientation: str = field(
        default=AUTO,
        metadata=_holds(
            "choice",
            "Which side of a normal is outward: away from the axis, towards the viewpoint, or as stored in the file.",
            auto="decided from the cloud and from what its file has",
            choices=(AUTO, "outward", "viewpoint", "stored"),
        ),
    )


@dataclass(frozen=True)
class Projection(_Checked):
    """Projection of the surface points onto the axis (paper Eq. 4)."""

    enabled: bool = field(
        default=True,
        metadata=_holds("flag", "Move points inwards by r along their normals; false for objects too thin to matter."),
    )


@dataclass(frozen=True)
class Sorting(_Checked):
    """Sorting of the points along the object (paper Eq. 5-6)."""

    start: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "Index of the point that the walk starts from, counted from 0.",
            auto="chosen from the cloud",
            least=0,
            sought=("start_point", "p0"),
        ),
    )


@dataclass(frozen=True)
class SkeletonLine(_Checked):
    """The skeleton line as weighted basis functions (paper Eq. 7-11)."""

    tau: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Width parameter of the inverse quadratic basis functions (profile paper).",
            auto="N / 4, as in the paper (printed there as k)",
            above=0,
            sought=("width", "basis_width"),
        ),
    )


@dataclass(frozen=True)
class Segmentation(_Checked):
    """Segment length from curvature and e_max (paper III.D)."""

    criterion: str = field(
        default="paper",
        metadata=_holds("choice", "How the segment length follows from e_max: paper is Eq. 17.", choices=("paper",)),
    )


@dataclass(frozen=True)
class Refine(_Checked):
    """The fit of the tube to all points (profile refined)."""

    iterations: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "Gauss-Newton steps.",
            auto="until nothing changes any more",
            least=1,
            most=100,
            sought=("max_iterations", "steps"),
        ),
    )


@dataclass(frozen=True)
class MdtwSettings(_Checked):
    """The error between skeleton line and chain (paper IV.A)."""

    samples: int = field(
        default=1000,
        metadata=_holds(
            "integer", "Points that each curve is sampled with.", least=2, most=20_000, sought=("num_samples",)
        ),
    )


@dataclass(frozen=True)
class Material(_Checked):
    """What the object is made of, for the masses and inertias of the model."""

    name: str = field(
        default="generic", metadata=_holds("text", "Name of the material in the model.", least=1, most=100)
    )
    density: float = field(
        default=1200.0,
        metadata=_holds(
            "number",
            "Mass per volume of the whole cross-section, hollow parts included: mass per length / (pi r^2).",
            unit="kg/m^3",
            above=0,
            sought=("mass_density", "rho", "mass"),
        ),
    )


@dataclass(frozen=True)
class Report(_Checked):
    """The report file."""

    timings: bool = field(
        default=True,
        metadata=_holds("flag", "Write the seconds that each stage took; they differ from run to run."),
    )


@dataclass(frozen=True)
class Config(_Checked):
    """Everything that can be set. `Config()` is the default and fits most clouds.

    Raises:
        ConfigError: a value is not allowed, or two contradict each other.
    """

    profile: Literal["refined", "paper"] = field(
        default="refined",
        metadata=_holds(
            "choice",
            "refined: as good as can be made; paper: the stages exactly as published.",
            choices=("refined", "paper"),
            sought=("method", "mode"),
        ),
    )
    units: Literal["m", "mm", "cm", "auto"] = field(
        default="m",
        metadata=_holds(
            "choice",
            "What the numbers in the cloud are. All settings and all output are metres regardless.",
            auto="guessed from the extent of the cloud",
            choices=("m", "mm", "cm", AUTO),
            sought=("unit", "scale"),
        ),
    )
    r: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Radius of the object.",
            unit="m",
            auto="estimated from the cloud",
            above=0,
            sought=("radius", "diameter", "thickness"),
        ),
    )
    r_n: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Search radius of the sorting walk (Eq. 5); at least the diameter 2 r.",
            unit="m",
            auto="chosen from r and the spacing of the points",
            above=0,
            sought=("search_radius", "sorting_radius", "neighbour_radius"),
        ),
    )
    N: int | Auto = field(
        default=AUTO,
        metadata=_holds(
            "integer",
            "Number of basis functions of the skeleton line (Eq. 7).",
            auto="chosen from the cloud",
            least=4,
            most=2000,
            sought=("basis_functions", "num_basis", "n_basis"),
        ),
    )
    beta: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Regularisation of the weights (Eq. 10-11).",
            auto="the one with the smallest variance of the residuals",
            least=0,
            also=("β",),
            sought=("regularization", "regularisation", "lambda", "ridge", "ß"),
        ),
    )
    e_max: float | Auto = field(
        default=AUTO,
        metadata=_holds(
            "number",
            "Largest distance allowed between the skeleton line and the chain (Eq. 17).",
            unit="m",
            auto="r / 2, the paper's ratio",
            above=0,
            sought=("max_error", "error", "tolerance", "accuracy"),
        ),
    )
    seed: int = field(
        default=0,
        metadata=_holds("integer", "Seed of everything random.", least=0, most=2**32 - 1, sought=("random_seed",)),
    )
    normals: Normals = field(default_factory=Normals)
    projection: Projection = field(default_factory=Projection)
    sorting: Sorting = field(default_factory=Sorting)
    skeleton: SkeletonLine = field(default_factory=SkeletonLine)
    segmentation: Segmentation = field(default_factory=Segmentation)
    refine: Refine = field(default_factory=Refine)
    mdtw: MdtwSettings = field(default_factory=MdtwSettings)
    material: Material = field(default_factory=Material)
    report: Report = field(default_factory=Report)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, section in sections().items():
            value = getattr(self, name)
            if not isinstance(value, section):
                _refuse(
                    [_Problem("", f"{name}: expected {section.__name__}(...), got {_show(value)}", "see dlogen.config")]
                )
        _refuse(_contradictions(_flat(self.to_dict()), {}))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Config:
        """The configuration that a mapping describes, sections being mappings in it. What is left out is default.

        Raises:
            ConfigError: names every key that is unknown or holds what it may not.
        """
        values, problems = _read_mapping(data, lambda path: "")
        _refuse(problems)
        return cls._from_flat(values)

    @classmethod
    def _from_flat(cls, values: Mapping[str, Any]) -> Config:
        """From dotted keys, with values that have been read."""
        inner: dict[str, dict[str, Any]] = {name: {} for name in sections()}
        top: dict[str, Any] = {}
        for key, value in values.items():
            section, dot, name = key.partition(".")
            if dot:
                inner[section][name] = value
            else:
                top[key] = value
        return cls(**top, **{name: cast("Any", section(**inner[name])) for name, section in sections().items()})

    def to_dict(self) -> dict[str, Any]:
        """As nested plain data, in the order of declaration; `from_dict` reads it back."""
        out: dict[str, Any] = {name: getattr(self, name) for name, _ in Config._settings()}
        for name, section in sections().items():
            values = getattr(self, name)
            out[name] = {key: getattr(values, key) for key, _ in section._settings()}
        return out

    def replace(self, changes: Mapping[str, Any] | None = None, /, **top: Any) -> Config:
        """A configuration that differs in some keys: `config.replace({"normals.neighbours": 20}, e_max=0.005)`.

        Raises:
            ConfigError: as `from_dict`.
        """
        values, problems = _flat(self.to_dict()), []
        for name, value in {**(changes or {}), **top}.items():
            key = _spellings().get(name)
            if key is None:
                problems.append(_unknown("", name, ""))
            else:
                _read_value(key, value, "", values, problems)
        _refuse(problems)
        return self._from_flat(values)


def load_config(path: str | Path | None = None, overrides: Sequence[str] = ()) -> Config:
    """Read a YAML file and apply overrides to it.

    Args:
        path: the file; "-" for standard input; None for the defaults.
        overrides: "KEY=VALUE" with dotted keys, such as "normals.neighbours=20". Later ones win over earlier ones, and
            all of them over the file.

    Raises:
        ConfigError: the file cannot be read or is not YAML; a key is unknown, given twice or holds what it may not;
            two keys contradict each other. All that is wrong is named, with lines.
    """
    values: dict[str, Any] = {}
    origins: dict[str, str] = {}
    if path is not None:
        values, origins = _read_file(path)
    problems: list[_Problem] = []
    for override in overrides:
        key = _read_override(override, values, problems)
        if key is not None:
            origins[key] = f"--set {override}"
    _refuse(problems)
    _refuse(_contradictions(values, origins))
    return Config._from_flat(values)


@cache
def sections() -> dict[str, type[_Checked]]:
    """The sections of a configuration by name; each explains itself in its docstring."""
    factories: dict[str, Any] = {item.name: item.default_factory for item in fields(Config)}
    return {name: kind for name, kind in factories.items() if isinstance(kind, type) and issubclass(kind, _Checked)}


@cache
def settings() -> dict[str, Setting]:
    """All settings by dotted key, in the order of declaration."""
    out = dict(Config._settings())
    for name, section in sections().items():
        out |= {f"{name}.{key}": setting for key, setting in section._settings()}
    return out


@cache
def _spellings() -> dict[str, str]:
    """Every accepted spelling of a dotted key -> the key."""
    out = {key: key for key in settings()}
    for key, setting in settings().items():
        out |= dict.fromkeys(setting.also, key)
    return out


# --- what is wrong, and saying so ---


@dataclass(frozen=True)
class _Problem:
    where: str  # "line 3", "--set r=x" or nothing
    message: str
    hint: str

    @property
    def text(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message


def _refuse(problems: Sequence[_Problem], path: str | Path | None = None) -> None:
    """Raise one error for all problems, if there are any."""
    if len(problems) == 1:
        raise ConfigError(problems[0].text, problems[0].hint, path=path)
    if problems:
        listed = "".join(f"\n  {item.text} ({item.hint})" for item in problems)
        raise ConfigError(
            f"{len(problems)} problems:{listed}", "dlogen config show lists all keys and their values", path=path
        )


def _show(value: object) -> str:
    """A value as a user would recognise it, shortened."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a section"
    if isinstance(value, (list, tuple)):
        return "a list"
    if isinstance(value, int) and abs(value) > 10**30:
        return "a number with very many digits"
    text = ascii(value) if isinstance(value, str) and not value.isprintable() else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _wrong_value(where: str, key: str, value: object, setting: Setting, hint: str) -> _Problem:
    if value is None and not hint:
        hint = "leave the key out for the default" + (", or write auto" if setting.auto is not None else "")
    return _Problem(where, f"{key} = {_show(value)}: expected {setting.expected}", hint or setting.help)


def _unknown(where: str, name: object, section: str) -> _Problem:
    shown = f"{section}.{name}" if section else str(name)
    near = _nearest(shown)
    known = [key.rpartition(".")[2] for key in settings() if key.rpartition(".")[0] == section]
    known += [] if section else list(sections())
    if near:
        hint = "did you mean " + " or ".join(repr(key) for key in near) + "?"
    else:
        hint = f"known {'in ' + section if section else 'keys'}: {', '.join(known)}"
    return _Problem(where, f"unknown key {_show(shown)}", hint)


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name.casefold())


def _nearest(name: str) -> list[str]:
    """Known keys that somebody who wrote this may have meant: same letters, a name it goes by, or few letters off."""
    whole: dict[str, list[str]] = {}
    last: dict[str, list[str]] = {}
    for key, setting in settings().items():
        section, _, leaf = key.rpartition(".")
        whole.setdefault(_plain(key), []).append(key)
        for word in (leaf, *setting.also, *setting.sought):
            whole.setdefault(_plain(section + word), []).append(key)
            last.setdefault(_plain(word), []).append(key)
    for section in sections():
        whole.setdefault(_plain(section), []).append(section)
    leaf = _plain(name.rpartition(".")[2])
    if exact := [*whole.get(_plain(name), ()), *last.get(leaf, ())]:
        return list(dict.fromkeys(exact))
    for table, word in ((whole, _plain(name)), (last, leaf)):
        # Words of one or two letters are all alike.
        if len(word) > 2 and (close := difflib.get_close_matches(word, table, n=1, cutoff=0.7)):
            return list(dict.fromkeys(table[close[0]]))
    return []


def _contradictions(values: Mapping[str, Any], origins: Mapping[str, str]) -> list[_Problem]:
    """What is wrong between keys that are each right, as far as it shows without a cloud."""

    def said(key: str) -> str:
        origin = f" ({origins[key]})" if key in origins else ""
        return f"{key} = {values[key]!r}{origin}"

    def number(key: str) -> float | None:
        value = values.get(key, AUTO)
        return None if value == AUTO else value

    problems = []
    r, r_n = number("r"), number("r_n")
    if r is not None and r_n is not None and r_n < 2 * r:
        problems.append(
            _Problem(
                "",
                f"{said('r_n')} is less than the diameter 2 r, {said('r')}",
                "the sorting walk needs r_n > 2 r (paper III.B); the paper has 8 r; or write r_n: auto",
            )
        )
    if number("normals.neighbours") is not None and number("normals.radius") is not None:
        problems.append(
            _Problem(
                "",
                f"{said('normals.neighbours')} and {said('normals.radius')} are both set",
                "keep one: a normal is fitted either to the nearest points or to all within a radius",
            )
        )
    if values.get("units") in ("mm", "cm"):
        for key in ("r", "e_max"):
            value = number(key)
            if value is not None and value >= 1:
                factor = 1e-3 if values["units"] == "mm" else 1e-2
                problems.append(
                    _Problem(
                        "",
                        f"{said(key)} is a metre or more, but {said('units')}",
                        "lengths in the configuration are metres, whatever the units of the cloud: "
                        f"{value:.12g} {values['units']} is {value * factor:.12g}",
                    )
                )
    return problems


# --- reading ---


def _flat(data: Mapping[str, Any]) -> dict[str, Any]:
    """Nested, valid data with dotted keys."""
    out: dict[str, Any] = {}
    for name, value in data.items():
        out |= {f"{name}.{key}": inner for key, inner in value.items()} if isinstance(value, Mapping) else {name: value}
    return out


def _read_value(key: str, value: object, where: str, values: dict[str, Any], problems: list[_Problem]) -> None:
    """Check one value and store it under its dotted key, or note what is wrong."""
    setting = settings()[key]
    try:
        values[key] = setting.read(value)
    except ValueError as error:
        problems.append(_wrong_value(where, key, value, setting, str(error)))


def _read_mapping(data: object, where: Callable[[tuple[object, ...]], str]) -> tuple[dict[str, Any], list[_Problem]]:
    """Nested data -> values by dotted key, and all that is wrong. `where` says where a path of keys stands."""
    values: dict[str, Any] = {}
    problems: list[_Problem] = []
    spelt: dict[str, tuple[object, ...]] = {}

    def take(section: str, path: tuple[object, ...], value: object) -> None:
        name = path[-1]
        key = _spellings().get(f"{section}.{name}" if section else name) if isinstance(name, str) else None
        if key is None or (not section and "." in key):
            problem = _unknown(where(path), name, section)
            if key is not None:
                inner, _, leaf = key.partition(".")
                problem = _Problem(problem.where, problem.message, f"write it in its section: {inner}: {{{leaf}: ...}}")
            problems.append(problem)
        elif key in spelt:
            before = f" and {spelt[key][-1]}" + (f" in {where(spelt[key])}" if where(spelt[key]) else "")
            problems.append(_Problem(where(path), f"{name}{before} are the same key", "keep one of them"))
        else:
            spelt[key] = path
            _read_value(key, value, where(path), values, problems)

    if not isinstance(data, Mapping):
        return {}, [_Problem("", f"expected keys and values, got {_show(data)}", "write `key: value`, one a line")]
    for name, value in data.items():
        if not isinstance(name, str) or name not in sections():
            take("", (name,), value)
        elif isinstance(value, Mapping):
            for inner_name, inner in value.items():
                take(name, (name, inner_name), inner)
        elif value is not None:  # a section whose keys are all commented out is None
            keys = ", ".join(key.partition(".")[2] for key in settings() if key.startswith(f"{name}."))
            problems.append(
                _Problem(where((name,)), f"{name} = {_show(value)}: expected a section", f"its keys: {keys}")
            )
    return values, problems


def _read_file(path: str | Path) -> tuple[dict[str, Any], dict[str, str]]:
    """A file -> values by dotted key, and where each stands."""
    from dlogen.strict_yaml import parse

    name = "standard input" if str(path) == "-" else str(path)
    try:
        document = parse(_read_text(path))
    except ConfigError as error:
        raise ConfigError(error.message, error.hint, path=name) from None

    def where(keys: tuple[object, ...]) -> str:
        line = document.lines.get(tuple(str(key) for key in keys))
        return f"line {line}" if line else ""

    problems = [
        _Problem(f"line {line}", f"{'.'.join(keys)} is given twice, first in line {first}", "keep one of them")
        for keys, first, line in document.duplicates
    ]
    data = {} if document.data is None else document.data
    values, wrong = _read_mapping(data, where)
    _refuse(sorted(problems + wrong, key=lambda item: int(item.where.partition(" ")[2] or 0)), name)
    origins = {}
    for keys, line in document.lines.items():
        key = _spellings().get(".".join(keys))
        if key is not None:
            origins[key] = f"{name}, line {line}"
    return values, origins


def _read_text(path: str | Path) -> str:
    """The text of a file, or of standard input for "-"."""
    try:
        if str(path) == "-":
            raw = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with Path(path).open("rb") as stream:
                raw = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise ConfigError(
            "no such configuration file", "dlogen config show > my.yaml writes one to start from", path=path
        ) from None
    except IsADirectoryError:
        raise ConfigError("is a folder, not a configuration file", "name a YAML file in it", path=path) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"cannot be read: {reason}", "check its name and permissions", path=path) from None
    if len(raw) > MAX_BYTES:
        raise ConfigError(
            f"is larger than {MAX_BYTES // 1000} kB: not a configuration",
            "-c takes the YAML file; the cloud is given without a flag",
            path=path,
        )
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"line {line}: is not UTF-8 text", "save it as UTF-8", path=path) from None


def _read_override(override: str, values: dict[str, Any], problems: list[_Problem]) -> str | None:
    """Read "KEY=VALUE" into the values; the key, unless something is wrong."""
    from dlogen.strict_yaml import resolve

    where = f"--set {override if override.isprintable() else ascii(override)}"
    name, equals, text = (part.strip() for part in override.partition("="))
    key = _spellings().get(name)
    if not equals:
        problems.append(_Problem(where, "expected KEY=VALUE", "such as --set e_max=0.005"))
    elif name in sections():
        example = next(key for key in settings() if key.startswith(f"{name}."))
        problems.append(_Problem(where, f"{name} is a section", f"set its keys, such as --set {example}=..."))
    elif key is None:
        problems.append(_unknown(where, name, ""))
    else:
        value = text if settings()[key].kind == "text" else resolve(text)
        found = len(problems)
        _read_value(key, value, where, values, problems)
        return key if len(problems) == found else None
    return None
