"""A study in shards by Slurm: one node, started for the test, with killed and requeued tasks.

slurm.py PROGRAM SOURCE_DIR
"""

import getpass
import os
import pathlib
import random
import re
import shutil
import socket
import subprocess
import sys
import time

from study import Study, call, kill_some, skip

DAEMONS = ("munged", "slurmctld", "slurmd")
COMMANDS = ("sbatch", "squeue", "scontrol", "sinfo")


def find(tool):
    return shutil.which(tool, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")


def free_ports(count):
    """Ports that are free now."""
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


class Cluster:
    """Controller and daemon of one node, with munge, in a folder of their own."""

    def __init__(self, root):
        self.root = root
        for name in ("state", "spool"):
            (root / name).mkdir(parents=True)
        controller, daemon = free_ports(2)
        cores = os.cpu_count() or 1
        (root / "munge.key").write_bytes(os.urandom(1024))
        (root / "munge.key").chmod(0o400)
        for folder in (root, root.parent):  # other users must reach the socket of munge
            folder.chmod(0o755)
        self.config = root / "slurm.conf"
        self.config.write_text(
            f"""ClusterName=hamelin
SlurmctldHost=localhost
SlurmUser={getpass.getuser()}
SlurmdUser={getpass.getuser()}
AuthType=auth/munge
AuthInfo=socket={root}/munge.socket
StateSaveLocation={root}/state
SlurmdSpoolDir={root}/spool
SlurmctldPidFile={root}/slurmctld.pid
SlurmdPidFile={root}/slurmd.pid
SlurmctldPort={controller}
SlurmdPort={daemon}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
KillWait=5
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName=localhost NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=main Nodes=localhost Default=YES MaxTime=INFINITE State=UP OverSubscribe=NO
"""
        )
        os.environ["SLURM_CONF"] = str(self.config)
        self.processes = []

    def start(self):
        """Whether all daemons run and the node is idle."""
        commands = (
            [find("munged"), "--foreground", "--force", f"--socket={self.root}/munge.socket", f"--key-file={self.root}/munge.key",
             f"--pid-file={self.root}/munged.pid", f"--log-file={self.root}/munged.log",
             f"--seed-file={self.root}/munge.seed"],
            [find("slurmctld"), "-D", "-f", self.config],
            [find("slurmd"), "-D", "-N", "localhost", "-f", self.config],
        )  # fmt: skip
        for name, command in zip(DAEMONS, commands):
            log = open(self.root / f"{name}.out", "w")
            self.processes.append(subprocess.Popen(command, stdout=log, stderr=log))
            time.sleep(1)
        for _ in range(60):
            if any(process.poll() is not None for process in self.processes):
                return False
            done = subprocess.run(["sinfo", "-h", "-o", "%t"], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True)  # fmt: skip
            if done.stdout.strip() == "idle":
                return True
            time.sleep(0.5)
        return False

    def log(self):
        return "\n".join(
            f"{file.name}: {file.read_text()[-600:]}" for file in sorted(self.root.glob("*.out"))
        )

    def stop(self):
        subprocess.run(["scancel", "--user", getpass.getuser()], stderr=subprocess.DEVNULL)
        for process in reversed(self.processes):
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def submit(script):
    """The number of a job."""
    return re.search(r"job (\d+)", call("sbatch", script))[1]


def tasks(job):
    """Numbers and states of the tasks of a job that have not ended."""
    out = subprocess.run(["squeue", "-h", "-r", "-j", job, "-o", "%K %T"], stdout=subprocess.PIPE,
                         stderr=subprocess.DEVNULL, text=True).stdout  # fmt: skip
    return [line.split() for line in out.splitlines()]


def wait_for(job, what, seconds=300):
    end = time.monotonic() + seconds
    while tasks(job):
        if time.monotonic() > end:
            sys.exit(f"{what}: job {job} does not end: {tasks(job)}")
        time.sleep(0.2)


def requeue_some(job, seed, seconds):
    """Puts random running tasks into the queue again, as an administrator would."""
    chosen, count, end = random.Random(seed), 0, time.monotonic() + seconds
    while time.monotonic() < end:
        running = [task for task, state in tasks(job) if state == "RUNNING"]
        if running:
            done = subprocess.run(["scontrol", "requeue", f"{job}_{chosen.choice(running)}"],
                                  stderr=subprocess.DEVNULL)  # fmt: skip
            count += done.returncode == 0
        time.sleep(0.5)
    return count


def release(job):
    """Lets tasks start that Slurm holds back for a while after they were requeued."""
    time.sleep(2)  # within a second of its end, the node refuses to start the same task again
    for task, state in tasks(job):
        if state == "PENDING":
            subprocess.run(["scontrol", "update", f"JobId={job}_{task}", "StartTime=now"],
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip


def signal_task(task, signal):
    """Signals the script of a task. While Slurm still starts it, it asks callers to try again later."""
    end = time.monotonic() + 60
    while True:
        done = subprocess.run(["scancel", "--batch", f"--signal={signal}", task],
                              stderr=subprocess.PIPE, text=True)  # fmt: skip
        if done.returncode == 0:
            return
        if "try again later" not in done.stderr or time.monotonic() > end:
            sys.exit(f"scancel, task {task}: {done.stderr}")
        time.sleep(0.2)


def execute(study, shards):
    directory, script = study.plan(f"slurm-{shards}"), study.root / f"slurm-{shards}.sbatch"
    call(
        study.program, "sweep", "emit", directory, "--slurm", "--shards", shards, "--time", "00:10:00",
        "-o", script,
    )  # fmt: skip
    job = submit(script)
    killed = kill_some(f"sweep\0run\0{directory}", shards, 2.0, 0.3, lambda: bool(tasks(job)))
    requeued = requeue_some(job, shards, 2.0)
    release(job)
    wait_for(job, f"{shards} shards")
    wait_for(submit(script), f"{shards} shards, submitted again")
    study.compare(
        f"Slurm, {shards} shards, {killed} tasks killed, {requeued} requeued, submitted twice", directory
    )


def time_limit(study):
    """A task whose time is nearly up ends its runs and queues itself again."""
    directory, script = study.plan("slurm-limit"), study.root / "slurm-limit.sbatch"
    call(
        study.program, "sweep", "emit", directory, "--slurm", "--shards", 1, "--time", "3", "-o", script
    )
    job = submit(script)
    for _ in range(100):
        if any(state == "RUNNING" for _, state in tasks(job)):
            break
        time.sleep(0.1)
    time.sleep(0.5)  # until the script has begun
    signal_task(f"{job}_1", "USR1")  # what Slurm sends before the limit
    end = time.monotonic() + 60
    while "Restarts=1" not in (state := call("scontrol", "show", "job", f"{job}_1")):
        if time.monotonic() > end:
            sys.exit(f"the task has not queued itself again:\n{state}")
        time.sleep(0.2)
    release(job)
    wait_for(job, "time limit", 400)
    study.compare("Slurm, a task that queued itself again before its time limit", directory)


def main():
    for tool in (*DAEMONS, *COMMANDS):
        if find(tool) is None:
            skip(f"{tool} is not installed")
    study = Study(*sys.argv[1:3])
    cluster = Cluster(study.root / "cluster")
    try:
        if not cluster.start():
            skip(f"Slurm does not start on this machine:\n{cluster.log()}")
        study.run_whole()
        for shards in (1, 7, 40):
            execute(study, shards)
        time_limit(study)
    finally:
        cluster.stop()


if __name__ == "__main__":
    main()
