"""What all sections have in common: declarations, checks, and how they compare and show themselves."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from dlogen.config.base import Section
from dlogen.config.fields import AUTO, Auto, choice, flag, integer, length, number, text
from dlogen.errors import ConfigError


@dataclass(frozen=True, repr=False, eq=False)
class Hose(Section):
    """A section as a new one would be declared."""

    size: float | Auto = length(AUTO, "Size.", auto="measured", sought=("long",))  # noqa: RUF009
    turns: int = integer(3, "Turns.", least=0)
    coiled: bool = flag(True, "Whether it is coiled.")
    colour: str = choice("red", "Colour.", choices=("red", "blue"))
    name: str = text("it", "Name.", least=1, most=3)


def test_a_declaration_gives_default_and_setting():
    assert Hose().own_values() == {"size": AUTO, "turns": 3, "coiled": True, "colour": "red", "name": "it"}
    assert [*Hose.settings()] == ["size", "turns", "coiled", "colour", "name"]
    size = Hose.settings()["size"]
    assert (size.kind, size.help, size.unit, size.auto) == ("number", "Size.", "m", "measured")
    assert (size.above, size.least, size.sought) == (0, None, ("long",))
    assert [setting.kind for setting in Hose.settings().values()] == ["number", "integer", "flag", "choice", "text"]
    assert [Hose.settings()[name].least for name in ("turns", "name")] == [0, 1]
    assert Hose.settings()["name"].most == 3
    assert Hose.settings()["colour"].choices == ("red", "blue")


def test_values_are_checked_and_stored_with_the_type_of_their_field():
    made = Hose(size=2, turns=4.0)
    assert [type(value) for value in (made.size, made.turns)] == [float, int]
    with pytest.raises(ConfigError, match="3 problems") as caught:
        Hose(size=0, turns=-1, colour="blu")
    for says in ("size = 0: expected a number > 0 (m), or auto", "turns = -1", "did you mean 'blue'?"):
        assert says in caught.value.message


def test_a_default_that_is_not_allowed_shows_at_once():
    @dataclass(frozen=True)
    class Wrong(Section):
        size: float = number(0.0, "Size.", above=0)

    with pytest.raises(ConfigError, match="size = 0"):
        Wrong()


def test_they_are_equal_and_hashed_by_class_and_values():
    @dataclass(frozen=True, repr=False, eq=False)
    class Other(Section):
        coiled: bool = flag(True, "Whether it is coiled.")

    @dataclass(frozen=True, repr=False, eq=False)
    class Same(Section):
        coiled: bool = flag(True, "Whether it is coiled.")

    assert Hose(turns=4) == Hose(turns=4.0) != Hose()
    assert {Hose(turns=4), Hose(turns=4.0)} == {Hose(turns=4)}
    assert Other() == Other() != Other(coiled=False)
    assert Other().own_values() == Same().own_values()
    assert Other() != Same()
    assert Other() != {"coiled": True}


def test_they_show_themselves_as_they_are_made():
    assert repr(Hose(size=2)) == "Hose(size=2.0, turns=3, coiled=True, colour='red', name='it')"
