"""A communicator that counts what leaves a rank."""

from collections import Counter

import pytest

MPI = pytest.importorskip("mpi4py.MPI")


class CountingCommunicator(MPI.Intracomm):
    """The same ranks; bytes that leave this one, the calls, and the largest message.

    Of a call that is not here nothing is known: those that send what is not here are refused.
    """

    def __init__(self, comm):
        self.reset()

    def reset(self):
        self.sent, self.largest, self.calls = 0, 0, Counter()

    def _count(self, name, *messages):
        self.calls[name] += 1
        self.sent += sum(messages)
        self.largest = max(self.largest, *messages)

    def Alltoallv(self, sent, got):
        data, sizes = sent
        if isinstance(sizes, tuple):
            sizes, _ = sizes  # The others are where the pieces begin.
        others = [size * data.itemsize for rank, size in enumerate(sizes) if rank != self.rank]
        self._count("Alltoallv", sum(others))
        return super().Alltoallv(sent, got)

    def Allgather(self, sent, got):
        self._count("Allgather", sent.nbytes * (self.size - 1))
        return super().Allgather(sent, got)

    def Allgatherv(self, sent, got):
        self._count("Allgatherv", sent.nbytes * (self.size - 1))
        return super().Allgatherv(sent, got)

    def Sendrecv(self, sent, there, **options):
        self._count("Sendrecv", 0 if there == MPI.PROC_NULL else sent.nbytes)
        return super().Sendrecv(sent, there, **options)

    def allgather(self, thing):
        self._count("allgather", 0)  # Words about arguments, of some hundred bytes.
        return super().allgather(thing)

    def _refuse(self, *arguments, **options):
        raise NotImplementedError("this communicator cannot count that")

    Send = Recv = Isend = Irecv = Bcast = Gather = Gatherv = Scatter = Scatterv = _refuse
    Reduce = Allreduce = Alltoall = Alltoallw = Ialltoallv = Scan = Exscan = _refuse
    send = recv = isend = irecv = bcast = gather = scatter = reduce = allreduce = _refuse
    alltoall = sendrecv = scan = exscan = _refuse
