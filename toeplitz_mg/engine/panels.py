"""Transforms of long rows in four steps, and what is done with them."""

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.fourstep import FourStep, Load
from toeplitz_mg.engine.workspace import workspace


class Panels:
    """Transforms of long rows by `FourStep`, one row after the other."""

    def __init__(self, plan: FourStep) -> None:
        self.plan = plan
        self.length = plan.length

    def astype(self, dtype: DTypeLike) -> "Panels":
        """Return the plan for numbers of another precision."""
        return self if self.plan.dtype == dtype else Panels(FourStep(*self.plan.shape, dtype))

    def spectrum(self, real: Array, imag: Array | None, shift: float) -> Array:
        """Transform a vector at the frequencies k + s, in the order of the plan.

        Parameters
        ----------
        real, imag : ndarray of shape (L,)
            The parts of the vector; None in the place of the imaginary one where it is zero.
        shift : float
            The shift s.
        """
        X = real.reshape(self.plan.shape)
        Y = None if imag is None else imag.reshape(self.plan.shape)
        u = self.plan.weights(shift)

        def load(columns: slice, P: Array) -> None:
            P.real = X[:, columns]
            P.imag = 0.0 if Y is None else Y[:, columns]
            P *= u

        return self.plan.spectrum(load, shift)

    def parts(self, spectrum: Array, shift: float) -> tuple[Array, Array]:
        """Return the real and the imaginary part of the vector that has a spectrum."""
        real, imag = parts = np.empty((2, *self.plan.shape), self.plan.dtype.char.lower())
        u = self.plan.weights(shift) / self.length

        def store(columns: slice, Q: Array) -> None:
            Q *= u
            real[:, columns] = Q.real
            np.negative(Q.imag, out=imag[:, columns])

        self.plan.invert(spectrum, shift, store)
        real, imag = parts.reshape(2, -1)
        return real, imag

    def in_order(self, spectrum: Array) -> Array:
        """Return a spectrum in the order of the frequencies."""
        ordered = np.empty(self.plan.shape[::-1], spectrum.dtype)
        self.plan.transpose(spectrum, ordered)
        return ordered.ravel()

    def eigenvalues(self, spectrum: Array) -> Array:
        """Prepare a spectrum for the products."""
        return self.plan.eigenvalues(spectrum)

    def cosine_sums(self, a: Array) -> Array:
        """Return what the function `cosine_sums` does, for a of shape (L + 1,), L even."""
        return self._sums(a, 1.0)

    def sine_sums(self, a: Array) -> Array:
        """Return what the function `sine_sums` does, for a of shape (L + 1,), zero at both ends."""
        return self._sums(a, -1.0)

    def _sums(self, a: Array, sign: float) -> Array:
        """Transform an even or odd sequence of period 2 L.

        The sums for even k are the transform of e_j = a_j ± a_(L-j); those for odd k are that of
        o_j = a_j ∓ a_(L-j), at the frequencies k + 1/2. For an even sequence both are real, for an
        odd one imaginary: one transform, of e + i o w, has both.
        """
        L = self.length
        ahead, back = (x.reshape(self.plan.shape) for x in (a[:-1], a[:0:-1]))
        rows, columns_of = self.plan.shape
        u = 1j * np.exp(-1j * np.pi / rows * np.arange(rows))[:, np.newaxis]
        v = np.exp(-1j * np.pi / L * np.arange(columns_of))

        def load(columns: slice, P: Array) -> None:
            x, y = ahead[:, columns], back[:, columns] * sign
            np.multiply(x - y, u, out=P)
            P *= v[columns]
            real = P.real
            real += x
            real += y

        Z = self.plan.spectrum(load, 0.0)
        # A pair has the sums for k = 2 m and 2 m + 1, m = k₁ + N₁ k₂. The second half of the
        # spectrum follows from the first.
        half = -(-columns_of // 2) + 1
        pairs = np.empty((half, rows), np.complex128)
        self.plan.transpose(Z[:, :half], pairs)
        if sign < 0.0:
            # The even part is imaginary, and of the other sign; the odd part is real.
            pairs *= 1j
        return pairs.view(np.float64).ravel()[: L + 1]

    def multiply_real(self, X: Array, eigenvalues: Array, out: Array) -> None:
        """Write the real parts of the products of rows with the matrix of the shift 1/4."""
        plan = self.plan
        u = plan.weights(0.25)
        for x, y in zip(X, out, strict=True):
            matrix, tail = self._fold(y)

            def store(columns: slice, Q: Array, matrix: Array = matrix, tail: Array = tail) -> None:
                Q *= u
                whole = len(matrix)
                matrix[:, columns] = Q.real[:whole]
                if len(tail):
                    end = tail[columns]
                    end[...] = Q.real[whole, : len(end)]

            plan.multiply(self._loader(x, u), [(0.25, eigenvalues)], store)

    def multiply_complex(self, X: Array, eigenvalues: tuple[Array, ...], out: Array) -> None:
        """Write the sums of the products of rows with the matrices of the shifts 0 and 1/2."""
        plan = self.plan
        z = workspace(plan.shape, plan.dtype)

        def store(columns: slice, Q: Array) -> None:
            np.conjugate(Q, out=z[:, columns])  # The shift is 0, so that u is 1.

        def add(columns: slice, Q: Array) -> None:
            Q *= u
            z[:, columns] += np.conjugate(Q, out=Q)

        u = plan.weights(0.5)
        for x, y in zip(X, out, strict=True):
            plan.multiply(self._loader(x, None), [(0.0, eigenvalues[0])], store)
            plan.multiply(self._loader(x, u), [(0.5, eigenvalues[1])], add)
            y[...] = z.reshape(-1)[: len(y)]

    def _fold(self, x: Array) -> tuple[Array, Array]:
        """Return the full rows of a vector as a matrix, and what is left."""
        columns = self.plan.shape[1]
        whole = len(x) // columns
        return x[: whole * columns].reshape(whole, columns), x[whole * columns :]

    def _loader(self, x: Array, u: Array | None) -> Load:
        """Return what fills panels with a vector, times u where there is one, and then zeros."""
        matrix, tail = self._fold(x)
        whole = len(matrix)

        def load(columns: slice, P: Array) -> None:
            P[:whole] = matrix[:, columns]
            if whole < len(P):
                P[whole:] = 0.0
                end = tail[columns]
                P[whole, : len(end)] = end
            if u is not None:
                P *= u

        return load

    def multiply_in_turn(self, X: Array, factors: list[tuple[float, Array]], out: Array) -> None:
        """Write the products of rows with the matrices of these shifts, of which the last is 0.

        Where `out` is real, these are their real parts.
        """
        plan = self.plan
        u = plan.weights(factors[0][0])
        for x, y in zip(X, out, strict=True):
            x_matrix, y_matrix = x.reshape(plan.shape), y.reshape(plan.shape)

            def load(columns: slice, P: Array, matrix: Array = x_matrix) -> None:
                np.multiply(matrix[:, columns], u, out=P, casting="same_kind")

            def store(columns: slice, Q: Array, matrix: Array = y_matrix) -> None:
                # The last shift is 0, so that its weights are 1.
                matrix[:, columns] = Q.conj() if matrix.dtype.kind == "c" else Q.real

            plan.multiply(load, factors, store)
