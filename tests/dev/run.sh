#!/usr/bin/env bash
# run.sh SOURCE BUILD: runs a copy of SOURCE/dev in a temporary folder. Programs that install,
# configure or compile are replaced by stubs that only record their calls. The demo runs the program
# of BUILD.
set -u
source=$(realpath "$1") build=$(realpath "$2")
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/tree/tests/fuzz" "$work/tree/docs" "$work/stubs" "$work/system"
cp "$source/dev" "$work/tree/"
ln -s "$source/data" "$work/tree/data"
for script in tests/fuzz/run.sh docs/make_accuracy.sh; do
  printf '#!/bin/sh\necho fake %s >>"%s/calls"\n' "$script" "$work" >"$work/tree/$script"
  chmod +x "$work/tree/$script"
done

# A PATH with only the tools that the script itself needs, so that no installed program is found by
# accident.
for tool in bash sh env dirname cat grep sed xargs head nproc rm cp mv mkdir mktemp sort; do
  ln -s "$(command -v "$tool")" "$work/system/$tool"
done
stub() { # NAME EXIT_CODE: makes a program that records its call
  printf '#!/bin/sh\necho "%s $*" >>"%s/calls"\nexit %s\n' "$1" "$work" "$2" >"$work/stubs/$1"
  chmod +x "$work/stubs/$1"
}
failed=0
expect() { # NAME CONDITION...
  if "${@:2}"; then echo "ok      $1"; else
    echo "failed  $1 (exit code $code)"
    cat "$work/out" "$work/err" "$work/calls"
    failed=1
  fi
}
run() { # ARGUMENT...: runs ./dev ARGUMENT... and sets $code to its exit code
  : >"$work/calls"
  code=0
  env -u CHROMIUM PATH="$work/stubs:$work/system" "$work/tree/dev" "$@" >"$work/out" 2>"$work/err" </dev/null || code=$?
}
printed() { grep -qE -- "$1" "$work/out" "$work/err"; }
called() { grep -qE -- "$1" "$work/calls"; }

refused() { # COMMAND_THAT_INSTALLS
  ((code == 2)) && ! called 'apt-get|cmake|ninja|fake' && (($(wc -l <"$work/err") == 1)) &&
    printed "^dev: missing: .*; install with $1\$"
}
no_package_task() { # NAME COMMAND_THAT_INSTALLS ARGUMENT...
  run "${@:3}"
  expect "$1 installs nothing and names what is missing" refused "$2"
}

# ---- Nothing is installed ----
stub dpkg-query 1
stub apt-get 0
stub sudo 0
for task in build check tsan tidy cover bench docs accuracy fuzz packages; do no_package_task "$task" './dev setup' "$task"; done
no_package_task format './dev setup --all' format
installs() { ((code == 0)) && called '(apt-get|sudo .*apt-get) install .*libeigen3-dev' && ! called 'clang-tidy'; }
run setup
expect "setup installs what builds and tests need" installs
installs_all() {
  ((code == 0)) && called 'install .*libeigen3-dev' &&
    called 'install .*clang-format.*clang-tidy.*gcovr.*libclang-rt-dev.*lintian.*mmdebstrap'
}
run setup --all
expect "setup --all installs what check, cover, fuzz and packages need as well" installs_all

# ---- What the demo installs is there, and nothing of the tests ----
for tool in g++ cmake ninja ccache pkg-config git node npm; do stub "$tool" 0; done
cat >"$work/stubs/dpkg-query" <<'STUB'
#!/bin/sh
for package; do :; done
case "$package" in catch2 | pybind11-dev | python3-* | *mujoco* | *ompl* | *ipopt*) exit 1 ;; esac
echo "install ok installed"
STUB
builds_demo() { ((code == 0)) && called 'cmake --build --preset demo'; }
run build demo
expect "build demo needs no packages of tests" builds_demo

# ---- Everything is installed; the stubbed build provides the program of BUILD ----
for tool in g++ cmake ninja ccache pkg-config git node npm clang man chromium; do stub "$tool" 0; done
printf '#!/bin/sh\necho "install ok installed"\n' >"$work/stubs/dpkg-query"
demo="$work/tree/build/demo"
mkdir -p "$demo/bin" "$demo/share/hamelin"
cp "$build/bin/hamelin" "$demo/bin/"
ln -s "$build/lib" "$demo/lib"
for task in check tidy; do no_package_task "$task without clang-format or clang-tidy" './dev setup --all' "$task"; done
no_package_task "cover without gcovr" './dev setup --all' cover

configures_for_demo() {
  called "cmake --preset demo -DHAMELIN_COMMANDS=run;.* -DHAMELIN_BUILD_C_INTERFACE=OFF -DHAMELIN_FURTHER_SOURCES=OFF" &&
    called 'cmake --build build/demo --target demo' &&
    grep -A 3 '"name": "demo", "displayName"' "$source/CMakePresets.json" | grep -q '"HAMELIN_INSTRUCTION_SETS": "best"'
}
run demo
expect "the demo builds what it runs, for this machine" configures_for_demo
touch "$demo/CMakeCache.txt"
keeps_build() { ! called 'cmake --preset' && called 'cmake --build build/demo --target demo'; }
run demo
expect "the demo keeps a build that is there" keeps_build

no_page() {
  ((code == 0)) && printed '^outcome +reached' && [[ ! -e "$work/tree/out/shelf.html" ]] &&
    printed '^out/shelf.html: not made, .*run ./dev demo again'
}
run demo
expect "the demo succeeds without the page and prints how to get it" no_page
if [[ -f "$build/share/hamelin/report/page.html" ]]; then
  ln -s "$build/share/hamelin/report" "$demo/share/hamelin/report"
  page() { ((code == 0)) && [[ -s "$work/tree/out/shelf.html" ]] && ! called apt-get; }
  run demo
  expect "the demo makes the page if its template was built" page
fi

# ---- quick: the parts with changes, or those that are named ----
printf '#!/bin/sh\necho " M libs/control/src/a.cpp"\necho " M plugins/hybrid/src/b.cpp"\necho " M docs/c.md"\n' >"$work/stubs/git"
mkdir -p "$work/tree/libs/control/tests" "$work/tree/libs/scene/tests" "$work/tree/plugins/hybrid/tests" "$work/tree/build/ci"
touch "$work/tree/build/ci/CMakeCache.txt"
builds_changed() {
  called 'cmake --build --preset ci --target hamelin_control_tests hamelin_plugin_hybrid_tests$' &&
    called 'ctest .*-LE slow -L \^\(control\|plugin_hybrid\)\$'
}
stub ctest 0
run quick
expect "quick builds and tests what changed" builds_changed
builds_named() { called 'cmake --build --preset ci --target hamelin_scene_tests hamelin_plugin_hybrid_tests$'; }
run quick scene hybrid
expect "quick builds and tests what is named" builds_named
refuses_unknown() { ((code == 2)) && ! called cmake && printed "^dev: 'no_such': is not a library or plugin with tests"; }
run quick no_such
expect "quick names what has no tests" refuses_unknown
stub git 0

# ---- The last line of ./dev test: tests that could not run count as failed, skipped ones do not ----
cat >"$work/stubs/ctest" <<'STUB'
#!/bin/sh
while [ "$1" != --output-junit ]; do shift; done
cat >"$2" <<'XML'
<testsuite tests="5" failures="1" disabled="0" skipped="2">
	<testcase name="a" classname="a" time="1" status="run">
	<testcase name="b" classname="b" time="1" status="run">
	<testcase name="c" classname="c" time="1" status="fail">
	<testcase name="d" classname="d" time="1" status="notrun">
		<skipped message="SKIP_RETURN_CODE=77"/>
	<testcase name="e" classname="e" time="1" status="notrun">
		<skipped message="Unable to find executable"/>
XML
exit 8
STUB
chmod +x "$work/stubs/ctest"
mkdir -p "$work/tree/build/ci"
printf '[ci]\nd\n' >"$work/tree/tests/may_skip.txt"
prints_counts() { ((code == 8)) && [[ "$(sed -n '$p' "$work/out")" == "2 passed, 2 failed, 1 skipped" ]]; }
run test
expect "test prints the counts of passed, failed and skipped tests, and returns ctest's exit code" \
  prints_counts
# ---- A skipped test must be listed for its preset ----
cat >"$work/stubs/ctest" <<'STUB'
#!/bin/sh
while [ "$1" != --output-junit ]; do shift; done
cat >"$2" <<'XML'
<testsuite tests="2" failures="0" disabled="0" skipped="1">
	<testcase name="a" classname="a" time="1" status="run">
	<testcase name="maps: FCL&apos;s &lt;distances&gt; agree" classname="d" time="1" status="notrun">
		<skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>
XML
STUB
printf "# comment\n[all]\nother\n[tsan]\nmaps: FCL's <distances> agree\n" >"$work/tree/tests/may_skip.txt"
names_skipped() {
  ((code == 1)) && printed "^  maps: FCL's <distances> agree\$" &&
    printed "^dev: skipped, but not listed in tests/may_skip.txt for the preset 'ci':\$" &&
    [[ "$(sed -n '$p' "$work/out")" == "1 passed, 0 failed, 1 skipped" ]]
}
run test
expect "test fails if a test is skipped that is not listed for the preset" names_skipped
sed -i 's/tsan/tsan ci/' "$work/tree/tests/may_skip.txt"
listed() { ((code == 0)) && ! printed '^dev:'; }
run test
expect "test succeeds if all skipped tests are listed for the preset" listed
exit $failed
