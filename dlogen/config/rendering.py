"""A configuration as people and editors read it: commented YAML and a JSON Schema, both from the declared settings."""

from __future__ import annotations

import json
import textwrap
from typing import Any

from dlogen.config.fields import AUTO, Setting
from dlogen.config.schema import Config, config_keys

_WIDTH = 112
_HEADER = (
    "dlogen configuration. A key that is left out has its default.\n"
    "Lengths are metres, whatever the numbers in the cloud are (units)."
)


def to_yaml(config: Config) -> str:
    """All keys with their values, each with its help, what it may hold and its default. `load_config` reads it back."""
    keys, values, defaults = config_keys(), config.to_dict(), Config().to_dict()
    lines = _comment(_HEADER)
    for name, setting in keys.of_section("").items():
        lines += ["", *_entry(name, setting, values[name], defaults[name])]
    for section, about in keys.sections.items():
        lines += ["", "", *_comment(about), f"{section}:"]
        for index, (name, setting) in enumerate(keys.of_section(section).items()):
            entry = _entry(name, setting, values[section][name], defaults[section][name])
            lines += [""] * (index > 0) + [f"  {line}" for line in entry]
    return "\n".join(lines) + "\n"


def _entry(name: str, setting: Setting, value: object, default: object) -> list[str]:
    auto = f": {setting.auto}" if setting.auto else ""
    spelt = "".join(f" Also spelt {other}." for other in setting.also)
    allowed = f"Allowed: {setting.expected}{auto}. Default: {_scalar(default)}.{spelt}"
    return [*_comment(setting.help), *_comment(allowed), f"{name}: {_scalar(value, quote=setting.kind == 'text')}"]


def _comment(text: str) -> list[str]:
    return [f"# {part}" for line in text.splitlines() for part in textwrap.wrap(line, _WIDTH, break_on_hyphens=False)]


def _scalar(value: object, quote: bool = False) -> str:
    """A value in YAML that readers of YAML 1.1 and of 1.2 understand alike."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False) if quote else value
    text = json.dumps(value)
    if "e" in text and "." not in text and isinstance(value, float):
        # YAML 1.1 reads 1e-05 as text, 1.0e-05 as a number.
        text = text.replace("e", ".0e")
    return text


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the YAML file. What holds between keys is not in it."""
    keys, defaults = config_keys(), Config().to_dict()
    properties = _properties(keys.of_section(""), defaults)
    for section, about in keys.sections.items():
        properties[section] = {
            "description": about,
            "type": ["object", "null"],
            "properties": _properties(keys.of_section(section), defaults[section]),
            "additionalProperties": False,
        }
    twice = [{"required": [name, other]} for name, setting in keys.of_section("").items() for other in setting.also]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "urn:dlogen:config:1",
        "title": "dlogen configuration",
        "description": _HEADER.replace("\n", " "),
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
        "not": {"anyOf": twice},
    }


def _properties(settings: dict[str, Setting], defaults: dict[str, Any]) -> dict[str, Any]:
    out = {}
    for name, setting in settings.items():
        for spelling in (name, *setting.also):
            out[spelling] = _property(setting, defaults[name])
    return out


def _property(setting: Setting, default: object) -> dict[str, Any]:
    allowed = _allowed(setting)
    unit = f" Unit: {setting.unit}." if setting.unit else ""
    auto = f" auto: {setting.auto}." if setting.auto else ""
    if setting.auto and setting.kind != "choice":
        allowed = {"anyOf": [{"const": AUTO}, *({"const": word} for word, _ in setting.words), allowed]}
    return {"description": f"{setting.help}{unit}{auto}", **allowed, "default": default}


def _allowed(setting: Setting) -> dict[str, Any]:
    if setting.kind == "flag":
        return {"type": "boolean"}
    if setting.kind == "choice":
        return {"enum": list(setting.choices)}
    names = (
        {
            "minLength": setting.least,
            "maxLength": setting.most,
            "pattern": f"^{setting.pattern}$" if setting.pattern else None,
        }
        if setting.kind == "text"
        else {"exclusiveMinimum": setting.above, "minimum": setting.least, "maximum": setting.most}
    )
    kind = "string" if setting.kind == "text" else setting.kind
    return {"type": kind, **{name: limit for name, limit in names.items() if limit is not None}}
