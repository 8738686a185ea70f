# pyright: reportUnnecessaryTypeIgnoreComment=true
"""What mypy --strict and pyright see of the wheel: answers as they are, and mistakes refused.

The stage `wheel` of `.ci/run` checks this file; none of its functions is called. A `type: ignore`
where nothing is refused is an error itself.
"""

from typing import assert_type

import numpy as np

import toeplitz_mg as tmg
from toeplitz_mg.contact import Material, NormalResult, TangentialResult

b = np.ones(3)
gap = np.ones((4, 4))
steel = Material(E=210000.0, nu=0.28)


def operators(A: tmg.ToeplitzOperator) -> None:
    for B in (2 * A, A * 2.0, -A, A / 3.0):
        assert_type(B.grid_shape, tuple[int, ...])
        tmg.cg(B, b)
    range(2 * A)  # type: ignore[call-overload]


def likelihoods(process: tmg.ToeplitzNormal) -> None:
    assert_type(process.logpdf([1.0, 2.0, 3.0]), float)
    assert_type(process.logpdf(np.zeros(3)), float)


def contact(pressed: NormalResult) -> None:
    assert_type(tmg.contact.friction(pressed, mu=0.3, shift=(1e-3, 0.0)), TangentialResult)
    tmg.contact.rolling(pressed, mu=np.full((4, 4), 0.3))
    tmg.contact.rolling(pressed, mu=[[0.1, 0.2], [0.3, 0.4]])
    tmg.contact.friction(pressed, mu="0.3", shift=(1e-3, 0.0))  # type: ignore[arg-type]
    tmg.contact.rolling(pressed, mu="0.3")  # type: ignore[arg-type]
    tmg.contact.hertz(radii=10.0, material=(steel, Material.rigid()), force=10.0)
    both = tmg.halfspace.combined_material(steel, steel)
    tmg.contact.normal_contact(gap, (0.1, 0.1), material=both, force=10.0)
    tmg.contact.normal_contact(gap, 0.1, material="steel", force=1.0)  # type: ignore[arg-type]
    tmg.contact.hertz(radii=10.0, material="steel", force=10.0)  # type: ignore[arg-type]


def names() -> None:
    assert_type(tmg.covariances.Exponential(length=2.0), tmg.covariances.Exponential)
    tmg.contct  # type: ignore[attr-defined]  # noqa: B018
