"""The reader of .npz archives: sound ones to the bit, one kind of error for every other file."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gpudem.output.archive import ArchiveError, read_npz

ARRAYS = {"a": np.linspace(0, 1, 5000), "n": np.array(7), "text": np.array("{}"), "none": np.empty((0, 3))}


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed], ids=["stored", "compressed"])
def test_arrays_come_back(save, tmp_path: Path) -> None:
    """To the bit, scalars and empty arrays included."""
    save(tmp_path / "f.npz", **ARRAYS)
    found = read_npz(tmp_path / "f.npz")
    assert list(found) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed], ids=["stored", "compressed"])
def test_any_damage_is_one_kind_of_error(save, tmp_path: Path) -> None:
    """Every fifth byte flipped in turn, and the file cut at many lengths: catches zlib.error, struct.error,
    NotImplementedError and their like passing through. What is still readable must be what was written.
    """
    path = tmp_path / "f.npz"
    values = np.random.default_rng(1).integers(0, 7, 60)
    save(path, a=values)
    sound, caught = path.read_bytes(), 0
    damaged = [sound[:k] + bytes([sound[k] ^ 0xFF]) + sound[k + 1 :] for k in range(0, len(sound), 5)]
    damaged += [sound[:k] for k in range(0, len(sound), 11)]
    for content in damaged:
        path.write_bytes(content)
        try:
            found = read_npz(path)
        except ArchiveError:
            caught += 1
        else:
            assert all(np.array_equal(array, values) for array in found.values())
    assert caught > len(damaged) / 2


def _npy(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.zeros((2, 3)))


def _member(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("notes.txt", "not an array")


def _twice(path: Path) -> None:
    import warnings

    with zipfile.ZipFile(path, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # zipfile's own, of a duplicate name
        for value in (1.0, 2.0):
            with archive.open("a.npy", "w") as member:
                np.lib.format.write_array(member, np.array(value))


BAD = {
    "array twice": (_twice, "array 'a' given twice"),
    "npy": (_npy, "one array"),
    "objects": (lambda p: np.savez(p, a=np.array([{}], dtype=object)), "truncated or corrupted"),
    "pickle": (lambda p: p.write_bytes(pickle.dumps([1, 2])), "not an .npz archive"),
    "text": (lambda p: p.write_text("x,y,z\n"), "not an .npz archive"),
    "empty": (lambda p: p.write_bytes(b""), "not an .npz archive"),
    "zip of text": (_member, "is not an array"),
    "folder": (lambda p: p.mkdir(), "cannot be read"),
    "missing": (lambda p: None, "no such file"),
}


@pytest.mark.parametrize("name", BAD)
def test_files_that_are_no_archive(name: str, tmp_path: Path) -> None:
    path = tmp_path / "f.npz"
    make, expected = BAD[name]
    make(path)
    with pytest.raises(ArchiveError, match=expected) as caught:
        read_npz(path)
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
