"""`dlogen config`: what can be set, and what is."""

from __future__ import annotations

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command


@click.group(
    epilog="Examples:\n\n\b\n"
    "  dlogen config show > my.yaml\n"
    "  dlogen config show -c my.yaml --set e_max=0.005\n"
    "  dlogen config schema > dlogen.schema.json\n",
)
def command() -> None:
    """Show what can be set, and check configurations."""


@command.command(
    cls=Command,
    epilog="Examples:\n\n\b\n"
    "  dlogen config show > my.yaml\n"
    "  dlogen config show -c my.yaml --set e_max=0.005 --json\n",
)
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration, - for stdin.")
@click.option("--set", "overrides", metavar="KEY=VALUE", multiple=True, help="Set one configuration key; repeatable.")
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def show(config_path: str | None, overrides: tuple[str, ...], as_json: bool, console: Console) -> None:
    """Print the configuration in effect as YAML, every key with its meaning, range, unit and default.

    Without options these are the defaults: a file to start from. With -c and --set the configuration is checked, and
    what they leave out is filled in.
    """
    from dlogen.config.reader import load_config
    from dlogen.config.rendering import to_yaml

    config = load_config(config_path, overrides)
    if as_json:
        print_json(config.to_dict())
    else:
        click.echo(to_yaml(config), nl=False)


@command.command(cls=Command, epilog="Example:\n\n\b\n  dlogen config schema > dlogen.schema.json\n")
def schema(console: Console) -> None:
    """Print the JSON Schema of the YAML configuration.

    Editors complete and check keys with it. For those that use the YAML language server, put this on the first line of
    your configuration:

    \b
      # yaml-language-server: $schema=dlogen.schema.json
    """
    from dlogen.config.rendering import json_schema

    print_json(json_schema())
