#!/usr/bin/env python3
"""A driver of an arm as a client of `hamelin serve`, with the standard library only (Linux).

    hamelin serve reach.json --socket /run/user/1000/arm &
    python3 robot.py /run/user/1000/arm --start 0,-0.785,0,-2.356,0,1.571,0.785

Replace Arm.read() and Arm.write() by calls of the arm's own interface. As they are, they simulate
servos that follow their set points exactly, so that a server of torques is refused: what torques do
to an arm needs a model of it, see `hamelin plant`.

The program ends when the goals are reached (exit code 0), when the arm cannot begin, gives up,
stalls or remains stopped (1), and after Ctrl-C, when the server has brought the arm to rest (130).
"""

import argparse
import mmap
import os
import signal
import socket
import struct
import sys
import time
import zlib

JOINTS, TEXT = 32, 192
HEADER = struct.Struct("=QIIIId")  # magic, version, size, joints, position, period_s
MEASUREMENT = struct.Struct(f"=Qd{JOINTS}d{JOINTS}dI")  # and the checksum
SETPOINT = struct.Struct(f"=Qd{JOINTS}d{JOINTS}d{JOINTS}ddiiIIQQQ{TEXT}sI")  # and the checksum
CHECKSUM = struct.Struct("=I")
MAGIC, VERSION = 0x6B6E696C6C6D6168, 1
MEASUREMENT_AT = HEADER.size
SETPOINT_AT = MEASUREMENT_AT + MEASUREMENT.size + CHECKSUM.size
SIZE = SETPOINT_AT + SETPOINT.size + CHECKSUM.size

REQUEST_NONE, REQUEST_STOP, REQUEST_RESUME = 0, 1, 2
REACHED, STALLED, GAVE_UP, STOPPING = 1, 2, 3, 4
NOT_BEGUN = 8  # flag of a set point

MISSED_MAX = 20  # after so many periods in a row without a set point the driver holds the arm
RESTS_MAX = 2000  # after so many periods at rest in a stop that nobody ends the program does


class Arm:
    """Servos that follow their set points exactly."""

    def __init__(self, q):
        self.q, self.v = list(q), [0.0] * len(q)

    def read(self):
        """The joint positions and velocities that the arm measures."""
        return self.q, self.v

    def write(self, setpoint):
        """Sends a set point to the servos."""
        n = len(self.q)
        self.q, self.v = setpoint.q[:n], setpoint.v[:n]

    def hold(self):
        """The driver's own watchdog: no set point has come for too long."""
        self.v = [0.0] * len(self.v)


class Setpoint:
    def __init__(self, fields):
        self.sequence, self.time_s = fields[0:2]
        arrays = fields[2 : 2 + 3 * JOINTS]
        self.torque, self.q = list(arrays[:JOINTS]), list(arrays[JOINTS : 2 * JOINTS])
        self.v = list(arrays[2 * JOINTS :])
        rest = fields[2 + 3 * JOINTS :]
        self.clearance_m, self.state, self.reason, self.flags, self.goal_index = rest[:5]
        self.lost, self.late, self.damaged = rest[5:8]
        self.cause = rest[8].split(b"\0")[0].decode(errors="replace")


class Link:
    """The client's end: a measurement goes out, a set point comes back."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(path)
        message, descriptors, _, _ = socket.recv_fds(self.socket, 8, 1)
        if message != struct.pack("=Q", MAGIC) or not descriptors:
            raise ConnectionError(f"{path}: expected a server that has no other client")
        self.memory = mmap.mmap(descriptors[0], SIZE)
        os.close(descriptors[0])
        magic, version, size, self.joints, position, self.period_s = HEADER.unpack_from(self.memory)
        if (magic, version, size) != (MAGIC, VERSION, SIZE):
            raise ConnectionError(
                f"{path}: version {version} of {size} bytes, expected {VERSION} of {SIZE}"
            )
        self.position = position != 0
        self.setpoint, self.damaged = None, 0

    def send(self, sequence, time_s, q, v, request):
        fill = [0.0] * (JOINTS - len(q))
        frame = MEASUREMENT.pack(sequence, time_s, *q, *fill, *v, *fill, request)
        self.memory[MEASUREMENT_AT:SETPOINT_AT] = frame + CHECKSUM.pack(zlib.crc32(frame))
        try:
            self.socket.send(struct.pack("=Q", sequence), socket.MSG_DONTWAIT)
        except BlockingIOError:
            pass  # the server has yet to read the numbers before, and then finds this frame

    def receive(self, sequence, timeout_s):
        """Takes the newest set point, waiting at most so long for that of a period."""
        until_s = time.monotonic() + timeout_s
        while self.setpoint is None or self.setpoint.sequence < sequence:
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                return
            self.socket.settimeout(left_s)
            try:
                message = self.socket.recv(1 << 16)
            except socket.timeout:
                continue
            if not message:
                raise ConnectionError("the server has gone")
            if len(message) == 8:  # others answer requests
                self._take_setpoint()

    def _take_setpoint(self):
        frame = self.memory[SETPOINT_AT:SIZE]
        (checksum,) = CHECKSUM.unpack_from(frame, SETPOINT.size)
        if checksum == zlib.crc32(frame[: SETPOINT.size]):
            self.setpoint = Setpoint(SETPOINT.unpack_from(frame))
        else:
            self.damaged += 1


class Driver:
    def __init__(self, link, arm, request):
        self.link, self.arm, self.request = link, arm, request
        self.sequence, self.missed, self.lost = 0, 0, 0
        self.interrupted = False
        self.rests_for = 0

    def interrupt(self, *_):
        self.interrupted = True

    def exchange(self, time_s):
        """One period: a measurement goes out, and what has come back by its end acts on the arm."""
        before = self.link.setpoint.sequence if self.link.setpoint else 0
        # after a pause the server's periods are ahead of those counted here
        self.sequence = max(self.sequence, before) + 1
        request = REQUEST_STOP if self.interrupted else self.request
        self.link.send(self.sequence, time_s, *self.arm.read(), request)
        # the first one may take longer than a period
        self.link.receive(self.sequence, 0.8 * self.link.period_s if before else 1.0)
        setpoint = self.link.setpoint
        arrived = setpoint is not None and setpoint.sequence > before
        self.missed = 0 if arrived else self.missed + 1
        self.lost += not arrived
        if arrived and not setpoint.flags & NOT_BEGUN:
            self.arm.write(setpoint)
        elif self.missed > MISSED_MAX:
            self.arm.hold()  # the last set point acts on, but not for ever

    def exit_code(self):
        """None while the run goes on."""
        setpoint = self.link.setpoint
        if setpoint is None:
            return None
        if setpoint.state == REACHED:
            return 0
        if setpoint.flags & NOT_BEGUN or setpoint.state in (STALLED, GAVE_UP):
            return 1
        rests = setpoint.state == STOPPING and max(map(abs, setpoint.v)) < 1e-6
        self.rests_for = self.rests_for + 1 if rests else 0
        if self.interrupted:
            return 130 if rests else None
        return 1 if self.rests_for > RESTS_MAX else None

    def run(self):
        due_s = time.monotonic()
        while True:
            self.exchange(due_s)
            code = self.exit_code()
            if code is not None:
                return code
            due_s += self.link.period_s
            if time.monotonic() > due_s + 1.0:
                due_s = time.monotonic()  # a pause is not made up for
            time.sleep(max(0.0, due_s - time.monotonic()))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("socket")
    parser.add_argument("--start", help="joint positions of the simulated arm, comma-separated")
    parser.add_argument("--resume", action="store_true", help="continue after a stop")
    options = parser.parse_args()
    link = Link(options.socket)
    if not link.position:
        sys.exit("robot.py: the server sends torques, expected positions: see Arm.read()")
    start = [float(x) for x in options.start.split(",")] if options.start else [0.0] * link.joints
    driver = Driver(link, Arm(start), REQUEST_RESUME if options.resume else REQUEST_NONE)
    signal.signal(signal.SIGINT, driver.interrupt)
    signal.signal(signal.SIGTERM, driver.interrupt)
    print(f"{link.joints} joints, a period of {link.period_s:g} s", flush=True)
    code = driver.run()
    setpoint = link.setpoint
    print(
        f"{driver.sequence} periods, {driver.lost} without a set point; state {setpoint.state}, "
        f"goal {setpoint.goal_index}" + (f": {setpoint.cause}" if setpoint.cause else "")
    )
    print("the arm is at " + ",".join(f"{q:.9g}" for q in driver.arm.q))
    return code


if __name__ == "__main__":
    sys.exit(main())
