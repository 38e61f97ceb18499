from __future__ import annotations

import os
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from dlogen.cli.options import config_options, cores
from dlogen.config.reader import load_config


@pytest.mark.parametrize(
    ("text", "expected"),
    [("100000 100000\n", 1), ("10000 100000\n", 1), ("max 100000\n", None), ("6400000 100000\n", None), ("?", None)],
)
def test_cores_are_those_of_the_container(tmp_path: Path, text: str, expected: int | None) -> None:
    limits = tmp_path / "cpu.max"
    limits.write_text(text)
    everything = cores(tmp_path / "missing")
    assert 1 <= everything <= (os.cpu_count() or 1)
    assert cores(limits) == (expected if expected is not None else min(everything, 64))


def test_a_flag_wins_over_set_and_that_over_the_file(tmp_path: Path) -> None:
    @click.command()
    @config_options
    def command(config_path: str | None, overrides: tuple[str, ...]) -> None:
        config = load_config(config_path, list(overrides))
        click.echo(f"{config.profile} {config.e_max} {config.r}")

    path = tmp_path / "c.yaml"
    path.write_text("profile: refined\ne_max: 0.02\nr: 0.02\n")
    flagged = ["--profile", "paper", "-c", str(path), "--set", "profile=refined", "--set", "e_max=0.01"]
    # In whatever order they stand.
    for words in (flagged, [*flagged[2:], *flagged[:2]]):
        assert CliRunner().invoke(command, words).output == "paper 0.01 0.02\n"
    assert CliRunner().invoke(command, flagged[2:]).output == "refined 0.01 0.02\n"
