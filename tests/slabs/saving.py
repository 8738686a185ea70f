"""Files that all ranks write together, and of which each reads its rows."""

import os
import shutil
import stat
import tempfile
from contextlib import contextmanager, nullcontext
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from unittest import mock

import numpy as np
from scipy.io import netcdf_file

from tests.slabs.ranks import refuses
from toeplitz_mg import slabs


@contextmanager
def folder(comm):
    """A folder that is the same on all ranks."""
    path = Path(comm.allgather(tempfile.mkdtemp() if comm.rank == 0 else None)[0])
    try:
        yield path
        comm.allgather(None)  # None removes it before the others are done.
    finally:
        if comm.rank == 0:
            shutil.rmtree(path)


def grid_of(*shape):
    return np.random.default_rng(0).random(shape)


def test_what_is_saved_is_the_whole_field(comm):
    with folder(comm) as there:
        for shape in ((5, 7), (97, 3), (8, 4, 5)):
            slab = slabs.Slab(comm, shape)
            for X in (grid_of(*shape), grid_of(*shape) < 0.5, grid_of(*shape).astype(np.float32)):
                slab.save(there / "x.npy", X[slab.rows])
                saved = np.load(there / "x.npy")
                assert saved.dtype == X.dtype
                assert np.array_equal(saved, X)
                comm.allgather(None)
            components = grid_of(3, *shape)
            slab.save(str(there / "x.npy"), components[:, slab.rows])
            assert np.array_equal(np.load(there / "x.npy"), components)
            comm.allgather(None)
        assert os.listdir(there) == ["x.npy"]


def test_each_rank_reads_its_rows_alone(comm):
    with folder(comm) as there:
        slab, X = slabs.Slab(comm, (97, 5)), grid_of(97, 5)
        slab.save(there / "x.npy", X[slab.rows])
        own = np.load(there / "x.npy", mmap_mode="r")[slab.rows]
        assert isinstance(own, np.memmap)
        assert np.array_equal(own, X[slab.rows])
        slab.save(there / "y.npy", own)  # A file that is mapped is an array like any other.
        assert np.array_equal(np.load(there / "y.npy"), X)


def test_each_rank_reads_its_rows_of_other_files_alone(comm):
    """Whatever takes slices will do: NetCDF by SciPy, mapped, and by h5netcdf where it is there."""
    X = grid_of(97, 5)
    slab = slabs.Slab(comm, X.shape)
    with folder(comm) as there:
        if comm.rank == 0:
            with netcdf_file(there / "x.nc", "w") as file:
                for name, length in zip("yx", X.shape, strict=True):
                    file.createDimension(name, length)
                file.createVariable("gap", "f8", ("y", "x"))[:] = X
        comm.allgather(None)
        with netcdf_file(there / "x.nc", mmap=True) as file:
            check_rows(slab, X, file.variables["gap"][slab.rows].copy())
        if find_spec("h5netcdf"):
            check_hdf5(comm, slab, X, there / "y.nc")


def check_hdf5(comm, slab, X, path):
    import h5netcdf

    if comm.rank == 0:
        with h5netcdf.File(path, "w") as file:
            file.dimensions = {"y": X.shape[0], "x": X.shape[1]}
            file.create_variable("gap", ("y", "x"), data=X)
    comm.allgather(None)
    with h5netcdf.File(path, "r") as file:
        check_rows(slab, X, file.variables["gap"][slab.rows])


def check_rows(slab, X, gap):
    """Assert that a product takes what was read, of whatever order of bytes it is."""
    assert np.array_equal(gap, X[slab.rows])
    c = 1.0 / (1.0 + np.add.outer(np.arange(97)[slab.rows], np.arange(5)))
    A = slabs.ToeplitzOperator(c, slab)
    assert np.array_equal(A @ gap.ravel(), A @ X[slab.rows].ravel())


def test_an_old_file_is_replaced_and_its_rights_are_kept(comm):
    with folder(comm) as there:
        slab, path, link = slabs.Slab(comm, (9, 4)), there / "x.npy", there / "link.npy"
        if comm.rank == 0:
            path.write_bytes(b"old")
            path.chmod(0o640)
            link.symlink_to(path)
        comm.allgather(None)
        slab.save(link, np.ones(slab.local))
        assert link.is_symlink()
        assert np.array_equal(np.load(path), np.ones((9, 4)))
        assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_file_is_whole_or_as_it_was(comm):
    with folder(comm) as there:
        slab, path, last = slabs.Slab(comm, (9, 4)), there / "x.npy", comm.size - 1
        slab.save(path, np.ones(slab.local))

        def fail(name, rank):
            error = OSError(28, "No space left on device")
            broken = mock.patch(name, side_effect=error)
            with broken if comm.rank == rank else nullcontext():
                slab.save(path, np.zeros(slab.local))

        for name, rank in (("os.fsync", last), ("os.replace", 0)):
            text = f"rank {rank}: {path} cannot be written: No space left on device"
            refuses(comm, OSError, text, partial(fail, name, rank))
            assert np.array_equal(np.load(path), np.ones((9, 4)))
            assert os.listdir(there) == ["x.npy"]
            comm.allgather(None)


def test_what_cannot_be_saved_is_refused_by_all(comm):
    with folder(comm) as there:
        slab, last = slabs.Slab(comm, (9, 4)), comm.size - 1
        x, save = np.ones(slab.local), slab.save
        wrong = x[:, :3] if comm.rank == last else x
        refuses(comm, ValueError, f"rank {last}: x has shape", lambda: save(there / "x.npy", wrong))
        objects = x.astype(object)
        refuses(comm, TypeError, "x has dtype object", lambda: save(there / "x.npy", objects))
        refuses(comm, OSError, "is no folder", lambda: save(there / "none" / "x.npy", x))
        refuses(comm, OSError, "is not a regular file", lambda: save(there, x))
        if last:
            name = f"{comm.rank}.npy"
            refuses(comm, ValueError, "path is ", lambda: save(there / name, x))
            y = x.astype(np.float32) if comm.rank else x
            text = "the dtype of x is float64 on rank 0 and float32 on rank 1"
            refuses(comm, ValueError, text, lambda: save(there / "x.npy", y))
            z = np.ones((2 if comm.rank else 3, *slab.local))
            text = "the components of x is (3,) on rank 0 and (2,) on rank 1"
            refuses(comm, ValueError, text, lambda: save(there / "x.npy", z))
        comm.allgather(None)
        assert not os.listdir(there)
