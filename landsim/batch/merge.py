"""The shards of a batch to one batch."""

import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from landsim.batch.chunks import NotWrittenError
from landsim.batch.folder import FLIGHTS_FILE, KEPT, BatchFolder, load_batch, locked
from landsim.batch.gather import gather
from landsim.batch.identity import Identity, Shard, differing_version, flights
from landsim.batch.verify import check_flights
from landsim.config import Scenario
from landsim.dispersion import keys_of
from landsim.errors import InputError, RunFolderError


def check_shards(folders: Sequence[Path]) -> tuple[Scenario, Identity]:
    """The scenario and the identity of the batch that shards are of.

    Raises
    ------
    RunFolderError
        If a folder holds no finished shard or is named twice, or they are not all the shards of one batch.
    InputError
        If shards are missing.
    """
    _must_differ(folders)
    loaded = [load_batch(folder) for folder in folders]
    scenario, first = loaded[0]
    for folder, (_, identity) in zip(folders, loaded, strict=True):
        for name in ("scenario", "scenario_digest", "aircraft_digest", "n", "seed", "time_limit_s"):
            there, here = getattr(first, name), getattr(identity, name)
            if there != here:
                what = name.replace("_digest", "").replace("_", " ")
                values = "" if name.endswith("digest") else f": {there} there and {here} here"
                raise RunFolderError(f"{folder}: is of another batch than {folders[0]}: its {what} differs{values}")
        differs = differing_version(first.versions, identity.versions)
        if differs is not None:
            raise RunFolderError(f"{folder}: was flown with other versions than {folders[0]}: {differs}")
        if identity.shard.of != first.shard.of:
            raise RunFolderError(f"{folder}: is shard {identity.shard}, but {folders[0]} is {first.shard}")
    if first.shard.of == 1:
        raise RunFolderError(f"{folders[0]}: is a whole batch, not a shard of one: there is nothing to merge")
    shards = [identity.shard for _, identity in loaded]
    for i, shard in enumerate(shards):
        if shard in shards[:i]:
            raise RunFolderError(f"{folders[i]}: is shard {shard}, and so is {folders[shards.index(shard)]}")
    there_are = {shard.number for shard in shards}
    missing = [str(Shard(number, first.shard.of)) for number in range(1, first.shard.of + 1) if number not in there_are]
    if missing:
        named = ", ".join(missing[:5]) + (f" and {len(missing) - 5} more" if len(missing) > 5 else "")
        have = f"{folders[0]} is shard {shards[0]} alone" if len(shards) == 1 else f"there are {len(shards)}"
        lacks = f"shard {named} of the batch is" if len(missing) == 1 else f"shards {named} of the batch are"
        raise InputError(f"{have}: {lacks} missing; name the folders of all of them")
    for folder, (_, identity) in zip(folders, loaded, strict=True):
        _check_finished(folder, scenario, identity)
    return scenario, replace(first, shard=Shard())


def _must_differ(folders: Sequence[Path]) -> None:
    places = [os.path.realpath(folder) for folder in folders]
    for i, place in enumerate(places):
        if place in places[:i]:
            raise RunFolderError(f"{folders[i]}: is named twice; name each shard's folder once")


def _check_finished(folder: Path, scenario: Scenario, identity: Identity) -> None:
    n = len(identity.indices())
    if (folder / FLIGHTS_FILE).is_file():
        done = check_flights(folder / FLIGHTS_FILE, identity, keys_of(scenario))
    else:
        with locked(folder):
            done = BatchFolder(folder, identity).done
    if done < n:
        missing = f"{n - done} of its {flights(n)} {'is' if n - done == 1 else 'are'} missing"
        raise RunFolderError(f"{folder}: {missing}; --resume flies {'it' if n - done == 1 else 'them'}")


def merge(folders: Sequence[Path], to: BatchFolder) -> Path:
    """Write the flights of shards into the folder of their batch, with the whole flights that they kept.

    Parameters
    ----------
    folders : sequence of Path
        Of `check_shards`.
    to : BatchFolder
        New, of the identity that `check_shards` gave.

    Returns
    -------
    Path
        The table of flights.

    Raises
    ------
    RunFolderError
        If a shard's table cannot be read, or flights are missing.
    NotWrittenError
        If the table cannot be written.
    """
    path = to.path / FLIGHTS_FILE
    try:
        gather([folder / FLIGHTS_FILE for folder in folders], path, to.identity.indices())
        for folder in folders:
            if (folder / KEPT).is_dir():
                shutil.copytree(folder / KEPT, to.path / KEPT, dirs_exist_ok=True)
    except OSError as error:
        raise NotWrittenError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path
