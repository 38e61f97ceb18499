"""`dlogen explain`: what the codes in the outputs mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dlogen.cli.console import Console, print_json
from dlogen.cli.main import Command

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dlogen.stages.quality.findings import Explanation

#: What stands above the codes of a command.
_HEADINGS = {
    "fit": "Findings about a cloud and its chain (dlogen fit, batch, sequence):",
    "sequence": "Why a frame of a recording is set aside, and doubts about all of it (dlogen sequence):",
    "batch": "Why there is no model of a cloud (dlogen batch, sequence):",
}

_EXAMPLES = """Examples:

\b
  dlogen explain
  dlogen explain gap closed-ring
  dlogen explain --json | jq -r .[].code
"""


@click.command(cls=Command, epilog=_EXAMPLES)
@click.argument("codes", metavar="[CODE]...", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print the explanations as JSON.")
def command(codes: tuple[str, ...], as_json: bool, console: Console) -> None:
    """Explain the codes of findings, of frames that are set aside and of failures.

    Without a CODE all are listed. With one or more, what they mean and what to do is printed in full; a code that
    several commands have is explained for each of them.
    """
    known = _known()
    chosen = [item for code in codes for item in _of_code(code, known)] if codes else known
    if as_json:
        print_json([item.to_dict() for item in chosen])
    elif codes:
        click.echo("\n\n".join(_in_full(item) for item in chosen))
    else:
        click.echo("\n\n".join(_listed(known, where) for where in _HEADINGS))


def _known() -> list[Explanation]:
    """All codes that dlogen writes."""
    from dlogen.batch.failures import FAILURES
    from dlogen.sequence.reasons import REASONS
    from dlogen.stages.quality.findings import REGISTRY

    return [*REGISTRY.values(), *REASONS.values(), *FAILURES.values()]


def _of_code(text: str, known: Sequence[Explanation]) -> list[Explanation]:
    """The explanations of a code, which may be written as messages show it: in brackets.

    Raises:
        UsageError: there is no such code.
    """
    code = text.strip("[]").casefold()
    found = [item for item in known if item.code.casefold() == code]
    if not found:
        import difflib

        from dlogen.errors import UsageError

        # All lower case but for e_max, so that this is the code as well.
        near = difflib.get_close_matches(code, [item.code for item in known], n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise UsageError(f"there is no code '{text}'", f"{hint}dlogen explain lists all of them")
    return found


def _listed(known: Sequence[Explanation], where: str) -> str:
    """The codes of a command, each in a line: code, severities if there are any, and meaning."""
    rows = [(item.code, ", ".join(item.severities), item.meaning) for item in known if item.where == where]
    widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
    lines = [
        "  ".join([code.ljust(widths[0]), *([severities.ljust(widths[1])] if widths[1] else []), meaning])
        for code, severities, meaning in rows
    ]
    return "\n".join([_HEADINGS[where], *lines])


def _in_full(item: Explanation) -> str:
    """All that is known of a code, wrapped as help texts are."""
    parts = [
        ("what it means", item.meaning),
        ("what to do", item.what_to_do),
        ("severities", ", ".join(item.severities)),
        ("told by", f"dlogen {item.where}"),
    ]
    width = max(len(name) for name, _ in parts)
    return "\n".join(
        [
            item.code,
            *(click.wrap_text(text, 100, f"  {name:<{width}}  ", " " * (width + 4)) for name, text in parts if text),
        ]
    )
