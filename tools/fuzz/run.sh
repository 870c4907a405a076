#!/usr/bin/env bash
# Fuzzes targets for so many seconds each, one after the other, on one core:
#     tools/fuzz/run.sh SECONDS [TARGET...]
# What was found lies in artifacts/, what is worth going on from in corpus/.
set -euo pipefail
cd "$(dirname "$0")"
seconds=$1
shift
targets=("$@")
[ $# -gt 0 ] || targets=(gltf glb obj mtl picture points arguments faces)
# Files are read in processes of their own: what the threads of others do is not to be seen.
export RAYON_NUM_THREADS=1
for target in "${targets[@]}"; do
    case $target in
    gltf | glb) dictionary=json.dict longest=12000 ;;
    arguments) dictionary=arguments.dict longest=600 ;;
    faces) dictionary= longest=321 ;;
    picture) dictionary= longest=2000 ;;
    *) dictionary=text.dict longest=4000 ;;
    esac
    mkdir -p "corpus/$target" "artifacts/$target"
    echo "== $target"
    # No sanitizer: nothing in lumel is unsafe. Overflows and debug assertions are checked.
    nice -n 10 cargo +nightly fuzz run --fuzz-dir . -s none "$target" "corpus/$target" "seeds/$target" -- \
        -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -max_len="$longest" \
        -print_final_stats=1 -print_funcs=0 ${dictionary:+-dict="$dictionary"} 2>&1 |
        grep -Ev '^(INFO|WARNING|#[0-9]+.(NEW|REDUCE|pulse|RELOAD|INITED))' || true
    rm -rf /dev/shm/lumel-fuzz-* "${TMPDIR:-/tmp}"/lumel-fuzz-*
done
