from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formulas import evaluate, names_in
from samrl_ros.log_import.units import factor

X = np.array([1.0, 2.0, 3.0, 5.0])
VALUES: dict[str, Any] = {
    "x": X,
    "raw": np.array([5.0, 1024 + 5.0, 1023.0, 2047.0]),
    "count": np.array([4000.0, 4090.0, 10.0, 100.0]),
    "lists": np.column_stack([X, 10 * X]),
    "M": np.array([[2.0, 0.0], [1.0, 1.0]]),
    "k": 2.0,
}


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("2 * x - x / 4 + k", 2 * X - X / 4 + 2),
        ("-x ** 2", -(X**2)),
        ("x // 2 + x % 2", X // 2 + X % 2),
        ("signed(raw, 10)", [5, -5, 1023, -1023]),
        ("unwrap(count, 4096)", [4000, 4090, 4106, 4196]),
        ("lists[1]", 10 * X),
        ("apply(M, lists)[1]", 11 * X),
        ("solve(M, apply(M, lists))[1]", 10 * X),
        ("stack(x, k)[1]", [2, 2, 2, 2]),
        ("where(x > 2, x, 0)", [0, 0, 3, 5]),
        ("shift(x, 1)", [1, 1, 2, 3]),
        ("sin(pi / 2) * clip(x, 2, 3)", [2, 2, 3, 3]),
        (7, 7.0),
    ],
)
def test_values(formula: Any, expected: Any) -> None:
    np.testing.assert_allclose(evaluate(formula, VALUES, "here"), expected)


@pytest.mark.parametrize(
    "formula",
    [
        "__import__('os').system('true')", "x.__class__", "(lambda: 1)()", "[x for x in (1,)]", "open('f')",
        "x if k else 0", "'text'", "x[0:1]", "x[k]", "lists[-1]", "lists[2]", "x[0]; x", "x and k", "f(x)",
        "eval('1')", "x := 3", "{1: 2}", "abs(x=3)", "", None, True, "x +", "(" * 400, "1" * 2000,
    ],
)  # fmt: skip
def test_nothing_else_can_be_said(formula: Any) -> None:
    values = dict(VALUES, x=np.arange(100.0))
    with pytest.raises(InputError, match="here"):
        evaluate(formula, values, "here")


def test_huge_powers_end_at_once() -> None:
    assert evaluate("9 ** 9 ** 9 ** 9", {}, "here") == np.inf


def test_unknown_names_list_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"'y' is not known.*'count'"):
        evaluate("y + 1", VALUES, "here")


def test_names_used() -> None:
    assert names_in("signed(raw, 10) * k + pi", "here") == {"raw", "k"}


def test_units() -> None:
    assert factor("position", "deg", "") == pytest.approx(np.pi / 180)
    assert factor("position", "counts/4096", "") == pytest.approx(2 * np.pi / 4096)
    assert factor("velocity", "rpm", "") == pytest.approx(2 * np.pi / 60)
    assert factor("velocity", "counts/4096/s", "") == pytest.approx(2 * np.pi / 4096)
    for quantity, unit in (("position", "rpm"), ("effort", "counts/4096"), ("velocity", "counts/4096")):
        with pytest.raises(InputError, match=f"here: unit '{unit}'"):
            factor(quantity, unit, "here")


@pytest.mark.parametrize("bit", ["1e9", "-1", "2.5", "1 / 0", "x"])
def test_a_sign_is_a_bit_of_a_count(bit: str) -> None:
    """Two to the power of a damaged mapping's number took longer than anybody waits."""
    with pytest.raises(InputError, match="here"):
        evaluate(f"signed(raw, {bit})", VALUES, "here")
