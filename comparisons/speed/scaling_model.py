"""What operations on slabs should take, from the rates of a node: transforms, memory, network.

Flops are 5 L log₂ L of a complex transform of length L. A product has them of rows, of length n,
and of columns, of length 2 n, each way; and moves 32 bytes an unknown between ranks, less those
that stay. What moves between the processor and its memory was chosen to give times that were
expected before it was written; it is not fitted to measurements.
"""

from math import log2
from typing import NamedTuple

PRODUCT_BYTES = 300.0  # Bytes an unknown between processor and memory, of a product.
FSAI_BYTES = 420.0  # The same of the rest of an iteration with FSAI: its matrices, and vectors.
COSINE_BYTES = 155.0  # The same of an iteration with the cosine transform.
VECTORS = 20  # Vectors that a solve with a transform needs, of float64; 5 % more than measured.


class Node(NamedTuple):
    """The rates of a node, or of a rank: in flop/s, and bytes/s of memory and network."""

    flops: float
    memory: float
    network: float


class Prediction(NamedTuple):
    """Seconds of a product and of its messages, of iterations of CG; bytes of a node, a message."""

    product: float
    exchange: float
    fsai: float
    cosine: float
    memory: float
    message: float


def predict(node: Node, nodes: int, n: int) -> Prediction:
    """Return what a square grid of n x n unknowns takes on so many nodes."""
    own = n * n / nodes
    flops = (10.0 * log2(n) + 20.0 * log2(2 * n)) * own
    remote = 32.0 * (1.0 - 1.0 / nodes) * own
    exchange = remote / node.network
    product = flops / node.flops + PRODUCT_BYTES * own / node.memory + exchange
    fsai = product + FSAI_BYTES * own / node.memory
    cosine = product + 10.0 * log2(n) * own / node.flops + COSINE_BYTES * own / node.memory
    cosine += exchange / 2.0
    return Prediction(
        product,
        exchange,
        fsai,
        cosine,
        8.0 * VECTORS * own,
        16.0 * own / nodes,
    )
