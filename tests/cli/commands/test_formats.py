"""`dlogen formats` lists what the registry holds."""

from __future__ import annotations

import json

from click.testing import CliRunner

from dlogen.cli.main import cli
from dlogen.io.registry import cloud_formats, registered


def test_every_format_with_its_suffixes() -> None:
    rows = json.loads(CliRunner().invoke(cli, ["formats", "--json"]).stdout)
    assert [row["name"] for row in rows] == [item.name for item in registered()]
    clouds = {item.name: item for item in cloud_formats()}
    assert {row["name"] for row in rows if row["read"]} == set(clouds) == {"ply", "pcd"}
    for row, item in zip(rows, registered(), strict=True):
        assert row["suffixes"] == list(item.suffixes)
        assert row["kind"] == ("cloud" if row["name"] in clouds else "model")
        assert row["encodings"] == (list(clouds[row["name"]].encodings) if row["name"] in clouds else [])
        assert row["write"] is True
        assert row["description"] == item.description != ""


def test_a_line_for_each() -> None:
    done = CliRunner().invoke(cli, ["formats"])
    lines = done.stdout.splitlines()
    assert done.exit_code == 0
    assert [line.split()[0] for line in lines] == [item.name for item in registered()]
    does = {line.split()[0]: line[11:24].strip() for line in lines}
    assert (does["ply"], does["urdf"]) == ("read, write", "write")
