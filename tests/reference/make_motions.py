#!/usr/bin/env python3
"""Computes the reference motions of data/golden/integration/motions.json: make_motions.py [FILE].

Written from the equations of docs/theory (cited below) with numpy and dense matrices, and shares no code with hamelin.
Without FILE it prints the motions. With it, it prints the largest differences of each motion from those of the file, and
exits with 1 if one is larger than 1e-10 rad, 1e-9 rad/s or 1e-5 of the energy error. Takes about a minute.
"""

from __future__ import annotations

import json
import math
import sys
from typing import Any, Callable

import numpy as np

G = 9.81
H = 0.01
STEPS = 10000
SAMPLES = (10, 100, 1000, 10000)
Array = np.ndarray


class Planar3:
    """Example 5.1 in its plane (y, z): links of 0.1 m, mass 1 kg, inertia 1 kg m^2 about the centre of mass."""

    n, length, com, mass, inertia = 3, 0.1, 0.05, 1.0, 1.0

    def __init__(self) -> None:
        # With absolute angles phi = L q, the centre of mass of link i is at sum_j lever[i, j] (cos phi_j, sin phi_j).
        self.sums = np.tril(np.ones((3, 3)))
        self.lever = self.length * np.tril(np.ones((3, 3)), -1) + self.com * np.eye(3)
        self.products = self.mass * self.lever.T @ self.lever

    def mass_matrix(self, q: Array) -> Array:
        phi = self.sums @ q
        return self.sums.T @ (self.products * np.cos(phi[:, None] - phi) + self.inertia * np.eye(3)) @ self.sums

    def kinetic_gradient(self, q: Array, v: Array) -> Array:
        """dK/dq at fixed v."""
        phi, rate = self.sums @ q, self.sums @ v
        return self.sums.T @ -(self.products * np.sin(phi[:, None] - phi) @ rate * rate)

    def coriolis(self, q: Array, v: Array) -> Array:
        phi, rate = self.sums @ q, self.sums @ v
        return self.sums.T @ (self.products * np.sin(phi[:, None] - phi) @ rate**2)

    def potential(self, q: Array) -> float:
        return float(self.mass * G * (self.lever @ np.sin(self.sums @ q)).sum())

    def potential_gradient(self, q: Array) -> Array:
        return self.sums.T @ (self.mass * G * self.lever.sum(axis=0) * np.cos(self.sums @ q))

    def kinetic(self, q: Array, v: Array) -> float:
        return float(0.5 * v @ self.mass_matrix(q) @ v)

    def tip_y(self, q: Array) -> float:
        return float(self.length * np.cos(self.sums @ q).sum())


ARM = Planar3()


def recorded(scheme: dict[str, Any], step: Callable[[], tuple[Array, float]]) -> dict[str, Any]:
    """Takes all steps. `step` returns the configuration and the energy after it."""
    first = ARM.potential(np.zeros(3))
    samples, worst = [], 0.0
    for k in range(1, STEPS + 1):
        q, energy = step()
        worst = max(worst, abs(energy - first))
        if k in SAMPLES:
            samples.append({"k": k, "q": [float(f"{x:.15g}") for x in q], "tip_y": float(f"{ARM.tip_y(q):.15g}")})
    return {**scheme, "samples": samples, "max_energy_error_J": float(f"{worst:.6g}")}


def solved(residual: Callable[[Array], Array], inverse: Array, guess: Array) -> Array:
    """The root by Newton's method with a constant matrix, iterated until corrections are below rounding."""
    delta = guess
    for _ in range(100):
        correction = inverse @ residual(delta)
        delta = delta - correction
        if np.abs(correction).max() < 1e-15:
            break
    return delta


# ---- Planar rigid motions: twists are (angular, y, z), poses (angle, y, z) ----


def adjoint_of_inverse(angle: float, p: tuple[float, float]) -> Array:
    """Ad of the inverse of the pose with this rotation and origin."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [s * p[0] - c * p[1], c, s], [c * p[0] + s * p[1], -s, c]])


def bracket(x: Array) -> Array:
    """ad(x)."""
    return np.array([[0, 0, 0], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


INERTIA = np.array([[Planar3.inertia + Planar3.mass * Planar3.com**2, 0, Planar3.mass * Planar3.com],
                    [0, Planar3.mass, 0], [Planar3.mass * Planar3.com, 0, Planar3.mass]])  # fmt: skip


def transports(q: Array) -> list[Array]:
    return [adjoint_of_inverse(angle, (0.0 if i == 0 else Planar3.length, 0.0)) for i, angle in enumerate(q)]


def hamel(alpha: float, midpoint: bool) -> dict[str, Any]:
    """docs/theory/hamel.md (3.2), (3.10), (3.11) with the published start (3.14); energy (3.13)."""
    q, before = np.zeros(3), [np.zeros(3)] * 3

    def twists(delta: Array) -> list[Array]:
        out, carried = [], np.zeros(3)
        for i, moved in enumerate(transports(q + 0.5 * delta if midpoint else q)):
            carried = moved @ carried
            carried[0] += delta[i] / H
            out.append(carried)
        return out

    def residual(delta: Array) -> Array:
        xi, at, out = twists(delta), transports(q), H * ARM.potential_gradient(q)
        f = np.zeros(3)
        for i in (2, 1, 0):
            new, old = INERTIA @ xi[i], INERTIA @ before[i]
            f = (at[i + 1].T @ f if i < 2 else f) + new - old
            f = f - (1 - alpha) * H * bracket(xi[i]).T @ new - alpha * H * bracket(before[i]).T @ old
            out[i] += f[0]
        return out

    def step() -> tuple[Array, float]:
        nonlocal q, before
        delta = solved(residual, H * np.linalg.inv(ARM.mass_matrix(q)), np.zeros(3))
        before = twists(delta)
        energy = ARM.kinetic(q + 0.5 * delta, delta / H) + 0.5 * (ARM.potential(q) + ARM.potential(q + delta))
        q = q + delta
        return q, energy

    name = "hamel-midpoint" if midpoint else "hamel"
    return recorded({"scheme": name, "alpha": alpha, "start": "xi^{-1}=0"}, step)


def variational() -> dict[str, Any]:
    """docs/theory/variational.md (4.1), (4.2)."""
    q, p = np.zeros(3), np.zeros(3)

    def momenta(delta: Array) -> tuple[Array, Array]:
        mid, v = q + 0.5 * delta, delta / H
        half = 0.5 * H * ARM.kinetic_gradient(mid, v)
        momentum = ARM.mass_matrix(mid) @ v
        return (momentum - half + 0.5 * H * ARM.potential_gradient(q),
                momentum + half - 0.5 * H * ARM.potential_gradient(q + delta))  # fmt: skip

    def step() -> tuple[Array, float]:
        nonlocal q, p
        delta = solved(lambda d: momenta(d)[0] - p, H * np.linalg.inv(ARM.mass_matrix(q)), np.zeros(3))
        p, q = momenta(delta)[1], q + delta
        return q, 0.5 * float(p @ np.linalg.solve(ARM.mass_matrix(q), p)) + ARM.potential(q)

    return recorded({"scheme": "hamel-variational"}, step)


def semi_implicit_euler() -> dict[str, Any]:
    """docs/theory/other-integrators.md (7.2)."""
    q, v = np.zeros(3), np.zeros(3)

    def step() -> tuple[Array, float]:
        nonlocal q, v
        force = ARM.coriolis(q, v) + ARM.potential_gradient(q)
        v = v - H * np.linalg.solve(ARM.mass_matrix(q), force)
        q = q + H * v
        return q, ARM.kinetic(q, v) + ARM.potential(q)

    return recorded({"scheme": "semi-implicit-euler"}, step)


# ---- Spatial chains ----


def cross(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rotation(axis: int, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    if axis == 0:
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def acceleration(q: Array, v: Array) -> Array:
    """Newton and Euler in the world's frame, with a dense mass matrix from Jacobians."""
    n, length, radius = len(q), 0.2, 0.03
    body = np.diag([length**2 / 12 + radius**2 / 4, radius**2 / 2, length**2 / 12 + radius**2 / 4])
    turn, origin = np.eye(3), np.zeros(3)
    omega, alpha, linear = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, G])
    mass, bias = np.zeros((n, n)), np.zeros(n)
    axes, origins = [], []
    for k in range(n):
        axis = turn[:, (0, 2, 0)[k % 3]]
        turn = turn @ rotation((0, 2, 0)[k % 3], q[k])
        alpha = alpha + v[k] * cross(omega, axis)
        omega = omega + v[k] * axis
        axes.append(axis)
        origins.append(origin)
        arm = turn[:, 1] * 0.5 * length
        inertia = turn @ body @ turn.T
        force = linear + cross(alpha, arm) + cross(omega, cross(omega, arm))
        torque = inertia @ alpha + cross(omega, inertia @ omega)
        center = origin + arm
        speeds = [cross(a, center - o) for a, o in zip(axes, origins)]
        moved = [inertia @ a for a in axes]
        for i in range(k + 1):
            bias[i] += speeds[i] @ force + axes[i] @ torque
            for j in range(i + 1):
                mass[i, j] += speeds[i] @ speeds[j] + axes[i] @ moved[j]
        arm = 2.0 * arm
        linear = linear + cross(alpha, arm) + cross(omega, cross(omega, arm))
        origin = origin + arm
    mass = np.tril(mass) + np.tril(mass, -1).T
    return np.linalg.solve(mass, -bias)


def spatial_chain(n: int, steps: int = 1000) -> dict[str, Any]:
    """By extrapolation from RK4 with `steps` and twice as many steps, whose error is far below that of rounding."""
    q0 = np.array([0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6])[:n]

    def rk4(count: int) -> Array:
        h, y = 0.5 / count, np.concatenate([q0, np.zeros(n)])

        def rate(x: Array) -> Array:
            return np.concatenate([x[n:], acceleration(x[:n], x[n:])])

        for _ in range(count):
            a = rate(y)
            b = rate(y + 0.5 * h * a)
            c = rate(y + 0.5 * h * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c))
        return y

    coarse, fine = rk4(steps), rk4(2 * steps)
    y = fine + (fine - coarse) / 15
    return {"n": n, "T": 0.5, "q0": q0.tolist(), "qT": y[:n].tolist(), "vT": y[n:].tolist()}


def motions() -> dict[str, Any]:
    return {
        "schemes": [hamel(0.0, False), hamel(0.5, False), hamel(1.0, False), hamel(0.5, True), variational(),
                    semi_implicit_euler()],
        "rk4_reference": [spatial_chain(3), spatial_chain(7)],
    }  # fmt: skip


def compare(ours: dict[str, Any], file: dict[str, Any]) -> bool:
    equal = True
    for a, b in zip(ours["schemes"], file["schemes"], strict=True):
        assert a["scheme"] == b["scheme"] and a.get("alpha") == b.get("alpha")
        differences = [float(np.abs(np.subtract(x["q"], y["q"])).max()) for x, y in zip(a["samples"], b["samples"])]
        shown = ", ".join(f"{d:.1e} at k = {s['k']}" for d, s in zip(differences, a["samples"]))
        energy = abs(a["max_energy_error_J"] / b["max_energy_error_J"] - 1)
        equal = equal and max(differences) <= 1e-10 and energy <= 1e-5
        print(f"{a['scheme']} {a.get('alpha', '')}: q differs by {shown}; largest energy error by {energy:.1e} of itself")
    for a, b in zip(ours["rk4_reference"], file["rk4_reference"], strict=True):
        q, v = (float(np.abs(np.subtract(a[key], b[key])).max()) for key in ("qT", "vT"))
        equal = equal and q <= 1e-10 and v <= 1e-9
        print(f"chain of {a['n']}: q differs by {q:.1e}, v by {v:.1e}")
    return equal


def main() -> int:
    ours = motions()
    if len(sys.argv) == 1:
        print(json.dumps(ours, indent=1))
        return 0
    with open(sys.argv[1], encoding="utf-8") as file:
        return 0 if compare(ours, json.load(file)) else 1


if __name__ == "__main__":
    sys.exit(main())
