#!/usr/bin/env python3
"""Writes a Lissajous figure as way-points of a target, centred at the origin.

The figure is y = A sin(w t), z = A/2 sin(2 w t), which is passed at a mean speed.
"""
import argparse
import math


def length(amplitude, pieces=100000):
    points = [figure(amplitude, 2 * math.pi * i / pieces) for i in range(pieces + 1)]
    return sum(math.dist(a, b) for a, b in zip(points, points[1:]))


def figure(amplitude, phase):
    return (0.0, amplitude * math.sin(phase), 0.5 * amplitude * math.sin(2 * phase))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--amplitude", type=float, default=0.25, help="half its width [m]")
    parser.add_argument("--speed", type=float, default=0.2, help="mean speed [m/s]")
    parser.add_argument("--rate", type=float, default=25, help="way-points per second, about")
    parser.add_argument("--plane", choices=["yz", "zy"], default="yz",
                        help="axes of its width and its height")
    args = parser.parse_args()
    period_s = length(args.amplitude) / args.speed
    count = round(period_s * args.rate)
    print(f"# A Lissajous figure of {args.amplitude} m at a mean of {args.speed} m/s,")
    print("# by tests/follow/make_lissajous.py.")
    print("time_s,x_m,y_m,z_m")
    for i in range(count + 1):
        x, y, z = figure(args.amplitude, 2 * math.pi * (i % count) / count)
        if args.plane == "zy":
            y, z = z, y
        print(f"{i * period_s / count:.6f},{x:.9f},{y:.9f},{z:.9f}")


if __name__ == "__main__":
    main()
