"""The table of findings in `dlogen/stages/quality/README.md`, made from the registry.

    python tests/tools/findings_table.py            # print it
    python tests/tools/findings_table.py --write    # put it into the README, between the two comments

`tests/stages/quality/test_findings.py` fails when the README is not what this writes.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from dlogen.stages.quality.findings import REGISTRY

README = Path(__file__).parents[2] / "dlogen" / "stages" / "quality" / "README.md"

#: The two comments and what is between them.
_PLACE = re.compile(r"(^<!-- findings:[^\n]*-->\n).*?(^<!-- /findings -->$)", re.MULTILINE | re.DOTALL)


def table() -> str:
    """A row for each kind of finding, in Markdown."""
    lines = ["| code | severity | what it means | what to do |", "|---|---|---|---|"]
    for kind in REGISTRY.values():
        severities = ", ".join(f"`{severity}`" for severity in kind.severities)
        lines.append(f"| `{kind.code}` | {severities} | {kind.meaning} | {kind.what_to_do} |")
    return "".join(f"{line}\n" for line in lines)


def with_table(text: str) -> str:
    """A text with the table between the two comments, whatever was there.

    Raises:
        ValueError: the text does not have the two comments, or has several.
    """
    found = _PLACE.findall(text)
    if len(found) != 1:
        raise ValueError(f"the two comments that the table stands between are there {len(found)} times")
    return _PLACE.sub(lambda match: match[1] + table() + match[2], text)


def main() -> None:
    """Print the table, or write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write it into the README")
    if parser.parse_args().write:
        README.write_text(with_table(README.read_text(encoding="utf-8")), encoding="utf-8")
    else:
        print(table(), end="")


if __name__ == "__main__":
    main()
