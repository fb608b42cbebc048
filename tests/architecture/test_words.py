"""Code in the field's words: functions are verbs, and replaced words stay out of docstrings and comments."""

from __future__ import annotations

import ast
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(p for package in ("samrl_core", "samrl_ros") for p in (ROOT / package).rglob("*.py"))

# What a function did, or a colloquial verb, instead of a verb with its object (glossary in conventions.md).
NO_FUNCTION = re.compile(
    r"_?(drawn|told|said|judged|judge|kept|seen|looked|shortened|placed|thinned|draw|slopes)"
)
REPLACED = re.compile(
    r"\b(programmes|known by heart|null worlds|stand-in|priced?|(?:true|is) judged)\b", re.IGNORECASE
)


def functions(file: Path) -> list[str]:
    text = file.read_text()
    if not re.search(rf"def {NO_FUNCTION.pattern}\b", text):
        return []  # parsing takes a hundred times as long, and what is in a string is no function of ours
    return [
        node.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]


def prose(file: Path) -> Iterator[str]:
    """Comments and docstrings."""
    with tokenize.open(file) as source:
        for token in tokenize.generate_tokens(source.readline):
            if token.type == tokenize.COMMENT or token.string.startswith('"""'):
                yield token.string


@pytest.mark.parametrize("package", ["samrl_core", "samrl_ros"])
def test_functions_are_named_by_verbs(package: str) -> None:
    some = [file for file in FILES if file.is_relative_to(ROOT / package)]
    assert len(some) > 100
    found = [
        f"{f.relative_to(ROOT)}: {name}" for f in some for name in functions(f) if NO_FUNCTION.fullmatch(name)
    ]
    assert not found, f"name these by a verb and its object: {found}"


@pytest.mark.parametrize("package", ["samrl_core", "samrl_ros"])
def test_docstrings_and_comments_use_the_words_of_the_glossary(package: str) -> None:
    some = [file for file in FILES if file.is_relative_to(ROOT / package)]
    assert any("field's words" in text for text in prose(Path(__file__))), "the search must find prose"
    texts = [(f, text) for f in some if REPLACED.search(f.read_text()) for text in prose(f)]
    found = [f"{f.relative_to(ROOT)}: {hit.group()!r}" for f, text in texts if (hit := REPLACED.search(text))]
    assert not found, f"the glossary has other words for these: {found}"
