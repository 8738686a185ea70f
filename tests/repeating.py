"""Matrices of surfaces that repeat, by definition: sums of plane waves, and of images."""

import numpy as np

from toeplitz_mg import halfspace

FINE, IMAGES = 64, 60  # Elements by which a wave is resolved in one, and periods on each side.


def sum_of_waves(directions, shape, element, G=0.7, nu=0.3):
    """Return the matrix where all axes repeat: no transform, and no half spectrum.

    A wave of pressures is displaced by 2 (1 - ν)/(G|q|), and one of tractions along the surface by
    2/(G|q|) (1 - ν q q/|q|²). Directions are "z" or "xy".
    """
    sizes = np.array(element[: len(shape)])
    places = np.indices(shape).reshape(len(shape), -1).T * sizes
    count, N = len(directions), len(places)
    matrix = np.zeros((count, N, count, N))
    for k in [*np.ndindex(*shape)][1:]:
        # The frequency n - k is that of -k.
        signed = [j if j <= n // 2 else j - n for j, n in zip(k, shape, strict=True)]
        q = 2.0 * np.pi * np.array(signed) / (shape * sizes)
        if directions == "z":
            factor = np.array([[1.0 - nu]])
        else:
            factor = np.eye(2) - nu * np.outer(q, q) / (q @ q)
            if any(2 * j == n for j, n in zip(k, shape, strict=True)):
                factor[0, 1] = factor[1, 0] = 0.0  # A wave of two elements has no sign there.
        phase = places @ q
        wave = 2.0 / (G * np.linalg.norm(q)) / N * np.cos(phase[:, None] - phase)
        matrix += factor[:, None, :, None] * wave[:, None, :]
    return matrix.reshape(count * N, -1)


def sum_of_images(directions, shape, element, axis, reference, G=0.7, nu=0.3):
    """Return the matrix where one axis of two repeats, to three digits.

    Waves along that axis are resolved by fine elements, with many images of them. The mean along it
    is a line contact, in which `reference` decides on the constant: along the line it is antiplane
    shear, of which ν is no part.
    """
    (n, rows), (h, b) = (shape, element) if axis == 0 else (shape[::-1], element[::-1])
    reach = IMAGES * n * FINE
    along = h / FINE * np.arange(-reach, reach + 1)
    weights = np.ones(len(along))
    weights[[0, -1]] = 0.5  # Whole periods: what is further away has the mean zero.
    apart = (np.arange(n)[:, None] - np.arange(n)) % n
    beside = np.arange(rows)[:, None] - np.arange(rows)

    def block(to, of):
        c = np.zeros((n, rows))
        if to == of:
            ratio = 0.0 if to == "xy"[axis] else nu
            c[:] = halfspace.line_contact_coefficients(rows, b, G=G, nu=ratio, reference=reference)
        c = c[:, np.abs(np.r_[:rows, 1 - rows : 0])] / n  # Negative offsets count from the end.
        kernel = getattr(halfspace, f"influence_{min(to, of)}{max(to, of)}")
        for row in range(1 - rows, rows):
            across = np.full_like(along, row * b)
            x, y = (along, across) if axis == 0 else (across, along)
            size = (h / FINE, b) if axis == 0 else (b, h / FINE)
            k = weights * kernel(x, y, size, G=G, nu=nu)
            for wave in range(1, n // 2 + 1):
                q = 2.0 * np.pi * wave / (n * h)
                # A wave and its mirror image; the shortest is both.
                part = (2.0 if 2 * wave < n else 1.0) / n
                even, odd = (k * np.cos(q * along)).sum(), (k * np.sin(q * along)).sum()
                phase = q * h * np.arange(n)
                c[:, row] += part * (even * np.cos(phase) + odd * np.sin(phase))
        matrix = c[apart[:, None, :, None], beside[:, None, :]]
        return (matrix if axis == 0 else matrix.transpose(1, 0, 3, 2)).reshape(n * rows, -1)

    return np.block([[block(to, of) for of in directions] for to in directions])
