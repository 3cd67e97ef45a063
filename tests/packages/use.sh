#!/usr/bin/env bash
# use.sh PART: uses the installed packages in the home folder of a plain user; clean_root.sh calls it.
set -euo pipefail
cd
scenes=/usr/share/hamelin/scenes
ok() { echo "ok      $1"; }
prints() { # REGEX COMMAND...: the output of the command has a line that matches
  "${@:2}" >out.txt 2>&1 || { cat out.txt && return 1; }
  grep -qE -- "$1" out.txt || { echo "failed  ${*:2}: no line matches $1" && cat out.txt && return 1; }
}

case "$1" in
  program)
    prints '^hybrid ' hamelin plugins list
    ok "the planners are listed"
    prints '^outcome +reached' hamelin run $scenes/shelf.json --log shelf.jsonl --result shelf.json
    ok "a scene runs"
    prints 'identical|equal' hamelin replay shelf.jsonl --verify
    ok "its replay is equal"
    hamelin report shelf.jsonl -o shelf.html >/dev/null 2>&1
    [[ $(stat -c %s shelf.html) -gt 100000 ]] && grep -q '</html>' shelf.html
    ok "its report is written"
    prints '"hamelin.scene/1"' hamelin schema print scene
    ok "a schema is printed"
    ;;
  python)
    prints '^reached 7 True$' python3 - <<'PYTHON'
import hamelin
import numpy as np

arm = hamelin.load_robot(hamelin.data_path("robots/arm7.urdf"))
acceleration = arm.aba(np.full(7, 0.3), np.zeros(7), np.zeros(7))
result = hamelin.run(hamelin.data_path("scenes/pillar.json"), log="pillar.jsonl")
hamelin.report("pillar.jsonl", output="pillar.html")
print(result.outcome, len(acceleration), len(hamelin.read_log("pillar.jsonl").q) > 100)
PYTHON
    ok "Python imports hamelin, computes, runs a scene and reads its log"
    cat >mine.py <<'PYTHON'
class Spring:
    def start(self, setup):
        self.arm = setup.model

    def tick(self, tick, command):
        a = 30.0 * (tick.goal["q"] - tick.q) - 11.0 * tick.v
        command.held_torque = self.arm.rnea(tick.q, tick.v, a)
PYTHON
    hamelin run $scenes/pillar.json --planner python:mine.py:Spring --duration 0.2 --result spring.json \
      >/dev/null 2>&1 || (($? == 1)) # the goal is not reached so soon
    grep -q '"planner": "python"' spring.json && grep -q '"outcome": "timeout"' spring.json
    ok "the program runs a planner in Python"
    ;;
  development)
    man -w hamelin hamelin-run >/dev/null
    prints '^ +hamelin run' man --pager=cat hamelin-run
    ok "manual pages are found"
    prints ' -F _hamelin' bash -c '. /usr/share/bash-completion/bash_completion; _completion_loader hamelin; complete -p hamelin'
    prints '^replay report$' bash -c '. /usr/share/bash-completion/completions/hamelin
      COMP_WORDS=(hamelin rep) COMP_CWORD=1; _hamelin; echo "${COMPREPLY[@]}"'
    ok "bash completes commands"
    cp -r /usr/share/doc/libhamelin-dev/examples/template mine
    cmake -S mine -B mine/build >/dev/null
    cmake --build mine/build >/dev/null
    hamelin plugins check mine/build/lib/hamelin/plugins/template.hamelin.so >/dev/null
    ok "the template planner builds against libhamelin-dev and passes the check of plugins"
    hamelin run $scenes/pillar.json --planner mine/build/lib/hamelin/plugins/template.hamelin.so --duration 0.2 \
      --result mine.json >/dev/null 2>&1 || (($? == 1))
    grep -q '"outcome": "timeout"' mine.json
    ok "the program runs it"
    # shellcheck disable=SC2046
    cc -Wall -Werror /usr/share/doc/libhamelin-dev/examples/robot_loop/live.c $(pkg-config --cflags --libs hamelin) -o live
    prints '^home after [0-9.]+ s, clearance 0[.][0-9]+ m at least$' \
      ./live $scenes/clutter.json "$(pkg-config --variable=plugindir hamelin)"
    ok "a program in C links libhamelin by pkg-config and controls an arm"
    cc -std=c11 -Wall -Werror /usr/share/doc/libhamelin-dev/examples/clients/robot.c -o robot -lm
    ok "the driver in C compiles with the header of the frames alone"
    mkdir project && cd project
    cp /usr/share/doc/libhamelin-dev/examples/robot_loop/loop.cpp .
    printf '%s\n' 'cmake_minimum_required(VERSION 3.25)' 'project(loop LANGUAGES CXX)' \
      'find_package(hamelin REQUIRED)' 'add_executable(loop loop.cpp)' \
      'target_link_libraries(loop PRIVATE hamelin::hamelin)' >CMakeLists.txt
    cmake -B build -DCMAKE_BUILD_TYPE=Release >/dev/null
    cmake --build build >/dev/null
    prints '^there after [0-9.]+ s, clearance' build/loop $scenes/clutter.json "$(pkg-config --variable=plugindir hamelin)"
    ok "a program in C++ links all static libraries by find_package"
    [[ -e /usr/share/doc/hamelin-doc/docs/theory.md || -e /usr/share/doc/hamelin-doc/html/index.html ]]
    ok "documents are there"
    ;;
esac
