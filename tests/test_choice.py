"""select_preconditioner: it names what default_preconditioner takes, and builds nothing."""

import numpy as np
import pytest

import toeplitz_mg as tmg
from comparisons.systems import masks
from comparisons.systems.matrices import typical
from comparisons.systems.random_matrices import random_ones
from tests.cases import CASES, contact, coupled, coupled_kernel, exponential
from tests.test_fsai_coupled import tangential
from toeplitz_mg.operators.structure import components, unwrap
from toeplitz_mg.preconditioners.choice import DIRECT, FEW, LONG
from toeplitz_mg.preconditioners.traits import likeness_of_axes


def matrix_of(A):
    """The matrix that candidates are for: a whole line is that without axes of one element."""
    full, mask = unwrap(A)
    is_line = isinstance(full, tmg.ToeplitzOperator) and len(full.squeezed.grid_shape) == 1
    return full.squeezed if is_line and (mask is None or mask.all()) else A


def accepted(candidates, A):
    """Make candidates, and yield those that are not refused."""
    for candidate in candidates:
        try:
            yield candidate, candidate.make(matrix_of(A))
        except np.linalg.LinAlgError:
            continue


def check(selection, A, M):
    """Check that M is what a selection says of A."""
    for candidate, first in accepted(selection.candidates, A):
        if candidate.is_exact or not selection.needs_trial:
            x = np.random.default_rng(3).standard_normal(A.shape[0])
            assert repr(M) == repr(first)
            assert np.array_equal(M @ x, first @ x)
            return
        break
    if selection.components:
        parts = components(*unwrap(A))
        for own, part, block in zip(selection.components, parts, M.blocks, strict=True):
            check(own, part, block)
        return
    names = [repr(other) for _, other in accepted((*selection.candidates, *selection.others), A)]
    assert repr(M) in names or "ScaledIdentity" in repr(M)


def test_it_names_what_is_taken_of_every_case():
    seen = 0
    for case in CASES:
        A = case.operator(np.float64)
        is_suitable = isinstance(unwrap(A)[0], tmg.ToeplitzOperator | tmg.CoupledOperator)
        if is_suitable and case.symmetric and case.positive:
            selection = tmg.select_preconditioner(A)
            assert selection.candidates[0].is_exact  # They are all small.
            check(selection, A, tmg.default_preconditioner(A))
            seen += 1
    assert seen > 50


@pytest.mark.parametrize("solves", [1, 5])
@pytest.mark.parametrize("case", [*list(typical())[::12], *random_ones(18)], ids=lambda c: c.name)
def test_it_names_what_is_taken_of_matrices_of_every_kind(case, solves):
    A = case.operator()
    try:
        M = tmg.default_preconditioner(A, solves=solves)
    except np.linalg.LinAlgError:
        return  # It is not positive definite, in float64.
    check(tmg.select_preconditioner(A, solves=solves), A, M)


@pytest.mark.parametrize(
    "A",
    [
        coupled(coupled_kernel(2, 30, 30))(np.float64),
        tmg.MaskedOperator(coupled(coupled_kernel(2, 30, 30))(np.float64), masks.rough(0.6, 30)),
        tmg.MaskedOperator(tangential((48, 48), 0.5), np.stack([masks.rough(0.5, 48)] * 2)),
        tmg.ToeplitzOperator(contact(LONG).reshape(1, LONG)),
        tmg.ToeplitzOperator(contact(131, 131)),
    ],
    ids=["coupled", "on a mask", "strongly", "a line", "slow lengths"],
)
def test_it_names_what_is_taken_of_others(A):
    assert A.shape[0] > DIRECT
    check(tmg.select_preconditioner(A), A, tmg.default_preconditioner(A))


def test_it_builds_nothing():
    """It makes no product on a grid, nor a transform; on a line that of the symbol."""
    mask = masks.rough(0.3, 256)
    for A, most in (
        (tmg.MaskedOperator(tmg.ToeplitzOperator(contact(256, 256)), mask), 0.0),
        (tmg.ToeplitzOperator(contact(256, 256)), 0.0),
        (tmg.ToeplitzOperator(exponential(2**16)), 4.0),
    ):
        with tmg.count_products() as work:
            tmg.select_preconditioner(A)
        assert work.units(A.shape[1]) <= most


def test_it_tells_why():
    def why(mask, *element, solves=1):
        x, y = tmg.halfspace.offsets(mask.shape, element)
        full = tmg.ToeplitzOperator(tmg.halfspace.influence_zz(x, y, element, G=1.0, nu=0.28))
        selection = tmg.select_preconditioner(tmg.MaskedOperator(full, mask), solves=solves)
        return repr(selection).splitlines()[0]

    circle = masks.circle(64)
    assert why(circle, 1.0, 1.0) == "sine_preconditioner: one small blob, and one solve"
    assert why(circle, 1.0, 1.0, solves=2).endswith("a mask, and a set-up that pays off")
    assert why(circle, 1.0, 20.0).endswith("stretched elements; 12 neighbours")
    assert why(masks.rough(0.3, 64), 1.0, 1.0).endswith("a fragmented mask; 12 neighbours")
    assert (large := masks.circle(256)).sum() > FEW
    assert why(large, 1.0, 1.0).endswith("many unknowns; 12 neighbours")


def test_it_prints_what_depends_on_a_refusal_or_a_trial():
    A = tmg.ToeplitzOperator(contact(40, 40))
    lines = repr(tmg.select_preconditioner(A)).splitlines()
    assert lines[0] == "cosine_preconditioner: all of a grid"
    assert all(line.startswith("if refused, fsai") for line in lines[1:-1])
    assert lines[-1].startswith("if all are refused, the best of sine")
    isolated = tmg.ToeplitzOperator(np.where(np.arange(900) % 400, 0.0, 1.0).reshape(30, 30))
    assert (
        repr(tmg.select_preconditioner(isolated))
        .splitlines()[-1]
        .startswith("and then the best of it, sine_preconditioner, cosine_preconditioner, ")
    )
    two = tmg.MaskedOperator(tangential((40, 40), 0.3), masks.rough(0.9, 40))
    lines = repr(tmg.select_preconditioner(two)).splitlines()
    assert lines[0].startswith("fsai_preconditioner: a mask; of all components together")
    assert lines[1] == "if refused, each component by itself:"
    assert lines[2] == "    fsai_preconditioner: a mask, and a set-up that pays off"


def test_elements_are_alike_along_both_axes_only_if_they_are_square():
    def likeness(ratio):
        x, y = tmg.halfspace.offsets((8, 8), (1.0, ratio))
        c = tmg.halfspace.influence_zz(x, y, (1.0, ratio), G=1.0, nu=0.28)
        return likeness_of_axes(tmg.ToeplitzOperator(c))

    assert likeness(1.0) == pytest.approx(1.0)
    assert likeness(4.0) == pytest.approx(likeness(0.25)) == pytest.approx(0.36, abs=0.01)
    assert likeness_of_axes(tmg.ToeplitzOperator(np.eye(1, 9).reshape(3, 3))) == 1.0
