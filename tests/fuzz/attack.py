"""`make fuzz`: damaged inputs to every reader; each gives a value or a `SamrlError`, soon.

python -m tests.fuzz.attack [--count N] [--seed S] [--only NAME] [--jobs N]
Every reader runs in a process of its own, so that a crash of a library counts as a fault, too.
"""

from __future__ import annotations

import argparse
import faulthandler
import logging
import math
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import NoReturn

import hypothesis
import numpy as np
from hypothesis import HealthCheck, Phase, given, settings

from samrl_core.common.errors import SamrlError
from tests.fuzz.mutations import damaged
from tests.fuzz.reader import Reader
from tests.fuzz.readers import READERS

TOTAL = 100_000  # inputs over all readers
LONGEST_S = 20.0  # of the process's own time for one input: a busy machine takes no part in it
MOST_BYTES = 2 << 30  # that a reader's process may grow


class Hang(BaseException):
    """A reader took too long; no reader's own handling of errors may catch it."""


def attack(reader: Reader, count: int, seed: int) -> int:
    """Try a reader; the number of inputs. Raises what the reader lets through, and tells the input."""
    done = 0
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    path = folder / reader.file
    reader.prepare(path)
    path.parent.mkdir(exist_ok=True)
    started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    def too_long(_signal: int, _frame: FrameType | None) -> NoReturn:
        raise Hang(f"{reader.name} took more than {LONGEST_S} s")

    @hypothesis.seed(seed)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
        print_blob=False,
    )
    @given(damaged(reader.sound()))
    def one(content: bytes) -> None:
        nonlocal done
        done += 1
        path.write_bytes(content)
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)
        try:
            reader.read(path)
        except SamrlError:
            pass
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - started) * 1024
        assert grown < MOST_BYTES, f"{reader.name} grew by {grown / 1e9:.1f} GB"

    before = signal.signal(signal.SIGVTALRM, too_long)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            one()
    finally:
        signal.signal(signal.SIGVTALRM, before)
        shutil.rmtree(folder)
    return done


def main() -> int:
    """Attack every reader; 1 if one gave way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=TOTAL, help="inputs over all readers")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="readers whose name holds this")
    parser.add_argument("--jobs", type=int, default=1, help="readers attacked at once")
    parser.add_argument("--reader", default="", help="run this one here, not in a process of its own")
    options = parser.parse_args()
    if options.reader:
        logging.disable()
        faulthandler.enable()
        (reader,) = [r for r in READERS if r.name == options.reader]
        print(attack(reader, options.count, options.seed))
        return 0
    chosen = [r for r in READERS if options.only in r.name]
    shares = sum(r.share for r in READERS)
    with ThreadPoolExecutor(max(1, options.jobs)) as pool:
        done = list(
            pool.map(lambda r: _apart(r, math.ceil(options.count * r.share / shares), options.seed), chosen)
        )
    broken = [reader.name for reader, inputs in zip(chosen, done, strict=True) if inputs is None]
    total = sum(inputs or 0 for inputs in done)
    print(f"{total} inputs, seed {options.seed}; readers that gave way: {', '.join(broken) or 'none'}")
    return 1 if broken else 0


def _apart(reader: Reader, count: int, seed: int) -> int | None:
    """Attack a reader in a process of its own, and say how it went; none if it gave way."""
    began = time.monotonic()
    command = [sys.executable, "-m", "tests.fuzz.attack", "--reader", reader.name]
    command += ["--count", str(count), "--seed", str(seed)]
    run = subprocess.run(command, capture_output=True, text=True)
    lines = run.stdout.split()
    if run.returncode or not lines:
        print(f"{reader.name}: GAVE WAY (exit {run.returncode})\n{_shown(run.stderr)}", flush=True)
        return None
    print(f"{reader.name:24} {int(lines[-1]):7} inputs {time.monotonic() - began:7.1f} s", flush=True)
    return int(lines[-1])


def _shown(said: str) -> str:
    """The traceback, and the input as far as it can be read."""
    trace, found, content = said.partition("Failing test case")
    return trace[-3000:] + found + content[:2000]


if __name__ == "__main__":
    sys.exit(main())
