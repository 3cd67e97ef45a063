#!/usr/bin/env bash
# check.sh BUILD SOURCE [--quick]: makes the Debian packages of the build folder BUILD in
# BUILD/packages, and checks them without installing them: files, dependencies, exported symbols,
# lintian. Prints their sizes. --quick: compresses less, without lintian.
set -u
build=$(realpath "$1") source=$(realpath "$2")
packages=$build/packages
quick=() && [[ "${3:-}" == --quick ]] && quick=(-D CPACK_DEBIAN_COMPRESSION_TYPE=gzip)
rm -f "$packages"/*.deb
(cd "$build" && cpack "${quick[@]}") >"$packages/cpack.log" 2>&1 || { cat "$packages/cpack.log" && exit 1; }
names=(libhamelin0 libhamelin-dev hamelin-plugins hamelin python3-hamelin hamelin-doc)
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
failed=0
expect() { # WHAT COMMAND...
  if "${@:2}"; then echo "ok      $1"; else
    echo "failed  $1"
    failed=1
  fi
}
file_of() { echo "$packages/$1"_*.deb; }

for name in "${names[@]}"; do
  if [[ ! -f "$(file_of "$name")" ]]; then
    echo "$packages: has no package $name, expected one"
    exit 1
  fi
  dpkg-deb -c "$(file_of "$name")" | awk '{print $1, $2, $6}' >"$work/$name.list"
  dpkg-deb -x "$(file_of "$name")" "$work/$name"
done

# ---- Files ----
contains() { # PACKAGE REGEX...: each REGEX matches the path of a file
  local pattern
  for pattern in "${@:2}"; do
    if ! awk '{print $3}' "$work/$1.list" | grep -qE "^[.]/$pattern\$"; then
      echo "        no $pattern"
      return 1
    fi
  done
}
lib='usr/lib/[^/]+-linux-gnu[^/]*'
expect "libhamelin0 has the shared library" contains libhamelin0 "$lib/libhamelin[.]so[.]0" "$lib/libhamelin[.]so[.]0[.].*"
expect "libhamelin-dev has what programs in C and C++ link" contains libhamelin-dev "$lib/libhamelin[.]so" \
  "$lib/pkgconfig/hamelin[.]pc" "$lib/libhamelin_control[.]a" "$lib/cmake/hamelin/hamelinConfig[.]cmake" \
  "usr/include/hamelin/control/hamelin_control[.]h" "usr/share/doc/libhamelin-dev/examples/template/src/template[.]cpp" \
  "usr/share/doc/libhamelin-dev/examples/robot_loop/live[.]c" \
  "usr/include/hamelin/serve/hamelin_frames[.]h" "usr/share/doc/libhamelin-dev/examples/clients/robot[.]c"
expect "hamelin-plugins has the planners" contains hamelin-plugins \
  "$lib/hamelin/plugins/"{apf,gyro,hybrid,mppi,template}"[.]hamelin[.]so"
expect "hamelin has the program, manual pages, completion, data and schemas" contains hamelin "usr/bin/hamelin" \
  "usr/share/man/man1/hamelin[.]1[.]gz" "usr/share/man/man1/hamelin-run[.]1[.]gz" \
  "usr/share/bash-completion/completions/hamelin" "usr/share/hamelin/scenes/shelf[.]json" "usr/share/hamelin/maps/shelf[.]bt" \
  "usr/share/hamelin/schema/scene[.]schema[.]json"
if [[ -f "$build/share/hamelin/report/page.html" ]]; then
  expect "hamelin has the pages" contains hamelin "usr/share/hamelin/report/"{page,sweep,accuracy}"[.]html"
else
  echo "skipped the pages, which were not built"
fi
expect "python3-hamelin has the package and the planner that runs planners in Python" contains python3-hamelin \
  "usr/lib/python3/dist-packages/hamelin/"{__init__[.]py,_hamelin[.]pyi,py[.]typed,"_hamelin[.].*[.]so"} \
  "$lib/hamelin/plugins/python[.]hamelin[.]so"
expect "hamelin-doc has documents" contains hamelin-doc "usr/share/doc/hamelin-doc/.*(index[.]html|docs/theory[.]md)"
documented() {
  local name
  for name in "${names[@]}"; do
    contains "$name" "usr/share/doc/$name/copyright" "usr/share/doc/$name/changelog[.]gz" || return 1
  done
}
expect "every package has its copyright and changelog" documented
no_file_twice() {
  local twice
  twice=$(cat "$work"/*.list | grep -v '^d' | awk '{print $3}' | sort | uniq -d)
  [[ -z "$twice" ]] || { echo "        $twice" && return 1; }
}
expect "no file is in two packages" no_file_twice
owned_by_root() { ! awk '$2 != "root/root"' "$work"/*.list | grep .; }
expect "all files belong to root" owned_by_root
complete() { # everything that `cmake --install` installs is in a package
  local missing
  missing=$(cd "$work/stage/usr" && find . -type f -o -type l | sed 's|^[.]/||' | sort |
    comm -23 - <(cat "$work"/*.list | grep -v '^d' | awk '{print $3}' | sed 's|^[.]/usr/||' | sort))
  [[ -z "$missing" ]] || { echo "        not in a package: $missing" && return 1; }
}
DESTDIR="$work/stage" cmake --install "$build" >/dev/null
expect "everything that is installed is in a package" complete

# ---- Fields ----
version=$(dpkg-deb -f "$(file_of hamelin)" Version)
field() { dpkg-deb -f "$(file_of "$1")" "$2"; }
depends() { # PACKAGE ENTRY...: the package depends on each entry, a regular expression
  local entry
  for entry in "${@:2}"; do
    if ! field "$1" Depends | tr ',' '\n' | sed 's/^ *//' | grep -qE "^$entry\$"; then
      echo "        $1 does not depend on $entry but on: $(field "$1" Depends)"
      return 1
    fi
  done
}
expect "libhamelin0 depends on the libraries that it loads" depends libhamelin0 "libc6 .*" "libstdc[+][+]6 .*" "libfmt9 .*"
expect "libhamelin-dev depends on libhamelin0 of its version and on what static libraries need" \
  depends libhamelin-dev "libhamelin0 [(]= $version[)]" libeigen3-dev libfmt-dev libssl-dev
expect "hamelin depends on the planners of its version" depends hamelin "hamelin-plugins [(]= $version[)]" "libc6 .*"
expect "hamelin-plugins depends on the C library" depends hamelin-plugins "libc6 .*"
expect "python3-hamelin depends on Python of one minor version, numpy, the program and the planners" \
  depends python3-hamelin "hamelin [(]= $version[)]" "hamelin-plugins [(]= $version[)]" "python3 [(]>= 3[.].*[)]" \
  "python3 [(]<< 3[.].*[)]" "python3-numpy.*" "libpython3[.][0-9]+.*"
recommends() { [[ "$(field python3-hamelin Recommends)" == *python3-pandas*python3-matplotlib* ]]; }
expect "python3-hamelin recommends pandas and matplotlib" recommends
for_all() { [[ "$(field hamelin-doc Architecture)" == all && "$(field hamelin Architecture)" == "$(dpkg --print-architecture)" ]]; }
expect "hamelin-doc is for all architectures, hamelin for this one" for_all

# ---- The interface of the shared library ----
exported() { # cmake/packages/symbols, the header and the library agree
  nm -D --defined-only "$work"/libhamelin0/usr/lib/*/libhamelin.so.0 | awk '{print $3}' | sort >"$work/exported"
  sed -n 's/^ \(.*\)@Base .*/\1/p' "$source/cmake/packages/symbols" | sort | diff - "$work/exported" &&
    grep -oE '\bhamelin_controller_[a-z_]+\(' "$source/libs/control/include/hamelin/control/hamelin_control.h" |
    tr -d '(' | sort -u | diff - "$work/exported"
}
expect "libhamelin0 exports the functions of its header, as its symbols file says" exported
stripped() { ! find "$work" -path "$work/stage" -prune -o -name '*.so*' -type f -print -o -path '*/bin/*' -type f -print |
  xargs file | grep 'not stripped'; }
expect "programs and libraries are stripped" stripped

if ((${#quick[@]})); then
  echo "skipped lintian; ./dev packages runs it"
else
  lintian_passes() {
    (cd "$work" && lintian --allow-root --fail-on error,warning --display-info --pedantic "$packages"/*.deb >"$work/lintian")
    local code=$?
    grep -E '^[EW]:' "$work/lintian"
    echo "        lintian: $(grep -c '^E:' "$work/lintian") errors, $(grep -c '^W:' "$work/lintian") warnings," \
      "$(grep -c '^I:' "$work/lintian") infos, $(grep -c '^P:' "$work/lintian") pedantic"
    grep -E '^[IP]:' "$work/lintian" | awk '{print $1, $3}' | sort | uniq -c | sed 's/^/        /'
    return $code
  }
  expect "lintian finds no error and no warning" lintian_passes
fi

echo "sizes   package KiB, installed KiB:"
for name in "${names[@]}"; do
  printf '        %-16s %6d %6d\n' "$name" "$(($(stat -c %s "$(file_of "$name")") / 1024))" "$(field "$name" Installed-Size)"
done
exit $failed
