#!/usr/bin/env bash
# Installs what is missing of Debian's packages. Each check looks for the thing itself, so that a compiler or a Python
# from elsewhere is as good; without apt it names what to install. Usage: tools/system_packages.sh GROUP...
# Groups: build (compile the module), test, browser (for tests of the live page), bench, clang, mingw, target (2.4 GB:
# a Cortex-M for tests of exported controllers, which are skipped without).
set -euo pipefail
cd "$(dirname "$0")/.."

python="${PYTHON:-python3}"
missing=() # needed
useful=()  # the work gets done without
fail() {
  echo "mgdd: $1" >&2
  exit 1
}
has() { command -v "$1" >/dev/null; }
has_header() { echo "#include <$1>" | g++ -E -x c++ - >/dev/null 2>&1; }
runs() { "$python" -c "$1" 2>/dev/null; }

if has "$python" && ! runs "import sys; sys.exit(sys.version_info < (3, 11))"; then
  fail "Python 3.11 or newer is needed, $python is $("$python" -V 2>&1): name another one, make demo PYTHON=python3.12"
fi
free_mb="$(df -Pm . | awk 'NR == 2 { print $4 }')"
((free_mb >= 1000)) || fail "1000 MB of disk are needed, $free_mb MB are free below $PWD"

for group in "$@"; do
  case "$group" in
    build)
      has g++ || missing+=(build-essential)
      has "$python" || missing+=(python3)
      runs "import venv, ensurepip" || missing+=(python3-venv)
      runs "import sysconfig; open(sysconfig.get_path('include') + '/Python.h')" || missing+=(python3-dev)
      has ccache || useful+=(ccache)
      ;;
    test)
      has_header gtest/gtest.h || missing+=(libgtest-dev)
      # A kernel with CAN for one test, which is skipped without; built for these two architectures only.
      if [[ "$(uname -m)" =~ ^(x86_64|i.86)$ ]]; then
        has linux.uml || useful+=(user-mode-linux)
        [[ -x /sbin/insmod ]] || has insmod || useful+=(kmod)
        [[ -x /sbin/ip ]] || has ip || useful+=(iproute2)
      fi
      ;;
    browser) has chromium || has chromium-browser || useful+=(chromium) ;;
    bench) has_header benchmark/benchmark.h || missing+=(libbenchmark-dev) ;;
    clang) has clang++ || missing+=(clang) ;;
    target)
      has arm-none-eabi-g++ || missing+=(gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib)
      has qemu-system-arm || missing+=(qemu-system-arm)
      ;;
    mingw) has x86_64-w64-mingw32-g++-posix || missing+=(g++-mingw-w64-x86-64-posix) ;;
    *) echo "unknown group: $group" >&2; exit 2 ;;
  esac
done

if ((${#useful[@]})) && ! has apt-get; then
  echo "would help: ${useful[*]}"
  useful=()
fi
((${#missing[@]} + ${#useful[@]})) || exit 0
has apt-get || fail "missing: please install what Debian calls ${missing[*]}"

sudo=()
if [[ "$(id -u)" != 0 ]]; then
  if ! has sudo; then
    ((${#missing[@]})) || exit 0
    fail "missing: ${missing[*]}; install them as root with apt-get, there is no sudo"
  fi
  sudo=(sudo)
fi
"${sudo[@]}" env DEBIAN_FRONTEND=noninteractive tools/aloud.sh apt-get update -q ||
  fail "apt-get update failed: is there a network?"
for package in "${useful[@]}"; do # what this distribution does not have is done without
  if apt-cache show "$package" >/dev/null 2>&1; then missing+=("$package"); fi
done
((${#missing[@]})) || exit 0
echo "installing: ${missing[*]}"
"${sudo[@]}" env DEBIAN_FRONTEND=noninteractive tools/aloud.sh \
  apt-get install -y -q -o Dpkg::Use-Pty=0 --no-install-recommends "${missing[@]}" ||
  fail "apt-get could not install ${missing[*]}: is there a network?"
