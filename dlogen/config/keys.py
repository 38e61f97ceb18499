"""Which keys a configuration has, and which of them somebody may have meant."""

from __future__ import annotations

import re
from collections.abc import Mapping

from dlogen.config.fields import Setting
from dlogen.config.problems import Problem, show


class Keys:
    """The keys of a configuration.

    Args:
        settings: every setting by its dotted key ("normals.neighbours"), in the order of declaration.
        sections: what each section is about, by its name.
    """

    def __init__(self, settings: Mapping[str, Setting], sections: Mapping[str, str]) -> None:
        self.settings = dict(settings)
        self.sections = dict(sections)
        self._spellings = {spelling: key for key, item in settings.items() for spelling in (key, *item.also)}

    def find(self, name: object) -> str | None:
        """The dotted key that is spelt so, if there is one."""
        return self._spellings.get(name) if isinstance(name, str) else None

    def of_section(self, section: str) -> dict[str, Setting]:
        """The settings of a section by their names in it; "" is the top level."""
        parts = ((key.rpartition("."), item) for key, item in self.settings.items())
        return {name: item for (before, _, name), item in parts if before == section}

    def nearest(self, name: str) -> list[str]:
        """Keys that somebody who wrote this may have meant: the same letters, another name for it, or a slip."""
        whole: dict[str, list[str]] = {_letters(section): [section] for section in self.sections}
        last: dict[str, list[str]] = {}
        for key, setting in self.settings.items():
            section, _, leaf = key.rpartition(".")
            for word in (leaf, *setting.also, *setting.sought):
                whole.setdefault(_letters(section + word), []).append(key)
                last.setdefault(_letters(word), []).append(key)
        leaf = name.rpartition(".")[2]
        for table, word in ((whole, _letters(name)), (last, _letters(leaf))):
            if word in table:
                # Another section may have what was looked for, too.
                return list(dict.fromkeys([*table[word], *last.get(word, ())]))
        import difflib

        similar = [
            (difflib.SequenceMatcher(None, word, known).ratio(), keys)
            for table, word in ((whole, _letters(name)), (last, _letters(leaf)))
            for known, keys in table.items()
            if len(word) > 2  # those of one or two letters are all alike
        ]
        ratio, keys = max(similar, key=lambda pair: pair[0], default=(0.0, []))
        return keys if ratio >= 0.7 else []

    def unknown(self, where: str, name: object, section: str = "") -> Problem:
        """A key that does not exist, with the nearest that do."""
        shown = f"{section}.{name}" if section else str(name)
        if near := self.nearest(shown):
            hint = "did you mean " + " or ".join(repr(key) for key in near) + "?"
        else:
            known = [*self.of_section(section), *(() if section else self.sections)]
            hint = f"known {f'in {section}' if section else 'keys'}: {', '.join(known)}"
        return Problem(where, f"unknown key {show(shown)}", hint)


def _letters(name: str) -> str:
    return re.sub(r"[\W_]", "", name.casefold())
