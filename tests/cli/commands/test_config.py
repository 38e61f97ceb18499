"""`dlogen config show` and `dlogen config schema`, as a shell sees them."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from dlogen.cli.main import cli
from dlogen.config.rendering import to_yaml
from dlogen.config.schema import Config, config_keys


def run(*args: str, stdin: str | None = None):
    return CliRunner().invoke(cli, ["config", *args], input=stdin)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("r: 0.02\nnormals: {neighbours: 12}\n")
    return str(path)


def test_show_prints_every_key_with_help_unit_range_and_default():
    result = run("show")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert result.stdout == to_yaml(Config())
    one_line = " ".join(line.lstrip(" #") for line in result.stdout.splitlines())
    for key, setting in config_keys().settings.items():
        assert f"{key.rpartition('.')[2]}: " in one_line
        assert setting.help in one_line
        assert not setting.unit or f"({setting.unit})" in one_line
        assert setting.expected in one_line
    density = "a number > 0 (kg/m^3), or auto: from mass, mass_per_length or the preset, else 1200. Default: auto."
    assert f"Allowed: {density}" in one_line
    assert "auto: r / 2, the paper's ratio. Default: auto." in one_line
    assert max(map(len, result.stdout.splitlines())) <= 120


def test_show_of_a_file_and_overrides(path):
    result = run("show", "-c", path, "--set", "e_max=1e-5", "--set", "e_max=2e-5", "--set", "material.name=a b")
    assert result.exit_code == 0
    expected = Config.from_dict({"r": 0.02, "e_max": 2e-5, "normals": {"neighbours": 12}, "material": {"name": "a b"}})
    assert result.stdout == to_yaml(expected)
    assert "\ne_max: 2.0e-05\n" in result.stdout
    assert '\n  name: "a b"\n' in result.stdout


def test_show_reads_standard_input():
    assert "\nr: 0.02\n" in run("show", "--config", "-", stdin="r: 0.02\n").stdout


def test_what_show_prints_shows_the_same_again(path):
    first = run("show", "-c", path).stdout
    assert run("show", "-c", "-", stdin=first).stdout == first


def test_show_as_json(path):
    result = run("show", "-c", path, "--json")
    assert json.loads(result.stdout) == Config.from_dict({"r": 0.02, "normals": {"neighbours": 12}}).to_dict()


def test_quiet_still_prints_data():
    assert run("show", "-q").stdout == to_yaml(Config())


def test_schema_is_valid_and_explains_every_key():
    result = run("schema")
    assert result.exit_code == 0
    schema = json.loads(result.stdout)
    Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    for key, setting in config_keys().settings.items():
        section, _, name = key.rpartition(".")
        entry = (schema["properties"][section] if section else schema)["properties"][name]
        assert entry["description"].startswith(setting.help)
        assert (f"Unit: {setting.unit}." in entry["description"]) == bool(setting.unit)
        assert "default" in entry


@pytest.mark.parametrize(
    ("data", "valid"),
    [
        ({}, True),
        ({"β": 0.01}, True),
        ({"beta": 0.01, "β": 0.01}, False),
        ({"emax": 0.01}, False),
        ({"r": "auto", "N": 21.0, "normals": None}, True),
        ({"r": 0}, False),
        ({"r": "0.02"}, False),
        ({"normals": {"neighbors": 12}}, False),
        ({"normals": {"neighbours": True}}, False),
        ({"projection": {"enabled": "yes"}}, False),
        ([], False),
    ],
)
def test_schema_says_what_is_valid(data, valid):
    assert Draft202012Validator(json.loads(run("schema").stdout)).is_valid(data) == valid


def test_wrong_file(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("r: 0.02\nemax: 0.01\n")
    result = run("show", "-c", str(path))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr == f"error: {path}: line 2: unknown key 'emax'\nhint: did you mean 'e_max'?\n"


def test_debug_shows_the_traceback():
    result = run("show", "--debug", "--set", "r=x")
    assert type(result.exception).__name__ == "ConfigError"


@pytest.mark.parametrize("args", [["-h"], ["--help"], ["show", "-h"], ["schema", "--help"]])
def test_help_has_examples(args):
    result = run(*args)
    assert result.exit_code == 0
    assert "Example" in result.stdout
    assert "dlogen config" in result.stdout


def test_wrong_subcommand():
    result = run("shwo")
    assert result.exit_code == 2
    assert "No such command 'shwo'" in result.stderr


def test_without_subcommand_the_help_is_shown():
    assert "schema" in run().output
