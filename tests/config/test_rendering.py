"""Commented YAML and JSON Schema: what they hold loads, and means the same."""

from __future__ import annotations

import math

import pytest
from configurations import ANYTHING, KEYS, valid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from dlogen.config.reader import load_config
from dlogen.config.rendering import json_schema, to_yaml
from dlogen.config.schema import Config
from dlogen.errors import ConfigError


# Whole configurations take long to draw where other tests run on the same core.
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(valid())
def test_round_trip_through_data_and_yaml(tmp_path_factory, data):
    config = Config.from_dict(data)
    assert Config.from_dict(config.to_dict()) == config
    path = tmp_path_factory.mktemp("config") / "c.yaml"
    path.write_text(to_yaml(config), encoding="utf-8")
    assert load_config(path) == config


@given(valid())
def test_yaml_means_the_same_to_other_readers(data):
    yaml = pytest.importorskip("yaml")
    config = Config.from_dict(data)
    assert yaml.safe_load(to_yaml(config)) == config.to_dict()


@given(valid())
def test_what_loads_is_valid_by_the_schema(data):
    Draft202012Validator(json_schema()).validate(data)
    Draft202012Validator(json_schema()).validate(Config.from_dict(data).to_dict())


@given(st.sampled_from(sorted(KEYS.settings)), ANYTHING)
def test_schema_and_checks_agree_on_single_values(key, value):
    section, _, name = key.rpartition(".")
    data = {section: {name: value}} if section else {name: value}
    if section == "material" and name != "preset":
        data[section]["preset"] = "rope"  # some keys of the material say nothing alone
    if isinstance(value, float) and not math.isfinite(value):
        return  # JSON has no such numbers
    try:
        Config.from_dict(data)
        loads = True
    except ConfigError:
        loads = False
    printable = not isinstance(value, str) or value.isprintable()
    assert Draft202012Validator(json_schema()).is_valid(data) == loads or not printable
