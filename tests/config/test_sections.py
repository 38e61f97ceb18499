"""Sections: what is declared, and how they compare and show themselves."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass, fields

import pytest
from configurations import KEYS

from dlogen.config.fields import AUTO, Auto, choice, flag, integer, number, text
from dlogen.config.schema import Config
from dlogen.config.sections import Normals, Projection, Section
from dlogen.errors import ConfigError


@dataclass(frozen=True, repr=False, eq=False)
class Hose(Section):
    """A section as a new one would be declared."""

    length: float | Auto = number(AUTO, "Length.", unit="m", auto="measured", above=0, sought=("long",))  # noqa: RUF009
    turns: int = integer(3, "Turns.", least=0)
    coiled: bool = flag(True, "Whether it is coiled.")
    colour: str = choice("red", "Colour.", choices=("red", "blue"))
    name: str = text("it", "Name.", least=1, most=3)


def test_a_declaration_gives_default_and_setting():
    assert Hose().values() == {"length": AUTO, "turns": 3, "coiled": True, "colour": "red", "name": "it"}
    assert [*Hose.settings()] == ["length", "turns", "coiled", "colour", "name"]
    length = Hose.settings()["length"]
    assert (length.kind, length.unit, length.auto, length.above, length.sought) == (
        "number",
        "m",
        "measured",
        0,
        ("long",),
    )
    assert [setting.kind for setting in Hose.settings().values()] == ["number", "integer", "flag", "choice", "text"]
    assert [Hose.settings()[name].least for name in ("turns", "name")] == [0, 1]
    assert Hose.settings()["colour"].choices == ("red", "blue")


def test_values_are_checked_and_stored_with_the_type_of_their_field():
    made = Hose(length=2, turns=4.0)
    assert [type(value) for value in (made.length, made.turns)] == [float, int]
    with pytest.raises(ConfigError, match="3 problems") as caught:
        Hose(length=0, turns=-1, colour="blu")
    for says in ("length = 0: expected a number > 0 (m), or auto", "turns = -1", "did you mean 'blue'?"):
        assert says in caught.value.message


def test_a_default_that_is_not_allowed_shows_at_once():
    @dataclass(frozen=True)
    class Wrong(Section):
        length: float = number(0.0, "Length.", above=0)

    with pytest.raises(ConfigError, match="length = 0"):
        Wrong()


def test_they_are_equal_and_hashed_by_class_and_values():
    assert Hose(turns=4) == Hose(turns=4.0) != Hose()
    assert {Hose(turns=4), Hose(turns=4.0)} == {Hose(turns=4)}
    assert Projection() != Normals()
    assert Projection().__eq__(Normals()) is NotImplemented

    @dataclass(frozen=True, repr=False, eq=False)
    class Other(Section):
        enabled: bool = flag(True, "The same value.")

    assert Other().values() == Projection().values()
    assert Other() != Projection()


def test_they_show_themselves_as_they_are_made():
    assert repr(Normals(neighbours=5)) == "Normals(neighbours=5, radius='auto', orientation='auto')"
    assert repr(Hose()) == "Hose(length='auto', turns=3, coiled=True, colour='red', name='it')"
    config = Config(r=0.02)
    assert repr(config).startswith("Config(profile='refined', units='m', r=0.02, ")
    assert eval(repr(config), _classes()) == config


def _classes() -> dict[str, type]:
    sections = {type(getattr(Config(), name)) for name in KEYS.sections}
    return {kind.__name__: kind for kind in (Config, *sections)}


def test_they_are_frozen():
    for section in (Hose(), *(getattr(Config(), name) for name in KEYS.sections)):
        with pytest.raises(FrozenInstanceError):
            setattr(section, fields(section)[0].name, None)
