"""A study in shards by GNU parallel: on this machine, and on a host over ssh that shares no folder.

parallel.py PROGRAM SOURCE_DIR
"""

import contextlib
import getpass
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

from study import Study, call, kill_some, processes_with, skip


def run_with_kills(script, text, seed):
    """Executes a script while its shards are killed, then again until it succeeds."""
    begun = subprocess.Popen(
        ["bash", script], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    killed = kill_some(text, seed, 1.5, 0.1, lambda: begun.poll() is None)
    begun.wait()
    while processes_with(text):  # shards whose script was killed go on
        time.sleep(0.1)
    # GNU parallel counts free processes by starting `sleep 10101`, which outlives its kill and held
    # the output of this test.
    with contextlib.suppress(ProcessLookupError):
        os.killpg(begun.pid, signal.SIGKILL)
    for _ in range(3):
        if subprocess.run(["bash", script]).returncode == 0:
            return killed
    sys.exit(f"{script}: does not succeed when it is repeated")


def local(study):
    for shards in (1, 7, 40):
        directory = study.plan(f"parallel-{shards}")
        script = study.root / f"parallel-{shards}.sh"
        call(study.program, "sweep", "emit", directory, "--parallel", "--shards", shards, "-o", script)
        killed = run_with_kills(script, str(directory), shards)
        study.compare(f"parallel, {shards} shards, {killed} processes killed", directory)
        call("bash", script)
        study.compare(f"parallel, {shards} shards, repeated", directory)


class SshServer:
    """An sshd on the loopback interface that lets this user in with a key made for the test."""

    def __init__(self, root, port):
        self.key = root / "key"
        call("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", self.key)
        call("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", root / "host_key")
        config = root / "sshd_config"
        config.write_text(
            f"Port {port}\nListenAddress 127.0.0.1\nHostKey {root}/host_key\n"
            f"AuthorizedKeysFile {self.key}.pub\nPidFile {root}/sshd.pid\nStrictModes no\n"
            "UsePAM no\nPasswordAuthentication no\nPermitRootLogin prohibit-password\n"
        )
        if os.geteuid() == 0:
            pathlib.Path("/run/sshd").mkdir(exist_ok=True)  # for its separation of privileges
        self.process = subprocess.Popen(
            [shutil.which("sshd", path=f"{os.environ['PATH']}:/usr/sbin"), "-D", "-e", "-f", config],
            stderr=open(root / "sshd.log", "w"),
        )
        # A wrapper, because GNU parallel splits logins at blanks and commas.
        self.command = root / "ssh"
        self.command.write_text(
            f"#!/bin/sh\nexec ssh -p {port} -i {self.key} -o StrictHostKeyChecking=no "
            f'-o UserKnownHostsFile=/dev/null -o LogLevel=ERROR "$@"\n'
        )
        self.command.chmod(0o755)
        self.login = f"{getpass.getuser()}@127.0.0.1"

    def answers(self):
        for _ in range(50):
            if subprocess.run([self.command, self.login, "true"], stderr=subprocess.DEVNULL).returncode == 0:
                return True
            time.sleep(0.1)
        return False

    def stop(self):
        self.process.terminate()
        self.process.wait()


def over_ssh(study):
    for tool in ("ssh", "ssh-keygen", "rsync"):
        if shutil.which(tool) is None:
            print(f"over ssh: skipped: {tool} is not installed")
            return
    if shutil.which("sshd", path=f"{os.environ['PATH']}:/usr/sbin") is None:
        print("over ssh: skipped: sshd is not installed")
        return
    server = SshServer(study.root, 20000 + os.getpid() % 20000)
    left = []
    try:
        if not server.answers():
            print("over ssh: skipped: sshd does not start here:")
            print((study.root / "sshd.log").read_text())
            return
        login = f"2/{server.command} {server.login}"
        for mode, options in (("shared", []), ("transfer", ["--transfer"])):
            directory, script = study.plan(f"ssh-{mode}"), study.root / f"ssh-{mode}.sh"
            before = set(pathlib.Path.home().glob("hamelin-*"))
            call(
                study.program, "sweep", "emit", directory, "--parallel", "--shards", 7,
                "--sshlogin", login, "--program", study.program, *options, "-o", script,
            )  # fmt: skip
            text = str(directory) if mode == "shared" else "ssh-transfer\0--shard"
            killed = run_with_kills(script, text, 3)
            left += set(pathlib.Path.home().glob("hamelin-*")) - before
            study.compare(f"parallel over ssh, {mode}, {killed} processes killed", directory)
    finally:
        server.stop()
        for folder in left:
            shutil.rmtree(folder, ignore_errors=True)


def main():
    if shutil.which("parallel") is None:
        skip("GNU parallel is not installed")
    study = Study(*sys.argv[1:3])
    study.run_whole()
    local(study)
    over_ssh(study)
    if processes_with(str(study.root)):
        sys.exit("processes of the study are left")


if __name__ == "__main__":
    main()
