"""What is wrong between keys that are each right, as far as it shows without a cloud."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from dlogen.config.fields import AUTO
from dlogen.config.presets import NO_PRESET
from dlogen.config.problems import Problem

_MODULI = ("youngs_modulus", "shear_modulus", "poissons_ratio")

#: Problems as a rule finds them: message and hint.
_Found = Iterator[tuple[str, str]]


def contradictions(values: Mapping[str, Any], places: Mapping[str, str]) -> list[Problem]:
    """All that is wrong between keys.

    Args:
        values: checked values by dotted key; those that are missing or auto contradict nothing.
        places: where the values stand in the input, as far as that is known.
    """
    given = _Given(values, places)
    return [Problem("", message, hint) for rule in _RULES for message, hint in rule(given)]


class _Given(dict[str, Any]):
    """The values that are not auto, by dotted key, and how messages name them."""

    def __init__(self, values: Mapping[str, Any], places: Mapping[str, str]) -> None:
        super().__init__({key: value for key, value in values.items() if value != AUTO})
        self._places = places

    def among(self, section: str, *names: str) -> list[str]:
        """The keys of these names that are given."""
        return [key for name in names if (key := f"{section}.{name}") in self]

    def said(self, *keys: str) -> str:
        """Keys with their values and where those stand."""
        return " and ".join(
            f"{key} = {self[key]}" + (f" ({self._places[key]})" if key in self._places else "") for key in keys
        )


def _search_radius(given: _Given) -> _Found:
    if "r" in given and "r_n" in given and given["r_n"] < 2 * given["r"]:
        yield (
            f"{given.said('r_n')} is less than the diameter 2 r = {2 * given['r']:.12g}, with {given.said('r')}",
            "the sorting walk needs r_n > 2 r (paper III.B; its experiment has 8 r), or leave r_n at auto",
        )


def _normals(given: _Given) -> _Found:
    keys = given.among("normals", "neighbours", "radius")
    if len(keys) > 1:
        yield (
            f"{given.said(*keys)} contradict each other",
            "set one of them: a plane is fitted either to the nearest points or to all within a radius",
        )


def _material(given: _Given) -> _Found:
    """A preset is only a default: it contradicts nothing."""
    for most, names, hint in (
        (1, ("density", "mass", "mass_per_length"), "set one of them: the others follow from it"),
        (1, ("inner_radius", "wall_thickness"), "set one of them: inner_radius + wall_thickness = r"),
        (2, _MODULI, "set two of them: G = E / (2 (1 + nu))"),
    ):
        keys = given.among("material", *names)
        if len(keys) > most:
            yield f"{given.said(*keys)} contradict each other", hint
    for key in given.among("material", "inner_radius", "wall_thickness"):
        if "r" in given and given[key] >= given["r"]:
            yield f"{given.said(key)} is not less than {given.said('r')}", "r is the outer radius"


def _stiffness(given: _Given) -> _Found:
    """What the springs of the joints need to know."""
    if given.get("material.preset", NO_PRESET) != NO_PRESET:
        return  # it knows all moduli
    young, shear, ratio = (f"material.{name}" in given for name in _MODULI)
    if shear and not (young or ratio):
        yield (
            f"{given.said('material.shear_modulus')} says nothing of the bending stiffness",
            "set material.youngs_modulus or material.poissons_ratio as well",
        )
    if young and not (shear or ratio) and given.get("joints.dof") == 3:
        yield (
            f"{given.said('joints.dof')}: {given.said('material.youngs_modulus')} says nothing of the torsional "
            "stiffness",
            "set material.poissons_ratio or material.shear_modulus as well, or joints.dof to 2",
        )
    if not (young or shear):
        for key in given.among("material", "poissons_ratio", "damping_ratio"):
            yield f"{given.said(key)}, but no modulus is known", "set material.youngs_modulus or a preset"


def _segmentation(given: _Given) -> _Found:
    """Each of some keys alone says how long the segments are."""
    known = given.among("segmentation", "segments", "segment_length", "curvature_max", "min_bend_radius")
    if len(known) > 1:
        yield (
            f"{given.said(*known)} contradict each other",
            "set one of them: each says how long the segments are",
        )
    criterion, placement = given.get("segmentation.criterion"), given.get("segmentation.placement")
    exact = given.among("segmentation", "segments", "segment_length")
    if known and criterion is not None and (criterion == "fewest" or exact):
        yield (
            f"{given.said('segmentation.criterion', known[0])} contradict each other",
            "leave criterion at auto where the segments are given",
        )
    if placement == "minimax" and (known or criterion == "paper"):
        yield (
            f"{given.said('segmentation.placement', known[0] if known else 'segmentation.criterion')} contradict each "
            "other",
            "minimax looks for the fewest segments: set criterion to fewest and leave the others at auto",
        )
    elif placement == "minimax" and criterion is None and given.get("profile") == "paper":
        yield (
            f"{given.said('segmentation.placement')}, but the profile paper has its joints on the line (Eq. 18)",
            "set segmentation.criterion to fewest as well",
        )


def _lengths_in_metres(given: _Given) -> _Found:
    """Nobody has a cable a metre thick: the number was meant in the cloud's units."""
    factor = {"mm": 1e-3, "cm": 1e-2}.get(given.get("units", ""))
    for key in ("r", "e_max"):
        if factor and given.get(key, 0) >= 1:
            yield (
                f"{given.said(key)} is a metre or more, with {given.said('units')}",
                "lengths in the configuration are metres, whatever the cloud is in: "
                f"{given[key]:g} {given['units']} is {given[key] * factor:.12g}",
            )


_RULES = (_search_radius, _normals, _material, _stiffness, _segmentation, _lengths_in_metres)
