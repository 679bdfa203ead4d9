"""Interrupts wait until a piece of work is done, and are then heard."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator

import pytest

from albot_core.interrupts import INTERRUPTS, interrupts_deferred


class _HeardError(Exception):
    pass


def _hear(number: int, frame: object) -> None:
    raise _HeardError(number)


@pytest.fixture(autouse=True)
def _heard() -> Iterator[None]:
    before = {number: signal.signal(number, _hear) for number in INTERRUPTS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", INTERRUPTS)
def test_a_signal_waits_for_the_end_of_the_block(number: int) -> None:
    done = []
    with pytest.raises(_HeardError), interrupts_deferred():
        signal.raise_signal(number)
        signal.raise_signal(number)
        done.append("all")
    assert done == ["all"]
    assert {signal.getsignal(each) for each in INTERRUPTS} == {_hear}


def test_a_block_in_a_block_waits_for_the_outer_one() -> None:
    done = []
    with pytest.raises(_HeardError), interrupts_deferred():
        with interrupts_deferred():
            signal.raise_signal(signal.SIGINT)
        done.append("all")
    assert done == ["all"]


def test_every_handler_comes_back_when_several_signals_came() -> None:
    with pytest.raises(_HeardError), interrupts_deferred():
        for number in INTERRUPTS:
            signal.raise_signal(number)
    assert {signal.getsignal(each) for each in INTERRUPTS} == {_hear}


def test_an_error_of_the_block_comes_out() -> None:
    with pytest.raises(ValueError, match="ours"), interrupts_deferred():
        raise ValueError("ours")
    assert {signal.getsignal(each) for each in INTERRUPTS} == {_hear}


def test_what_is_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with interrupts_deferred():
        signal.raise_signal(signal.SIGHUP)
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_other_threads_need_no_protection() -> None:
    errors: list[BaseException] = []

    def work() -> None:
        try:
            with interrupts_deferred():
                pass
        except ValueError as error:  # Only the main thread may ask for signals.
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert not errors
