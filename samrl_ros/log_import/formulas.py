"""Formulas over columns: arithmetic of a whitelist, evaluated on arrays; nothing else can be expressed.

Values are floats, columns (N,), lists of columns (N, K) or constant matrices. `x[2]` is the third of a list.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError

_LONGEST = 1000  # characters
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: np.true_divide,
    ast.FloorDiv: np.floor_divide,
    ast.Mod: np.mod,
    ast.Pow: np.power,
}
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


HIGHEST_BIT = 62  # of a count


def signed(values: Any, bit: Any) -> np.ndarray:
    """Sign and magnitude to numbers: a set `bit` (from 0) means minus, lower bits are the magnitude."""
    if not 0 <= bit <= HIGHEST_BIT or bit != int(bit):
        raise ValueError(f"signed(x, {bit:g}): a sign is a bit, a whole number from 0 to {HIGHEST_BIT}")
    weight = 2.0 ** int(bit)
    return np.where(np.mod(np.floor(values / weight), 2) == 1, -1.0, 1.0) * np.mod(values, weight)


def unwrap(values: Any, period: Any) -> np.ndarray:
    """Jumps of more than half a period taken out, column by column."""
    return np.unwrap(values, period=float(period), axis=0)


def apply(matrix: Any, values: Any) -> np.ndarray:
    """matrix @ x for each sample x of values (N, K)."""
    return np.asarray(values) @ np.asarray(matrix).T


def solve(matrix: Any, values: Any) -> np.ndarray:
    """inv(matrix) @ x for each sample x of values (N, K)."""
    return np.linalg.solve(np.asarray(matrix), np.asarray(values).T).T


def stack(*columns: Any) -> np.ndarray:
    """Columns (N,) to a list of columns (N, K)."""
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def shift(values: Any, samples: Any) -> np.ndarray:
    """The value so many samples ago (later, if negative); the ends hold."""
    values = np.asarray(values)
    row = np.clip(np.arange(len(values)) - int(samples), 0, len(values) - 1)
    return values[row]


def derivative(values: Any, time: Any) -> np.ndarray:
    """Central differences of values (N,) or (N, K) over time (N,)."""
    return np.gradient(np.asarray(values), np.asarray(time), axis=0)


def integral(values: Any, time: Any) -> np.ndarray:
    """The integral of values (N,) or (N, K) over time (N,), by trapezoids, 0 at the first sample."""
    values, time = np.asarray(values, dtype=float), np.asarray(time, dtype=float)
    steps = np.diff(time).reshape(-1, *([1] * (values.ndim - 1)))
    parts = 0.5 * (values[1:] + values[:-1]) * steps
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(parts, axis=0)])


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "log": np.log,
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "tanh": np.tanh, "atan2": np.arctan2,
    "min": np.minimum, "max": np.maximum, "clip": np.clip, "where": np.where, "signed": signed,
    "unwrap": unwrap, "shift": shift, "derivative": derivative, "integral": integral, "apply": apply,
    "solve": solve, "stack": stack,
}  # fmt: skip
_NAMES = {"pi": np.pi}


def evaluate(text: str | float, values: Mapping[str, Any], where: str) -> Any:
    """The value of a formula.

    Args:
        text: the formula, or a number.
        values: columns and constants by name.
        where: key path, for messages.

    Raises:
        InputError: not a formula of the whitelist, an unknown name (known ones are listed), or values
            whose shapes do not fit.
    """
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        return float(text)
    if not isinstance(text, str) or not text.strip():
        raise InputError(f"{where} is {text!r}, must be a formula or a number")
    tree = _parse(text, where)
    try:
        with np.errstate(all="ignore"):  # what is not finite is found, and named, where it is used
            return _value(tree.body, values, f"{where}: in {text!r}")
    except (ValueError, TypeError, IndexError, OverflowError, np.linalg.LinAlgError) as error:
        raise InputError(f"{where}: {text!r} cannot be computed: {error}") from error


def names_in(text: str | float, where: str) -> set[str]:
    """Names that a formula uses, functions left out."""
    if not isinstance(text, str):
        return set()
    tree = _parse(text, where)
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    return {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called} - set(_NAMES)


def _parse(text: str, where: str) -> ast.Expression:
    if len(text) > _LONGEST:
        raise InputError(f"{where}: a formula of {len(text)} characters; at most {_LONGEST}")
    try:
        return ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"{where}: {text!r} is no formula: {getattr(error, 'msg', error)}") from error


def _value(node: ast.expr, values: Mapping[str, Any], where: str) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return float(node.value)  # float also for integers: 9**9**9 becomes inf instead of a long wait
    if isinstance(node, ast.Name):
        if node.id in values:
            return values[node.id]
        if node.id in _NAMES:
            return _NAMES[node.id]
        raise InputError(
            f"{where}: {node.id!r} is not known; columns and constants are {sorted(values)},"
            f" functions {sorted(FUNCTIONS)}"
        )
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        return _BINARY[type(node.op)](_value(node.left, values, where), _value(node.right, values, where))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        value = _value(node.operand, values, where)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _COMPARE:
        right = _value(node.comparators[0], values, where)
        return _COMPARE[type(node.ops[0])](_value(node.left, values, where), right)
    if isinstance(node, ast.Subscript):
        return _item(node, values, where)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        if node.func.id not in FUNCTIONS:
            raise InputError(f"{where}: no function {node.func.id!r}; there are {sorted(FUNCTIONS)}")
        return FUNCTIONS[node.func.id](*(_value(each, values, where) for each in node.args))
    raise InputError(
        f"{where}: {ast.unparse(node)!r} is not allowed; a formula has numbers, names, + - * / // % **,"
        f" comparisons, x[0], and the functions {sorted(FUNCTIONS)}"
    )


def _item(node: ast.Subscript, values: Mapping[str, Any], where: str) -> Any:
    index = node.slice
    if not (isinstance(index, ast.Constant) and type(index.value) is int):
        raise InputError(f"{where}: {ast.unparse(node)!r}: an index is a whole number from 0")
    value = np.asarray(_value(node.value, values, where))
    if value.ndim == 0 or not 0 <= index.value < value.shape[-1] or (value.ndim == 1 and len(value) > 64):
        raise InputError(
            f"{where}: {ast.unparse(node)!r}: shape {value.shape} has no such column; lists of columns are"
            " (samples, columns)"
        )
    return value[..., index.value]
