"""What a page names exists: links, anchors, files, modules, command lines and their options."""

from __future__ import annotations

import ast
import contextlib
import importlib
import importlib.util
import io
import re
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "bags").rglob("*.md"), *(ROOT / "msgs_docs").rglob("*.md")])
IDS = [str(page.relative_to(ROOT)) for page in PAGES]
EVERY_PAGE = pytest.mark.parametrize("page", PAGES, ids=IDS)
# Recipes name files that their reader makes; a test of their own makes and runs these (tests/guide).
LASTING = [page for page in PAGES if not page.name.startswith("add_")]
EVERY_LASTING_PAGE = pytest.mark.parametrize("page", LASTING, ids=[str(p.relative_to(ROOT)) for p in LASTING])

LINK = re.compile(r"\]\(([^)\s]+)\)")
OUR_PATH = re.compile(r"(?<![\w./-])((?:samrl_core|samrl_ros|tests|msgs_docs|bags)/[\w./*-]*[\w*/])")
MODULE = re.compile(r"python -m ([\w.]+)")
GENERATED = re.compile(r"^bags/(local|emps|sts3215_backlash|run|c\b)")  # what a command of the page makes
OUR_MODULES = ("samrl_core", "samrl_ros", "tests")


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, made as GitHub makes them."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    headings = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@EVERY_PAGE
def test_links_and_pictures_exist(page: Path) -> None:
    for link in LINK.findall(page.read_text()):
        if "://" in link or link.startswith("mailto:"):
            continue
        target, _, anchor = unquote(link).partition("#")
        file = (page.parent / target).resolve() if target else page
        assert file.exists(), f"{page.name} links {link}"
        assert file.is_relative_to(ROOT), f"{page.name} links {link}, outside the project"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{page.name} links {link}: no such heading"


def test_decisions_have_numbers_of_their_own() -> None:
    pages = sorted((ROOT / "msgs_docs" / "decisions").glob("*.md"))
    assert [page.name[:4] for page in pages] == [f"{k:04d}" for k in range(1, len(pages) + 1)]
    assert all(page.read_text().startswith(f"# {page.name[:4]} ") for page in pages)


@EVERY_LASTING_PAGE
def test_files_and_folders_exist(page: Path) -> None:
    for path in OUR_PATH.findall(page.read_text()):
        if GENERATED.match(path):
            continue
        found = list(ROOT.glob(path)) if "*" in path else [ROOT / path]
        assert found and all(file.exists() for file in found), f"{page.name} names {path}"


# Words that the field has others for (glossary in reference/conventions.md), and words of a diary.
REPLACED = ("stand-in", "programmes?", "by heart", "null worlds", "slopes?", "mended", "no longer")
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)


@EVERY_PAGE
def test_pages_use_the_words_of_the_glossary(page: Path) -> None:
    if page.name == "CHANGELOG.md":
        return  # it names the former words
    prose = CODE.sub("", page.read_text())
    found = re.search(rf"\b(?:{'|'.join(REPLACED)})\b", prose, re.IGNORECASE)
    assert not found, f"{page.name} writes {found and found.group()!r}"


@cache
def sources() -> tuple[Path, ...]:
    """All source files of the project: what a page may quote."""
    folders = ("samrl_core", "samrl_ros", "tests", "msgs_docs")
    return tuple(f for d in folders for f in sorted((ROOT / d).rglob("*.*")))


@cache
def words() -> frozenset[str]:
    """All words of the source files."""
    kinds = (".py", ".yaml", ".msg", ".srv")
    return frozenset(w for f in sources() if f.suffix in kinds for w in re.findall(r"\w+", f.read_text()))


@EVERY_LASTING_PAGE
def test_quoted_names_of_classes_and_files_exist(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for name in re.findall(r"`([^`\n]+)`", text):
        for part in re.findall(r"(?<![\w.])[A-Z][a-z]+(?:[A-Z][a-z]+)+(?:\.\w+)?", name):
            missing = [x for x in part.split(".") if x not in words()]
            assert not missing, f"{page.name} quotes `{name}`: no {missing} in the code"
        if re.fullmatch(r"[\w/]+\.py", name):
            assert any(f.match(name) for f in sources()), f"{page.name} quotes `{name}`, which does not exist"


@EVERY_LASTING_PAGE
def test_quoted_python_paths_can_be_imported(page: Path) -> None:
    if page.name == "CHANGELOG.md":
        return  # it quotes former names
    for dotted in re.findall(r"`((?:samrl_core|samrl_ros)(?:\.\w+)+)", page.read_text()):
        assert can_be_imported(dotted), f"{page.name} quotes {dotted}"


def can_be_imported(dotted: str) -> bool:
    """Whether a dotted name is a module, or something in a module."""
    parts = dotted.split(".")
    for k in range(len(parts), 0, -1):
        file = ROOT.joinpath(*parts[:k])
        if file.is_dir() or file.with_suffix(".py").is_file():
            thing = importlib.import_module(".".join(parts[:k]))
            for name in parts[k:]:
                if not hasattr(thing, name):
                    return False
                thing = getattr(thing, name)
            return True
    return False


@EVERY_PAGE
def test_modules_that_are_run_exist(page: Path) -> None:
    for module in MODULE.findall(page.read_text()):
        if module.split(".")[0] in OUR_MODULES:
            assert importlib.util.find_spec(module.rstrip(".")), f"{page.name} runs {module}"


@cache
def help_of(words: tuple[str, ...]) -> str:
    """What `samrl WORDS --help` prints; empty if there is no such command."""
    from samrl_ros.cli.main import run

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        code = run([*words, "--help"])
    return printed.getvalue() if code == 0 else ""


def command_lines(text: str) -> list[str]:
    """Command lines that begin with `samrl`, in blocks and quotes; without comments and what follows `&&`."""
    blocks = re.findall(r"^```\w*\n(.*?)^```|^ {4,}(\S.*\n)", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in "".join(block).splitlines()]
    lines += re.findall(
        r"`(samrl [^`\n]*)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    )
    commands = [re.sub(r"^.*\$\(BIN\)/|^\$ ", "", line).split(" #")[0].split(" && ")[0] for line in lines]
    return [line.rstrip() for line in commands if line.startswith("samrl ")]


def why_not_accepted(line: str) -> str:
    """What of a command line its help does not know; empty if nothing."""
    words = shlex.split(line.split("--ros-args")[0])[1:]
    command: tuple[str, ...] = ()
    while "COMMAND [ARGS]" in help_of(command) and words and not words[0].startswith("-"):
        command = (*command, words.pop(0))
    known = help_of(command)
    if not known:
        return f"no command {' '.join(command)!r}"
    options = {word.split("=")[0] for word in words if word.startswith("--")}
    return ", ".join(f"no option {o}" for o in options if not re.search(rf"(?<![\w-]){o}(?![\w-])", known))


@pytest.fixture(autouse=True)
def wide_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")  # help of a narrow terminal cuts the options' names
    monkeypatch.setenv("TERMINAL_WIDTH", "200")


@EVERY_PAGE
def test_command_lines_are_accepted(page: Path) -> None:
    for line in command_lines(page.read_text()):
        reason = why_not_accepted(line)
        assert not reason, f"{page.name}: {line!r}: {reason}"


PYTHON = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.mark.thorough
def test_python_of_the_readme_runs() -> None:
    """In a process of its own, without ROS: what it prints points from the guess towards the true hole."""
    (program,) = PYTHON.findall((ROOT / "README.md").read_text())
    done = subprocess.run(
        [sys.executable, "-c", "import sys; sys.modules['rclpy'] = None\n" + program],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    slopes = [float(x) for x in re.findall(r"-?\d+\.\d+", done.stdout.split("gradient")[1])]
    assert len(slopes) == 2
    assert max(slopes) < 0.0


@EVERY_LASTING_PAGE
def test_python_of_pages_compiles_and_imports_what_exists(page: Path) -> None:
    for program in PYTHON.findall(page.read_text()):
        for node in ast.walk(ast.parse(program)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OUR_MODULES:
                module = importlib.import_module(str(node.module))
                missing = [a.name for a in node.names if not hasattr(module, a.name)]
                assert not missing, f"{page.name} imports {missing} from {node.module}"


def test_command_lines_are_found_and_checked() -> None:
    text = "a\n    samrl cell --sead 0\n```sh\nsamrl forge score study  # x\n```\nand `samrl effects FAMILY`."
    found = command_lines(text)
    assert found == ["samrl cell --sead 0", "samrl forge score study", "samrl effects FAMILY"]
    assert [why_not_accepted(line) for line in found] == ["no option --sead", "", ""]
    assert why_not_accepted("samrl fly") == "no command 'fly'"
