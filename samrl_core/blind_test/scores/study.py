"""A blind test on disk: observations, sealed labels, their published hash, and what was diagnosed."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import tarfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole

SETS = ("A", "B", "C")  # C is held out
PLAN = "plan.json"


@dataclass(frozen=True)
class Study:
    """Paths below one folder.

    obs/<id>/{A,B,C}.mcap is all that a diagnosis may see; sealed/ and sealed.tar hold labels, oracles and the
    plan with its seed; forge.json carries the hash of sealed.tar and is written before anything is diagnosed.
    """

    root: Path

    @property
    def forge_file(self) -> Path:
        """What was made, with the hash of the labels."""
        return self.root / "forge.json"

    @property
    def tar(self) -> Path:
        """Labels and oracles, sealed."""
        return self.root / "sealed.tar"

    @property
    def plan(self) -> Path:
        """What the worlds are sampled from, the seed included; sealed with the labels."""
        return self.root / "sealed" / PLAN

    def observations(self, world: str) -> Path:
        """Folder of one world's bags."""
        return self.root / "obs" / world

    def label(self, world: str) -> Path:
        """The label before it is sealed."""
        return self.root / "sealed" / f"{world}.json"

    def oracle(self, world: str) -> Path:
        """Re-simulation of the held-out recording with the true effect."""
        return self.root / "sealed" / f"{world}.npz"

    def run_folder(self, stage: str, world: str) -> Path:
        """Result of one world: stage `diagnosis`, `left_out`, or a baseline's name."""
        return self.root / stage / world

    def made(self, world: str) -> bool:
        """Whether a world is whole: its observations are moved into place last."""
        return self.label(world).exists() and self.observations(world).is_dir()

    def sweep(self, folder: str) -> None:
        """Remove what killed runs left half done in a folder of worlds; nothing may be running in it."""
        for half in (self.root / folder).glob(".*"):
            if half.is_dir():
                shutil.rmtree(half)
            else:
                half.unlink()

    def published(self) -> dict[str, Any]:
        """Content of forge.json.

        Raises:
            InputError: not there, so nothing was sealed yet.
        """
        if not self.forge_file.exists():
            raise InputError(
                f"{self.forge_file} does not exist: the labels are not sealed; run samrl forge first"
            )
        return json.loads(self.forge_file.read_text())

    def seal(self, worlds: list[str], facts: Mapping[str, Any]) -> dict[str, Any]:
        """Pack the labels of `worlds` (byte for byte the same each time) and publish their hash."""
        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w") as tar:
            of_worlds = [path for w in sorted(worlds) for path in (self.label(w), self.oracle(w))]
            for path in (self.plan, *of_worlds):
                if path.exists():
                    content = path.read_bytes()
                    entry = tarfile.TarInfo(path.name)  # owner and time stay zero: the hash is reproducible
                    entry.size = len(content)
                    tar.addfile(entry, io.BytesIO(content))
        write_whole(self.tar, buffer.getvalue())
        content = {**facts, "worlds": worlds, "sealed_sha256": sha256(self.tar)}
        write_whole(self.forge_file, json.dumps(content, indent=1) + "\n")
        return content

    def open_seal(self) -> Sealed:
        """Labels and oracles out of sealed.tar, after its hash was compared with the published one.

        Raises:
            InputError: hash mismatch, or no tar. Loose files in sealed/ are never read.
        """
        stated = self.published()["sealed_sha256"]
        if not self.tar.exists():
            raise InputError(f"{self.tar} does not exist; nothing can be scored without it")
        if (found := sha256(self.tar)) != stated:
            raise InputError(
                f"{self.tar} has sha256 {found}, but {stated} was published: labels were changed"
            )
        return Sealed(self.tar)


@dataclass(frozen=True)
class Sealed:
    """Reader of a verified sealed.tar."""

    path: Path

    @cached_property
    def _places(self) -> dict[str, tuple[int, int]]:
        """File name to offset and size in the archive, so that it is searched once."""
        with tarfile.open(self.path) as tar:
            return {Path(m.name).name: (m.offset_data, m.size) for m in tar.getmembers() if m.isfile()}

    def _content(self, name: str) -> bytes:
        offset, size = self._places[name]
        with self.path.open("rb") as stream:
            stream.seek(offset)
            return stream.read(size)

    def labels(self) -> dict[str, dict[str, Any]]:
        """World to label."""
        files = [name for name in self._places if name.endswith(".json") and name != PLAN]
        return {Path(name).stem: json.loads(self._content(name)) for name in files}

    def oracle(self, world: str) -> dict[str, np.ndarray] | None:
        """Arrays of one world's oracle; None where the forge made none."""
        if f"{world}.npz" not in self._places:
            return None
        with np.load(io.BytesIO(self._content(f"{world}.npz"))) as file:
            return {k: np.asarray(file[k], float) for k in file.files}


def sha256(path: Path) -> str:
    """Of a file's content."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def move_folder(source: Path, target: Path) -> None:
    """Put a finished folder in place; what a killed run left there goes first."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        shutil.rmtree(target)
    source.rename(target)
