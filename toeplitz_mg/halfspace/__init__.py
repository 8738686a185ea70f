"""The elastic half-space: its matrices, influence coefficients and elastic constants."""

from toeplitz_mg.halfspace.influence import (
    influence_xx,
    influence_xy,
    influence_xz,
    influence_yy,
    influence_yz,
    influence_zz,
)
from toeplitz_mg.halfspace.line_contact import line_contact_coefficients
from toeplitz_mg.halfspace.materials import (
    CombinedMaterial,
    Material,
    combined_material,
    difference_parameter,
)
from toeplitz_mg.halfspace.matrices import influence_matrix
from toeplitz_mg.halfspace.points import all_offsets, offsets

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
    "offsets",
]
