#!/bin/sh
# Installs header, libraries, and what pkg-config and CMake find them by:
#
#   crates/noisefloor-capi/install.sh PREFIX            builds optimised libraries, and installs them
#   crates/noisefloor-capi/install.sh PREFIX FOLDER     installs the libraries in FOLDER, such as target/debug/deps
set -eu
[ $# -ge 1 ] || { sed -n 's/^# *//p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1/include" "$1/lib/pkgconfig" "$1/lib/cmake/noisefloor"
prefix=$(cd "$1" && pwd)
if [ $# -ge 2 ]; then
    built=$2
else
    cargo build --release --manifest-path "$here/Cargo.toml"
    built=${CARGO_TARGET_DIR:-$here/../../target}/release
fi
version=$(cargo pkgid --manifest-path "$here/Cargo.toml")
version=${version##*[@#]}

cp "$here/include/noisefloor.h" "$prefix/include/"
cp "$built/libnoisefloor_capi.a" "$prefix/lib/libnoisefloor.a"
case $(uname) in
Darwin)
    cp "$built/libnoisefloor_capi.dylib" "$prefix/lib/libnoisefloor.dylib"
    install_name_tool -id "$prefix/lib/libnoisefloor.dylib" "$prefix/lib/libnoisefloor.dylib"
    shared=libnoisefloor.dylib
    private="-liconv -lm" ;;
*)
    # Programs look for the name that build.rs wrote into the library
    cp "$built/libnoisefloor_capi.so" "$prefix/lib/libnoisefloor.so.$version"
    ln -sf "libnoisefloor.so.$version" "$prefix/lib/libnoisefloor.so.0"
    ln -sf "libnoisefloor.so.0" "$prefix/lib/libnoisefloor.so"
    shared=libnoisefloor.so.0
    private="-lgcc_s -lutil -lrt -lpthread -lm -ldl" ;;
esac

# Both find the rest from where they lie, so that a package may be made in one folder and installed in another
cat >"$prefix/lib/pkgconfig/noisefloor.pc" <<PC
prefix=\${pcfiledir}/../..
libdir=\${prefix}/lib
includedir=\${prefix}/include

Name: noisefloor
Description: Tells progressive renderers, tile by tile, when people stop seeing noise
Version: $version
Cflags: -I\${includedir}
Libs: -L\${libdir} -lnoisefloor
Libs.private: $private
PC
cat >"$prefix/lib/cmake/noisefloor/noisefloor-config.cmake" <<CMAKE
# noisefloor::noisefloor is the shared library, noisefloor::static the static one.
get_filename_component(_noisefloor "\${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET noisefloor::noisefloor)
    add_library(noisefloor::noisefloor SHARED IMPORTED)
    set_target_properties(noisefloor::noisefloor PROPERTIES
        IMPORTED_LOCATION "\${_noisefloor}/lib/$shared"
        INTERFACE_INCLUDE_DIRECTORIES "\${_noisefloor}/include")
    add_library(noisefloor::static STATIC IMPORTED)
    set_target_properties(noisefloor::static PROPERTIES
        IMPORTED_LOCATION "\${_noisefloor}/lib/libnoisefloor.a"
        INTERFACE_INCLUDE_DIRECTORIES "\${_noisefloor}/include"
        INTERFACE_LINK_LIBRARIES "$(echo "$private" | tr ' ' ';')")
endif()
unset(_noisefloor)
CMAKE
# Before 1.0, the interface may change with the second number
cat >"$prefix/lib/cmake/noisefloor/noisefloor-config-version.cmake" <<CMAKE
set(PACKAGE_VERSION $version)
if(PACKAGE_FIND_VERSION VERSION_LESS_EQUAL PACKAGE_VERSION AND NOT PACKAGE_FIND_VERSION VERSION_LESS ${version%.*})
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
endif()
if(PACKAGE_FIND_VERSION VERSION_EQUAL PACKAGE_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
endif()
CMAKE
echo "installed noisefloor $version in $prefix"
