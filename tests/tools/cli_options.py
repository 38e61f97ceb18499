"""The options of every command in `dlogen/cli/README.md`, generated from the commands themselves.

    python tests/tools/cli_options.py           # write them anew, after a command or an option has changed
    python tests/tools/cli_options.py --check   # exit 1 where the file is not what would be written

What stands between the marks is generated; the text around them is written by hand and stays. A command that has no
marks yet gets them at the end of the file.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import click

ROOT = Path(__file__).parents[2]
FILE = ROOT / "dlogen" / "cli" / "README.md"
#: All commands have these; the text says so once.
COMMON = ("quiet", "verbose", "debug")
_BEGIN, _END = "<!-- generated: dlogen {words} -->", "<!-- end -->"


def leaf_commands(root: click.Command) -> list[tuple[str, click.Command]]:
    """All commands that do something, with the words that call them."""

    def below(words: str, command: click.Command) -> list[tuple[str, click.Command]]:
        if not isinstance(command, click.Group):
            return [(words, command)]
        context = click.Context(command)
        return [
            found
            for name in command.list_commands(context)
            for found in below(f"{words} {name}".strip(), command.get_command(context, name))
        ]

    return below("", root)


def block(words: str, command: click.Command) -> str:
    """What is generated for a command: how it is called, what it says of itself, its options and its examples."""
    arguments = [_argument(item) for item in command.params if isinstance(item, click.Argument)]
    options = [item for item in command.params if isinstance(item, click.Option) and item.name not in COMMON]
    call = " ".join(["dlogen", words, *(["[OPTIONS]"] if options else []), *arguments])
    parts = [f"```text\n{call}\n```", _paragraphs(command.help or "")]
    if options:
        rows = [f"| {_names(item)} | {_meaning(item)} |" for item in options]
        parts.append("\n".join(["| option | meaning |", "|---|---|", *rows]))
    examples = re.findall(rf"^ +(dlogen {words}\b.*)$", command.epilog or "", re.MULTILINE)
    if examples:
        parts.append("```console\n" + "\n".join(f"$ {line}" for line in examples) + "\n```")
    return "\n\n".join(parts)


def generated(text: str, commands: list[tuple[str, click.Command]]) -> str:
    """The text with the blocks of all commands written anew."""
    for words, command in commands:
        begin = _BEGIN.format(words=words)
        made = f"{begin}\n\n{block(words, command)}\n\n{_END}"
        if begin not in text:
            text = f"{text.rstrip()}\n\n## `dlogen {words}`\n\n{made}\n"
            continue
        head, rest = text.split(begin, 1)
        text = head + made + rest.split(_END, 1)[1]
    return text


def _argument(item: click.Argument) -> str:
    name = item.metavar or (item.name or "").upper()
    return name if item.required or name.startswith("[") else f"[{name}]"


def _names(item: click.Option) -> str:
    value = "" if item.is_flag or item.count else f" {_value(item)}"
    names = ", ".join(f"`{name}`" for name in item.opts[:-1] + item.secondary_opts)
    last = f"`{item.opts[-1]}{value}`".replace("|", "\\|")
    return ", ".join(filter(None, [names, last])) if not item.secondary_opts else f"{last}, {names}"


def _value(item: click.Option) -> str:
    if item.metavar:
        return item.metavar
    if isinstance(item.type, click.Choice):
        return "|".join(map(str, item.type.choices))
    if isinstance(item.type, click.IntRange) or item.type is click.INT:
        return "N"
    if isinstance(item.type, click.FloatRange) or item.type is click.FLOAT:
        return "NUMBER"
    return item.type.name.upper() if item.type is click.STRING else item.type.name


def _meaning(item: click.Option) -> str:
    default = ""
    if item.show_default:
        value = item.default
        if item.secondary_opts:
            value = (item.opts if value else item.secondary_opts)[0]
        default = f"  [default: {value}]"
    text = re.sub(r"\s+", " ", f"{item.help or ''}{default}").replace("|", "\\|")
    return re.sub(r"\s*\[default: (.*?)\]", lambda found: f" Default: {_code(found[1])}.", text)


def _code(value: str) -> str:
    return value if " " in value else f"`{value}`"


def _paragraphs(text: str) -> str:
    """The help text of a command as Markdown: what it takes for code stays as it is."""
    out = []
    for paragraph in re.split(r"\n\s*\n", re.sub(r"^[ \t]+", "", text.strip(), flags=re.MULTILINE)):
        if paragraph.startswith("\b"):
            out.append("```text\n" + paragraph.lstrip("\b\n") + "\n```")
        else:
            out.append(re.sub(r"\s+", " ", paragraph))
    return "\n\n".join(out)


def main() -> int:
    """Write the file, or say whether it is up to date."""
    from dlogen.cli.main import cli

    before = FILE.read_text(encoding="utf-8")
    after = generated(before, leaf_commands(cli))
    if "--check" in sys.argv[1:]:
        return int(before != after)
    FILE.write_text(after, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
