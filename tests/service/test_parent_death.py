"""Workers whose parent is gone; a whole server that is killed is in test_server.py."""

import os
import threading

import pytest

from service.parent_death import end_with_parent, when_closed


def test_called_when_the_far_end_is_closed() -> None:
    near, far = os.pipe()
    called = threading.Event()
    thread = when_closed(near, called.set)
    try:
        assert not called.is_set()
        os.close(far)
        thread.join()
        assert called.is_set()
    finally:
        os.close(near)


def test_a_process_that_nobody_waits_for_is_told() -> None:
    with pytest.raises(RuntimeError, match="no parent"):
        end_with_parent()
