import asyncio
from dataclasses import replace

import pytest

from app.llm.base import ModelUnavailableError
from app.llm.resilient import Circuit, Places, ProviderLimits

pytestmark = pytest.mark.anyio

LIMITS = ProviderLimits(concurrent=2, queued=1, failures=3, pause_s=10.0)


class Clock:
    def __init__(self):
        self.now_s = 1000.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def circuit(clock):
    return Circuit("openai", LIMITS, clock)


def fail(circuit, times=1):
    for number in range(times):
        with circuit.passage():
            circuit.failed(f"reason {number}")


def refused(circuit):
    try:
        with circuit.passage():
            return False
    except ModelUnavailableError:
        return True


def test_failures_in_a_row_open_the_circuit_and_the_error_names_it(circuit, clock):
    fail(circuit, 3)
    clock.now_s += 4
    with pytest.raises(ModelUnavailableError) as caught, circuit.passage():
        pass
    said = "openai failed 3 times in a row and is not asked for another 6 s; the last time: reason 2"
    assert str(caught.value) == said
    assert caught.value.retry_after_s == 6.0
    assert not caught.value.retryable


def test_an_answer_in_between_starts_the_count_anew(circuit):
    fail(circuit, 2)
    with circuit.passage():
        circuit.answered()
    fail(circuit, 2)
    assert not circuit.is_open
    fail(circuit)
    assert circuit.is_open


def test_after_the_pause_one_request_tries_it_and_the_others_wait_for_the_outcome(circuit, clock):
    fail(circuit, 3)
    clock.now_s += 10
    with circuit.passage():
        assert refused(circuit)
        circuit.answered()
        assert not refused(circuit)
    assert not circuit.is_open


def test_a_failed_trial_opens_the_circuit_for_another_pause(circuit, clock):
    fail(circuit, 3)
    clock.now_s += 10
    fail(circuit)
    assert refused(circuit)
    clock.now_s += 9.9
    assert refused(circuit)
    clock.now_s += 0.1
    assert not refused(circuit)


def test_a_trial_without_an_outcome_leaves_the_next_one_to_try(circuit, clock):
    fail(circuit, 3)
    clock.now_s += 10
    with pytest.raises(KeyboardInterrupt), circuit.passage():
        raise KeyboardInterrupt
    with circuit.passage():
        assert refused(circuit)


def test_a_circuit_without_a_limit_never_opens(clock):
    circuit = Circuit("embedded", replace(LIMITS, failures=None), clock)
    fail(circuit, 100)
    assert not circuit.is_open


async def test_a_cancelled_request_makes_room_in_the_queue():
    places, leave = Places("openai", LIMITS), asyncio.Event()

    async def visit():
        async with places.one():
            await leave.wait()

    *inside, waiting = [asyncio.create_task(visit()) for _ in range(3)]
    await asyncio.sleep(0)
    waiting.cancel()
    await asyncio.wait([waiting])
    inside.append(asyncio.create_task(visit()))
    await asyncio.sleep(0)
    leave.set()
    await asyncio.gather(*inside)
