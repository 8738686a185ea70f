"""A communicator that counts what leaves a rank."""

import pickle
from collections import Counter
from typing import Any, NoReturn

from mpi4py import MPI


class CountingCommunicator(MPI.Intracomm):
    """The same ranks; bytes that leave this one, the calls, and the largest message.

    Of a call that is not here nothing is known: those that send what is not here are refused.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin to count from zero."""
        self.sent, self.largest = 0, 0
        self.calls: Counter[str] = Counter()

    def _count(self, name: str, *messages: int) -> None:
        self.calls[name] += 1
        self.sent += sum(messages)
        self.largest = max(self.largest, *messages)

    def Alltoallv(self, sent: Any, got: Any) -> None:  # noqa: D102
        data, sizes = sent
        if isinstance(sizes, tuple):
            sizes, _ = sizes  # The others are where the pieces begin.
        others = [size * data.itemsize for rank, size in enumerate(sizes) if rank != self.rank]
        self._count("Alltoallv", sum(others))
        return super().Alltoallv(sent, got)

    def Allgather(self, sent: Any, got: Any) -> None:  # noqa: D102
        self._count("Allgather", sent.nbytes * (self.size - 1))
        return super().Allgather(sent, got)

    def Allgatherv(self, sent: Any, got: Any) -> None:  # noqa: D102
        self._count("Allgatherv", sent.nbytes * (self.size - 1))
        return super().Allgatherv(sent, got)

    def allgather(self, thing: Any) -> Any:  # noqa: D102
        self._count("allgather", 0)  # Words about arguments, of some hundred bytes.
        return super().allgather(thing)

    def bcast(self, thing: Any, root: int = 0) -> Any:  # noqa: D102
        own = len(pickle.dumps(thing)) if self.rank == root else 0
        self._count("bcast", own * (self.size - 1))
        return super().bcast(thing, root)

    def _refuse(self, *arguments: Any, **options: Any) -> NoReturn:
        raise NotImplementedError("this communicator cannot count that")

    Send = Recv = Isend = Irecv = Sendrecv = Bcast = Gather = Gatherv = Scatter = Scatterv = _refuse
    Reduce = Allreduce = Alltoall = Alltoallw = Ialltoallv = Scan = Exscan = _refuse
    send = recv = isend = irecv = gather = scatter = reduce = allreduce = _refuse
    alltoall = sendrecv = scan = exscan = _refuse
