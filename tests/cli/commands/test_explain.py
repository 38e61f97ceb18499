"""`dlogen explain`: all codes in the outputs, in full or in a list, and texts that can be followed."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner, Result

from dlogen.batch.failures import FAILURES
from dlogen.cli.main import cli
from dlogen.config.schema import Config
from dlogen.sequence.reasons import REASONS
from dlogen.stages.quality.findings import REGISTRY, Explanation

KNOWN = [*REGISTRY.values(), *REASONS.values(), *FAILURES.values()]
NAMES = [f"{item.where}-{item.code}" for item in KNOWN]


def run(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["explain", *arguments])


def test_all_are_listed_a_line_each() -> None:
    result = run()
    assert result.exit_code == 0 and result.stderr == ""
    parts = result.stdout.removesuffix("\n").split("\n\n")
    assert [part.splitlines()[0].rsplit("(", 1)[0] for part in parts] == [
        "Findings about a cloud and its chain ",
        "Why a frame of a recording is set aside, and doubts about all of it ",
        "Why there is no model of a cloud ",
    ]
    lines = [line for part in parts for line in part.splitlines()[1:]]
    for line, item in zip(lines, KNOWN, strict=True):
        assert re.split(r" {2,}", line) == [item.code, *filter(None, [", ".join(item.severities)]), item.meaning]


def test_the_columns_of_the_list_are_aligned() -> None:
    for part, table in zip(run().stdout.split("\n\n"), (REGISTRY, REASONS, FAILURES), strict=True):
        lines = part.splitlines()[1:]
        assert len({line.index(item.meaning) for line, item in zip(lines, table.values(), strict=True)}) == 1


def test_the_list_as_json() -> None:
    result = run("--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == [
        {
            "code": item.code,
            "where": item.where,
            "severities": list(item.severities),
            "meaning": item.meaning,
            "what_to_do": item.what_to_do,
        }
        for item in KNOWN
    ]


def test_one_in_full() -> None:
    result = run("gap")
    assert result.exit_code == 0
    assert result.stdout.startswith("gap\n")
    text = " ".join(result.stdout.split())
    gap = REGISTRY["gap"]
    assert text == (
        f"gap what it means {gap.meaning} what to do {gap.what_to_do} severities note, doubtful, bad told by dlogen fit"
    )
    assert max(map(len, result.stdout.splitlines())) <= 100


def test_several_as_they_were_asked_for() -> None:
    result = run("timeout", "gap", "--json")
    assert [(item["code"], item["where"]) for item in json.loads(result.stdout)] == [
        ("timeout", "batch"),
        ("gap", "fit"),
    ]
    parts = run("timeout", "gap").stdout.split("\n\n")
    assert [part.splitlines()[0] for part in parts] == ["timeout", "gap"]
    assert "severities" not in parts[0]


def test_a_code_of_several_commands_is_explained_for_each() -> None:
    assert [item["where"] for item in json.loads(run("noise", "--json").stdout)] == ["fit", "sequence"]
    assert [line for line in run("noise").stdout.splitlines() if "told by" in line] == [
        "  told by        dlogen fit",
        "  told by        dlogen sequence",
    ]


@pytest.mark.parametrize("text", ["[gap]", "GAP", "deviation-above-e_max", "Deviation-above-E_MAX"])
def test_codes_as_messages_show_them(text: str) -> None:
    assert run(text).stdout.splitlines()[0] == text.strip("[]").lower()


@pytest.mark.parametrize("arguments", [(), ("--json",)])
@pytest.mark.parametrize(
    ("code", "nearest"), [("bransh", "branch"), ("time-out", "timeout"), ("direktion", "direction"), ("qqqqq", None)]
)
def test_an_unknown_code(code: str, nearest: str | None, arguments: tuple[str, ...]) -> None:
    result = run("gap", code, *arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    said = f"did you mean {nearest}? " if nearest else ""
    assert result.stderr.splitlines() == [
        f"error: there is no code '{code}'",
        f"hint: {said}dlogen explain lists all of them",
    ]


@pytest.mark.parametrize("arguments", [[], ["gap"], ["--json"], ["bransh"]])
def test_nothing_heavy_is_imported(arguments: list[str]) -> None:
    code = (
        "import sys; from dlogen.cli.main import cli\n"
        f"try: cli.main({['explain', *arguments]!r})\n"
        "except SystemExit: pass\n"
        "assert 'dlogen.stages.quality.findings' in sys.modules\n"
        "heavy = {'numpy', 'scipy', 'yaml', 'rich', 'trimesh', 'plyfile', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize("item", KNOWN, ids=NAMES)
def test_texts_are_sentences(item: Explanation) -> None:
    """What it means is one sentence, short enough for a line; what to do is one or more."""
    for text in (item.meaning, item.what_to_do):
        assert re.fullmatch(r"[A-Z][^|\n]*[a-z0-9)]\.", text), text
        assert "  " not in text
    assert not re.search(r"\. [A-Z]", item.meaning)
    assert len(item.meaning) <= 130


def test_no_two_say_the_same() -> None:
    assert len({item.meaning for item in KNOWN}) == len({item.what_to_do for item in KNOWN}) == len(KNOWN)


@pytest.mark.parametrize("item", KNOWN, ids=NAMES)
def test_what_to_do_names_what_there_is(item: Explanation) -> None:
    """Commands, options of the command that tells it or of the one that is named, and settings."""
    context = click.Context(cli)
    commands = cli.list_commands(context)
    said = f"{item.meaning} {item.what_to_do}"
    named = re.findall(r"dlogen ([a-z]+)", said)
    assert set(named) <= set(commands)
    options = {
        option
        for name in {item.where, *named}
        for parameter in cli.get_command(context, name).params
        for option in parameter.opts
    }
    assert set(re.findall(r"(?<!\w)--?[a-z][a-z-]*", said)) <= options
    for section, key in re.findall(r"\b([a-z]+)\.([a-z_]+)", said):
        assert hasattr(getattr(Config(), section), key)
    for key in re.findall(r"\b(?:e_max|r_n|profile|units|segmentation)\b", said):
        assert hasattr(Config(), key)
