#!/bin/sh
# Makes the virtual environment that the tools in this directory run in: .venv/mitsuba at the top
# of the project, which git ignores. Needs Python 3.9 or later and PyPI, about 300 MB of disk.
#
# Mitsuba's vectorised variants need libLLVM. Those of LLVM 14 and 15 abort ("Cannot select:
# fminimum"), so on Debian and Ubuntu LLVM 19 is fetched and unpacked into the environment, not
# installed. Elsewhere set DRJIT_LIBLLVM_PATH to a libLLVM of version 16 or later.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
place=$here/../../.venv/mitsuba
python3 -m venv "$place"
"$place/bin/pip" install --quiet --requirement "$here/requirements.txt"
if [ -z "${DRJIT_LIBLLVM_PATH:-}" ] && command -v apt-get >/dev/null && command -v dpkg >/dev/null; then
    mkdir -p "$place/llvm"
    (cd "$place/llvm" && apt-get download --quiet --quiet libllvm19 && dpkg -x libllvm19_*.deb . && rm libllvm19_*.deb)
fi
"$place/bin/python" "$here/scene.py"
