"""`dlogen formats`: what can be read and written."""

from __future__ import annotations

from typing import Any

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command


@click.command(cls=Command, epilog="Example:\n\n\b\n  dlogen formats --json\n")
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON.")
def command(as_json: bool, console: Console) -> None:
    """List the file formats that can be read and written."""
    from dlogen.io.registry import CloudFormat, registered

    rows: list[dict[str, Any]] = [
        {
            "name": item.name,
            "suffixes": list(item.suffixes),
            "kind": "cloud" if isinstance(item, CloudFormat) else "model",
            "read": isinstance(item, CloudFormat),
            "write": True,
            "encodings": list(item.encodings) if isinstance(item, CloudFormat) else [],
            "description": item.description,
        }
        for item in registered()
    ]
    if as_json:
        print_json(rows)
        return
    for row in rows:
        does = "read, write" if row["read"] else "write"
        click.echo(f"{row['name']:<10} {does:<12} {' '.join(row['suffixes']):<16} {row['description']}")
