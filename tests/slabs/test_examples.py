"""The example of a cluster runs, on any number of ranks, to the same result."""

import subprocess

import numpy as np
import pytest

from tests.slabs.ranks import ROOT, run_on_ranks, with_ranks
from toeplitz_mg import contact

EXAMPLE = ROOT / "examples" / "press_on_a_cluster.py"


@with_ranks
@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_a_surface_is_pressed_and_the_pressure_saved(ranks, tmp_path):
    element, steel = (1e-3, 1e-3), contact.Material(E=210000.0, nu=0.28)
    gap = contact.surfaces.sphere((64, 48), element, radius=0.1)
    np.save(tmp_path / "surface.npy", gap)
    status, printed = run_on_ranks(ranks, str(EXAMPLE), cwd=tmp_path)
    assert status == 0, printed
    expected = contact.normal_contact(gap, element, material=steel, force=10.0)
    pressure = np.load(tmp_path / "pressure.npy")
    np.testing.assert_allclose(pressure, expected.traction, atol=1e-6 * expected.traction.max())
    assert f"{expected.rigid:.6f} mm" in printed


def test_the_batch_script_is_one_of_bash():
    subprocess.run(["bash", "-n", EXAMPLE.with_suffix(".sh")], check=True)
    assert EXAMPLE.name in EXAMPLE.with_suffix(".sh").read_text()
