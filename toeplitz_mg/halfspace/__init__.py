"""The elastic half-space: its matrices, coefficients, stresses and elastic constants."""

from toeplitz_mg.halfspace.influence import (
    all_offsets,
    influence_xx,
    influence_xy,
    influence_xz,
    influence_yy,
    influence_yz,
    influence_zz,
    line_contact_coefficients,
    offsets,
)
from toeplitz_mg.halfspace.materials import (
    CombinedMaterial,
    Material,
    combined_material,
    difference_parameter,
)
from toeplitz_mg.halfspace.matrices import influence_matrix
from toeplitz_mg.halfspace.stresses import (
    line_stresses_x,
    line_stresses_y,
    line_stresses_z,
    stresses_x,
    stresses_y,
    stresses_z,
)

__all__ = [
    "CombinedMaterial",
    "Material",
    "all_offsets",
    "combined_material",
    "difference_parameter",
    "influence_matrix",
    "influence_xx",
    "influence_xy",
    "influence_xz",
    "influence_yy",
    "influence_yz",
    "influence_zz",
    "line_contact_coefficients",
    "line_stresses_x",
    "line_stresses_y",
    "line_stresses_z",
    "offsets",
    "stresses_x",
    "stresses_y",
    "stresses_z",
]


def __dir__() -> list[str]:
    return __all__
