# Reads the log of the example 04: the fastest joint, and where the arm was nearest to the shelf.
import sys

import numpy as np

import hamelin

log = hamelin.read_log(sys.argv[1])
near = int(np.argmin(log.clearance_m))
print(f"{len(log.time_s)} ticks, fastest joint {np.abs(log.v).max():.6f} rad/s")
print(f"nearest to the shelf at {log.time_s[near]:.2f} s: {log.clearance_m[near]:.6f} m")
