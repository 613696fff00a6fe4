#!/usr/bin/env bash
# OMPL on our scenes, for comparison with `cargo bench --bench peers`. Needs Debian's libompl-dev and a C++ compiler:
#     apt-get install libompl-dev g++
# Takes about a minute; OMPL_RUNS=5 is the number of runs of BIT* (RRT-Connect: four times as many).
set -u
cd "$(dirname "$0")" || exit 1
skip() { echo "skipped: $1"; exit 0; }
command -v g++ >/dev/null || skip "no g++"
command -v pkg-config >/dev/null || skip "no pkg-config"
pkg-config --exists ompl || skip "OMPL is not installed (apt-get install libompl-dev)"

out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# The libraries that pkg-config lists besides, libompl.so loads by itself.
# shellcheck disable=SC2046
g++ -std=c++17 -O3 -DBOOST_BIND_GLOBAL_PLACEHOLDERS compare.cpp -o "$out/compare" \
    $(pkg-config --cflags-only-I ompl) -lompl || {
    echo "compare.cpp does not compile with this OMPL"
    exit 1
}
echo "OMPL $(pkg-config --modversion ompl), medians; ms of processor time, length in exact shortest lengths"
echo
echo "| scene | planner | found | aborted | ms | length |"
echo "|---|---|---|---|---|---|"
maps=../../scenarios/maps
# scene, turning radius (m), resolution (m), exact shortest length (m)
while read -r scene radius resolution exact; do
    "$out/compare" "$maps/$scene.json" "$radius" "$resolution" "$exact" "${OMPL_RUNS:-5}" ||
        echo "| $scene | ended with status $? | | | | |"
done <<'SCENES'
fig6 1 0.1 174.737
fig7 1 0.04 9.963
narrow 1 0.1 184.866
maze 1 0.1 187.772
clutter200 4 0.4 1373.862
clutter2000 2 0.2 1388.943
SCENES
