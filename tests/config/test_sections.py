"""The sections that there are."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields

import pytest
from configurations import KEYS

from dlogen.config import sections
from dlogen.config.base import Section
from dlogen.config.schema import Config
from dlogen.config.values import flat

SECTIONS = [kind for kind in vars(sections).values() if isinstance(kind, type) and issubclass(kind, Section)]


def test_each_is_a_section_of_the_configuration():
    assert [type(getattr(Config(), name)) for name in KEYS.sections] == [
        kind for kind in SECTIONS if kind is not Section
    ]


@pytest.mark.parametrize("name", KEYS.sections)
def test_a_section_is_frozen_and_shows_how_it_is_made(name):
    section = getattr(Config(), name)
    for item in fields(section):
        with pytest.raises(FrozenInstanceError):
            setattr(section, item.name, getattr(section, item.name))
    assert eval(repr(section), vars(sections)) == section
    assert eval(repr(Config()), vars(sections) | {"Config": Config}) == Config()


@pytest.mark.parametrize("key", KEYS.settings)
def test_a_setting_is_declared_in_full(key):
    """What the checks need is there, and nothing that the kind of the setting has no use for."""
    setting = KEYS.settings[key]
    limits = [limit for limit in (setting.above, setting.least, setting.most) if limit is not None]
    assert setting.help.endswith(".")
    assert (setting.kind == "choice") == bool(setting.choices)
    assert not (setting.unit or setting.above is not None) or setting.kind == "number"
    assert not limits or setting.kind in ("number", "integer", "text")
    assert setting.kind != "text" or len(limits) == 2
    default = flat(Config().to_dict())[key]
    assert setting.read(default) == default
    assert default != "auto" or setting.auto
