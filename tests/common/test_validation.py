"""Refusals of files that pydantic checks."""

import pytest
import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.validation import Checked


class Columns(Checked):
    columns: dict[str, str]


@pytest.mark.parametrize("word", ["on", "off", "yes", "no"])
def test_a_name_that_yaml_takes_for_a_truth_value_is_told_so(word: str) -> None:
    with pytest.raises(InputError, match=f"must be text; YAML takes {'.*'}{word}.*: quote it"):
        Columns.read(yaml.safe_load(f"columns: {{{word}: torque_enable}}"), "mapping.yaml:")
    assert Columns.read(yaml.safe_load(f"columns: {{'{word}': torque_enable}}"), "mapping.yaml:").columns


def test_a_number_is_refused_as_a_text_without_that_remedy() -> None:
    with pytest.raises(InputError, match=r"mapping.yaml: columns.a is 3, must be text$"):
        Columns.read({"columns": {"a": 3}}, "mapping.yaml:")
