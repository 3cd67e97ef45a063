#!/usr/bin/env bash
# clean_root.sh PACKAGES: installs the Debian packages in the folder PACKAGES by apt in a new Debian,
# uses them there as a plain user, and removes them again. Needs root, mmdebstrap and the Debian
# mirrors of /etc/apt.
set -euo pipefail
packages=$(realpath "$1")
here=$(dirname "$(realpath "${BASH_SOURCE[0]}")")
if ((EUID != 0)); then
  echo "clean_root.sh: the user is not root, expected root, who may change the root folder" >&2
  exit 2
fi
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
sources=()
for file in /etc/apt/sources.list /etc/apt/sources.list.d/*; do
  if [[ -f "$file" ]] && grep -qw "$suite" "$file" && grep -qE '/debian(-security)?/?( |$)' "$file"; then
    sources+=("$file")
  fi
done
if ((${#sources[@]} == 0)); then
  echo "/etc/apt: has no source of Debian $suite, expected one" >&2
  exit 2
fi

root=$(mktemp -d)
finish() {
  mountpoint -q "$root/proc" && umount "$root/proc"
  rm -rf --one-file-system "$root"
}
trap finish EXIT
chmod 755 "$root"
echo "== A new Debian $suite"
mmdebstrap --quiet --mode=root --variant=apt --include=ca-certificates "$suite" "$root" "${sources[@]}"
cp /etc/resolv.conf "$root/etc/"
mount -t proc proc "$root/proc"
mkdir "$root/packages"
cp "$packages"/*.deb "$here/use.sh" "$root/packages/"
chmod -R a+rX "$root/packages"

in_root() {
  chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
}
apt_get() { in_root apt-get -qq -o Dpkg::Use-Pty=0 --no-install-recommends -y "$@" >"$root/apt.log" 2>&1 || {
  cat "$root/apt.log"
  return 1
}; }
debs() { # NAME...: the files of these packages
  local name
  for name in "$@"; do (cd "$root" && echo /packages/"$(basename packages/"$name"_*.deb)"); done
}
as_user() { in_root runuser -l user -c "PATH=/usr/bin:/bin bash /packages/use.sh $1"; }
mine() { # the files of root whose path names hamelin
  in_root find / -xdev \( -path /proc -o -path /home -o -path /packages -o -path /var/log -o -path /tmp \) -prune -o -path '*hamelin*' -print
}
in_root useradd --create-home --shell /bin/bash user
apt_get update
mine >"$root/before"
[[ ! -s "$root/before" ]]

echo "== The program and its planners, with nothing but their dependencies"
apt_get install $(debs hamelin hamelin-plugins)
as_user program

echo "== The Python package"
apt_get install $(debs python3-hamelin)
as_user python

echo "== The development files and documents"
apt_get install $(debs libhamelin0 libhamelin-dev hamelin-doc) g++ cmake make pkg-config man-db bash-completion
as_user development

echo "== The packages are removed"
apt_get purge libhamelin0 libhamelin-dev hamelin-plugins hamelin python3-hamelin hamelin-doc
mine >"$root/after"
if [[ -s "$root/after" ]]; then
  echo "failed  left behind: $(cat "$root/after")"
  exit 1
fi
echo "ok      nothing is left behind"
