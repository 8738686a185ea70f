"""Draw the pictures of README: python docs/pictures.py, in a clone with the extra plot."""

import warnings
from pathlib import Path
from time import process_time

import matplotlib.pyplot as plt

from toeplitz_mg import contact

FOLDER = Path(__file__).parent / "pictures"
STEEL = contact.Material(E=210000.0, nu=0.28)


def draw_rough_contact():
    """Draw the pressures of a rough surface of 1024² elements, with the CPU time that it took."""
    n = 1024
    element = (1.0 / n, 1.0 / n)
    gap = contact.surfaces.rough(
        (n, n), element, rms=1e-4, hurst=0.8, longest=0.25, shortest=8 / n, seed=5
    )
    bodies = (contact.Material(E=70000.0, nu=0.33), contact.Material.rigid())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", contact.ContactWarning)
        start = process_time()
        pressed = contact.normal_contact(gap, element, material=bodies, force=70.0, periodic=True)
        seconds = process_time() - start
    figure, ax = plt.subplots(figsize=(6.2, 5), layout="compressed")
    pressed.plot(ax=ax)
    share = 100.0 * pressed.contact_fraction
    ax.set_title(f"{n}² elements, {share:.0f} % in contact: {seconds:.1f} s of CPU", fontsize=13)
    figure.savefig(FOLDER / "rough.png", dpi=110)


def draw_three():
    """Draw a sphere that is pressed, shifted and rolled."""
    n = 96
    element = (0.8 / n, 0.8 / n)
    gap = contact.surfaces.sphere((n, n), element, radius=50.0)
    pressed = contact.normal_contact(gap, element, material=STEEL, force=100.0)
    shifted = contact.friction(pressed, mu=0.3, force=(15.0, 0.0))
    rolled = contact.rolling(pressed, mu=0.3, longitudinal=-8e-4, spin=0.004)
    figure, axes = plt.subplots(1, 3, figsize=(14, 4.2), layout="compressed")
    titles = ("pressed", "shifted", "rolled")
    for ax, result, title in zip(axes, (pressed, shifted, rolled), titles, strict=True):
        result.plot(ax=ax)
        ax.set_title(f"{title}: {ax.get_title()}")
    figure.savefig(FOLDER / "sphere.png", dpi=90)


if __name__ == "__main__":
    plt.rcParams["font.size"] = 12
    FOLDER.mkdir(exist_ok=True)
    draw_rough_contact()
    draw_three()
