"""Steps that end at events, and the motion between nodes."""

import hamelin
import numpy as np
import pytest


def test_a_joint_passes_a_position(arm):
    integrator = hamelin.Integrator(arm, "gauss:8")
    state = integrator.start(np.full(7, 0.4))
    finder = hamelin.EventFinder(
        integrator,
        [lambda t, q, v: q[1] - 0.5, (lambda t, q, v: t - 0.2505, 1)],
    )
    found = []
    while state.time_s < 0.3:
        before = state.copy()
        report, event = finder.step(state, 0.01)
        assert report.converged
        if event is None:
            continue
        found.append((event, state.time_s))
        assert integrator.step(before, report.step_s).converged
        assert np.array_equal(before.q, state.q)
    assert [event for event, _ in found] in ([0, 1], [1])
    assert abs(found[-1][1] - 0.2505) < 3e-12


def test_motion_within_a_step(arm):
    integrator = hamelin.Integrator(arm, "dop853")
    state = integrator.start(np.full(7, 0.4))
    finder = hamelin.EventFinder(integrator, [])
    start = state.copy()
    finder.step(state, 0.02)
    q, v = finder.motion(0.008)
    integrator.step(start, 0.008)
    assert np.allclose(q, start.q, rtol=0, atol=1e-7)
    assert np.allclose(v, integrator.velocity(start), rtol=0, atol=1e-5)
    with pytest.raises(hamelin.Error, match="expected a time from 0 to 0.02 s"):
        finder.motion(0.03)


def test_wrong_events(arm):
    integrator = hamelin.Integrator(arm)
    for events, words in (
        ([3], "expected a function"),
        ([(print, 1, 2)], "expected \\(function, direction\\)"),
        ([(print, 7)], "direction 7"),
    ):
        with pytest.raises(hamelin.Error, match=words):
            hamelin.EventFinder(integrator, events)

    def fails(t, q, v):
        raise KeyError("in an event")

    state = integrator.start(np.zeros(7))
    with pytest.raises(KeyError, match="in an event"):
        hamelin.EventFinder(integrator, [fails]).step(state, 0.01)
    assert state.time_s == 0.0
