"""Data sets on disk: a manifest and shards of arrays, written shard by shard, resumed where one is missing.

A shard is a pure function of the manifest's seed and its own number, so a data set that was interrupted and
resumed has the same bytes as one that was not.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.array_file import MAX_BYTES, packed, unpacked
from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole, write_whole

FORMAT = 1
MANIFEST = "manifest.json"
_MAX_MANIFEST = 2**28  # [bytes], of some 150 per shard


@dataclass(frozen=True, eq=False)
class DataInfo:
    """What a data set is; all of it is in the manifest.

    Raises:
        InputError: counts below 1, or settings that JSON cannot hold.
    """

    kind: str  # of its shards: "states", "labels"
    task: str
    intrinsics: Intrinsics  # of the cell's camera; image size included
    seed: int
    count: int  # samples in all
    shard_size: int  # samples per shard; the last one may hold fewer
    settings: Mapping[str, Any]  # plain values that the samples depend on

    def __post_init__(self) -> None:
        whole = (self.count, self.shard_size, self.seed)
        if not all(type(n) is int for n in whole) or not (type(self.kind) is type(self.task) is str):
            raise InputError(
                f"count, shard_size and seed are {whole}, must be integers; kind {self.kind!r} and task "
                f"{self.task!r} must be texts"
            )
        if self.count < 1 or self.shard_size < 1:
            raise InputError(f"{self.count} samples in shards of {self.shard_size}; both must be at least 1")
        try:
            json.dumps(self.settings, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"settings of data set {self.kind} cannot be written as JSON: {error}"
            ) from error

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.count // self.shard_size)

    def size(self, shard: int) -> int:
        """Samples in a shard."""
        return min(self.shard_size, self.count - shard * self.shard_size)

    def entry(self, shard: int, sha256: str) -> dict[str, Any]:
        """What the manifest lists of a shard."""
        name = f"{self.kind}-{shard:05d}.npz"
        return {"shard": shard, "file": name, "count": self.size(shard), "sha256": sha256}

    def rng(self, shard: int) -> np.random.Generator:
        """The source of everything random in a shard."""
        return np.random.default_rng([self.seed, shard])

    def header(self) -> dict[str, Any]:
        """The manifest without its list of shards, as JSON reads it back."""
        return json.loads(json.dumps({"format": FORMAT, **asdict(self)}))


class ShardFolder:
    """A data set in a folder: new, or resumed.

    Args:
        folder: made if it is missing.
        info: of the data set; a folder that holds another one is refused.

    Raises:
        InputError: the folder holds another data set, or its manifest cannot be read.
    """

    def __init__(self, folder: Path, info: DataInfo) -> None:
        self.folder, self.info = folder, info
        self._listed: dict[int, dict[str, Any]] = {}
        path = folder / MANIFEST
        if path.exists():
            manifest = _manifest(path)
            listed = manifest.pop("shards")
            wanted = info.header()
            different = sorted(k for k in wanted.keys() | manifest.keys() if wanted.get(k) != manifest.get(k))
            if different:
                k = different[0]
                raise InputError(
                    f"{folder} holds another data set: its {k} is {manifest.get(k)!r}, must be "
                    f"{wanted.get(k)!r}; take another folder or delete this one"
                )
            self._listed = _checked(listed, info, path)
        else:
            self._write_manifest()

    @staticmethod
    def open(folder: Path, kind: str, task: str) -> ShardFolder:
        """A data set that is there, for reading.

        Raises:
            InputError: there is none, or it is of another kind or task.
        """
        path = folder / MANIFEST
        if not path.exists():
            raise InputError(f"{folder} has no {MANIFEST}; it holds no data set")
        manifest = _manifest(path)
        if (manifest["kind"], manifest["task"]) != (kind, task):
            raise InputError(
                f"{folder} holds {manifest['kind']} of task {manifest['task']}, not {kind} of task {task}"
            )
        fields = {k: v for k, v in manifest.items() if k not in ("format", "shards", "intrinsics")}
        try:
            info = DataInfo(intrinsics=Intrinsics(**manifest["intrinsics"]), **fields)
        except (TypeError, OverflowError, InputError) as error:
            raise InputError(f"{path} is damaged ({error}); delete the folder and make it anew") from error
        return ShardFolder(folder, info)

    def missing(self) -> tuple[int, ...]:
        """Shards that are still to be made, in order."""
        return tuple(k for k in range(self.info.shards) if k not in self._listed)

    def write(self, shard: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Store a shard whole, then list it.

        Raises:
            InputError: no such shard, or arrays that do not all have its number of samples.
        """
        if not 0 <= shard < self.info.shards:
            raise InputError(f"shard {shard} of {self.info.shards} does not exist")
        size = self.info.size(shard)
        wrong = {name: array.shape for name, array in arrays.items() if array.shape[:1] != (size,)}
        if wrong or not arrays:
            raise InputError(f"shard {shard} must hold {size} samples in every array; these differ: {wrong}")
        content = packed(arrays)
        entry = self.info.entry(shard, hashlib.sha256(content).hexdigest())
        write_whole(self.folder / entry["file"], content)
        self._listed[shard] = entry
        self._write_manifest()

    def read(self, shard: int) -> dict[str, np.ndarray]:
        """A shard's arrays.

        Raises:
            InputError: it is not listed, not there, or not what was written.
        """
        if shard not in self._listed:
            raise InputError(f"shard {shard} of {self.folder} was not made yet; resume the data set first")
        entry = self._listed[shard]
        path = self.folder / entry["file"]
        if not path.exists():
            raise InputError(
                f"{path} is listed in the manifest and missing; delete the folder and make it anew"
            )
        content = read_whole(path, MAX_BYTES)
        if hashlib.sha256(content).hexdigest() != entry["sha256"]:
            raise InputError(
                f"{path} is not the file that the manifest lists; delete the folder and make it anew"
            )
        return unpacked(content, path)

    def read_all(self) -> Iterator[dict[str, np.ndarray]]:
        """All shards in order.

        Raises:
            InputError: one is missing; otherwise as `read`.
        """
        if self.missing():
            raise InputError(
                f"{self.folder} lacks {len(self.missing())} of {self.info.shards} shards; resume it first"
            )
        for shard in range(self.info.shards):
            yield self.read(shard)

    def _write_manifest(self) -> None:
        listed = [self._listed[k] for k in sorted(self._listed)]
        content = json.dumps({**self.info.header(), "shards": listed}, indent=1)
        write_whole(self.folder / MANIFEST, content.encode())


def _manifest(path: Path) -> dict[str, Any]:
    """Checked as far as reading it needs."""
    try:
        manifest = json.loads(read_whole(path, _MAX_MANIFEST))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no manifest: {error}") from error
    wanted = {"format", "kind", "task", "intrinsics", "seed", "count", "shard_size", "settings", "shards"}
    if not isinstance(manifest, dict) or set(manifest) != wanted:
        raise InputError(f"{path} is no manifest of a data set; delete it or take another folder")
    if manifest["format"] != FORMAT:
        raise InputError(
            f"{path} is a manifest of format {manifest['format']}, this version reads {FORMAT}; make it anew"
        )
    return manifest


def _checked(listed: Any, info: DataInfo, path: Path) -> dict[int, dict[str, Any]]:
    """A manifest's shards by number."""
    found: dict[int, dict[str, Any]] = {}
    for one in listed if isinstance(listed, list) else [listed]:
        shard = one.get("shard") if isinstance(one, dict) else None
        if not isinstance(shard, int) or shard not in range(info.shards) or shard in found:
            raise InputError(f"{path} is damaged: it lists {one!r}; delete the folder and make it anew")
        if one != info.entry(shard, str(one.get("sha256"))):
            raise InputError(f"{path} is damaged: it lists {one!r}; delete the folder and make it anew")
        found[shard] = one
    return found
