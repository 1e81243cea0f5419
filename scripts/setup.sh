#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes .venv with Touchline: `setup.sh demo` with what the pages need, `setup.sh` also with what the
# tests and checks need, which is much more.
# What is missing is installed where that is allowed (root on Debian), else named in one line.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
  echo "touchline: $1" >&2
  exit 1
}

# obtain PACKAGE TEST...: installs the Debian package unless the test passes; whether it does then.
obtain() {
  local package=$1
  shift
  if "$@" >/dev/null 2>&1; then return; fi
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "touchline: installing $package" >&2
    (apt-get update -qq && apt-get install -y -qq "$package") >/dev/null 2>&1 || true
  fi
  "$@" >/dev/null 2>&1
}

# need WHAT PACKAGE TEST...: the same, and nothing goes without it.
need() {
  local what=$1 package=$2
  shift 2
  obtain "$package" "$@" || fail "$what is missing; on Debian: apt-get install $package"
}

need "python3" python3 command -v python3
need "python3 3.11 or newer" python3 python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))'
need "a C++ compiler (g++)" g++ command -v g++
need "Python's venv module" python3-venv python3 -c 'import ensurepip, venv'
need "Python's header files" python3-dev python3 -c \
  'import os, sysconfig; os.stat(os.path.join(sysconfig.get_paths()["include"], "Python.h"))'

echo "touchline: setting up .venv, which takes a minute or two" >&2
[ -x .venv/bin/python ] || python3 -m venv .venv
pip() { .venv/bin/python -m pip install --quiet --disable-pip-version-check "$@"; }
pip --upgrade "pip>=25.1"
if [ "${1:-all}" = demo ]; then
  pip --editable ".[all]"
  touch .venv/demo
  exit
fi

# What only tests of pages need: it is fetched and unpacked while the rest is compiled.
pages() {
  obtain chromium sh -c 'command -v chromium || command -v google-chrome' || echo \
    "touchline: no Chromium, so pages are not tested; on Debian: apt-get install chromium" >&2
  obtain npm command -v npm && npm install --silent --no-audit --no-fund --prefix .venv/npm \
    axe-core@4 >/dev/null 2>&1 || echo \
    "touchline: no axe-core, so the accessibility of pages is not tested; it needs npm" >&2
}

pages &
pip --editable ".[all]" --group test --group check --group docs
wait
touch .venv/demo .venv/ready
