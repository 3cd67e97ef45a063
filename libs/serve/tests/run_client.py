"""Runs a reference client against a server: run_client.py HAMELIN SCENE CLIENT...

The client is interrupted, and brings the arm to rest; the next one resumes and reaches the goal.
The server waits for each measurement and goes on without many, because a computer that is busy with
other tests makes frames late.
"""

import pathlib
import signal
import subprocess
import sys
import tempfile
import time

# A process that gets no time for 30 ms leaves 30 measurements unread.
SERVER = ["--lockstep", "--lost-max", "1000"]
START = "0,-0.785,0,-2.356,0,1.571,0.785"


def run(client, socket, start, *options, interrupt=False):
    """Runs the client. @return its exit code and what it printed"""
    with subprocess.Popen(
        [*client, str(socket), "--start", start, *options], stdout=subprocess.PIPE, text=True
    ) as process:
        connected = process.stdout.readline()
        if interrupt:
            time.sleep(0.1)  # on its way, which takes seconds
            process.send_signal(signal.SIGINT)
        text = connected + process.stdout.read()
        return process.wait(timeout=60), text


def expect(condition, what):
    if not condition:
        sys.exit(f"expected {what}")


def check(client, socket):
    code, text = run(client, socket, START, interrupt=True)
    print(text, end="")
    expect("7 joints, a period of 0.001 s" in text, "the joints and the period of the scene")
    expect(code == 130, f"exit code 130 after an interruption, not {code}")
    expect("state 4, goal 0: the client has asked for it" in text, "an arm that was stopped")
    start = text.splitlines()[-1].removeprefix("the arm is at ")
    expect(start != START, "an arm that has moved")
    code, text = run(client, socket, start)
    print(text, end="")
    expect(code == 1, f"exit code 1 of an arm that remains stopped, not {code}")
    code, text = run(client, socket, start, "--resume")
    print(text, end="")
    expect(code == 0, f"exit code 0 after the goal, not {code}")
    expect("state 1, goal 1" in text, "an arm at its goal")


def main():
    program, scene, *client = sys.argv[1:]
    with tempfile.TemporaryDirectory(prefix="hamelin-serve-") as folder:
        socket = pathlib.Path(folder) / "arm"
        code, _ = run(client, socket, START)
        expect(code not in (0, 130), f"a failure without a server, not {code}")
        server = subprocess.Popen([program, "serve", scene, "--socket", str(socket), *SERVER])
        try:
            while not socket.exists() and server.poll() is None:
                time.sleep(0.01)
            check(client, socket)
        finally:
            server.send_signal(signal.SIGINT)
            expect(server.wait(timeout=60) == 0, "a server that ends after an interruption")


if __name__ == "__main__":
    main()
