#!/usr/bin/env bash
# Tests our ray tracer for xdg, on particles in nested solids.
#   examples/transport/run.sh [PREFIX]    the folder of an installed C library; without, it is built
#   XDG=FOLDER        a recursive checkout of xdg: runs its tests of rays and points with our tracer, then
#                     both tracers side by side. The compiler finds Embree 4 (CPATH, LIBRARY_PATH).
#   MESHES="A.obj B.obj"    what ray_fire is timed on, and WORK=1000 nodes of search for each face
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
prefix=${1:-$folder/prefix}
[ $# -gt 0 ] || "$here/../../crates/bvh-c/install.sh" "$prefix"
library=("$prefix/lib/libbvh_search.a" -lpthread -ldl -lm)
compile() { "${CXX:-c++}" -std=c++17 -O2 -I"$here" -I"$prefix/include" "$@"; }

compile -Wall -Wextra -Werror -I"$here/alone" "$here/test.cpp" "${library[@]}" -o "$folder/test"
"$folder/test"

if [ -z "${XDG:-}" ]; then
    echo "transport: xdg's own tests are skipped, XDG names no checkout"
    exit
fi
xdg=$(cd "$XDG" && pwd)
catch=$xdg/vendor/catch2
if [ ! -e "$catch/extras/catch_amalgamated.cpp" ] || [ ! -e "$xdg/vendor/fmt/include" ] || [ ! -e "$xdg/vendor/linalg/linalg.h" ]; then
    echo "transport: $xdg/vendor lacks catch2, fmt or linalg; accepted: a recursive checkout" >&2
    exit 1
fi
# What CMake would write.
mkdir -p "$folder/catch2"
: >"$folder/catch2/catch_user_config.hpp"
theirs() {
    compile -w -march=native -DWITH_XDG -DXDG_ENABLE_EMBREE -DXDG_EMBREE4 -DFMT_HEADER_ONLY -I"$xdg/include" -I"$xdg" \
        -I"$xdg/tests" -I"$xdg/vendor" -I"$xdg/vendor/fmt/include" -I"$folder" -I"$catch/src" "$@"
}
theirs -I"$catch/extras" -c "$catch/extras/catch_amalgamated.cpp" -o "$folder/catch.o"
for source in config element_face_accessor error mesh_manager_interface metadata_interface \
    ray_tracing_interface tetrahedron_contain timer triangle_intersect geometry/closest \
    geometry/measure geometry/plucker util/str_utils embree/ray_tracer; do
    [ ! -e "$xdg/src/$source.cpp" ] || theirs -c "$xdg/src/$source.cpp" -o "$folder/$(basename $source).xdg.o"
done
embree=(-lembree4 -fopenmp -Wl,--allow-shlib-undefined)
theirs -include "$here/ours_for_theirs.h" -c "$xdg/src/xdg.cpp" -o "$folder/xdg.o"
for test in ray_fire point_in_volume closest occluded; do
    theirs -include "$here/ours_for_theirs.h" "$xdg/tests/test_$test.cpp" "$folder"/{catch,xdg}.o "$folder"/*.xdg.o \
        "${library[@]}" "${embree[@]}" -o "$folder/$test"
    echo "transport: xdg's test_$test with our tracer"
    "$folder/$test"
done
theirs "$here/beside.cpp" "$folder"/*.xdg.o "${library[@]}" "${embree[@]}" -o "$folder/beside"
# Several files.
# shellcheck disable=SC2086
"$folder/beside" ${MESHES:-}
