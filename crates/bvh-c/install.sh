#!/bin/sh
# Builds the C library and installs it: the header, the static and the shared library, and what CMake and pkg-config need to
# find them. Everything installed may be moved elsewhere together.
#   crates/bvh-c/install.sh PREFIX
#   CARGO_TARGET_DIR, CARGO_BUILD_TARGET    as for cargo
#   STRIP                                   strip of the compiler that links the library
set -eu

[ $# = 1 ] || {
    echo "usage: install.sh PREFIX" >&2
    exit 64
}
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
target=${CARGO_TARGET_DIR:-$here/target}
echo "install.sh: builds the library, which takes some minutes" >&2
cargo build --quiet --release --manifest-path "$here/Cargo.toml" --target-dir "$target"
release=$target/${CARGO_BUILD_TARGET:+$CARGO_BUILD_TARGET/}release

mkdir -p "$1"
prefix=$(CDPATH= cd -- "$1" && pwd)
lib=$prefix/lib
mkdir -p "$prefix/include" "$lib/pkgconfig" "$lib/cmake/bvh_search"
cp "$here/include/bvh_search.h" "$prefix/include"
static=
shared=
for name in libbvh_search.a bvh_search.lib libbvh_search.so libbvh_search.dylib bvh_search.dll.lib bvh_search.dll; do
    [ -e "$release/$name" ] || continue
    cp "$release/$name" "$lib"
    case $name in
    *.a | bvh_search.lib) static=$name ;;
    *.so | *.dylib | *.dll) shared=$name ;;
    esac
done
# The standard library comes with lines for debuggers and with code of the compiler in between, 6 MB together.
strip=${STRIP:-strip}
if "$strip" --version 2>/dev/null | grep -q GNU; then
    "$strip" -S -R .llvmbc -R .llvmcmd "$lib/$static"
elif command -v "$strip" >/dev/null; then
    "$strip" -S "$lib/$static"
fi

version=$(sed -n 's/^version = "\(.*\)"$/\1/p' "$here/Cargo.toml")
cat >"$lib/pkgconfig/bvh_search.pc" <<EOF
prefix=\${pcfiledir}/../..
includedir=\${prefix}/include
libdir=\${prefix}/lib

Name: bvh_search
Description: Trees from boxes or triangles, searched for seconds, saved, loaded and traced
Version: $version
Cflags: -I\${includedir}
Libs: -L\${libdir} -lbvh_search
Libs.private: -lpthread -ldl -lm
EOF
# As long as the first number is 0, another second number is another interface.
cat >"$lib/cmake/bvh_search/bvh_search-config-version.cmake" <<EOF
set(PACKAGE_VERSION $version)
string(REGEX MATCH "^[0-9]+[.][0-9]+" has "\${PACKAGE_VERSION}")
string(REGEX MATCH "^[0-9]+[.][0-9]+" wants "\${PACKAGE_FIND_VERSION}.0")
if(PACKAGE_VERSION VERSION_EQUAL PACKAGE_FIND_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
endif()
if(has VERSION_EQUAL wants AND NOT PACKAGE_VERSION VERSION_LESS PACKAGE_FIND_VERSION)
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
endif()
EOF
cat >"$lib/cmake/bvh_search/bvh_search-config.cmake" <<EOF
# bvh_search::bvh_search is the static library, bvh_search::shared the shared one.
include(CMakeFindDependencyMacro)
find_dependency(Threads)
get_filename_component(_prefix "\${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET bvh_search::bvh_search)
    add_library(bvh_search::bvh_search STATIC IMPORTED)
    set_target_properties(bvh_search::bvh_search PROPERTIES
        IMPORTED_LOCATION "\${_prefix}/lib/$static"
        INTERFACE_INCLUDE_DIRECTORIES "\${_prefix}/include"
        INTERFACE_LINK_LIBRARIES "Threads::Threads;\${CMAKE_DL_LIBS};\$<\$<NOT:\$<PLATFORM_ID:Windows>>:m>")
    add_library(bvh_search::shared SHARED IMPORTED)
    set_target_properties(bvh_search::shared PROPERTIES
        IMPORTED_LOCATION "\${_prefix}/lib/$shared"
        IMPORTED_IMPLIB "\${_prefix}/lib/bvh_search.dll.lib"
        IMPORTED_NO_SONAME TRUE
        INTERFACE_INCLUDE_DIRECTORIES "\${_prefix}/include")
endif()
unset(_prefix)
EOF
echo "$lib/$static: $(wc -c <"$lib/$static") bytes; bvh_search $version is in $prefix"
