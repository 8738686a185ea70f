"""A loop that threads share: each part is done once, all have ended when it is left.

The threads treat errors and transforms as the caller does, and where no thread may be had the
caller does all.
"""

import _thread
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import scipy.fft

from toeplitz_mg.engine import threads
from toeplitz_mg.engine.threads import chosen_backends

WORKERS = 1, 2, 3
LARGE = 8 * threads.WORTH_THREADS  # Numbers of a loop that all threads share.


@pytest.mark.parametrize("workers", WORKERS)
@pytest.mark.parametrize("points", [1, threads.WORTH_THREADS, LARGE])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 100])
def test_each_part_is_done_once(count, points, workers):
    done = []
    with scipy.fft.set_workers(workers):
        threads.share(done.extend, count, points)
        assert scipy.fft.get_workers() == workers
    assert sorted(done) == list(range(count))


@pytest.mark.parametrize("workers", WORKERS)
@pytest.mark.parametrize("points", [1, threads.WORTH_THREADS, LARGE])
@pytest.mark.parametrize("length", [0, 1, 7, 8, 9, 100])
def test_each_slice_is_done_once_and_none_is_empty(length, points, workers):
    done = []
    with scipy.fft.set_workers(workers):
        threads.share_slices(done.append, length, 8, points)
    assert all(0 < part.stop - part.start <= 8 for part in done)
    assert sorted(k for part in done for k in range(part.start, part.stop)) == list(range(length))


class Stop(BaseException):
    """What a part of the work raises."""


@pytest.mark.parametrize("raising", ["here", "there", "in both", "while waiting"])
def test_all_parts_have_ended_when_one_has_raised(raising):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # A job may ignore it.
    here, begun, back = threading.current_thread(), threading.Event(), threading.Event()
    ended = []

    def work(part):
        if threading.current_thread() is here:
            assert begun.wait(60.0)
            if raising in ("here", "in both"):
                raise Stop
        else:
            begun.set()
            back.wait(0.1)  # not before the caller is back, if it does not wait
            if raising == "while waiting":
                _thread.interrupt_main()
                back.wait(0.1)
            ended.append(part)
            if raising in ("there", "in both"):
                raise Stop

    error = KeyboardInterrupt if raising == "while waiting" else Stop
    with scipy.fft.set_workers(2), pytest.raises(error):
        threads.share(work, 2, threads.WORTH_THREADS)
    signal.signal(signal.SIGINT, before)
    # Either thread may take either part.
    assert ended in ([range(1)], [range(1, 2)])
    back.set()


def test_each_thread_has_enough_to_do():
    """More of them would wait for the interpreter's lock."""
    seen, met = set(), threading.Barrier(4, timeout=30)

    def work(parts):
        seen.add(threading.get_ident())
        met.wait()  # Four threads have one part each.

    def work_slowly(parts):
        seen.add(threading.get_ident())
        time.sleep(1e-3)

    with scipy.fft.set_workers(16):
        for do, count in ((work, 4), (work_slowly, 100)):
            seen.clear()
            threads.share(do, count, 4 * threads.WORTH_THREADS - 1)
            assert len(seen) <= 4


def test_a_thread_that_does_a_part_is_one():
    """What it does is not shared again, neither by us nor by SciPy."""
    seen = []

    def work(parts):
        here = threading.get_ident()
        within = []
        threads.share(lambda _: within.append(threading.get_ident()), 8, LARGE)
        seen.append((scipy.fft.get_workers(), set(within) == {here}))

    with scipy.fft.set_workers(3):
        threads.share(work, 12, LARGE)
        assert set(seen) == {(1, True)}
        seen.clear()
        threads.share(lambda _: seen.append(scipy.fft.get_workers()), 12, 1)
        assert seen == [1]  # A small one is not shared, and neither are its transforms.
        threads.share(lambda _: seen.append(scipy.fft.get_workers()), 1, LARGE)
        assert seen == [1, 3]  # The only part is, as it may be.


def test_threads_treat_overflow_as_the_caller_does():
    huge = np.full(threads.WORTH_THREADS, 1e300)
    with scipy.fft.set_workers(3):
        with np.errstate(over="ignore"):
            threads.share_rows(lambda part: huge[part] * huge[part], huge)
        with np.errstate(over="raise"), pytest.raises(FloatingPointError):
            threads.share_rows(lambda part: huge[part] * huge[part], huge)


def test_threads_transform_by_the_backend_of_the_caller():
    """SciPy keeps it in the thread that sets it, and has no public name for handing it on."""
    assert chosen_backends() is not None
    by = set()

    class Backend:
        __ua_domain__ = "numpy.scipy.fft"

        @staticmethod
        def __ua_function__(method, arguments, options):
            by.add(threading.get_ident())
            return NotImplemented

    met = threading.Barrier(3, timeout=30)

    def work(_):
        met.wait()  # Each thread has a part.
        scipy.fft.fft(np.ones(4))

    with scipy.fft.set_workers(3), scipy.fft.set_backend(Backend):
        threads.share(work, 3, LARGE)
    assert len(by) == 3
    by.clear()
    with scipy.fft.set_workers(3):  # Neither do they keep it.
        threads.share(work, 3, LARGE)
    assert not by


def test_no_part_is_left_to_a_thread_that_nobody_waits_for(monkeypatch):
    """What is queued for a thread that cannot be started, another takes: it is waited for."""
    start, failed, began = threading.Thread.start, [], threading.Event()

    def start_but_once(thread):
        if not failed:
            failed.append(thread)
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", start_but_once)
    here, done = threading.get_ident(), []

    def work(parts):
        if threading.get_ident() == here:
            began.wait(30)  # The other thread has a part, and is slow.
        else:
            began.set()
            time.sleep(0.2)
        done.extend(parts)

    with scipy.fft.set_workers(7):  # So many no other test asks for: its threads are new.
        threads.share(work, 3, LARGE)
    assert failed
    assert sorted(done) == [0, 1, 2]


def test_loops_are_done_where_no_thread_can_be_started_any_more():
    """As in a thread that goes on when the main one has ended, and when Python ends."""
    script = """
import atexit, threading
import scipy.fft
from toeplitz_mg.engine import threads

def work():
    done = []
    with scipy.fft.set_workers(2):
        threads.share(done.extend, 10, threads.WORTH_THREADS)
    print(sorted(done) == list(range(10)))

def later():
    threading.main_thread().join()
    work()

atexit.register(work)
threading.Thread(target=later).start()
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert run.stdout.split() == ["True", "True"], run.stderr
