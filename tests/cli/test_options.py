from __future__ import annotations

from pathlib import Path

import click
from click.testing import CliRunner

from dlogen.cli.options import config_options
from dlogen.config.reader import load_config


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
